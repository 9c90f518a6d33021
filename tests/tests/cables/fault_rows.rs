//! Rows of docs/faults.md over a serial line and over TCP: the same happens, with the same end.

use crate::rig::{Board, Shell, config};
use axis_driver::codes::error_code;
use axis_driver::driver::{Command, DriverConfig, OnCommanderLoss, OnPathDeviation, RunOutcome};
use cnc_msgs::machine::Mode;
use std::time::Duration;
use virtual_controller::Firmware;

/// What ends the run.
#[derive(Debug, Clone, Copy)]
enum Trouble {
    /// On the line or in the board, at an answer in the midst of the run.
    Fault(&'static str),
    /// The same, on a board with limit switches.
    Switched(&'static str),
    /// Of the operator, or of the node around the driver.
    Asked(fn() -> Command),
    /// Signs of life of a commander that stay away.
    CommanderGone(OnCommanderLoss),
    /// The recorder says that its bag misses something.
    RecordNotWhole,
}

/// A row of the page.
#[derive(Debug)]
struct Row {
    what: &'static str,
    trouble: Trouble,
    /// How the run ends; `None`: it goes on after a hold, and a resume ends it well.
    ends: Option<(RunOutcome, u16)>,
    /// A state that comes before (one of these), and a word of its reason.
    shows: (&'static [Mode], &'static str),
    /// What the operator presses then, to be ready again.
    then: &'static [fn() -> Command],
}

const RESET: fn() -> Command = || Command::SoftReset;
const RESUME: fn() -> Command = || Command::Resume;
const CANCEL: fn() -> Command = || Command::CancelRun { run: None };

const ABORTED: RunOutcome = RunOutcome::Aborted;

const ROWS: &[Row] = &[
    Row {
        what: "canceled",
        trouble: Trouble::Asked(CANCEL),
        ends: Some((RunOutcome::Canceled, error_code::CANCELED)),
        shows: (&[Mode::Idle], ""),
        then: &[],
    },
    Row {
        what: "deactivated",
        trouble: Trouble::Asked(|| Command::Deactivate),
        ends: Some((ABORTED, error_code::NOT_ACTIVE)),
        shows: (&[Mode::Idle], ""),
        then: &[],
    },
    Row {
        what: "shut down",
        trouble: Trouble::Asked(|| Command::Shutdown),
        ends: Some((ABORTED, error_code::SHUTDOWN)),
        shows: (&[Mode::Idle], ""),
        then: &[],
    },
    Row {
        what: "a soft reset",
        trouble: Trouble::Asked(RESET),
        ends: Some((ABORTED, error_code::SOFT_RESET)),
        shows: (&[Mode::Alarm], ""),
        then: &[],
    },
    Row {
        what: "a commander that is lost, hold",
        trouble: Trouble::CommanderGone(OnCommanderLoss::Hold),
        ends: None,
        shows: (&[Mode::Hold], "COMMANDER_LOST"),
        then: &[RESUME],
    },
    Row {
        what: "a commander that is lost, hold_then_abort",
        trouble: Trouble::CommanderGone(OnCommanderLoss::HoldThenAbort),
        ends: Some((ABORTED, error_code::COMMANDER_LOST)),
        shows: (&[Mode::Idle], ""),
        then: &[],
    },
    Row {
        what: "a record that misses something",
        trouble: Trouble::RecordNotWhole,
        ends: None,
        shows: (&[Mode::Hold], "RECORD_NOT_WHOLE"),
        then: &[RESUME],
    },
    Row {
        what: "an answer that is lost",
        trouble: Trouble::Fault("lose-ok@line=90"),
        ends: Some((ABORTED, error_code::PROTOCOL)),
        shows: (&[Mode::Hold], "soft_reset"),
        then: &[RESET],
    },
    Row {
        what: "a line that is lost",
        trouble: Trouble::Fault("lose-line@line=90"),
        ends: Some((ABORTED, error_code::PROTOCOL)),
        shows: (&[Mode::Hold], "soft_reset"),
        then: &[RESET],
    },
    Row {
        what: "an answer that comes twice",
        trouble: Trouble::Fault("extra-ok@line=90"),
        ends: Some((ABORTED, error_code::PROTOCOL)),
        shows: (&[Mode::Hold], "soft_reset"),
        then: &[RESET],
    },
    Row {
        what: "a line that comes twice",
        trouble: Trouble::Fault("extra-line@line=90"),
        ends: Some((ABORTED, error_code::PROTOCOL)),
        shows: (&[Mode::Hold], "soft_reset"),
        then: &[RESET],
    },
    Row {
        what: "a damaged answer",
        trouble: Trouble::Fault("garble:ok@line=90"),
        ends: Some((ABORTED, error_code::PROTOCOL)),
        shows: (&[Mode::Hold], "soft_reset"),
        then: &[RESET],
    },
    Row {
        what: "error:n",
        trouble: Trouble::Fault("push:error:20@line=90"),
        ends: Some((ABORTED, error_code::CONTROLLER_ERROR)),
        shows: (&[Mode::Hold], "soft_reset"),
        then: &[RESET],
    },
    Row {
        what: "ALARM:n",
        trouble: Trouble::Fault("alarm:3@line=90"),
        ends: Some((ABORTED, error_code::ALARM)),
        shows: (&[Mode::Alarm], "ALARM:3"),
        then: &[],
    },
    Row {
        what: "a limit switch",
        trouble: Trouble::Switched("limit:x@line=90"),
        ends: Some((ABORTED, error_code::ALARM)),
        shows: (&[Mode::Alarm], "ALARM:1"),
        then: &[],
    },
    Row {
        // It is held where lines that were under way move it on.
        what: "a start message without a reset",
        trouble: Trouble::Fault("reset@line=90"),
        ends: Some((ABORTED, error_code::RESTARTED)),
        shows: (&[Mode::Idle, Mode::Hold], "RESTARTED"),
        then: &[RESET],
    },
    Row {
        what: "no answer any more, for three seconds",
        trouble: Trouble::Fault("silent:60@line=90"),
        ends: Some((ABORTED, error_code::LINK_LOST)),
        shows: (&[Mode::Unknown], "LINK_LOST"),
        then: &[],
    },
    Row {
        what: "the door is opened",
        trouble: Trouble::Asked(|| Command::DoorHold),
        ends: None,
        shows: (&[Mode::Door], ""),
        then: &[RESUME],
    },
    Row {
        what: "a hold",
        trouble: Trouble::Asked(|| Command::FeedHold),
        ends: None,
        shows: (&[Mode::Hold], ""),
        then: &[RESUME],
    },
];

/// In real time, as on a machine: what is under way is what its buffer holds.
fn board(listen: Option<&str>, row: &Row) -> Board {
    let (faults, settings) = match row.trouble {
        Trouble::Fault(fault) => (vec![fault], vec![]),
        Trouble::Switched(fault) => (vec![fault], vec!["$21=1"]),
        _ => (vec![], vec![]),
    };
    Board::with(listen, Firmware::GrblHal, |options| {
        options.faults = faults.iter().map(|fault| fault.parse().expect("a fault")).collect();
        for line in settings {
            options.build.settings.set_line(line).expect("a setting");
        }
    })
}

fn driver(url: &str, row: &Row) -> DriverConfig {
    let on_commander_loss = match row.trouble {
        Trouble::CommanderGone(policy) => policy,
        _ => OnCommanderLoss::default(),
    };
    let require_recording = matches!(row.trouble, Trouble::RecordNotWhole);
    // It stops the machine as soon as the count of lines does, and sooner or later by chance.
    let on_path_deviation = match row.trouble {
        Trouble::Fault(_) => OnPathDeviation::Off,
        _ => OnPathDeviation::Hold,
    };
    DriverConfig { on_commander_loss, require_recording, on_path_deviation, ..config(url) }
}

/// Lets a row happen over a cable, and compares.
fn happens(row: &Row, listen: Option<&str>) {
    let board = board(listen, row);
    let what = format!("{} over {}", row.what, board.url);
    let mut shell = Shell::with(&board.url, driver(&board.url, row));
    shell.until_mode(Mode::Idle);
    if let Trouble::CommanderGone(_) = row.trouble {
        shell.command(Command::Heartbeat).expect("a sign of life");
    }
    shell.run(800);
    shell.states.clear();
    let recorder = |is_whole| Command::Recorder { is_whole, reason: "the disk is full".into() };
    if let Trouble::RecordNotWhole = row.trouble {
        shell.command(recorder(true)).expect("the recorder has opened its bag");
    }
    shell.until("a line", |shell| shell.state.line > 20 || shell.finished.is_some());
    match row.trouble {
        Trouble::Asked(command) => drop(shell.command(command())),
        Trouble::RecordNotWhole => drop(shell.command(recorder(false))),
        Trouble::Fault(_) | Trouble::Switched(_) | Trouble::CommanderGone(_) => {}
    }
    let (modes, reason) = row.shows;
    let shows = |shell: &Shell| {
        shell
            .states
            .iter()
            .any(|state| modes.contains(&state.mode) && state.reason.contains(reason))
    };
    shell.until(&what, shows);
    if !row.then.is_empty() {
        shell.until("a machine that stands", |shell| shell.state.feed_mm_per_min == 0.0);
    }
    for command in row.then {
        let mut tries = 0;
        // While it slows down it does not resume.
        while let Err(refusal) = shell.command(command()) {
            tries += 1;
            assert!(tries < 100, "{what}: {refusal:?}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
    let result = shell.result();
    let expected = row.ends.unwrap_or((RunOutcome::Succeeded, 0));
    let end = (result.outcome, result.error_code);
    assert_eq!(end, expected, "{what}: {result:?}\n{}", shell.log);
    if !row.then.is_empty() {
        shell.until("a machine that may run", |shell| {
            matches!(shell.state.mode, Mode::Idle | Mode::Alarm) && !shell.state.needs_reset
        });
    }
}

#[test]
fn each_row_has_the_same_end_over_a_serial_line_and_over_tcp() {
    for row in ROWS {
        for listen in [None, Some(crate::TCP)] {
            happens(row, listen);
        }
    }
}
