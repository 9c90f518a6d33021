//! The program: its arguments, its files, how it ends.
#![cfg(feature = "node")]

#[path = "common/terminal.rs"]
mod terminal;
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use terminal::{Peer, TIMEOUT};

/// The running program; it is killed when a test fails.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Running {
    fn terminate(&self) {
        let pid = rustix::process::Pid::from_raw(self.0.id() as i32).unwrap();
        rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
    }
}

/// Starts the program; returns it and the path it printed.
fn run(arguments: &[&str]) -> (Running, PathBuf) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_virtual_controller"))
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    (Running(child), PathBuf::from(line.trim()))
}

fn ends(mut child: Running) -> i32 {
    let started = Instant::now();
    loop {
        if let Some(status) = child.0.try_wait().unwrap() {
            return status.code().unwrap_or(-1);
        }
        assert!(started.elapsed() < TIMEOUT, "the program does not end");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn the_program_prints_its_port_makes_a_link_and_removes_it() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("ttyVC");
    let file = folder.path().join("settings");
    std::fs::write(&file, "# a machine\n$110=1234 ; mm/min\n\n").unwrap();
    let arguments = ["--link", link.to_str().unwrap(), "--settings", file.to_str().unwrap()];
    let (child, path) = run(&arguments);
    assert!(path.starts_with("/dev/pts"), "{path:?}");
    assert_eq!(std::fs::read_link(&link).unwrap(), path);
    let mut peer = Peer::open(&link);
    peer.expect("help]\r\n");
    peer.send(b"$$\n");
    assert!(peer.expect("ok\r\n").contains("\r\n$110=1234.000\r\n"));
    child.terminate();
    assert_eq!(ends(child), 0);
    assert!(std::fs::symlink_metadata(&link).is_err(), "the link is gone");
}

#[test]
fn the_program_takes_faults_from_stdin_and_ends_with_it() {
    let (mut child, path) = run(&["--stdin", "--homing", "--start=-1,-2,-3.5"]);
    let mut peer = Peer::open(&path);
    peer.expect("'$X' to unlock]\r\n");
    peer.send(b"$X\n?");
    assert!(peer.expect(">\r\n").contains("|MPos:-1.000,-2.000,-3.500|"));
    let mut stdin = child.0.stdin.take().unwrap();
    stdin.write_all(b"nonsense\nlimit:x\n").unwrap();
    let started = Instant::now();
    loop {
        peer.send(b"?");
        if peer.expect(">\r\n").contains("|Pn:X") {
            break;
        }
        assert!(started.elapsed() < TIMEOUT);
    }
    drop(stdin);
    assert_eq!(ends(child), 0);
}

#[test]
fn the_program_ends_with_the_process_it_watches() {
    let mut watched = Command::new("sleep").arg("60").spawn().unwrap();
    let (child, _) = run(&["--parent-pid", &watched.id().to_string()]);
    watched.kill().unwrap();
    watched.wait().unwrap();
    assert_eq!(ends(child), 0);
}

#[test]
fn the_program_imitates_the_firmware_of_its_argument() {
    for (arguments, banner, options) in [
        (&["--firmware", "grbl"][..], "Grbl 1.1h ['$' for help]", "[OPT:V,15,128]"),
        (
            &["--firmware", "grblhal", "--receive-buffer", "254"],
            "GrblHAL 1.1f ['$' or '$HELP' for help]",
            "[OPT:VNML+,100,254,3,0]",
        ),
        (
            &["--firmware", "fluidnc"],
            "Grbl 4.0 [FluidNC v4.0.5-pre2 (noradio) '$' for help]",
            "[OPT:MPHS]",
        ),
    ] {
        let (child, path) = run(arguments);
        let mut peer = Peer::open(&path);
        peer.expect(&format!("{banner}\r\n"));
        peer.send(b"$I\n");
        assert!(peer.expect("ok\r\n").contains(&format!("{options}\r\n")), "{arguments:?}");
        child.terminate();
        assert_eq!(ends(child), 0);
    }
}

#[test]
fn a_scenario_has_all_arguments_and_arguments_override_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scenario.yaml");
    std::fs::write(
        &file,
        "firmware: grblhal\nsettings: {$110: 1234, $133: 360}\nreceive_buffer_bytes: 254\n\
         start_mm: [-1, -2, -3]\nfaults: [lose-ok@line=1]\n",
    )
    .unwrap();
    let scenario = ["--scenario", file.to_str().unwrap()];
    // $133 is the travel of an axis that only the arguments have.
    let more = ["--axes", "XYZA", "--receive-buffer", "300", "--fault", "push:[MSG:hello]@line=2"];
    let (child, path) = run(&[&scenario[..], &more].concat());
    let mut peer = Peer::open(&path);
    peer.expect("GrblHAL 1.1f ['$' or '$HELP' for help]\r\n");
    peer.send(b"\n$foo\n$I\n?");
    let received = peer.expect(">\r\n");
    // The first answer is lost, the second triggers the message.
    assert!(received.starts_with("error:3\r\n[MSG:hello]\r\n"), "{received}");
    assert!(received.contains("[OPT:VNML+,100,300,4,0]"), "{received}");
    assert!(received.contains("|MPos:-1.000,-2.000,-3.000,0.000|"), "{received}");
    peer.send(b"$$\n");
    let settings = peer.expect("ok\r\n");
    for wanted in ["\r\n$110=1234.000\r\n", "\r\n$133=360.000\r\n"] {
        assert!(settings.contains(wanted), "{settings}");
    }
    child.terminate();
    assert_eq!(ends(child), 0);
}

#[test]
fn a_report_of_the_run_is_written_when_the_program_is_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let report = folder.path().join("report.json");
    let (child, path) = run(&["--report", report.to_str().unwrap(), "--time-factor", "100"]);
    let mut peer = Peer::open(&path);
    peer.expect("help]\r\n");
    peer.send(b"G21\nG41\nG1X10F600\nG4P0\n");
    peer.expect("ok\r\nerror:20\r\nok\r\nok\r\n");
    assert!(!report.exists(), "only at the end");
    child.terminate();
    assert_eq!(ends(child), 0);
    let json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&report).unwrap()).unwrap();
    for (key, expected) in [
        ("bytes_received", 23),
        ("bytes_lost", 0),
        ("lines_read", 4),
        ("oks", 3),
        ("errors", 1),
        ("blocks_planned", 1),
        ("blocks_executed", 1),
        ("motions_finished", 1),
        ("underruns", 0),
    ] {
        assert_eq!(json[key], expected, "{key} in {json}");
    }
    assert!(json["machine_seconds"].as_f64().unwrap() > 1.0, "{json}");
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
    assert_eq!(left.len(), 1, "{left:?}");
}

#[test]
fn an_error_in_a_scenario_names_file_and_place() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scenario.yaml");
    std::fs::write(&file, "seed: 7\nfaults:\n  - explode@line=1\n").unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_virtual_controller"))
        .args(["--scenario", file.to_str().unwrap()])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    let reported = String::from_utf8(output.stderr).unwrap();
    let place = format!("{}:3:5: ", file.display());
    assert!(reported.contains(&place) && reported.contains("use rx-drop"), "{reported}");
}

#[test]
fn wrong_arguments_are_reported_and_end_with_2() {
    for arguments in [
        &["--fault", "lose-ok"][..],
        &["--fault", "explode@line=1"],
        &["--firmware", "marlin"],
        &["--receive-buffer", "5"],
        &["--start", "1,2"],
        &["--time-factor", "0"],
        &["--settings", "/nowhere/at/all"],
        &["--scenario", "/nowhere/at/all"],
        &["--machine", "lathe"],
        &["--report", "/nowhere/at/all"],
        &["--report", "/tmp"],
        &["--link", "/dev/null"],
        &["--parent-pid", "0"],
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_virtual_controller"))
            .args(arguments)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(!output.stderr.is_empty(), "{arguments:?}");
    }
}
