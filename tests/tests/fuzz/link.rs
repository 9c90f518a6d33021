//! A link and an honest controller: lines, commands and damage in any order.
//!
//! While nothing is damaged: the window is kept and the receive buffer never runs over;
//! no line is sent twice, none is left out; answers come back in order to the line that
//! they are for; nothing is called a fault. After damage the count still holds, or the
//! link says in time that it does not.

use crate::controller::{Controller, Traits, WAIT, Wire};
use crate::mutate::Random;
use axis_driver::link::{LineKind, Link, LinkConfig, LinkEvent, realtime};
use std::time::Duration;

const STEP: Duration = Duration::from_millis(1);
/// Before anything is sent a few reports come.
const QUIET: Duration = Duration::from_millis(3500);
/// A lost line, answer or controller shows within this time once nothing else happens.
const NOTICE: Duration = Duration::from_secs(3);
/// All lines in transit are done by then.
const DRAINED: Duration = Duration::from_secs(300);
/// Lines continue for this long after the damage, so that it shows in mid-stream.
const STREAM_AFTER_DAMAGE: Duration = Duration::from_secs(8);

/// What happens to the line or to its other end, once.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Damage {
    LostAnswer,
    DoubledAnswer,
    FlippedBack,
    DroppedBack,
    FlippedForth,
    DroppedForth,
    Restart,
    Alarm,
    Death,
}

const DAMAGES: [Damage; 10] = [
    Damage::LostAnswer,
    Damage::LostAnswer,
    Damage::DoubledAnswer,
    Damage::FlippedBack,
    Damage::DroppedBack,
    Damage::FlippedForth,
    Damage::DroppedForth,
    Damage::Restart,
    Damage::Alarm,
    Damage::Death,
];

/// What a case showed of answers that were lost in mid-stream.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Early {
    /// They could have been seen while lines went on.
    pub(crate) possible: u64,
    pub(crate) seen: u64,
}

struct Bench {
    link: Link<usize>,
    controller: Controller,
    forth: Wire,
    back: Wire,
    now: Duration,
    damage: Option<(Duration, Damage)>,
    has_damaged: bool,
    /// A line had an answer before it was done.
    was_early: bool,
    /// A fault, silence, an alarm or an unexpected restart.
    noticed: Option<String>,
    /// All lines that were given to the link, by tag.
    lines: Vec<String>,
    /// The first that the controller may still answer, and what it had done before it.
    first: usize,
    done_before: usize,
    next_answer: usize,
    /// What should be on the wire and is not yet.
    unwritten: Vec<u8>,
    /// Since then a start message is awaited.
    resetting: Option<Duration>,
    wants_resume: bool,
    shown: String,
}

/// One case.
pub(crate) fn check(random: &mut Random) -> Early {
    let mut traits = Traits::random(random);
    let damage = random.once_in(2).then(|| {
        let at = QUIET + Duration::from_millis(100 + random.below(2500) as u64);
        (at, *random.of(&DAMAGES))
    });
    let config = config(&traits, random);
    if config.baud == 9_600 {
        // The line back would carry nothing but reports.
        traits.reports_every = None;
    }
    let latency = Duration::from_millis(*random.of(&[0, 1, 4, 16]));
    let mut bench = Bench {
        link: Link::new(config, Duration::ZERO),
        controller: Controller::new(traits.clone()),
        forth: Wire::new(config.baud, latency),
        back: Wire::new(config.baud, latency),
        now: Duration::ZERO,
        damage,
        has_damaged: false,
        was_early: false,
        noticed: None,
        lines: Vec::new(),
        first: 0,
        done_before: 0,
        next_answer: 0,
        unwritten: Vec::new(),
        resetting: Some(Duration::ZERO),
        wants_resume: false,
        shown: format!("{traits:?} {config:?} {latency:?} {damage:?}"),
    };
    bench.link.set_receive_bytes(traits.reported_size);
    let longest = *random.of(&[12, 25, 70]);
    let window = bench.link.window();
    let end = match damage {
        Some((at, _)) => at + STREAM_AFTER_DAMAGE,
        None => QUIET + Duration::from_millis(random.below(5000) as u64),
    };
    while bench.now < end && bench.noticed.is_none() {
        bench.step(random);
        if bench.now > QUIET {
            if random.once_in(2) {
                bench.command(random);
            }
            bench.feed(longest, random);
            bench.command(random);
        }
    }
    let was_noticed = bench.noticed.is_some();
    bench.drain(random);
    let is_early_possible = matches!(damage, Some((_, Damage::LostAnswer)))
        && traits.reports_free
        && traits.reported_size.is_some()
        && traits.reports_every.is_none()
        // Requests and reports are in step, since nothing was in transit for a while.
        && bench.first == 0
        // The planner is full, and there are lines after the lost one.
        && traits.block >= Duration::from_millis(20)
        && window >= 4 * longest
        && config.baud > 9600;
    Early {
        possible: u64::from(is_early_possible),
        seen: u64::from(is_early_possible && was_noticed),
    }
}

fn config(traits: &Traits, random: &mut Random) -> LinkConfig {
    let configured = match traits.reported_size {
        // A controller must not report a larger buffer than it has.
        None => random.once_in(2).then(|| 20 + random.below(traits.size - 19) as u16),
        Some(_) => random.once_in(4).then(|| 20 + random.below(2000) as u16),
    };
    LinkConfig {
        baud: *random.of(&[9_600, 115_200, 115_200, 1_000_000]),
        hold_latency_ms_max: *random.of(&[5, 20, 20, 200]),
        receive_buffer_bytes: configured,
        poll_interval_ms: *random.of(&[100, 200, 500]),
        busy_poll_interval_ms: *random.of(&[0, 50, 100]),
        line_check_interval_ms: 0,
        watches_path: random.once_in(2),
    }
}

impl Bench {
    fn step(&mut self, random: &mut Random) {
        self.now += STEP;
        if random.once_in(2) {
            self.write();
        }
        for byte in self.forth.take(self.now) {
            self.controller.receive(byte);
        }
        if let Some((at, damage)) = self.damage
            && self.now >= at
            && !self.has_damaged
        {
            self.has_damaged = match damage {
                Damage::Restart => {
                    self.controller.restart();
                    true
                }
                Damage::Alarm => {
                    self.controller.raise_alarm();
                    true
                }
                Damage::Death => {
                    self.controller.die();
                    true
                }
                _ => false,
            };
        }
        self.controller.run(self.now);
        let mut said = self.controller.take_output();
        self.spoil_back(&mut said, random);
        self.back.push(self.now, &said);
        let received = self.back.take(self.now);
        if !received.is_empty() {
            self.link.receive(self.now, &received);
        }
        self.link.handle_time(self.now);
        while let Some(event) = self.link.poll_event() {
            self.on_event(event);
        }
        // After a reset the driver waits for the start message, but not for ever.
        if self.resetting.is_some_and(|since| self.now > since + NOTICE) {
            assert!(self.has_damaged, "no start message\n{}", self.shown);
            self.noticed.get_or_insert("no start message".into());
        }
        assert!(
            self.has_damaged || !self.controller.has_lost_bytes,
            "the receive buffer ran over\n{}",
            self.shown
        );
    }

    /// Hands on what the link wants to write, and looks whether it is what it was given.
    fn write(&mut self) {
        let Some(mut bytes) = self.link.poll_transmit() else { return };
        let lines: Vec<u8> =
            bytes.iter().copied().filter(|byte| !realtime::is_named(*byte)).collect();
        assert!(self.unwritten.starts_with(&lines), "lines were left out or sent twice");
        self.unwritten.drain(..lines.len());
        let (unanswered, window) = (self.link.unanswered_bytes(), self.link.window());
        assert!(
            unanswered <= window || self.link.unanswered() == 1,
            "{unanswered} bytes are in transit, {window} may be\n{}",
            self.shown
        );
        self.spoil_forth(&mut bytes);
        self.forth.push(self.now, &bytes);
    }

    fn on_event(&mut self, event: LinkEvent<usize>) {
        match event {
            LinkEvent::Answer { tag, error } => {
                assert_eq!(tag, self.next_answer, "answers out of order\n{}", self.shown);
                self.next_answer += 1;
                let done = self.controller.done.get(self.done_before + tag - self.first);
                if self.has_damaged {
                    self.was_early |= done.is_none();
                    return;
                }
                let (line, answer) = done
                    .unwrap_or_else(|| panic!("line {tag} was not answered yet\n{}", self.shown));
                assert_eq!(line, self.lines[tag].as_bytes(), "{}", self.shown);
                assert_eq!(*answer, error, "{}", self.shown);
            }
            LinkEvent::Banner { .. } if self.resetting.is_some() => {
                self.resetting = None;
                self.first = self.lines.len();
                self.next_answer = self.first;
                self.done_before = self.controller.done.len();
            }
            LinkEvent::Alarm(3) if self.resetting.is_some() => {}
            event @ (LinkEvent::Banner { .. }
            | LinkEvent::Alarm(_)
            | LinkEvent::Fault(_)
            | LinkEvent::Silent) => {
                assert!(self.has_damaged, "{event:?} without reason\n{}", self.shown);
                self.noticed.get_or_insert(format!("{event:?}"));
            }
            LinkEvent::Status { report, .. } => self.wants_resume = report.is_held(),
            _ => {}
        }
    }

    /// What an operator does in the meantime.
    fn command(&mut self, random: &mut Random) {
        if self.wants_resume && random.once_in(100) {
            self.link.send_realtime(realtime::RESUME);
        }
        match random.below(6000) {
            0 | 1 => self.link.send_realtime(realtime::FEED_HOLD),
            2 => self.link.send_realtime(realtime::FEED_PLUS_10),
            3..6 => self.link.ask_status(self.now),
            6 if !self.has_damaged && self.resetting.is_none() => {
                self.link.send_reset(self.now);
                self.unwritten.clear();
                self.resetting = Some(self.now);
            }
            _ => {}
        }
    }

    fn feed(&mut self, longest: usize, random: &mut Random) {
        if self.resetting.is_some() || random.once_in(3) {
            return;
        }
        for _ in 0..random.below(40) {
            let tag = self.lines.len();
            // Where an answer may get lost nothing takes longer than a motion.
            let (mut line, kind) = match random.below(300) {
                0 if self.damage.is_none() => {
                    let milliseconds = WAIT.as_millis() as u32;
                    (format!("G4P{tag}"), LineKind::Dwell { milliseconds })
                }
                1 if self.damage.is_none() => (format!("M3S{tag}"), LineKind::Slow),
                _ => (format!("X{tag}"), LineKind::Motion),
            };
            let length = random.below(longest + 1);
            while line.len() < length {
                line.push(char::from(b'0' + random.below(10) as u8));
            }
            if !self.link.has_room(line.len()) {
                return;
            }
            self.link.send_line(&line, kind, tag);
            self.unwritten.extend_from_slice(line.as_bytes());
            self.unwritten.push(b'\n');
            self.lines.push(line);
        }
    }

    /// No further lines; until nothing happens any more, or the damage was noticed.
    fn drain(&mut self, random: &mut Random) {
        let (begin, mut quiet_since) = (self.now, self.now);
        while self.noticed.is_none() && self.now < quiet_since + NOTICE {
            self.step(random);
            if self.wants_resume && random.once_in(100) {
                self.link.send_realtime(realtime::RESUME);
            }
            let is_dead_quiet = self.controller.is_quiet()
                && self.resetting.is_none()
                && !self.forth.carries_lines()
                && !self.wants_resume;
            if !is_dead_quiet {
                quiet_since = self.now;
            }
            assert!(self.now < begin + DRAINED, "it never ends\n{}", self.shown);
        }
        if self.noticed.is_some() {
            return;
        }
        let (sent, done) =
            (self.lines.len() - self.first, self.controller.done.len() - self.done_before);
        let answered = self.next_answer - self.first;
        // An answer too many lets the buffer run over; if that takes a line end away, there
        // is an answer too few, and the count is right again. That cannot be detected.
        let is_evened_out = self.controller.has_lost_bytes && self.link.unanswered() == 0;
        let is_right = sent == done && sent == answered && !self.was_early;
        assert!(
            is_evened_out || self.link.unanswered() == 0 && is_right,
            "not detected: {sent} lines were sent, {done} done, {answered} answered\n{}",
            self.shown
        );
        let is_dead = matches!(self.damage, Some((_, Damage::Death)));
        assert!(!is_dead || !self.has_damaged, "the end was not detected\n{}", self.shown);
    }

    fn is_due(&self) -> Option<Damage> {
        let (at, damage) = self.damage?;
        (self.now >= at && !self.has_damaged).then_some(damage)
    }

    fn spoil_back(&mut self, bytes: &mut Vec<u8>, random: &mut Random) {
        let (Some(damage), false) = (self.is_due(), bytes.is_empty()) else { return };
        let answer = bytes.windows(4).position(|four| four == b"ok\r\n");
        self.has_damaged = match (damage, answer) {
            (Damage::LostAnswer, Some(at)) => {
                bytes.drain(at..at + 4);
                true
            }
            (Damage::DoubledAnswer, Some(at)) => {
                bytes.splice(at..at, *b"ok\r\n");
                true
            }
            (Damage::FlippedBack, _) => {
                let at = random.below(bytes.len());
                bytes[at] ^= 1 << random.below(8);
                true
            }
            (Damage::DroppedBack, _) => {
                let from = random.below(bytes.len());
                let to = (from + 1 + random.below(12)).min(bytes.len());
                bytes.drain(from..to);
                true
            }
            _ => false,
        };
    }

    fn spoil_forth(&mut self, bytes: &mut Vec<u8>) {
        // Any byte, but the same one each time the case is run.
        let at = self.lines.len() % bytes.len();
        self.has_damaged |= match self.is_due() {
            Some(Damage::FlippedForth) => {
                bytes[at] ^= 1 << (self.lines.len() / 7 % 8);
                true
            }
            Some(Damage::DroppedForth) => {
                bytes.remove(at);
                true
            }
            _ => false,
        };
    }
}
