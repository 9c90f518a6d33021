//! No false alarm: runs with nothing wrong, on every firmware.

use crate::parts::{Part, Random, START, holding, number, random_part, router, turn_along};
use crate::rig::{Cable, Rig};
use axis_driver::driver::{Command, DriverConfig, JogFrame, JogRequest, Overrides, RunOutcome};
use cnc_msgs::contour::{Action, Probe, SpindleMode};
use cnc_msgs::further::{FurtherAxes, FurtherMode, FurtherMove};
use cnc_msgs::geometry::{AxisSet, Plane, Position, Shape};
use cnc_msgs::machine::Mode;
use cnc_msgs::path::PathElement;
use kerf_tests::line::Line;
use std::time::Duration;
use virtual_controller::Firmware;

/// What a board may be set to, besides its firmware: reports, units, steps, arcs.
fn settings(firmware: Firmware, random: &mut Random) -> Vec<&'static str> {
    let masks: &[&str] = match firmware {
        Firmware::Grbl => &["$10=1", "$10=3", "$10=0", "$10=2"],
        Firmware::GrblHal => &["$10=511", "$10=509", "$10=510", "$10=95"],
        Firmware::FluidNc => &["$10=1", "$10=3", "$10=0"],
    };
    let mut lines = vec![random.of(masks)];
    if firmware != Firmware::FluidNc {
        lines.push(random.of(&["$13=0", "$13=1"]));
        lines.push(random.of(&["$12=0.002", "$12=0.02"]));
        lines.push(random.of(&["$100=250", "$100=80", "$100=800"]));
        lines.push(random.of(&["$102=250", "$102=400"]));
    }
    lines
}

/// Does to a run what an operator does, and lets it end.
fn attend(line: &mut Line, random: &mut Random, place: &str) {
    /// Two wrong reports within the lines that the planner holds may be held against a run.
    const BETWEEN_TORN: Duration = Duration::from_secs(30);
    /// No run takes longer.
    const PATIENCE: Duration = Duration::from_secs(3_600);
    let mut is_single = false;
    let (begin, mut torn_at) = (line.now, line.now);
    while line.finished.is_none() {
        let state = line.state();
        assert!(line.now < begin + PATIENCE, "{place}: {state:?} {:?}", line.log);
        assert!(!state.reason.starts_with("PATH_DEVIATION"), "{place}: {state:?}");
        match state.mode {
            Mode::ToolChange => {
                if random.below(2) == 0 {
                    change_by_hand(line, random);
                }
                line.wait(random.between(0.1, 2.0));
                // A hold that was asked for just before has to end first.
                if line.ask(Command::ConfirmToolChange { objection: None }).is_err() {
                    line.ask_resume();
                }
            }
            Mode::Hold if !line.ask_resume() => line.wait(0.1),
            Mode::Door => {
                line.controller.device_mut().controller_mut().set_door(false);
                line.wait(1.5);
                line.ask_resume();
            }
            _ => match random.below(40) {
                0 => drop(line.ask(Command::FeedHold)),
                1 => drop(line.ask(Command::DoorHold)),
                2 => {
                    let wanted = Overrides {
                        feed: Some(random.of(&[10, 50, 100, 150, 200])),
                        rapid: Some(random.of(&[25, 50, 100])),
                        spindle: Some(random.of(&[50, 100, 120])),
                    };
                    line.begin(Command::SetOverrides(wanted));
                }
                // Some boards do so a few times a night.
                4 if line.now >= torn_at + BETWEEN_TORN => {
                    line.controller.device_mut().controller_mut().tear_report();
                    torn_at = line.now;
                }
                3 => {
                    is_single = !is_single;
                    line.ask(Command::SetSingleBlock(is_single)).expect("single block");
                }
                _ => line.wait(random.between(0.05, 1.0)),
            },
        }
        if line.mode() == Mode::Hold {
            line.wait(random.between(0.0, 1.5));
        }
    }
    let ended = line.now;
    while line.mode() != Mode::Idle {
        let (state, result) = (line.state(), &line.finished);
        assert!(line.now < ended + PATIENCE, "{place}: {result:?} {state:?} {:?}", line.log);
        line.wait(0.5);
        line.ask_resume();
    }
    line.ask(Command::SetSingleBlock(false)).expect("single block off");
    line.replies.clear();
}

/// Up, aside, back down; the tool stands where it stood.
fn change_by_hand(line: &mut Line, random: &mut Random) {
    let stood = line.state().machine_position.expect("a position");
    let lift = random.between(1.0, 12.0);
    let jogs: [(JogFrame, Position); 2] =
        [(JogFrame::Relative, [lift, -lift, lift]), (JogFrame::Machine, stood)];
    for (frame, target) in jogs {
        let request = JogRequest {
            further: FurtherAxes::NONE,
            frame,
            axes: AxisSet::ALL,
            target,
            feed_mm_per_min: 1_500.0,
        };
        line.moved = None;
        if line.ask(Command::Jog(request)).is_err() {
            // A hold that was asked for just before has to end first.
            line.ask_resume();
            return;
        }
        assert_eq!(line.move_result().outcome, RunOutcome::Succeeded);
    }
}

/// Runs so many parts on one board; gives the virtual time that the runs took, and how many
/// reports were torn.
fn sound_runs(rig: Rig, seed: u64, runs: u32) -> (Duration, u64) {
    let mut random = Random(seed);
    let lines = settings(rig.firmware, &mut random);
    let config = DriverConfig { tool_change_return: true, ..holding() };
    let turns = rig.turns();
    let mut line = rig.line(&lines, config);
    let mut took = Duration::ZERO;
    for run in 0..runs {
        let elements = 20 + random.below(120) as usize;
        let mut path = random_part(&mut random, elements);
        if random.below(2) == 0 {
            let at = 1 + random.below(path.elements.len() as u64 - 1) as usize;
            insert(
                &mut path,
                at,
                &[Action::ChangeTool { tool: 2 }, Action::Spindle(SpindleMode::Clockwise)],
            );
        }
        if turns {
            zero_along(&mut path, &mut Random(seed + u64::from(run)));
            turn_along(&mut path, &mut random);
        } else {
            probe_along(&mut path, &mut Random(seed + u64::from(run)));
        }
        let begin = line.now;
        line.start(path, 0);
        let place = format!("{rig:?} {lines:?} seed {seed} run {run}");
        attend(&mut line, &mut random, &place);
        let result = line.finished.take().expect("it has ended");
        assert_eq!(
            result.outcome,
            RunOutcome::Succeeded,
            "{place}: {result:?}\n{}",
            line.log.join("\n")
        );
        let logged = line.log.iter().find(|text| text.contains("PATH_DEVIATION"));
        assert_eq!(logged, None, "{place}");
        line.log.clear();
        took += line.now - begin;
    }
    (took, line.controller.device().controller().counts().torn_reports)
}

/// Sets the zero of A now and then: where it stands, or to a place.
fn zero_along(path: &mut cnc_msgs::path::CompensatedPath, random: &mut Random) {
    for _ in 0..random.below(4) {
        let at = 1 + random.below(path.elements.len() as u64 - 1) as usize;
        let by_position = random.below(2) == 0;
        let axes = FurtherAxes::NONE.with(0, random.between(-200.0, 200.0).round());
        let (mode, origin) = (FurtherMode::Along, [0.0; 3]);
        let zero = Action::SetWorkOffset { system: 1, axes: AxisSet::NONE, origin, by_position };
        insert(path, at, &[Action::Further(FurtherMove { axes, mode }), zero]);
        // A block of its own.
        for event in path.events.iter_mut().filter(|event| event.at_element == at) {
            event.source.block = Some(1);
        }
    }
}

/// Makes a probe that touches nothing of one of the lines.
fn probe_along(path: &mut cnc_msgs::path::CompensatedPath, random: &mut Random) {
    let is_line =
        |element: &PathElement| element.shape == Shape::Line && element.feed_mm_per_min.is_some();
    let at = random.below(path.elements.len() as u64 - 1) as usize;
    if path.elements[at..=at + 1].iter().all(is_line) {
        insert(path, at, &[Action::Probe(Probe { away: false, may_miss: true })]);
        // The axes are not known before they are named.
        path.elements[at + 1].axes = AxisSet::ALL;
    }
}

/// Puts events before an element, after those that are there already.
fn insert(path: &mut cnc_msgs::path::CompensatedPath, at: usize, actions: &[Action]) {
    let place = path.events.partition_point(|event| event.at_element <= at);
    let source = path.elements[at].source;
    for (index, action) in actions.iter().enumerate() {
        let event = cnc_msgs::path::PathEvent { at_element: at, action: *action, source };
        path.events.insert(place + index, event);
    }
}

/// Rigs are drawn apart from what is cut on them.
const RIGS: u64 = 0x9E37_79B9;

/// `KERF_WATCH_HOURS=1000 cargo test -p kerf_tests --test path_watch wrong` goes on for so long, machine
/// time, from `KERF_WATCH_SEED` on.
#[test]
#[allow(clippy::print_stdout, reason = "a run of hours says how far it is")]
fn nothing_is_held_where_nothing_is_wrong() {
    let wanted = number("KERF_WATCH_HOURS", 0.0);
    let first = number("KERF_WATCH_SEED", 1.0) as u64;
    let (mut hours, mut torn) = (0.0, 0);
    for seed in first.. {
        for (firmware, number) in Firmware::ALL.into_iter().zip(0..) {
            let rig = Rig::draw(firmware, &mut Random((3 * seed + number).wrapping_mul(RIGS)));
            let (took, reports) = sound_runs(rig, seed, 4);
            hours += took.as_secs_f64() / 3_600.0;
            torn += reports;
        }
        if seed % 100 == 0 || hours >= wanted && wanted > 0.0 {
            println!("up to seed {seed}: {hours:.1} h, {torn} torn reports");
        }
        if seed >= first + 7 && hours >= wanted {
            break;
        }
    }
    assert!(hours > 1.0, "{hours:.2} h are too few for a statement");
    assert!(torn > 20, "{torn} torn reports are too few");
}

#[test]
fn a_feed_that_the_driver_has_raised_is_not_wrong_before_a_report_shows_its_override() {
    // The work offset takes the place of the override in the report after a torn one.
    let usual = Rig::usual(Firmware::GrblHal, "XYZA");
    let rig = Rig { cable: Cable::Network, acceleration_mm_per_s2: Some(800), ..usual };
    sound_runs(rig, 1092, 3);
}

#[test]
fn the_feed_from_before_a_hold_is_no_motion() {
    // grblHAL goes on reporting it, and the hold ends in a line that is cut more slowly.
    sound_runs(Rig::usual(Firmware::GrblHal, "XYZ"), 26, 1);
}

#[test]
fn no_feed_after_g93_is_no_restart() {
    // Words are asked for where a rapid follows a line that was sent as a time.
    sound_runs(Rig::usual(Firmware::FluidNc, "XYZA"), 103, 1);
    // In the words of the next run.
    sound_runs(Rig::usual(Firmware::FluidNc, "XYZA"), 172, 2);
    sound_runs(Rig::usual(Firmware::Grbl, "XYZA"), 2215, 3);
}

#[test]
fn programs_that_move_their_frame_are_followed() {
    for firmware in Firmware::ALL {
        let masks: &[&str] = match firmware {
            Firmware::GrblHal => &["$10=511", "$10=510"],
            Firmware::Grbl | Firmware::FluidNc => &["$10=3", "$10=0"],
        };
        for mask in masks {
            let mut line = router(firmware, &[mask], holding());
            let mut part = Part::new();
            part.line([10.0, 0.0, 0.0]);
            let origin = [START[0] + 30.0, START[1] - 20.0, START[2] + 4.0];
            part.event(Action::SetWorkOffset {
                system: 2,
                axes: AxisSet::ALL,
                origin,
                by_position: false,
            });
            part.event(Action::WorkOffset { system: 2 });
            part.rapid([0.0, 0.0, 2.0]);
            part.line([5.0, 5.0, 1.0]);
            part.event(Action::ToolLength { offset: Some(1), length_mm: 7.5, second: None });
            part.line([5.0, 9.0, -1.0]);
            part.arc(Plane::Xy, [-3.0, 4.0], 200.0, 1.0);
            part.event(Action::SetWorkOffset {
                system: 2,
                axes: AxisSet::from_bits(1),
                origin: [2.0; 3],
                by_position: true,
            });
            part.line([6.0, 3.0, 0.0]);
            part.event(Action::MachineMove {
                target: START,
                axes: AxisSet::from_bits(0b100),
                rapid: true,
                feed_mm_per_min: 0.0,
            });
            part.event(Action::WorkOffset { system: 1 });
            part.event(Action::ToolLength { offset: None, length_mm: 0.0, second: None });
            part.line([1.0, 2.0, 3.0]);
            part.event(Action::StoreReference { second: true });
            part.line([9.0, 9.0, 1.0]);
            part.event(Action::Reference { axes: AxisSet::from_bits(0b011), second: true });
            part.line([4.0, 4.0, 2.0]);
            part.event(Action::ProgramEnd { rewind: true });
            // What one run has stored the next one knows.
            let mut second = Part::new();
            second.event(Action::WorkOffset { system: 2 });
            second.rapid([1.0, 1.0, 1.0]);
            second.line([9.0, 2.0, 0.0]);
            for mut path in [part.path, second.path] {
                name_axes(&mut path);
                let result = line.run(path);
                let place = format!("{firmware} {mask}: {result:?}\n{}", line.log.join("\n"));
                assert_eq!(result.outcome, RunOutcome::Succeeded, "{place}");
                assert!(!line.log.iter().any(|text| text.contains("PATH_DEVIATION")), "{place}");
            }
        }
    }
}

/// Lines from another port of the board, which answers there.
fn pendant(line: &mut Line, text: &str) {
    for text in text.split_inclusive('\n') {
        line.inject("mute:ok");
        let now = line.now;
        line.controller.device_mut().controller_mut().receive(now, text.as_bytes());
        line.wait(0.01);
    }
}

#[test]
fn what_a_pendant_sets_before_a_run_is_known_in_it() {
    for firmware in Firmware::ALL {
        let masks: &[&str] = match firmware {
            Firmware::GrblHal => &["$10=511", "$10=510"],
            Firmware::Grbl | Firmware::FluidNc => &["$10=3", "$10=0"],
        };
        for (mask, waits_s) in masks.iter().flat_map(|mask| [(mask, 0.0), (mask, 0.3), (mask, 3.0)])
        {
            let mut line = router(firmware, &[mask], holding());
            let mut measured = Part::new();
            measured.event(Action::ToolLength { offset: Some(1), length_mm: 7.5, second: None });
            measured.line([5.0, 9.0, -1.0]);
            let mut path = measured.path;
            name_axes(&mut path);
            assert_eq!(line.run(path).outcome, RunOutcome::Succeeded, "{firmware} {mask}");
            for text in [
                "G10L20P1X0Y0\n",
                "G10L2P2X-290Y-190Z-40\nG55\n",
                "G43.1Z4.5\n",
                "G54\nG10L20P1X3Z2\nG55\nG43.1Z6\n",
                "G92X4Y4\n",
                "G49\nG10L20P1Y1\n",
            ] {
                line.wait(1.0);
                pendant(&mut line, text);
                line.wait(waits_s);
                let mut part = Part::new();
                part.line([8.0, 0.0, 1.0]);
                part.line([8.0, 6.0, -1.0]);
                part.line([1.0, 2.0, 1.0]);
                name_axes(&mut part.path);
                let result = line.run(part.path);
                let place = format!(
                    "{firmware} {mask} {waits_s} s after {text:?}: {result:?}\n{:?}",
                    line.log
                );
                assert_eq!(result.outcome, RunOutcome::Succeeded, "{place}");
                assert!(!line.log.iter().any(|text| text.contains("PATH_DEVIATION")), "{place}");
            }
        }
    }
}

/// Where the frame was moved an axis has no place before it is named.
fn name_axes(path: &mut cnc_msgs::path::CompensatedPath) {
    for element in &mut path.elements {
        element.axes = AxisSet::ALL;
    }
}
