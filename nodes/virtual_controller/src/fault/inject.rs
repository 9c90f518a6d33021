//! A controller with faults on its line, its supply and its switches.

use std::collections::VecDeque;
use std::time::Duration;

use crate::fault::{ByteFault, Direction, Fault, FaultAction, Trigger};
use crate::{
    Controller,
    paced::{Device, LineEvents},
};

/// A controller with faults; a [`Device`] like the controller itself.
#[derive(Debug)]
pub struct FaultInjector {
    controller: Controller,
    /// Each fault, and whether it has happened.
    faults: Vec<(Fault, bool)>,
    chance: Chance,
    received: u64,
    sent: u64,
    answers: u64,
    incoming: Incoming,
    silent_until: Option<Duration>,
    /// Lines that a fault will hit, and whether they are lost.
    marked: Vec<(String, bool)>,
    cable: Cable,
    pulls: u64,
    /// The board is held in reset, or its bootloader runs, until then.
    boots_at: Option<Duration>,
    outgoing: VecDeque<Outgoing>,
    /// Events of the line itself, except stalls from the controller.
    line_events: LineEvents,
    now: Duration,
}

/// The line that is being received: its number, its fate, its bytes so far.
#[derive(Debug, Default)]
struct Incoming {
    /// Lines received completely.
    lines: u64,
    fate: Option<FaultAction>,
    bytes: Vec<u8>,
}

/// Something to be sent.
#[derive(Debug, Clone, PartialEq)]
enum Outgoing {
    Bytes(Vec<u8>),
    Stall(Duration),
}

/// Whether the cable is plugged in.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Cable {
    Plugged,
    Pulled {
        back_at: Duration,
        loses_power: bool,
    },
    /// Pulled and not plugged in again.
    Gone,
}

impl FaultInjector {
    /// Wraps a controller. The seed determines all random faults.
    pub fn new(controller: Controller, faults: Vec<Fault>, seed: u64) -> Self {
        Self {
            controller,
            faults: faults.into_iter().map(|fault| (fault, false)).collect(),
            chance: Chance(seed),
            received: 0,
            sent: 0,
            answers: 0,
            incoming: Incoming::default(),
            silent_until: None,
            marked: Vec::new(),
            cable: Cable::Plugged,
            pulls: 0,
            boots_at: None,
            outgoing: VecDeque::new(),
            line_events: LineEvents::default(),
            now: Duration::ZERO,
        }
    }

    /// The wrapped controller.
    pub fn controller(&self) -> &Controller {
        &self.controller
    }

    /// The wrapped controller, to change it.
    pub fn controller_mut(&mut self) -> &mut Controller {
        &mut self.controller
    }

    /// Has the cable been pulled without coming back?
    pub fn is_closed(&self) -> bool {
        self.cable == Cable::Gone
    }

    /// Is there a device at the end of the cable?
    pub fn is_plugged(&self) -> bool {
        self.cable == Cable::Plugged
    }

    /// How often the cable has been pulled.
    pub fn pulls(&self) -> u64 {
        self.pulls
    }

    /// Presses the reset button: the firmware starts again when the bootloader is done.
    pub fn reset_board(&mut self, now: Duration, bootloader: Duration) {
        self.advance(now);
        self.controller.power_off();
        self.boots_at = Some(self.now + bootloader);
    }

    /// Applies a fault at once; a fault of bytes or answers hits the next one.
    pub fn inject(&mut self, now: Duration, action: FaultAction) {
        self.advance(now);
        let trigger = match action {
            FaultAction::Byte(Direction::ToController, _) => Trigger::Byte(self.received + 1),
            FaultAction::Byte(Direction::FromController, _) => Trigger::Byte(self.sent + 1),
            FaultAction::LoseOk => Trigger::Line(self.answers + 1),
            FaultAction::LoseLine | FaultAction::ExtraLine => {
                // A stall that has begun takes its course.
                let begun = u64::from(!self.incoming.bytes.is_empty());
                Trigger::Line(self.incoming.lines + begun + 1)
            }
            _ => return self.happen(action),
        };
        self.faults.push((Fault { action, trigger }, false));
    }

    fn happen(&mut self, action: FaultAction) {
        match action {
            FaultAction::ExtraOk => self.send(b"ok\r\n"),
            FaultAction::Silent { seconds } => {
                let seconds = seconds.map_or(Duration::MAX, Duration::from_secs_f64);
                self.silent_until = Some(self.now.saturating_add(seconds));
            }
            FaultAction::Line { text, is_lost } => self.marked.push((text, is_lost)),
            FaultAction::Delay { direction, seconds } => self.stall(direction, seconds),
            FaultAction::Push(text) => self.send(format!("{text}\r\n").as_bytes()),
            FaultAction::Alarm(number) => self.controller.raise_alarm(number),
            FaultAction::Reset => self.controller.power_cycle(),
            FaultAction::Limit(axis) => self.controller.hold_limit(axis, true),
            FaultAction::Release(axis) => self.controller.hold_limit(axis, false),
            FaultAction::Cut(axis) => self.controller.cut_limit(axis, true),
            FaultAction::Input { is_analog, port, value } => {
                self.controller.set_input(is_analog, port, value);
            }
            FaultAction::Door => self.controller.set_door(true),
            FaultAction::CloseDoor => self.controller.set_door(false),
            FaultAction::Close => self.pull(Cable::Gone),
            FaultAction::Vanish { seconds, loses_power } => {
                if loses_power {
                    self.controller.power_off();
                }
                let back_at = self.now + Duration::from_secs_f64(seconds);
                self.pull(Cable::Pulled { back_at, loses_power });
            }
            // These wait for the next byte, answer or line.
            FaultAction::Byte(..)
            | FaultAction::LoseOk
            | FaultAction::LoseLine
            | FaultAction::ExtraLine => {}
        }
    }

    fn stall(&mut self, direction: Direction, seconds: f64) {
        let time = Duration::from_secs_f64(seconds);
        match direction {
            Direction::ToController => self.line_events.incoming_stall += time,
            Direction::FromController => self.outgoing.push_back(Outgoing::Stall(time)),
        }
    }

    /// Loses everything in transit.
    fn pull(&mut self, cable: Cable) {
        self.cable = cable;
        self.pulls += 1;
        self.outgoing.clear();
        self.line_events = LineEvents { is_cut: true, ..LineEvents::default() };
    }

    /// Starts the firmware and brings the device back when it is time.
    fn come_back(&mut self, now: Duration) {
        if let Some(boots_at) = self.boots_at.take_if(|boots_at| *boots_at <= now) {
            self.now = self.now.max(boots_at);
            self.controller.advance(self.now);
            self.controller.power_cycle();
        }
        let Cable::Pulled { back_at, loses_power } = self.cable else { return };
        if back_at > now {
            return;
        }
        self.now = self.now.max(back_at);
        self.controller.advance(self.now);
        // What was sent while the cable was out is lost.
        self.controller.transmit(&mut Vec::new());
        self.cable = Cable::Plugged;
        if loses_power {
            self.controller.power_cycle();
        }
    }

    /// Returns the due faults and marks them as happened.
    fn due(&mut self, is_due: impl Fn(&Fault, &mut Chance) -> bool) -> Vec<FaultAction> {
        let chance = &mut self.chance;
        self.faults
            .iter_mut()
            .filter(|(_, happened)| !happened)
            .filter_map(|(fault, happened)| {
                is_due(fault, chance).then(|| {
                    *happened = !matches!(fault.trigger, Trigger::Rate(_));
                    fault.action.clone()
                })
            })
            .collect()
    }

    /// Returns the byte after the faults that hit it: none, one or two bytes.
    fn apply_byte_faults(&mut self, direction: Direction, byte: u8, number: u64) -> Vec<u8> {
        let mut bytes = vec![byte];
        let spoils = self.due(|fault, chance| match (&fault.action, fault.trigger) {
            (FaultAction::Byte(_, ByteFault::Digit), _) if !byte.is_ascii_digit() => false,
            (FaultAction::Byte(of, ByteFault::Digit), Trigger::Byte(at)) => {
                *of == direction && at <= number
            }
            (FaultAction::Byte(of, _), Trigger::Byte(at)) => *of == direction && at == number,
            (FaultAction::Byte(of, _), Trigger::Rate(rate)) => {
                *of == direction && chance.hits(rate)
            }
            _ => false,
        });
        for spoil in spoils {
            match spoil {
                FaultAction::Byte(_, ByteFault::Drop) => bytes.clear(),
                FaultAction::Byte(_, ByteFault::Duplicate) => bytes.push(byte),
                FaultAction::Byte(_, ByteFault::Digit) => {
                    let other = 1 + self.chance.next() % 9;
                    let digit = (u64::from(byte - b'0') + other) % 10;
                    bytes.iter_mut().for_each(|byte| *byte = b'0' + digit as u8);
                }
                FaultAction::Byte(_, ByteFault::Corrupt) => {
                    let bit = self.chance.next() % 7;
                    bytes.iter_mut().for_each(|byte| *byte ^= 1 << bit);
                }
                _ => {}
            }
        }
        bytes
    }

    /// Returns the bytes to pass on for a received byte, where whole lines are lost or doubled.
    fn gather(&mut self, byte: u8) -> Vec<u8> {
        let is_realtime = matches!(byte, b'?' | b'!' | b'~' | 0x18 | 0x80..);
        if is_realtime {
            return vec![byte];
        }
        if self.incoming.bytes.is_empty() {
            let number = self.incoming.lines + 1;
            let fate = self.due(|fault, chance| match (&fault.action, fault.trigger) {
                (FaultAction::LoseLine | FaultAction::ExtraLine, Trigger::Line(at)) => at == number,
                (FaultAction::LoseLine | FaultAction::ExtraLine, Trigger::Rate(rate)) => {
                    chance.hits(rate)
                }
                _ => false,
            });
            self.incoming.fate = fate.into_iter().next();
        }
        self.incoming.bytes.push(byte);
        let line = match byte {
            b'\n' => {
                self.incoming.lines += 1;
                std::mem::take(&mut self.incoming.bytes)
            }
            _ => Vec::new(),
        };
        match self.incoming.fate {
            Some(FaultAction::LoseLine) => Vec::new(),
            Some(FaultAction::ExtraLine) => [vec![byte], line].concat(),
            _ => vec![byte],
        }
    }

    fn send(&mut self, bytes: &[u8]) {
        let is_silent = self.silent_until.is_some_and(|until| self.now < until);
        if is_silent || !self.is_plugged() {
            return;
        }
        for &byte in bytes {
            self.sent += 1;
            let number = self.sent;
            let spoilt = self.apply_byte_faults(Direction::FromController, byte, number);
            match self.outgoing.back_mut() {
                Some(Outgoing::Bytes(part)) => part.extend(spoilt),
                _ => self.outgoing.push_back(Outgoing::Bytes(spoilt)),
            }
            let due = self.due(|fault, _| {
                is_tx_delay(&fault.action) && fault.trigger == Trigger::Byte(number)
            });
            due.into_iter().for_each(|action| self.happen(action));
        }
    }

    /// Returns a line after the fault that hit it; `None` when it is lost.
    fn suffer(&mut self, line: &[u8]) -> Option<Vec<u8>> {
        let mut line = line.to_vec();
        let text = String::from_utf8_lossy(&line).into_owned();
        let Some(place) = self.marked.iter().position(|(mark, _)| text.contains(mark)) else {
            return Some(line);
        };
        let (_, is_lost) = self.marked.remove(place);
        let bytes = text.trim_end().len() as u64;
        if is_lost || bytes == 0 {
            return None;
        }
        let at = usize::try_from(self.chance.next() % bytes).unwrap_or_default();
        line[at] ^= 1 << (self.chance.next() % 7);
        Some(line)
    }

    /// Passes on a line of the controller, and triggers the faults of an answer.
    fn pass(&mut self, line: &[u8]) {
        let Some(line) = self.suffer(line) else { return };
        let line = line.as_slice();
        if !(line.starts_with(b"ok") || line.starts_with(b"error:")) {
            return self.send(line);
        }
        self.answers += 1;
        let number = self.answers;
        let due = self.due(|fault, chance| match (&fault.action, fault.trigger) {
            (FaultAction::LoseLine | FaultAction::ExtraLine, _) => false,
            (_, Trigger::Line(at)) => at == number,
            (FaultAction::LoseOk | FaultAction::ExtraOk, Trigger::Rate(rate)) => chance.hits(rate),
            _ => false,
        });
        if !due.contains(&FaultAction::LoseOk) {
            self.send(line);
        }
        due.into_iter().for_each(|action| self.happen(action));
    }

    /// The next scheduled time of a fault.
    fn next_scheduled(&self) -> Option<Duration> {
        self.faults
            .iter()
            .filter_map(|(fault, happened)| match fault.trigger {
                Trigger::Time(at) if !happened => Some(Duration::from_secs_f64(at)),
                _ => None,
            })
            .min()
    }
}

impl Device for FaultInjector {
    fn receive(&mut self, now: Duration, bytes: &[u8]) {
        self.advance(now);
        for &byte in bytes {
            if !self.is_plugged() {
                return;
            }
            self.received += 1;
            let number = self.received;
            let spoilt = self.apply_byte_faults(Direction::ToController, byte, number);
            let passed: Vec<u8> = spoilt.into_iter().flat_map(|byte| self.gather(byte)).collect();
            self.controller.receive(now, &passed);
            let due = self.due(|fault, _| {
                !matches!(fault.action, FaultAction::Byte(..))
                    && !is_tx_delay(&fault.action)
                    && fault.trigger == Trigger::Byte(number)
            });
            due.into_iter().for_each(|action| self.happen(action));
        }
    }

    fn advance(&mut self, now: Duration) {
        while let Some(at) = self.next_scheduled().filter(|at| *at <= now) {
            self.come_back(at);
            self.now = self.now.max(at);
            self.controller.advance(self.now);
            let due = self.due(
                |fault, _| matches!(fault.trigger, Trigger::Time(s) if Duration::from_secs_f64(s) <= at),
            );
            due.into_iter().for_each(|action| self.happen(action));
        }
        self.come_back(now);
        self.now = self.now.max(now);
        self.controller.advance(now);
    }

    fn transmit(&mut self, to: &mut Vec<u8>) {
        let mut sent = Vec::new();
        self.controller.transmit(&mut sent);
        for line in sent.split_inclusive(|byte| *byte == b'\n') {
            self.pass(line);
        }
        // Up to where the line stalls; the rest is sent afterwards.
        while let Some(Outgoing::Bytes(part)) = self.outgoing.front_mut() {
            to.append(part);
            self.outgoing.pop_front();
        }
    }

    fn take_line_events(&mut self) -> LineEvents {
        let mut events = std::mem::take(&mut self.line_events);
        if let Some(Outgoing::Stall(time)) = self.outgoing.front() {
            events.outgoing_stall = *time;
            self.outgoing.pop_front();
        }
        events
    }

    fn next_event(&self, now: Duration) -> Option<Duration> {
        if !self.outgoing.is_empty() {
            return Some(now);
        }
        let back = match self.cable {
            Cable::Pulled { back_at, .. } => Some(back_at),
            Cable::Plugged | Cable::Gone => None,
        };
        let planned = self.next_scheduled().into_iter().chain(back).chain(self.boots_at);
        let planned = planned.map(|at| at.max(now));
        planned.chain(self.controller.next_event(now)).min()
    }
}

/// Does this delay bytes from the controller?
fn is_tx_delay(action: &FaultAction) -> bool {
    matches!(action, FaultAction::Delay { direction: Direction::FromController, .. })
}

/// A small random generator (splitmix64); its seed is a literal of the test.
#[derive(Debug, Clone)]
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn hits(&mut self, rate: f64) -> bool {
        // A double holds 53 bits.
        ((self.next() >> 11) as f64) < rate * (1u64 << 53) as f64
    }
}
