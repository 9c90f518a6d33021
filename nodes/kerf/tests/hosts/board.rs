//! A board on a network of its own that disappears without a word: no packet says that it is gone.

use super::network::{Host, PORT, Process, until};
use super::support::{Folder, Ran, TOOLS, run};
use std::time::{Duration, Instant};

/// Where the board listens.
const BOARD: &str = "tcp://10.77.0.2:7023";
/// The driver asks every 0.2 s and gives up after three questions; the rest is for a busy computer.
const NOTICED_WITHIN: Duration = Duration::from_secs(5);

#[test]
fn a_board_that_vanishes_from_the_network_is_unknown_and_is_held_when_it_is_back() {
    let (Some(computer), Some(board)) = (Host::new(), Host::new()) else { return };
    computer.connect(&board);
    let folder = Folder::new();
    let args = ["node", "virtual_controller", "--firmware", "grblhal", "--listen", BOARD];
    let _controller = Process::start(board.kerf("", &args), &folder.path().join("controller.log"));
    let mut up = computer.kerf("", &["up", "--ros-args", "-p", "run_recorder:directory:=bags"]);
    up.args(["-p", &format!("compensation_planner:tool_table:={TOOLS}")]);
    up.args(["-p", &format!("axis_driver:port:={BOARD}")]).current_dir(folder.path());
    let log = folder.path().join("up.log");
    let _up = Process::start(up, &log);
    let kerf = |args: &[&str]| -> Ran { run(computer.kerf("", args).current_dir(folder.path())) };
    let until_status = |word: &str| {
        let log = std::fs::read_to_string(&log).unwrap_or_default();
        until(&format!("{word}: {log}"), || {
            let status = kerf(&["status"]);
            status.out.starts_with(word).then_some(status.out)
        })
    };
    until_status("IDLE");
    let moves = "G1 X110\nG1 X10\n".repeat(20);
    folder.file("long.ngc", format!("G21 G90 G94 G17\nG0 X10 Y10\nF1200\n{moves}M30\n"));
    kerf(&["load", "long.ngc"]).expect(0);
    let _run = Process::start(computer.kerf("", &["run"]), &folder.path().join("run.log"));
    until_status("RUN");

    // At its far end: nothing here notices but for what does not come.
    board.ip(&format!("link set {PORT} down"));
    let begin = Instant::now();
    let lost = until_status("UNKNOWN");
    assert!(begin.elapsed() < NOTICED_WITHIN, "after {:?}", begin.elapsed());
    assert!(lost.contains("LINK_LOST") && lost.contains("position not known"), "{lost}");
    until("the end of the run", || {
        let said = std::fs::read_to_string(folder.path().join("run.log")).unwrap_or_default();
        said.contains("error 311").then_some(())
    });
    board.ip(&format!("link set {PORT} up"));
    let held = until_status("HOLD");
    assert!(held.contains("LINK_LOST") && held.contains("kerf reset"), "{held}");
    // It does not go on, whoever asks.
    assert_ne!(kerf(&["resume"]).status, 0);
    until_status("HOLD");
}
