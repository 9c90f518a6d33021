//! Random damages on the way to the controller: none takes the tool off the certified path for
//! longer than a report interval without a hold.

use crate::certified::Certified;
use crate::parts::{Random, START, holding, number, random_part, router};
use axis_driver::driver::{Command, RunOutcome};
use cnc_msgs::machine::Mode;
use kerf_tests::line::Line;
use std::time::Duration;
use virtual_controller::Firmware;

/// How often the true place is looked at.
const EVERY: Duration = Duration::from_millis(4);
/// Farther away is off the path, mm: what the watch lets pass on this machine (250 steps/mm,
/// `$12` 0.002 mm), and the chords of [`Certified`].
pub(crate) const OFF_MM: f64 = 0.06;
/// The longest that the tool is off before the hold is written: the interval of reports while many
/// lines are answered (160 ms), the way of the request and of the report behind other answers.
const HELD_WITHIN_S: f64 = 0.2;

/// No run takes longer.
const PATIENCE: Duration = Duration::from_secs(600);

/// What became of the damages.
#[derive(Debug, Default, Clone, Copy)]
struct Tally {
    damages: u64,
    /// Runs that a deviation has held.
    held: u64,
    /// Runs that were stopped for another reason: a refused line, a lost count.
    stopped: u64,
    /// Runs that have ended as if nothing were.
    done: u64,
    /// The longest time and the largest distance off the path before a hold.
    longest_s: f64,
    farthest_mm: f64,
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
fn damage(firmware: Firmware, seed: u64, damages: u64, tally: &mut Tally) {
    let mut random = Random(seed);
    let mut line = router(firmware, &[], holding());
    line.forget_written();
    let last = tally.damages + damages;
    let mut run = 0;
    while tally.damages < last {
        run += 1;
        let elements = 20 + random.below(40) as usize;
        let path = random_part(&mut random, elements);
        let certified = Certified::new(&path, START, line.axes());
        let what = format!("{firmware} seed {seed} run {run}");
        line.log.clear();
        line.start(path, 0);
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
        assert!(
            watcher.longest_s <= HELD_WITHIN_S,
            "{what}: {:.3} s and {:.3} mm off the path: {outcome:?}\n{}",
            watcher.longest_s,
            watcher.farthest_mm,
            line.log.join("\n")
        );
        if is_done {
            let end = certified.end();
            let at = line.axes();
            let off = (0..3).map(|axis| (end[axis] - at[axis]).powi(2)).sum::<f64>().sqrt();
            assert!(off <= OFF_MM, "{what}: it ends {off:.3} mm off: {outcome:?}");
        }
        settle(&mut line, firmware);
    }
}

/// Looks where the tool is, until a hold is written or the run is over.
struct Watcher<'a> {
    certified: &'a Certified,
    hint: usize,
    off_since: Option<Duration>,
    is_held: bool,
    longest_s: f64,
    farthest_mm: f64,
}

impl<'a> Watcher<'a> {
    fn new(certified: &'a Certified) -> Self {
        let (hint, off_since, is_held) = (0, None, false);
        Self { certified, hint, off_since, is_held, longest_s: 0.0, farthest_mm: 0.0 }
    }

    fn look(&mut self, line: &mut Line) {
        self.is_held |= line.has_held();
        if self.is_held {
            return;
        }
        line.controller.advance(line.now);
        let off = self.certified.off_mm(line.axes(), &mut self.hint);
        self.farthest_mm = self.farthest_mm.max(off);
        if off <= OFF_MM {
            self.off_since = None;
            return;
        }
        let since = *self.off_since.get_or_insert(line.now);
        self.longest_s = self.longest_s.max((line.now - since).as_secs_f64());
    }
}

/// Makes the machine ready for the next run, or takes another.
fn settle(line: &mut Line, firmware: Firmware) {
    line.wait(0.3);
    if line.mode() == Mode::Idle && line.state().reason.is_empty() {
        line.replies.clear();
        return;
    }
    *line = router(firmware, &[], holding());
    line.forget_written();
}

/// `KERF_WATCH_DAMAGES=1000000 cargo test -p kerf_tests --test path_watch damage` damages more, from
/// `KERF_WATCH_SEED` on.
#[test]
fn no_damage_takes_the_tool_off_its_path_for_longer_than_a_report() {
    let wanted = number("KERF_WATCH_DAMAGES", 600.0);
    let mut tally = Tally::default();
    for seed in number("KERF_WATCH_SEED", 1.0) as u64.. {
        for firmware in Firmware::ALL {
            damage(firmware, seed, 100, &mut tally);
        }
        if tally.damages as f64 >= wanted {
            break;
        }
    }
    assert!(tally.held > 50, "{tally:?}");
    assert!(tally.stopped > 100, "{tally:?}");
}
