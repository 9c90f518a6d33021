//! The virtual controller with a gate: its time stops where a command is due.
//!
//! If the machine kept moving while a command travels through DDS, it would be held at a different
//! position every time. Here the machine's time stops at the position where the command came in the
//! recording. It still answers requests, and time continues as soon as the command arrives. So the
//! result does not depend on the load of this computer.
//!
//! Sans-IO: a [`Device`] for the line, and a [`Gate`] for the side that gives the commands. Knows
//! the place; the conductor decides when to arm it.

use super::place::{Approach, NEAR_MM, Watch, WatchPlace, distance_mm};
use super::track::Track;
use axis_driver::link::realtime::{FEED_HOLD, SAFETY_DOOR, SOFT_RESET};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use virtual_controller::{Controller, Device, Vector};

/// Time step in which the machine is followed along its path, in its own time.
const SLICE: Duration = Duration::from_millis(1);
/// How far ahead the machine is searched within one step, mm; farther when it was off its path.
const AHEAD_MM: f64 = 1.0;
/// A machine stops within this time after a hold, in the machine's time.
const STANDS_WITHIN: Duration = Duration::from_secs(30);
/// The bytes that stop a machine: feed hold, soft reset, door.
const STOPS: [u8; 3] = [FEED_HOLD, SOFT_RESET, SAFETY_DOOR];

/// What the gate knows about the machine.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Machine {
    /// Lines that were answered since [`Gate::begin`].
    pub(super) answers: u64,
    pub(super) position: Vector,
    pub(super) speed_mm_per_min: f64,
    /// Its distance along the path of the goal, mm; `None`: it is not on the path.
    pub(super) along_mm: Option<f64>,
    /// Its time stands still: it has reached the place for which the gate was armed.
    pub(super) is_due: bool,
}

#[derive(Debug, Default)]
struct Shared {
    machine: Machine,
    watch: Option<Watch>,
    approach: Approach,
    /// The path that it is on.
    track: Option<Arc<Track>>,
    /// Its last place on the path, and how far it has gone since, mm.
    known_mm: f64,
    gone_mm: f64,
}

impl Shared {
    fn follow(&mut self, position: Vector) {
        let Some(track) = &self.track else { return };
        self.gone_mm += distance_mm(self.machine.position, position);
        let within_mm = self.gone_mm + AHEAD_MM;
        self.machine.along_mm = track.follow(self.known_mm, position, within_mm, None);
        if let Some(along_mm) = self.machine.along_mm {
            (self.known_mm, self.gone_mm) = (along_mm, 0.0);
        }
    }
}

/// The handle for the side that gives the commands; clones are the same gate.
#[derive(Debug, Clone, Default)]
pub(super) struct Gate(Arc<Mutex<Shared>>);

impl Gate {
    fn lock(&self) -> MutexGuard<'_, Shared> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts answers from here on, and follows the machine along this path.
    pub(super) fn begin(&self, track: Option<Arc<Track>>) {
        let mut shared = self.lock();
        shared.machine.answers = 0;
        (shared.track, shared.known_mm, shared.gone_mm) = (track, 0.0, 0.0);
    }

    /// Arms the gate: the machine's time stops when it reaches this place.
    pub(super) fn arm(&self, watch: Watch) {
        let mut shared = self.lock();
        // The rest of a run may have another path, which begins like the one before.
        shared.track = Some(Arc::clone(&watch.track));
        shared.watch = Some(watch);
        shared.approach = Approach::default();
    }

    fn stop_has_come(&self) {
        let stops = |watch: &Watch| matches!(watch.place, WatchPlace::StopsAt(_));
        if self.lock().watch.as_ref().is_some_and(stops) {
            self.release();
        }
    }

    /// Lets time continue, and disarms the gate.
    pub(super) fn release(&self) {
        let mut shared = self.lock();
        shared.watch = None;
        shared.machine.is_due = false;
    }

    /// The present state of the machine.
    pub(super) fn machine(&self) -> Machine {
        self.lock().machine
    }
}

/// A controller whose time the gate can stop.
#[derive(Debug)]
pub(super) struct GatedController {
    controller: Controller,
    gate: Gate,
    /// The controller's own time, and how far it is behind the line's.
    now: Duration,
    lag: Duration,
    /// Output that was not taken yet, and the line that is being received.
    said: Vec<u8>,
    line: Vec<u8>,
}

impl GatedController {
    pub(super) fn new(controller: Controller, gate: Gate) -> Self {
        let mut gated = Self {
            controller,
            gate,
            now: Duration::ZERO,
            lag: Duration::ZERO,
            said: Vec::new(),
            line: Vec::new(),
        };
        gated.look();
        gated
    }

    /// Takes the controller's output, and updates the gate with its position.
    fn look(&mut self) {
        let from = self.said.len();
        self.controller.transmit(&mut self.said);
        let mut answers = 0;
        for &byte in &self.said[from..] {
            match byte {
                b'\n' => {
                    answers += u64::from(is_answer(&self.line));
                    self.line.clear();
                }
                _ => self.line.push(byte),
            }
        }
        let mut shared = self.gate.lock();
        shared.machine.answers += answers;
        let position = self.controller.position();
        shared.follow(position);
        shared.machine.position = position;
        shared.machine.speed_mm_per_min = self.controller.speed_mm_per_min();
    }

    /// Advances to a time of its own clock, or until the gate stops it.
    fn live(&mut self, until: Duration) {
        while self.now < until && !self.is_due() {
            let is_followed = self.gate.lock().track.is_some();
            self.now = if is_followed { until.min(self.now + SLICE) } else { until };
            self.controller.advance(self.now);
            self.look();
            self.watch();
        }
    }

    fn is_due(&self) -> bool {
        self.gate.lock().machine.is_due
    }

    /// Stops time at the armed place.
    fn watch(&self) {
        let mut shared = self.gate.lock();
        let Shared { watch, approach, machine, .. } = &mut *shared;
        let Some(watch) = watch else { return };
        let Machine { answers, position, speed_mm_per_min, along_mm, .. } = *machine;
        if speed_mm_per_min <= 0.0 {
            return;
        }
        let braking_mm = self.braking_mm(speed_mm_per_min) + 2.0 * NEAR_MM;
        machine.is_due = match watch.place {
            WatchPlace::Passes(place) => watch.is_far_enough(along_mm).unwrap_or_else(|| {
                watch.is_answered(answers) && approach.is_there(distance_mm(position, place))
            }),
            WatchPlace::StopsAt(place) => match along_mm {
                // It cannot stop there yet.
                Some(along_mm)
                    if watch.is_far_enough(Some(along_mm + braking_mm)) == Some(false) =>
                {
                    false
                }
                Some(along_mm) if watch.along_mm.is_some() => {
                    let stop = self.stop_if_held();
                    let stop_mm = watch.track.follow(along_mm, stop, braking_mm, None);
                    watch.is_far_enough(stop_mm) == Some(true)
                }
                _ => {
                    let is_near = distance_mm(position, place) <= braking_mm;
                    watch.is_answered(answers)
                        && is_near
                        && approach.is_there(distance_mm(self.stop_if_held(), place))
                }
            },
        };
    }

    /// The longest distance that it may travel after a hold.
    fn braking_mm(&self, speed_mm_per_min: f64) -> f64 {
        let slowest = self.controller.settings().acceleration_mm_per_s2();
        let slowest = slowest.into_iter().fold(f64::INFINITY, f64::min).max(1.0);
        (speed_mm_per_min / 60.0).powi(2) / (2.0 * slowest)
    }

    /// Where it would stop if it were held now.
    fn stop_if_held(&self) -> Vector {
        let mut ahead = self.controller.clone();
        ahead.receive(self.now, &[FEED_HOLD]);
        ahead.advance(self.now + STANDS_WITHIN);
        ahead.position()
    }
}

impl Device for GatedController {
    fn receive(&mut self, now: Duration, bytes: &[u8]) {
        self.advance(now);
        if bytes.iter().any(|byte| STOPS.contains(byte)) {
            // The awaited command has arrived: time continues from here.
            self.gate.stop_has_come();
        }
        self.controller.receive(self.now, bytes);
        self.look();
    }

    fn advance(&mut self, now: Duration) {
        self.live(now.saturating_sub(self.lag).max(self.now));
        if self.is_due() {
            self.lag = now.saturating_sub(self.now);
        }
    }

    fn transmit(&mut self, to: &mut Vec<u8>) {
        self.look();
        to.append(&mut self.said);
    }

    fn next_event(&self, now: Duration) -> Option<Duration> {
        if !self.said.is_empty() {
            return Some(now);
        }
        if self.is_due() {
            return None;
        }
        self.controller.next_event(self.now).map(|at| (at + self.lag).max(now))
    }
}

/// `ok` and `error:20` answer a line.
fn is_answer(line: &[u8]) -> bool {
    let line = line.trim_ascii();
    line == b"ok" || line.starts_with(b"error:")
}

#[cfg(test)]
mod tests {
    use super::*;
    use virtual_controller::Settings;

    fn machine() -> (GatedController, Gate) {
        let gate = Gate::default();
        let controller = Controller::new(Settings::small_router());
        let mut gated = GatedController::new(controller, gate.clone());
        gated.advance(Duration::from_millis(10));
        gated.transmit(&mut Vec::new());
        gate.begin(None);
        (gated, gate)
    }

    fn watch(place: WatchPlace, along_mm: Option<f64>, answers: u64) -> Watch {
        Watch { place, track: Arc::new(there_and_back()), along_mm, answers, state: 3 }
    }

    /// From 0 to X20, to X40, and back.
    fn there_and_back() -> Track {
        Track::through([0.0, 20.0, 40.0, 0.0].map(|x| [x, 0.0, 0.0]).to_vec(), vec![1, 2, 3])
    }

    fn report(gated: &mut GatedController, now: Duration) -> String {
        gated.receive(now, b"?");
        let mut said = Vec::new();
        gated.transmit(&mut said);
        String::from_utf8_lossy(&said).into_owned()
    }

    #[test]
    fn time_stops_so_that_a_hold_ends_at_its_place_and_the_machine_answers() {
        let (mut gated, gate) = machine();
        let at = Duration::from_secs;
        gated.receive(at(1), b"G1X20F600\nX40\n");
        assert_eq!(gate.machine().answers, 2);
        gate.begin(Some(Arc::new(there_and_back())));
        gate.arm(watch(WatchPlace::StopsAt([30.0, 0.0, 0.0]), Some(30.0), 2));
        gated.advance(at(20));
        assert!(gate.machine().is_due, "{:?}", gate.machine());
        let output = report(&mut gated, at(40));
        assert!(output.contains("<Run"), "{output}");
        // Only a stop lets it continue.
        gated.receive(at(50), b"\x91~");
        assert!(gate.machine().is_due);
        // However late the command comes: the hold ends at its place.
        gated.receive(at(90), b"!");
        assert!(!gate.machine().is_due);
        gated.advance(at(91));
        let stop = gate.machine().position;
        assert!(distance_mm(stop, [30.0, 0.0, 0.0]) < NEAR_MM, "{stop:?}");
        assert!(report(&mut gated, at(91)).starts_with("<Hold:0"));
        gated.receive(at(92), b"~");
        gated.advance(at(100));
        assert_eq!(gate.machine().position, [40.0, 0.0, 0.0]);
    }

    #[test]
    fn time_stops_at_a_passed_place_and_continues_after_a_release() {
        let (mut gated, gate) = machine();
        let at = Duration::from_secs;
        gate.arm(watch(WatchPlace::Passes([10.0, 0.2, 0.0]), None, 1));
        gated.receive(at(1), b"G1X20F600\n");
        gated.advance(at(60));
        let seen = gate.machine();
        assert!(seen.is_due && (seen.position[0] - 10.0).abs() < 0.1, "{seen:?}");
        gate.release();
        gated.advance(at(61));
        gated.advance(at(63));
        assert_eq!(gate.machine().position, [20.0, 0.0, 0.0]);
    }

    #[test]
    fn time_stops_at_the_second_passage_of_a_place() {
        for place in [WatchPlace::StopsAt([30.0, 0.0, 0.0]), WatchPlace::Passes([30.0, 0.0, 0.0])] {
            let (mut gated, gate) = machine();
            gate.begin(Some(Arc::new(there_and_back())));
            gate.arm(watch(place, Some(50.0), 0));
            gated.receive(Duration::from_secs(1), b"G1X20F600\nX40\nX0\n");
            gated.advance(Duration::from_secs(60));
            let seen = gate.machine();
            assert!(seen.is_due, "{seen:?}");
            assert!(seen.along_mm.is_some_and(|along| (49.0..50.1).contains(&along)), "{seen:?}");
        }
    }

    #[test]
    fn a_place_that_is_not_passed_or_passed_too_early_does_not_stop_time() {
        for (place, along_mm, answers) in [
            (WatchPlace::Passes([10.0, 5.0, 0.0]), None, 1),
            (WatchPlace::Passes([10.0, 0.0, 0.0]), None, 9),
            (WatchPlace::StopsAt([10.0, 5.0, 0.0]), None, 1),
            (WatchPlace::StopsAt([10.0, 0.0, 0.0]), Some(55.0), 1),
        ] {
            let (mut gated, gate) = machine();
            gate.begin(Some(Arc::new(there_and_back())));
            gate.arm(watch(place, along_mm, answers));
            gated.receive(Duration::from_secs(1), b"G1X20F600\n");
            gated.advance(Duration::from_secs(10));
            assert!(!gate.machine().is_due, "{place:?}");
            assert_eq!(gate.machine().position, [20.0, 0.0, 0.0]);
        }
    }
}
