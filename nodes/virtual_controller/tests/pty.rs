//! The whole thing on a pseudo-terminal, spoken to through a plain file descriptor.
#![cfg(feature = "node")]

mod common;
use common::settings;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use virtual_controller::{Build, Pace, ServeError, ServeOptions, StopHandle, serve, stop_pair};

/// Far longer than anything here takes; only a hang reaches it.
const PATIENCE: Duration = Duration::from_secs(60);
const O_NOCTTY: i32 = 0o400;
const O_NONBLOCK: i32 = 0o4000;

struct Served {
    path: PathBuf,
    stop: Option<StopHandle>,
    thread: Option<JoinHandle<Result<(), ServeError>>>,
}

impl Served {
    fn start(options: ServeOptions) -> Self {
        let (handle, stop) = stop_pair().unwrap();
        let (sender, receiver) = mpsc::channel();
        let thread = std::thread::spawn(move || {
            serve(options, &stop, |path| {
                // Only the first is waited for.
                let _ = sender.send(path.to_path_buf());
                Ok(())
            })
        });
        let path = receiver.recv_timeout(PATIENCE).unwrap();
        Self { path, stop: Some(handle), thread: Some(thread) }
    }

    fn stop(mut self) {
        self.stop.take().unwrap().stop();
        self.thread.take().unwrap().join().unwrap().unwrap();
    }
}

struct Peer {
    file: File,
    heard: String,
}

impl Peer {
    fn open(path: &Path) -> Self {
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(O_NOCTTY | O_NONBLOCK)
            .open(path)
            .unwrap();
        Self { file, heard: String::new() }
    }

    fn send(&mut self, bytes: &[u8]) {
        self.file.write_all(bytes).unwrap();
    }

    /// Waits for a text and returns everything up to its end.
    fn expect(&mut self, text: &str) -> String {
        let started = Instant::now();
        loop {
            if let Some(at) = self.heard.find(text) {
                return self.heard.drain(..at + text.len()).collect();
            }
            assert!(started.elapsed() < PATIENCE, "no `{text}` in {:?}", self.heard);
            let mut buffer = [0; 256];
            match self.file.read(&mut buffer) {
                Ok(count) => self.heard += std::str::from_utf8(&buffer[..count]).unwrap(),
                Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {
                    std::thread::sleep(Duration::from_millis(2));
                }
                Err(error) => panic!("{error}; heard {:?}", self.heard),
            }
        }
    }
}

fn options() -> ServeOptions {
    ServeOptions {
        pace: Pace { time_factor: 100.0, ..Pace::default() },
        ..ServeOptions::new(Build::new(settings(&[])))
    }
}

#[test]
fn a_peer_talks_moves_the_axes_leaves_and_comes_back() {
    let served = Served::start(options());
    let metadata = std::fs::metadata(&served.path).unwrap();
    assert_eq!(metadata.mode() & 0o777, 0o600);

    let mut peer = Peer::open(&served.path);
    peer.expect("Grbl 1.1h ['$' for help]\r\n");
    peer.send(b"G1X10F600\nG4P0.1\n");
    assert_eq!(peer.expect("ok\r\nok\r\n"), "ok\r\nok\r\n");
    peer.send(b"?");
    assert!(peer.expect(">\r\n").starts_with("<Idle|MPos:10.000,0.000,0.000|"));
    drop(peer);

    let mut peer = Peer::open(&served.path);
    peer.send(b"\x18");
    peer.expect("Grbl 1.1h ['$' for help]\r\n");
    peer.send(b"?");
    assert!(peer.expect(">\r\n").starts_with("<Idle|MPos:10.000,0.000,0.000|"));
    served.stop();
}

#[test]
fn a_peer_that_does_not_read_does_not_stop_the_axes() {
    let served = Served::start(options());
    let mut peer = Peer::open(&served.path);
    peer.expect("help]\r\n");
    peer.send(b"$J=G91X5F6000\n");
    for _ in 0..40 {
        peer.send(&[b'?'; 50]);
    }
    peer.send(b"G4P0\n$G\n");
    // The answers are in there, or lost behind the reports; the controller lives on.
    std::thread::sleep(Duration::from_millis(200));
    peer.heard.clear();
    peer.send(b"\x18");
    peer.expect("help]\r\n");
    served.stop();
}

#[test]
fn a_pulled_cable_hangs_the_peer_up() {
    let mut options = options();
    options.faults = vec!["close@line=1".parse().unwrap()];
    let mut served = Served::start(options);
    let mut peer = Peer::open(&served.path);
    peer.send(b"\n");
    served.thread.take().unwrap().join().unwrap().unwrap();
    let started = Instant::now();
    let mut buffer = [0; 256];
    loop {
        assert!(started.elapsed() < PATIENCE);
        match peer.file.read(&mut buffer) {
            Ok(0) => break,
            Ok(_) => {}
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {}
            Err(_) => break,
        }
    }
}

#[test]
fn a_device_that_vanishes_is_back_as_another_and_the_link_follows() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("ttyVC");
    let mut options = options();
    options.pace.time_factor = 10.0;
    // A second of ours; 100 mm at 10 mm/s take as long.
    options.faults = vec!["vanish:10@line=1".parse().unwrap()];
    options.link = Some(link.clone());
    let served = Served::start(options);
    let first = std::fs::read_link(&link).unwrap();
    assert_eq!(first, served.path);
    let mut peer = Peer::open(&link);
    peer.expect("help]\r\n");
    peer.send(b"G1X100F600\n");
    let started = Instant::now();
    while let Ok(count) = peer.file.read(&mut [0; 64]).or_else(|error| {
        if error.kind() == std::io::ErrorKind::WouldBlock { Ok(1) } else { Err(error) }
    }) {
        assert!(started.elapsed() < PATIENCE, "nobody hangs up");
        if count == 0 {
            break;
        }
    }
    let second = loop {
        match std::fs::read_link(&link) {
            Ok(path) if path != first => break path,
            _ => std::thread::sleep(Duration::from_millis(2)),
        }
        assert!(started.elapsed() < PATIENCE, "it does not come back");
    };
    let mut peer = Peer::open(&second);
    let started = Instant::now();
    loop {
        peer.send(b"?");
        if peer.expect(">\r\n").starts_with("<Idle|MPos:100.000,") {
            break;
        }
        assert!(started.elapsed() < PATIENCE, "the machine has not moved on");
    }
    served.stop();
    assert!(std::fs::symlink_metadata(&link).is_err(), "the link is gone");
}

/// The binary while it runs; a test that fails leaves none behind.
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

/// The binary, and the path it printed.
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
        assert!(started.elapsed() < PATIENCE, "the program does not end");
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
        assert!(started.elapsed() < PATIENCE);
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
fn the_program_speaks_as_the_firmware_it_is_told() {
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
fn a_scenario_says_what_arguments_say_and_arguments_count_more() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scenario.yaml");
    std::fs::write(
        &file,
        "firmware: grblhal\nsettings: {$110: 1234}\nreceive_buffer_bytes: 254\n\
         start_mm: [-1, -2, -3]\nfaults: [lose-ok@line=1]\n",
    )
    .unwrap();
    let scenario = ["--scenario", file.to_str().unwrap()];
    let more = ["--receive-buffer", "300", "--fault", "push:[MSG:hello]@line=2"];
    let (child, path) = run(&[&scenario[..], &more].concat());
    let mut peer = Peer::open(&path);
    peer.expect("GrblHAL 1.1f ['$' or '$HELP' for help]\r\n");
    peer.send(b"\n$foo\n$I\n?");
    let heard = peer.expect(">\r\n");
    // The first answer is lost, the second sets off the message.
    assert!(heard.starts_with("error:3\r\n[MSG:hello]\r\n"), "{heard}");
    assert!(heard.contains("[OPT:VNML+,100,300,3,0]"), "{heard}");
    assert!(heard.contains("|MPos:-1.000,-2.000,-3.000|"), "{heard}");
    peer.send(b"$$\n");
    assert!(peer.expect("ok\r\n").contains("\r\n$110=1234.000\r\n"));
    child.terminate();
    assert_eq!(ends(child), 0);
}

/// Opens the port, leaves it with HUPCL on or off and the axes moved; returns what was said at first.
fn visit(path: &Path, hangs_up: bool) -> String {
    use rustix::termios::{ControlModes, OptionalActions, tcgetattr, tcsetattr};
    let mut peer = Peer::open(path);
    let started = Instant::now();
    let mut heard = String::new();
    // A bootloader does not answer.
    while !heard.contains(">\r\n") {
        assert!(started.elapsed() < PATIENCE, "no report in {heard:?}");
        peer.send(b"?");
        let mut buffer = [0; 256];
        std::thread::sleep(Duration::from_millis(20));
        if let Ok(count) = peer.file.read(&mut buffer) {
            heard += std::str::from_utf8(&buffer[..count]).unwrap();
        }
    }
    // Only now: what it was at the close before has been seen by then.
    let mut termios = tcgetattr(&peer.file).unwrap();
    termios.control_modes.set(ControlModes::HUPCL, hangs_up);
    tcsetattr(&peer.file, OptionalActions::Now, &termios).unwrap();
    peer.send(b"G91G0X5\nG4P0\n");
    peer.expect("ok\r\nok\r\n");
    heard
}

#[test]
fn a_board_of_the_arduino_kind_resets_when_its_port_is_opened_unless_hupcl_is_off() {
    let mut options = options();
    options.resets_on_open = true;
    let served = Served::start(options);
    let is_reset = |heard: &str| {
        let has_banner = heard.contains("Grbl 1.1h");
        assert_eq!(has_banner, heard.contains("MPos:0.000,"), "the position goes with it: {heard}");
        has_banner
    };
    assert!(is_reset(&visit(&served.path, true)), "at first");
    assert!(is_reset(&visit(&served.path, false)), "DTR dropped at the close before");
    assert!(!is_reset(&visit(&served.path, true)), "DTR stayed up at the close before");
    assert!(is_reset(&visit(&served.path, true)), "DTR dropped again");
    served.stop();
}

#[test]
fn a_report_of_the_run_is_written_when_it_is_told_to_end() {
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
fn a_wrong_scenario_is_told_with_file_and_place() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scenario.yaml");
    std::fs::write(&file, "seed: 7\nfaults:\n  - explode@line=1\n").unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_virtual_controller"))
        .args(["--scenario", file.to_str().unwrap()])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    let told = String::from_utf8(output.stderr).unwrap();
    let place = format!("{}:3:5: ", file.display());
    assert!(told.contains(&place) && told.contains("there are rx-drop"), "{told}");
}

#[test]
fn wrong_arguments_are_told_and_end_with_2() {
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
