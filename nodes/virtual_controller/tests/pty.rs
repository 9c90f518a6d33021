//! The whole controller on a pseudo-terminal, used through a plain file descriptor.
#![cfg(feature = "node")]

mod common;
#[path = "common/terminal.rs"]
mod terminal;
use common::settings;
use std::io::Read;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use terminal::{Peer, TIMEOUT};
use virtual_controller::{
    Build, LineTiming, ServeError, ServeOptions, StopHandle, serve, stop_pair,
};

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
                // Only the first call is waited for.
                let _ = sender.send(path.to_path_buf());
                Ok(())
            })
        });
        let path = receiver.recv_timeout(TIMEOUT).unwrap();
        Self { path, stop: Some(handle), thread: Some(thread) }
    }

    fn stop(mut self) {
        self.stop.take().unwrap().stop();
        self.thread.take().unwrap().join().unwrap().unwrap();
    }
}

fn options() -> ServeOptions {
    ServeOptions {
        timing: LineTiming { time_factor: 100.0, ..LineTiming::default() },
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
    // The answers are among the reports, or lost after them; the controller still runs.
    std::thread::sleep(Duration::from_millis(200));
    peer.received.clear();
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
        assert!(started.elapsed() < TIMEOUT);
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
    options.timing.time_factor = 10.0;
    // A second of wall time; 100 mm at 10 mm/s take as long.
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
        assert!(started.elapsed() < TIMEOUT, "the port does not hang up");
        if count == 0 {
            break;
        }
    }
    let second = loop {
        match std::fs::read_link(&link) {
            Ok(path) if path != first => break path,
            _ => std::thread::sleep(Duration::from_millis(2)),
        }
        assert!(started.elapsed() < TIMEOUT, "it does not come back");
    };
    let mut peer = Peer::open(&second);
    let started = Instant::now();
    loop {
        peer.send(b"?");
        if peer.expect(">\r\n").starts_with("<Idle|MPos:100.000,") {
            break;
        }
        assert!(started.elapsed() < TIMEOUT, "the machine has not moved on");
    }
    served.stop();
    assert!(std::fs::symlink_metadata(&link).is_err(), "the link is gone");
}

/// Opens the port, leaves it with HUPCL on or off and the axes moved; returns its first output.
fn visit(path: &Path, hangs_up: bool) -> String {
    use rustix::termios::{ControlModes, OptionalActions, tcgetattr, tcsetattr};
    let mut peer = Peer::open(path);
    let started = Instant::now();
    let mut received = String::new();
    // A bootloader does not answer.
    while !received.contains(">\r\n") {
        assert!(started.elapsed() < TIMEOUT, "no report in {received:?}");
        peer.send(b"?");
        let mut buffer = [0; 256];
        std::thread::sleep(Duration::from_millis(20));
        if let Ok(count) = peer.file.read(&mut buffer) {
            received += std::str::from_utf8(&buffer[..count]).unwrap();
        }
    }
    // HUPCL only now: the state at the previous close has been read by then.
    let mut termios = tcgetattr(&peer.file).unwrap();
    termios.control_modes.set(ControlModes::HUPCL, hangs_up);
    tcsetattr(&peer.file, OptionalActions::Now, &termios).unwrap();
    peer.send(b"G91G0X5\nG4P0\n");
    peer.expect("ok\r\nok\r\n");
    received
}

#[test]
fn a_board_of_the_arduino_kind_resets_when_its_port_is_opened_unless_hupcl_is_off() {
    let mut options = options();
    options.resets_on_open = true;
    let served = Served::start(options);
    let is_reset = |received: &str| {
        let has_banner = received.contains("Grbl 1.1h");
        assert_eq!(
            has_banner,
            received.contains("MPos:0.000,"),
            "the position goes with it: {received}"
        );
        has_banner
    };
    assert!(is_reset(&visit(&served.path, true)), "at first");
    assert!(is_reset(&visit(&served.path, false)), "DTR dropped at the close before");
    assert!(!is_reset(&visit(&served.path, true)), "DTR stayed up at the close before");
    assert!(is_reset(&visit(&served.path, true)), "DTR dropped again");
    served.stop();
}
