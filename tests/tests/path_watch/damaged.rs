//! Random damages on the way to the controller: none takes the tool off the certified path for
//! longer than a report interval without a hold.

use crate::certified::{Certified, OFF_DEGREES, OFF_MM};
use crate::parts::{Random, START, number, random_part, turn_along};
use crate::rig::{Cable, Rig};
use axis_driver::driver::{Command, RunOutcome};
use cnc_msgs::machine::Mode;
use kerf_tests::line::Line;
use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;
use virtual_controller::Firmware;

/// How often the true place is looked at.
const EVERY: Duration = Duration::from_millis(4);
/// A hold waits behind the bytes that are on the wire (`hold_latency_ms_max`), and for the firmware's look.
const HOLD_DELAY_S: f64 = 0.03;
/// The speed at the hold is that of so long before it: firmware plans in segments of up to 10 ms.
const SPEED_OF: Duration = Duration::from_millis(20);

/// No run takes longer.
const PATIENCE: Duration = Duration::from_secs(600);
/// No machine stops more slowly.
const STOPPED: Duration = Duration::from_secs(20);

/// What became of the damages, on machines with the same cable.
#[derive(Debug, Default, Clone, Copy)]
struct Tally {
    damages: u64,
    /// Runs that a deviation has held.
    held: u64,
    /// Runs that were stopped for another reason: a refused line, a lost count.
    stopped: u64,
    /// Runs that have ended as if nothing were.
    done: u64,
    /// The longest time off the path before a hold was written, and that in parts of what is allowed.
    longest_s: f64,
    share: f64,
    /// The largest distance off the path before a hold, and at standstill after one.
    farthest_mm: f64,
    stopped_mm: f64,
}

/// Damages one of the lines that are written; `None` where there is none among the bytes.
pub(crate) fn spoil(bytes: &[u8], random: &mut Random) -> Option<Vec<u8>> {
    let is_of_a_line = |index: &usize| bytes[*index] != b'?' && bytes[*index] != b'!';
    let places: Vec<usize> = (0..bytes.len()).filter(is_of_a_line).collect();
    let digits: Vec<usize> =
        places.iter().copied().filter(|index| bytes[*index].is_ascii_digit()).collect();
    if digits.is_empty() {
        return None;
    }
    let mut spoilt = bytes.to_vec();
    let (place, digit) = (random.of(&places), random.of(&digits));
    let begins = bytes[..place].iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
    let ends = bytes[place..].iter().position(|byte| *byte == b'\n').map(|at| place + at + 1)?;
    match random.below(10) {
        0..=3 => {
            let other = 1 + random.below(9) as u8;
            spoilt[digit] = b'0' + (bytes[digit] - b'0' + other) % 10;
        }
        4 => spoilt[place] ^= 1 << random.below(7),
        5 => drop(spoilt.remove(place)),
        6 => spoilt.insert(place, bytes[place]),
        // The line end: two lines are one.
        7 => drop(spoilt.remove(ends - 1)),
        8 => drop(spoilt.drain(begins..ends)),
        _ => {
            let line = bytes[begins..ends].to_vec();
            spoilt.splice(begins..begins, line);
        }
    }
    Some(spoilt)
}

/// Damages so many lines, one after the other, on one machine.
fn damage(firmware: Firmware, seed: u64, damages: u64, tallies: &mut BTreeMap<Cable, Tally>) {
    let mut random = Random(seed);
    let rig = Rig::draw(firmware, &mut random);
    let tally = tallies.entry(rig.cable).or_default();
    let mut line = rig.holding();
    let last = tally.damages + damages;
    let mut run = 0;
    while tally.damages < last {
        run += 1;
        let elements = 20 + random.below(40) as usize;
        let mut path = random_part(&mut random, elements);
        if rig.turns() {
            turn_along(&mut path, &mut random);
        }
        let certified = Certified::new(&path, START, line.all_axes());
        let what = format!("seed {seed} run {run} {rig:?}");
        line.log.clear();
        line.start(path, 0);
        // That of the run before, which was canceled.
        line.has_held();
        let (mut is_due, begin) = (false, line.now);
        let mut watcher = Watcher::new(&certified);
        let mut damage_at = line.now + Duration::from_secs_f64(random.between(0.0, 1.5));
        let (outcome, deviates) = loop {
            let state = line.state();
            if line.finished.is_some() {
                break (line.finished.take(), false);
            }
            // A byte may become a hold or M0, a digit M6 or a feed that takes hours: the operator
            // sees that it stands, or is on its path and slow.
            let stands = matches!(state.mode, Mode::Hold | Mode::Door | Mode::ToolChange);
            if stands || line.now > begin + PATIENCE {
                let deviates = state.reason.starts_with("PATH_DEVIATION");
                if deviates {
                    watcher.look_at_stop(&mut line, &rig, &what);
                }
                // It may have ended meanwhile.
                line.begin(Command::CancelRun { run: None });
                line.until("canceled", |line| line.finished.is_some());
                break (line.finished.take(), deviates);
            }
            if line.now >= damage_at && !is_due && state.mode == Mode::Run {
                let mut chance = Random(random.next());
                line.spoil_next(move |bytes| spoil(bytes, &mut chance));
                is_due = true;
                damage_at = line.now + Duration::from_secs_f64(random.between(0.1, 2.0));
            }
            watcher.look(&mut line);
            line.step_within(EVERY);
            if is_due && !line.is_spoil_due() {
                is_due = false;
                tally.damages += 1;
            }
        };
        let outcome = outcome.expect("it has ended");
        tally.held += u64::from(deviates);
        let is_done = outcome.outcome == RunOutcome::Succeeded;
        tally.done += u64::from(is_done);
        tally.stopped += u64::from(!is_done && !deviates);
        tally.longest_s = tally.longest_s.max(watcher.longest_s);
        tally.farthest_mm = tally.farthest_mm.max(watcher.farthest_mm);
        tally.stopped_mm = tally.stopped_mm.max(watcher.stopped_mm);
        // A look may come as late as this.
        let within_s = (rig.held_within() + EVERY).as_secs_f64();
        tally.share = tally.share.max(watcher.longest_s / within_s);
        assert!(
            watcher.longest_s <= within_s,
            "{what}: {:.3} s and {:.3} mm off the path, allowed are {within_s:.3} s: {outcome:?}\n{}",
            watcher.longest_s,
            watcher.farthest_mm,
            line.log.join("\n")
        );
        if is_done {
            let (end, angle) = certified.end();
            let at = line.all_axes();
            let off = (0..3).map(|axis| (end[axis] - at[axis]).powi(2)).sum::<f64>().sqrt();
            assert!(off <= OFF_MM, "{what}: it ends {off:.3} mm off: {outcome:?}");
            let off = (angle - at[3]).abs();
            assert!(off <= OFF_DEGREES, "{what}: A ends {off:.3} degrees off: {outcome:?}");
        }
        line.wait(0.3);
        if line.mode() == Mode::Idle && line.state().reason.is_empty() {
            line.replies.clear();
        } else {
            line = rig.holding();
        }
    }
}

/// Looks where the axes are, until a hold is written or the run is over.
struct Watcher<'a> {
    certified: &'a Certified,
    hint: usize,
    off_since: Option<Duration>,
    is_held: bool,
    /// The newest looks, the last one at the hold.
    looks: VecDeque<(Duration, [f64; 6])>,
    longest_s: f64,
    farthest_mm: f64,
    stopped_mm: f64,
}

impl<'a> Watcher<'a> {
    fn new(certified: &'a Certified) -> Self {
        Self {
            certified,
            hint: 0,
            off_since: None,
            is_held: false,
            looks: VecDeque::new(),
            longest_s: 0.0,
            farthest_mm: 0.0,
            stopped_mm: 0.0,
        }
    }

    fn look(&mut self, line: &mut Line) {
        let has_held = line.has_held();
        if self.is_held {
            return;
        }
        line.controller.advance(line.now);
        let axes = line.all_axes();
        self.looks.push_back((line.now, axes));
        while self.looks.front().is_some_and(|(then, _)| *then + SPEED_OF < line.now) {
            self.looks.pop_front();
        }
        self.is_held = has_held;
        let off = self.certified.off(axes, &mut self.hint);
        self.farthest_mm = self.farthest_mm.max(off.mm);
        if has_held {
            return;
        }
        if off.is_on_path() {
            self.off_since = None;
            return;
        }
        let since = *self.off_since.get_or_insert(line.now);
        self.longest_s = self.longest_s.max((line.now - since).as_secs_f64());
    }

    /// How fast all axes together were before the hold, mm/s, with degrees as mm: as a planner counts.
    fn speed(&self) -> f64 {
        let ends = self.looks.front().zip(self.looks.back());
        let (way, seconds) = ends.map_or((0.0, 0.0), |((then, from), (now, to))| {
            (way(*from, *to), now.saturating_sub(*then).as_secs_f64())
        });
        if seconds > 0.0 { way / seconds } else { 0.0 }
    }

    /// Lets the machine come to a stop, and compares the way with what its acceleration allows.
    fn look_at_stop(&mut self, line: &mut Line, rig: &Rig, what: &str) {
        let Some(&(_, held_at)) = self.looks.back() else { return };
        let (end, mut last, mut still) = (line.now + STOPPED, line.all_axes(), 0);
        while still < 20 {
            assert!(line.now < end, "{what}: it does not stop");
            line.step_within(EVERY);
            line.controller.advance(line.now);
            let at = line.all_axes();
            still = if at == last { still + 1 } else { 0 };
            last = at;
        }
        let Some(acceleration) = rig.acceleration_mm_per_s2.map(f64::from) else { return };
        let speed = self.speed() + acceleration * (HOLD_DELAY_S + SPEED_OF.as_secs_f64());
        let most = speed * HOLD_DELAY_S + speed.powi(2) / (2.0 * acceleration) + OFF_MM;
        let stopped = way(held_at, last);
        assert!(
            stopped <= most,
            "{what}: it stops after {stopped:.3} mm, and {most:.3} mm are allowed\n{}",
            line.log.join("\n")
        );
        self.stopped_mm = self.certified.off(last, &mut self.hint).mm;
    }
}

fn way(from: [f64; 6], to: [f64; 6]) -> f64 {
    (0..6).map(|axis| (to[axis] - from[axis]).powi(2)).sum::<f64>().sqrt()
}

/// `KERF_WATCH_DAMAGES=1000000 cargo test -p kerf_tests --test path_watch damage` damages more, from
/// `KERF_WATCH_SEED` on, and writes a table.
#[test]
#[allow(clippy::print_stdout, reason = "a run of hours says how far it is")]
fn no_damage_takes_the_axes_off_their_path_for_longer_than_a_report() {
    let wanted = number("KERF_WATCH_DAMAGES", 600.0);
    let mut tallies = BTreeMap::new();
    for seed in number("KERF_WATCH_SEED", 1.0) as u64.. {
        for (firmware, number) in Firmware::ALL.into_iter().zip(0..) {
            damage(firmware, 3 * seed + number, 40, &mut tallies);
        }
        let all: u64 = tallies.values().map(|it| it.damages).sum();
        if all % 12_000 < 120 || all as f64 >= wanted {
            println!("up to seed {seed}: {tallies:#?}");
        }
        if all as f64 >= wanted {
            break;
        }
    }
    assert!(tallies.values().map(|it| it.held).sum::<u64>() > 50, "{tallies:?}");
    assert!(tallies.values().map(|it| it.stopped).sum::<u64>() > 100, "{tallies:?}");
}
