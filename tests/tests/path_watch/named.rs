//! One test for each thing that goes wrong on a shop floor.

use crate::certified::{Certified, OFF_MM};
use crate::parts::{Part, START, holding, router};
use axis_driver::codes::error_code;
use axis_driver::driver::{Command, DriverConfig, OffsetRequest, OnPathDeviation, RunOutcome};
use cnc_msgs::contour::{Action, SpindleMode};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::{AxisSet, Plane};
use cnc_msgs::machine::Mode;
use cnc_msgs::path::CompensatedPath;
use kerf_tests::line::Line;
use std::time::Duration;
use virtual_controller::Firmware;

/// A part with corners and a Z of its own, minutes long; with arcs or without. Where the
/// start of an arc is wrong, the controller refuses it before anything moves.
fn part(has_arcs: bool) -> CompensatedPath {
    rounds(has_arcs, 0.25)
}

/// Each round so much deeper than the one before.
fn rounds(has_arcs: bool, deeper_mm: f64) -> CompensatedPath {
    let mut part = Part::new();
    part.event(Action::SpindleSpeed { rpm: 12_000.0 });
    part.event(Action::Spindle(SpindleMode::Clockwise));
    part.feed(4_000.0);
    for round in 0..40 {
        let z = -f64::from(round) * deeper_mm;
        part.line([0.0, 0.0, z]);
        part.line([31.0, 0.0, z]);
        part.line([31.0, 17.0, z]);
        if has_arcs {
            part.arc(Plane::Xy, [8.0, 0.0], 170.0, 0.0);
        }
        part.line([3.0, 22.0, z]);
        part.line([0.0, 0.0, z]);
    }
    part.path
}

/// Lets the run go on until it is held or over; how far and how long the tool was off its path
/// before the hold was written.
fn until_held(line: &mut Line, certified: &Certified) -> (f64, f64) {
    const EVERY: Duration = Duration::from_millis(4);
    let (mut hint, mut farthest, mut since) = (0, 0.0_f64, None);
    let mut longest = Duration::ZERO;
    let written = line.written.len();
    loop {
        let at = line.now;
        let is_held = line.written[written..].iter().any(|(_, bytes)| bytes.contains(&b'!'));
        if is_held || line.finished.is_some() {
            let off_s = since.map_or(longest, |since| longest.max(at.saturating_sub(since)));
            return (farthest, off_s.as_secs_f64());
        }
        line.controller.advance(at);
        let off = certified.off(line.all_axes(), &mut hint).mm;
        farthest = farthest.max(off);
        match off > OFF_MM {
            true => since = since.or(Some(at)),
            false => {
                let was = since.take().map_or(Duration::ZERO, |since| at.saturating_sub(since));
                longest = longest.max(was);
            }
        }
        line.step_within(EVERY);
    }
}

/// Runs the part, and lets something happen when a line is being cut.
fn spoilt(
    path: CompensatedPath,
    firmware: Firmware,
    happen: impl Fn(&mut Line),
) -> (Line, f64, f64) {
    // No field of the receive buffer: a second sender fills it too.
    let mask = if firmware == Firmware::GrblHal { "$10=509" } else { "$10=1" };
    // And room for what it sends; no check notices that its answers are not counted.
    let config =
        DriverConfig { receive_buffer_bytes: Some(90), line_check_interval_ms: 0, ..holding() };
    let mut line = router(firmware, &[mask], config);
    let certified = Certified::new(&path, START, line.all_axes());
    line.start(path, 0);
    line.until("the line is reached", |line| line.state().line >= 3);
    happen(&mut line);
    let (off_mm, off_s) = until_held(&mut line, &certified);
    (line, off_mm, off_s)
}

/// The interval of reports, and the way of the request and of the report.
const INTERVAL_S: f64 = 0.135;

/// What the watch says, or what ended the run.
fn verdict(line: &mut Line) -> String {
    line.wait(0.5);
    match &line.finished {
        Some(result) => format!("{}: {}", result.error_code, result.message),
        None => line.state().reason,
    }
}

#[track_caller]
fn assert_bounds(what: &str, off_mm: f64, off_s: f64) {
    assert!(off_s <= INTERVAL_S, "{what}: held {off_s:.3} s after it was off");
    // 4000 mm/min are 67 mm/s; a rapid of all axes 144.
    assert!(off_mm < 0.06 + 150.0 * INTERVAL_S, "{what}: {off_mm:.3} mm");
}

#[track_caller]
fn assert_deviation(line: &mut Line, what: &str, off_mm: f64, off_s: f64) {
    let verdict = verdict(line);
    assert!(verdict.starts_with("PATH_DEVIATION: at line "), "{what}: {verdict}");
    assert!(verdict.contains("resume"), "{what}: {verdict}");
    assert_eq!(line.mode(), Mode::Hold, "{what}");
    assert_bounds(what, off_mm, off_s);
    line.ask(Command::CancelRun { run: None }).expect("canceled");
    assert_eq!(line.result().outcome, RunOutcome::Canceled, "{what}");
}

/// What the driver says next is changed on its way.
fn replace_next(line: &mut Line, from: &'static str, to: &'static str) {
    line.spoil_next(move |bytes| {
        let text = String::from_utf8_lossy(bytes);
        text.contains(from).then(|| text.replacen(from, to, 1).into_bytes())
    });
}

#[test]
fn a_damaged_digit_is_held_where_it_takes_the_tool_off_its_path() {
    for firmware in Firmware::ALL {
        for (from, to) in [
            ("X31\n", "X37\n"),
            ("X31\n", "X21\n"),
            ("Y17\n", "Y77\n"),
            ("Y17\n", "Y18\n"),
            ("Y22", "Y21"),
            ("X3Y", "X8Y"),
        ] {
            let what = format!("{firmware}: {from:?} as {to:?}");
            let (mut line, off_mm, off_s) =
                spoilt(part(false), firmware, |line| replace_next(line, from, to));
            assert!(!line.is_spoil_due(), "{what}");
            assert_deviation(&mut line, &what, off_mm, off_s);
        }
    }
}

#[test]
fn of_equal_rounds_the_line_that_is_cut_is_named() {
    for firmware in Firmware::ALL {
        for (from, to) in [("X31\n", "X37\n"), ("Y17\n", "Y77\n"), ("Y22", "Y21")] {
            let what = format!("{firmware}: {from:?} as {to:?}");
            let (mut line, off_mm, off_s) =
                spoilt(rounds(false, 0.0), firmware, |line| replace_next(line, from, to));
            assert_bounds(&what, off_mm, off_s);
            let verdict = verdict(&mut line);
            let named = verdict.strip_prefix("PATH_DEVIATION: at line ");
            let named = named.and_then(|rest| rest.split(' ').next()?.parse::<u32>().ok());
            let named = named.unwrap_or_else(|| panic!("{what}: {verdict}"));
            // The one that is damaged, or the one after it.
            let cut = line.state().line;
            assert!(named.abs_diff(cut) <= 1, "{what}: line {cut} is cut: {verdict}");
        }
    }
}

#[test]
fn merged_and_lost_lines_are_held() {
    for firmware in Firmware::ALL {
        for (from, to) in [("X31\n", "X31"), ("X31\n", ""), ("X0Y0\n", "")] {
            let what = format!("{firmware}: {from:?} as {to:?}");
            let (mut line, off_mm, off_s) =
                spoilt(part(false), firmware, |line| replace_next(line, from, to));
            assert!(!line.is_spoil_due(), "{what}");
            let verdict = verdict(&mut line);
            // A check among the lines may come first, or be what a line was merged with.
            let codes = ["PATH_DEVIATION", "309", "312"];
            assert!(codes.iter().any(|code| verdict.starts_with(code)), "{what}: {verdict}");
            assert_bounds(&what, off_mm, off_s);
        }
    }
}

#[test]
fn a_doubled_arc_is_held() {
    for firmware in Firmware::ALL {
        let (mut line, off_mm, off_s) = spoilt(part(true), firmware, |line| {
            line.spoil_next(|bytes| {
                let text = String::from_utf8_lossy(bytes);
                let arc = text.lines().find(|line| line.contains('I'))?;
                let twice = format!("{arc}\n{arc}\n");
                Some(text.replacen(&format!("{arc}\n"), &twice, 1).into_bytes())
            });
        });
        assert!(!line.is_spoil_due(), "{firmware}");
        let verdict = verdict(&mut line);
        let codes = ["PATH_DEVIATION", "312", "309"];
        assert!(codes.iter().any(|code| verdict.starts_with(code)), "{firmware}: {verdict}");
        assert_bounds(&firmware.to_string(), off_mm, off_s);
    }
}

#[test]
fn a_board_that_restarts_without_a_start_message_is_held() {
    for firmware in Firmware::ALL {
        let (mut line, off_mm, off_s) = spoilt(part(false), firmware, |line| {
            for text in ["mute:Grbl", "mute:unlock", "mute:MSG", "reset"] {
                line.inject(text);
            }
        });
        let verdict = verdict(&mut line);
        let codes = ["PATH_DEVIATION", "310", "312", "CONNECTING", "RESTARTED"];
        assert!(codes.iter().any(|code| verdict.starts_with(code)), "{firmware}: {verdict}");
        // It counts from another zero: how far off it is says nothing. A place out of reach
        // is asked for twice.
        assert!(off_mm > 1.0 && off_s <= 2.0 * INTERVAL_S, "{firmware}: {off_s:.3} s");
    }
}

#[test]
fn a_second_sender_that_moves_an_axis_is_held() {
    for firmware in Firmware::ALL {
        for text in ["G91G1Y5\nG90\n", "G53G0Z-40\n", "G1X15Y9\n"] {
            let what = format!("{firmware}: {text:?}");
            let (mut line, off_mm, off_s) =
                spoilt(part(false), firmware, |line| line.other_sender(text));
            let verdict = verdict(&mut line);
            let codes = ["PATH_DEVIATION", "309", "312"];
            assert!(codes.iter().any(|code| verdict.starts_with(code)), "{what}: {verdict}");
            assert_bounds(&what, off_mm, off_s);
        }
    }
}

#[test]
fn a_work_offset_that_nobody_asked_for_is_held_before_the_tool_moves_in_it() {
    for firmware in Firmware::ALL {
        let (mut line, off_mm, off_s) =
            spoilt(part(false), firmware, |line| line.other_sender("G92X10\n"));
        let what = format!("{firmware}: the offset is set by another");
        assert_deviation(&mut line, &what, off_mm, off_s);
        // The words that every run begins with select another system.
        let mut line = router(firmware, &[], holding());
        let origin = [START[0] + 7.0, START[1], START[2]];
        let other = OffsetRequest {
            further: FurtherAxes::NONE,
            system: 2,
            axes: AxisSet::ALL,
            position: origin,
            is_origin: true,
        };
        line.ask(Command::SetWorkOffset(other)).expect("G55 is set");
        let path = part(false);
        let certified = Certified::new(&path, START, line.all_axes());
        replace_next(&mut line, "G54", "G55");
        line.start(path, 0);
        let (off_mm, off_s) = until_held(&mut line, &certified);
        let what = format!("{firmware}: G54 as G55");
        let verdict = verdict(&mut line);
        // Words in force come among the answers, perhaps before the second report that has it.
        let is_named = verdict.contains("has the work offset X-293.000")
            || verdict.contains("has G55 in force; G54 was sent");
        assert!(is_named, "{what}: {verdict}");
        assert_bounds(&what, off_mm, off_s);
    }
}

#[test]
fn words_in_force_that_were_not_sent_are_held() {
    for firmware in Firmware::ALL {
        for (from, to) in [("F4000", "F4900"), ("S12000", "S2000"), ("M3", "M4")] {
            let what = format!("{firmware}: {from} as {to}");
            let mut line = router(firmware, &[], holding());
            replace_next(&mut line, from, to);
            line.start(part(false), 0);
            line.until("it is held", |line| line.mode() == Mode::Hold || line.finished.is_some());
            let verdict = verdict(&mut line);
            let is_feed = verdict.contains("at 4900 mm/min; 4000 mm/min is the most");
            let is_word = verdict.contains(&format!("in force; {from} was sent"));
            assert!(is_feed || is_word, "{what}: {verdict}");
        }
    }
}

#[test]
fn the_last_line_is_looked_at_before_the_run_is_called_done() {
    for firmware in Firmware::ALL {
        let mut line = router(firmware, &[], holding());
        let mut part = Part::new();
        part.line([0.5, 0.0, 0.0]);
        replace_next(&mut line, "X.5", "X.1");
        let result = line.run(part.path);
        assert_eq!(result.error_code, error_code::PATH_DEVIATION, "{firmware}: {result:?}");
        assert_eq!(result.blamed_line, 2, "{firmware}: {result:?}");
    }
}

#[test]
fn the_operator_may_resume_and_what_is_sent_then_is_watched_again() {
    {
        // It has the shortest planner, and says so.
        let firmware = Firmware::Grbl;
        let (mut line, ..) =
            spoilt(part(false), firmware, |line| replace_next(line, "X31\n", "X37\n"));
        let _ = verdict(&mut line);
        assert!(line.ask_resume());
        line.until("the run goes on", |line| line.mode() == Mode::Run);
        // What was under way at the resume is let pass.
        let at = line.state().line;
        line.until("other lines are cut", |line| {
            line.state().line >= at + 45 || line.finished.is_some()
        });
        replace_next(&mut line, "X31\n", "X36\n");
        line.until("held again, or over", |line| {
            line.mode() == Mode::Hold || line.finished.is_some()
        });
        let again = verdict(&mut line);
        assert!(again.starts_with("PATH_DEVIATION"), "{firmware}: {again}");
        assert!(line.ask_resume());
        assert_eq!(line.result().outcome, RunOutcome::Succeeded, "{firmware}");
    }
}

#[test]
fn a_board_whose_motors_do_not_move_along_straight_axes_is_not_held() {
    for (kinematics, is_held) in [("CoreXY", true), ("WallPlotter", false)] {
        let mut line = router(Firmware::FluidNc, &[], holding());
        line.inject(&format!("push:[MSG:INFO: Kinematic system: {kinematics}]"));
        line.wait(0.3);
        replace_next(&mut line, "X31\n", "X37\n");
        line.start(part(false), 0);
        line.until("it is held", |line| line.mode() == Mode::Hold || line.finished.is_some());
        assert_eq!(line.mode() == Mode::Hold, is_held, "{kinematics}: {:?}", line.log);
        assert!(line.log.iter().any(|text| text.starts_with("PATH_DEVIATION")), "{kinematics}");
    }
}

#[test]
fn the_parameter_says_what_is_done() {
    for (policy, logged) in [(OnPathDeviation::Log, true), (OnPathDeviation::Off, false)] {
        let config = DriverConfig { on_path_deviation: policy, ..holding() };
        let mut line = router(Firmware::GrblHal, &[], config);
        replace_next(&mut line, "X31\n", "X37\n");
        let result = line.run(part(false));
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{policy:?}: {result:?}");
        let is_logged = line.log.iter().any(|text| text.starts_with("PATH_DEVIATION"));
        assert_eq!(is_logged, logged, "{policy:?}: {:?}", line.log);
    }
}
