//! The recorder's disk is full, or there is no recorder.

use super::cell::{Cell, Moment, Plan, Serpentine};
use super::commander::Running;
use super::machine::{kill_at_once, until};
use cnc_msgs::wire::cnc_msgs::action::RunProgramResult;
use cnc_msgs::wire::cnc_msgs::msg::{MachineState, Recording};
use rustix::process::{Signal, kill_process};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Starts the nodes where there is room for so much only, kB; in `bags` if a file system
/// may be mounted here, else in any file.
fn with_little_room(kilobytes: u32, command: &Command) -> Command {
    let mut probe = Command::new("unshare");
    probe.args(["-rm", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]);
    let may_mount = probe.output().is_ok_and(|output| output.status.success());
    #[allow(clippy::print_stderr, reason = "it is in the log which of the two was tested")]
    let mut surrounded = if may_mount {
        eprintln!("a disk of {kilobytes} kB: a tmpfs in a mount namespace");
        let script =
            format!("mkdir bags && mount -t tmpfs -o size={kilobytes}k bags bags && exec \"$@\"");
        let mut surrounded = Command::new("unshare");
        surrounded.args(["-rm", "sh", "-c", &script, "sh"]);
        surrounded
    } else {
        eprintln!("files of {kilobytes} kB: a limit of the process");
        // In blocks of 512 bytes; the signal is ignored, so that the write fails instead.
        let script = format!("trap '' XFSZ; ulimit -f {}; exec \"$@\"", kilobytes * 2);
        let mut surrounded = Command::new("sh");
        surrounded.args(["-c", &script, "sh"]);
        surrounded
    };
    surrounded.arg(command.get_program()).args(command.get_args());
    for (name, value) in command.get_envs() {
        match value {
            Some(value) => surrounded.env(name, value),
            None => surrounded.env_remove(name),
        };
    }
    surrounded.current_dir(command.get_current_dir().expect("nodes have a folder"));
    surrounded
}

/// A path as the recorder sees it.
fn seen_by_recorder(cell: &Cell, path: &Path) -> PathBuf {
    let recorder = cell.machine.node("run_recorder").as_raw_nonzero();
    let path = path.strip_prefix("/").expect("an absolute path");
    Path::new("/proc").join(recorder.to_string()).join("root").join(path)
}

#[test]
fn a_run_continues_when_the_disk_of_the_recorder_is_full() {
    let program = Serpentine { passes: 20, ..Serpentine::SHORT_LINES };
    let surround = |command: Command, _: &Path| with_little_room(64, &command);
    let cell = Cell::new(&Plan { program, surround: &surround, ..Plan::default() });
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    let is_full = |it: &Recording| it.is_recording && !it.complete;
    let full = until("a full disk", || cell.commander.recording().filter(is_full));
    assert_eq!(cell.commander.state().state, MachineState::STATE_RUN, "it is published at once");
    assert!(full.reason.contains("o space left") || full.reason.contains("too large"), "{full:?}");
    let result = cell.result(run);
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_SUCCEEDED, "{result:?}");
    assert_eq!(cell.place(), [-100.0, -80.0], "the end of the program");
    let sent = cell.sent_since(moment);
    assert!(!sent.contains(['!', '~']) && !sent.contains("\\x18"), "{sent}");
    // The recording is not reported as complete afterwards.
    let last = until("the end of the record", || {
        cell.commander.recording().filter(|recording| !recording.is_recording)
    });
    assert!(!last.complete && !last.reason.is_empty(), "{last:?}");
    let bag = seen_by_recorder(&cell, Path::new(&last.uri));
    let ran = cell.machine.kerf(&["bag", "info", bag.to_str().expect("UTF-8")]);
    assert_ne!(ran.status, 0, "{ran:?}");
    assert!(!ran.out.contains("complete:    yes"), "{ran:?}");
    assert!(cell.machine.log().contains(&last.reason), "{}", cell.machine.log());
    // What had room is had again, and the copy says that it is not all.
    assert!(last.message_count > 0, "{last:?}");
    let from = bag.to_str().expect("UTF-8");
    let ran = cell.machine.kerf(&["bag", "recover", from, "mended"]).expect(0);
    let count = ran.out.lines().next().and_then(|line| line.split_whitespace().rev().nth(1));
    let count = count.and_then(|word| word.parse().ok());
    assert!(count.is_some_and(|count: u64| count >= last.message_count), "{ran:?}, {last:?}");
    cell.machine.kerf(&["bag", "info", "mended"]).expect(1).says(&["machine_state"]);
}

/// Fails unless this run is ended before anything was sent; returns why.
#[track_caller]
fn is_not_begun(cell: &Cell, moment: Moment, run: Running) -> String {
    let result = cell.result(run);
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_ABORTED, "{result:?}");
    assert_eq!(result.error_code, RunProgramResult::NOT_RECORDING, "{result:?}");
    assert_eq!(result.last_line, 0, "{result:?}");
    assert_eq!(cell.sent_since(moment), "", "nothing at all");
    assert_eq!(cell.modes_since(moment), ["IDLE"]);
    result.message
}

#[test]
fn where_a_record_is_required_no_run_begins_on_a_full_disk() {
    let ros = ["-p", "axis_driver:require_recording:=true"];
    let surround = |command: Command, _: &Path| with_little_room(4, &command);
    let cell = Cell::new(&Plan { ros: &ros, surround: &surround, ..Plan::default() });
    let moment = cell.moment();
    let run = cell.commander.run().expect("the driver takes the run");
    let why = is_not_begun(&cell, moment, run);
    assert!(why.contains("o space left") || why.contains("too large"), "{why}");
}

#[test]
fn where_a_record_is_required_no_run_begins_without_a_recorder() {
    let ros = ["-p", "axis_driver:require_recording:=true"];
    let program = Serpentine { passes: 6, ..Serpentine::SHORT_LINES };
    let cell = Cell::new(&Plan { program, ros: &ros, ..Plan::default() });
    let recorder = cell.machine.node("run_recorder");
    // It is there and does nothing.
    kill_process(recorder, Signal::STOP).expect("the recorder is there");
    let moment = cell.moment();
    let run = cell.commander.run().expect("the driver takes the run");
    cell.commander.until("a run that waits", |it| it.reason.contains("WAITING_FOR_RECORDER"));
    is_not_begun(&cell, moment, run);

    // Another starts in its place, and has to be found first; `kerf up` may have seen to that.
    let _ = kill_process(recorder, Signal::KILL);
    let run = until("a run that is recorded", || {
        let moment = cell.moment();
        let run = cell.commander.run().expect("the driver takes the run");
        until("a decision", || {
            (run.is_over() || cell.modes_since(moment).contains(&"RUN")).then_some(())
        });
        if !run.is_over() {
            return Some(run);
        }
        is_not_begun(&cell, moment, run);
        None
    });
    let during = cell.commander.recording().expect("it records");
    assert!(during.is_recording && during.complete, "{during:?}");

    // It dies in the midst: the part is worth more than its record.
    let moment = cell.moment();
    kill_at_once(cell.machine.node("run_recorder"));
    let result = cell.result(run);
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_SUCCEEDED, "{result:?}");
    let sent = cell.sent_since(moment);
    assert!(!sent.contains(['!', '~']) && !sent.contains("\\x18"), "{sent}");
}
