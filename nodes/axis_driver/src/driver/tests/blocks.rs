//! Single blocks: stops between them, and blocks from the operator's hand; homing in
//! the middle of a program; which side the cutter is said to be on.

use super::bench::source;
use super::*;
use cnc_msgs::contour::CutterSide;
use cnc_msgs::path::{CompensatedPath, Role};
use cnc_msgs::text::Text;
use std::sync::Arc;

/// Five lines: one to the start, lead-on, contour, a generated corner of the block
/// after it, lead-off; then the end.
fn compensated() -> CompensatedPath {
    let mut path = straight(5);
    let roles = [Role::None, Role::LeadOn, Role::Contour, Role::Corner, Role::LeadOff];
    for (element, role) in path.elements.iter_mut().zip(roles) {
        element.role = role;
        element.side = (role != Role::None).then_some(CutterSide::Left);
    }
    path.elements[3].source = source(5);
    with_event(path, 5, Action::ProgramEnd { rewind: true })
}

/// The stop that the machine stands at.
fn stop(bench: &mut Bench) -> (u32, f64, Option<CutterSide>, String) {
    bench.until("a stop", |bench| bench.mode() == Mode::Hold || bench.finished.is_some());
    let state = bench.state();
    let x = state.work_position.map_or(f64::NAN, |at| at[0]);
    (state.line, x, state.compensation, state.reason)
}

#[test]
fn s10_in_single_block_every_block_is_a_stop_point_generated_ones_too() {
    let mut bench = Bench::connected();
    bench.ask(Command::SetSingleBlock(true)).unwrap();
    let mut path = with_event(compensated(), 1, Action::SpindleSpeed { rpm: 900.0 });
    // A function of block 2, before its motion: no stop between the two.
    path.events.rotate_right(1);
    path.events[0].source = source(2);
    bench.start(path);
    let left = Some(CutterSide::Left);
    for (line, x, side, text) in [
        (1, 10.0, None, "line 1"),
        (2, 20.0, left, "line 2, lead_on"),
        (3, 30.0, left, "line 3, contour"),
        (5, 40.0, left, "line 5, corner"),
    ] {
        let found = stop(&mut bench);
        assert_eq!(found, (line, x, side, format!("SINGLE_BLOCK: resume to go on ({text})")));
        // Nothing goes on by itself, and nothing more is under way.
        bench.wait(3_000);
        assert_eq!(stop(&mut bench), found);
        bench.ask(Command::Resume).unwrap();
    }
    // The end of the program is in the block of the lead-off here.
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
    assert_eq!(bench.sent_count(b'~'), 0, "a machine that stands needs no cycle start");
}

#[test]
fn the_end_of_the_lead_off_is_no_longer_compensated() {
    let mut path = compensated();
    // The end of the program in a block of its own.
    path.events[0].source = source(6);
    let mut bench = Bench::connected();
    bench.ask(Command::SetSingleBlock(true)).unwrap();
    bench.start(path);
    for _ in 0..4 {
        stop(&mut bench);
        bench.ask(Command::Resume).unwrap();
    }
    let (line, x, side, reason) = stop(&mut bench);
    assert_eq!((line, x, side), (5, 50.0, None), "{reason}");
    bench.ask(Command::Resume).unwrap();
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
    let sides: Vec<_> = bench.states.iter().map(|state| state.compensation).collect();
    assert!(sides.contains(&Some(CutterSide::Left)));
}

#[test]
fn single_block_can_be_switched_in_the_middle_of_a_run() {
    let mut bench = Bench::running(straight(60));
    let text = bench.ask(Command::SetSingleBlock(true)).unwrap();
    assert!(text.contains("blocks that were sent already are cut first"), "{text}");
    let (first, x, ..) = stop(&mut bench);
    assert!(first > 3 && x == 10.0 * f64::from(first), "{first} at X{x}");
    bench.ask(Command::Resume).unwrap();
    assert_eq!(stop(&mut bench).0, first + 1);
    // Off does not resume.
    let text = bench.ask(Command::SetSingleBlock(false)).unwrap();
    assert!(text.contains("resume to go on"), "{text}");
    bench.wait(3_000);
    assert_eq!(stop(&mut bench).0, first + 1);
    bench.ask(Command::Resume).unwrap();
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
}

#[test]
fn a_hold_at_a_stop_point_wants_its_own_resume() {
    let mut bench = Bench::connected();
    bench.ask(Command::SetSingleBlock(true)).unwrap();
    bench.start(straight(3));
    stop(&mut bench);
    bench.ask(Command::FeedHold).unwrap();
    bench.wait(1_000);
    bench.ask(Command::Resume).unwrap();
    bench.wait(2_000);
    assert_eq!(stop(&mut bench).0, 1, "the hold is over, the block is not");
    bench.ask(Command::Resume).unwrap();
    assert_eq!(stop(&mut bench).0, 2);
    bench.ask(Command::CancelRun { run: None }).unwrap();
    assert_ended(&bench.result(), RunOutcome::Canceled, error_code::CANCELED);
    // The mode stays for the next run, and in a record that begins here.
    bench.finished = None;
    bench.until("idle", |bench| bench.mode() == Mode::Idle);
    let mut path = straight(2);
    path.elements.iter_mut().for_each(|element| element.end[0] += 100.0);
    bench.start(path);
    assert_eq!(stop(&mut bench).0, 1);
}

#[test]
fn a_block_that_stops_by_itself_is_one_stop() {
    let mut bench = Bench::connected();
    bench.ask(Command::SetSingleBlock(true)).unwrap();
    let mut path = with_event(straight(2), 1, Action::Stop { optional: false });
    path.elements[1].source = source(3);
    path.events[0].source = source(2);
    bench.start(path);
    assert!(stop(&mut bench).3.starts_with("SINGLE_BLOCK"));
    bench.ask(Command::Resume).unwrap();
    bench.until("a program stop", |bench| bench.firmware.executed.iter().any(|l| l == "M0"));
    bench.wait(1_000);
    assert_eq!(bench.mode(), Mode::Hold);
    bench.ask(Command::Resume).unwrap();
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
}

#[test]
fn n09_a_block_by_hand_runs_from_idle_only_and_is_in_the_record_with_its_path() {
    let mut bench = Bench::connected();
    let mut path = straight(1);
    // A number that hardly survives a decimal notation.
    path.elements[0].end = [10.0 / 3.0, 0.1 + 0.2, 0.0];
    path.elements[0].end = path.elements[0].end.map(|mm| (mm * 1e9).round() / 1e9);
    let mdi = |path: &CompensatedPath| Command::ExecuteMdi {
        path: Arc::new(path.clone()),
        tool_diameters_mm: Default::default(),
    };
    bench.command(5, mdi(&path));
    bench.until("it runs", |bench| bench.mode() == Mode::Run);
    assert_eq!((bench.state().program_id.as_str(), bench.state().compensation), (MDI, None));
    assert_eq!(refusal(bench.ask(mdi(&path))).0, error_code::BUSY);
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
    assert_eq!(bench.firmware.executed[1], "G1X3.3333Y.3F600");
    // It relies on where the tool is: not from elsewhere.
    path.assumed_axes = AxisSet::NONE.with(0);
    bench.finished = None;
    assert_eq!(refusal(bench.ask(mdi(&path))).0, error_code::START_POSITION);
    // Nor in the middle of a program.
    bench.finished = None;
    bench.start(straight(20));
    bench.until("it runs", |bench| bench.mode() == Mode::Run);
    path.assumed_axes = AxisSet::NONE;
    assert_eq!(refusal(bench.ask(mdi(&path))).0, error_code::BUSY);
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
}

#[test]
fn a05_home_in_a_program_waits_for_standstill_and_says_the_words_in_force_again() {
    let mut bench = Bench::connected();
    let path = with_event(straight(4), 2, Action::Home { axes: AxisSet::ALL });
    bench.start(path);
    bench.until("homing", |bench| bench.mode() == Mode::Home);
    assert!(!bench.state().is_homed);
    bench.until("homed", |bench| bench.state().is_homed);
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
    assert_eq!(
        bench.firmware.executed[1..],
        ["G1X10F600", "X20", "G4P0.01", "G21G90G94G17G40G54", "G1X30F600", "X40", "G4P0.01"]
    );
    let sent = String::from_utf8_lossy(&bench.sent).replace('?', "").replace("$G\n", "");
    assert!(sent.contains("X20\nG4P0.01\n$H\nG21"), "{sent}");
}

#[test]
fn homing_that_fails_or_is_canceled_ends_the_run_and_the_position_is_not_trusted() {
    let path = with_event(straight(4), 2, Action::Home { axes: AxisSet::ALL });
    let mut bench = Bench::connected();
    bench.firmware.alarm = Some(("$H", 9));
    bench.start(path.clone());
    assert_ended(&bench.result(), RunOutcome::Aborted, error_code::ALARM);
    assert!(!bench.state().is_homed);

    let mut bench = Bench::connected();
    // The switches are never found.
    bench.firmware.ignore = Some("$H");
    bench.start(path.clone());
    bench.until("homing", |bench| bench.mode() == Mode::Home);
    bench.ask(Command::CancelRun { run: None }).unwrap();
    assert_eq!(bench.sent.last(), Some(&0x18), "homing listens to nothing else");
    assert_ended(&bench.result(), RunOutcome::Canceled, error_code::CANCELED);

    // One axis by itself is not what this controller can do, and nothing moves.
    let mut bench = Bench::connected();
    bench.start(with_event(straight(4), 2, Action::Home { axes: AxisSet::NONE.with(0) }));
    bench.until("an answer", |bench| !bench.replies.is_empty());
    let (code, message) = refusal(bench.replies[0].1.clone());
    assert_eq!(code, error_code::NOT_ENCODABLE);
    assert!(message.contains("Home X: it homes all axes together"), "{message}");
}

#[test]
fn s48_what_is_left_of_a_run_can_be_another_path_while_the_machine_holds() {
    let old = straight(60);
    let mut bench = Bench::running(old.clone());
    let rest = |bench: &mut Bench, path: CompensatedPath, of| {
        let path = Arc::new(path);
        let revision = bench.keep(&path);
        bench.command(
            7,
            Command::Replan(ReplanRequest { program_id: "part".into(), of, revision, path }),
        );
    };
    let shifted = |from: usize| {
        let mut path = old.clone();
        path.elements[from..].iter_mut().for_each(|element| element.end[1] = 3.0);
        path
    };
    rest(&mut bench, shifted(50), 0);
    assert_eq!(refusal(bench.replies.pop().unwrap().1).0, error_code::BUSY);
    bench.ask(Command::FeedHold).unwrap();
    bench.until("a hold", |bench| bench.state().settled_elements > 0);
    let settled = bench.state().settled_elements as usize;
    assert_eq!(bench.state().path_revision, 0);
    for (path, of, code) in [
        (shifted(settled - 1), 0, error_code::START_POSITION),
        (straight(4), 0, error_code::START_POSITION),
        (shifted(settled), 9, error_code::NOTHING_TO_DO),
    ] {
        rest(&mut bench, path, of);
        assert_eq!(refusal(bench.replies.pop().unwrap().1).0, code);
    }
    // What cannot be sent does not count, and the run is what it was.
    let mut impossible = shifted(settled);
    impossible.elements[59].end[0] = 1e9;
    rest(&mut bench, impossible, 0);
    bench.until("an answer", |bench| bench.replies.iter().any(|(id, _)| *id == 7));
    assert_eq!(refusal(bench.replies.pop().unwrap().1).0, error_code::NOT_ENCODABLE);
    rest(&mut bench, shifted(settled), 0);
    bench.until("an answer", |bench| bench.replies.iter().any(|(id, _)| *id == 7));
    let revision = bench.state().path_revision;
    assert!(revision > 0, "{:?}", bench.replies.pop());
    bench.ask(Command::Resume).unwrap();
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
    let executed = &bench.firmware.executed;
    assert_eq!(executed.len(), 62, "no line is lost and none is sent twice");
    assert_eq!(executed[settled], format!("X{}", 10 * settled));
    assert_eq!(executed[settled + 1], format!("X{}Y3", 10 * (settled + 1)));
}

#[test]
fn a_message_is_shown_when_the_tool_is_there_and_what_follows_a_stop_after_it() {
    let say = |text| Action::Message { text: Text::new(text).expect("short") };
    let mut path = straight(30);
    for (at, action) in [
        (0, say("begin")),
        (10, say("at ten")),
        (10, Action::Stop { optional: false }),
        (10, say("after the stop")),
        (20, say("at twenty")),
        (30, say("end")),
    ] {
        path = with_event(path, at, action);
    }
    let mut bench = Bench::connected();
    bench.start(path);
    let says = |text: &str| format!("line {text}\n");
    bench.until("the first", |bench| bench.log.ends_with(&says("0: begin")));
    bench.until("the stop", |bench| bench.mode() == Mode::Hold);
    bench.wait(1_000);
    assert!(bench.log.ends_with(&says("10: at ten")), "{}", bench.log);
    bench.ask(Command::Resume).unwrap();
    bench.until("the next", |bench| bench.log.ends_with(&says("10: after the stop")));
    bench.until("the one after it", |bench| bench.log.ends_with(&says("20: at twenty")));
    let x = bench.state().work_position.expect("a position")[0];
    assert!((199.0..=215.0).contains(&x), "{x}");
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
    assert!(bench.log.ends_with(&says("30: end")), "{}", bench.log);
}

#[test]
fn very_many_messages_at_one_place_come_in_parts() {
    let say = |text: &str| Action::Message { text: Text::new(text).expect("short") };
    let mut path = straight(30);
    for n in 0..50 {
        path = with_event(path, 5, say(&format!("five {n}")));
    }
    for n in 0..50 {
        path = with_event(path, 30, say(&format!("end {n}")));
    }
    let mut bench = Bench::connected();
    bench.start(path);
    let shown = std::cell::Cell::new(0);
    bench.until("all of them", |bench| {
        let now = bench.log.matches(": five").count();
        assert!(now <= shown.get() + 20, "{shown:?}, then {now}");
        shown.set(now);
        now == 50
    });
    assert_ended(&bench.result(), RunOutcome::Succeeded, 0);
    let ends = bench.log.matches(": end").count();
    let rest = format!("{} more messages of the program are in its path only\n", 50 - ends);
    assert!(ends >= 20 && (ends == 50 || bench.log.ends_with(&rest)), "{}", bench.log);
}
