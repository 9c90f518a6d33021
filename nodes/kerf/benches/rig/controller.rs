//! Virtual controllers for benches: in a thread of this process, or as a process.

use super::support::kerf;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::sync::mpsc::sync_channel;
use std::thread::JoinHandle;
use tempfile::TempDir;
use virtual_controller::{Build, Firmware, ServeOptions, Settings, StopHandle, serve, stop_pair};

/// Settings that make the machine fast enough for the line to be the bottleneck.
pub(crate) fn fast_settings() -> String {
    let axes = 0..3;
    axes.map(|axis| format!("$11{axis}=30000\n$12{axis}=20000\n")).collect()
}

/// A machine with these settings.
pub(crate) fn fast(firmware: Firmware) -> Build {
    let mut settings = Settings::small_router_of(firmware);
    for line in fast_settings().lines() {
        settings.set_line(line).expect("every firmware has rates and accelerations");
    }
    Build::new(settings)
}

/// A controller in a thread, on a pseudo-terminal, at 115 200 Bd in real time.
#[derive(Debug)]
pub(crate) struct InThread {
    pub(crate) port: PathBuf,
    stop: StopHandle,
    thread: Option<JoinHandle<()>>,
    folder: TempDir,
}

/// The file in which a controller in a thread leaves its counts.
const REPORT: &str = "report.json";

impl InThread {
    pub(crate) fn start(build: Build) -> Self {
        let folder = tempfile::tempdir().expect("a folder for the report");
        let report = Some(folder.path().join(REPORT));
        let (stop, stopped) = stop_pair().expect("a pipe");
        let (port_sender, port) = sync_channel(1);
        let serving = move || {
            let options = ServeOptions { report, ..ServeOptions::new(build) };
            let ready = |path: &Path| {
                // Only the first call is waited for.
                let _ = port_sender.try_send(path.to_owned());
                Ok(())
            };
            serve(options, &stopped, ready).expect("a pseudo-terminal");
        };
        let thread = std::thread::Builder::new().name("controller".into()).spawn(serving);
        let thread = Some(thread.expect("a thread"));
        let port = port.recv().expect("it reports its port");
        Self { port, stop, thread, folder }
    }

    /// Ends it; returns its counts.
    pub(crate) fn counts(mut self) -> serde_json::Value {
        self.stop.stop();
        self.thread.take().expect("not ended yet").join().expect("it only serves");
        read_counts(&self.folder.path().join(REPORT))
    }
}

impl Drop for InThread {
    fn drop(&mut self) {
        self.stop.stop();
        if let Some(thread) = self.thread.take() {
            // Its error is on standard error.
            let _ = thread.join();
        }
    }
}

/// The counts in the report of a controller.
pub(crate) fn read_counts(report: &Path) -> serde_json::Value {
    let text = std::fs::read_to_string(report).expect("the controller leaves its counts");
    serde_json::from_str(&text).expect("a JSON object")
}

/// A controller as a process, with a fast machine. It is ended when this value is dropped, and with
/// this process.
#[derive(Debug)]
pub(crate) struct InProcess {
    pub(crate) port: PathBuf,
    process: Child,
}

impl InProcess {
    /// Starts one with these arguments; its settings go to `folder`.
    pub(crate) fn start(folder: &Path, args: &[&str]) -> Self {
        let settings = folder.join("controller-settings.txt");
        std::fs::write(&settings, fast_settings()).expect("settings can be written");
        let mut process = kerf()
            .args(["node", "virtual_controller", "--settings"])
            .arg(settings)
            .args(["--parent-pid", &std::process::id().to_string()])
            .args(args)
            .stdout(Stdio::piped())
            .spawn()
            .expect("a virtual controller can be started");
        let mut port = String::new();
        let said = process.stdout.take().expect("piped");
        BufReader::new(said).read_line(&mut port).expect("it reports its port");
        Self { port: PathBuf::from(port.trim()), process }
    }

    /// Its process id.
    pub(crate) fn id(&self) -> u32 {
        self.process.id()
    }

    /// Asks it to exit, and waits for it.
    pub(crate) fn stop(&mut self) {
        let pid = rustix::process::Pid::from_child(&self.process);
        // It may have exited by itself.
        let _ = rustix::process::kill_process(pid, rustix::process::Signal::TERM);
        self.process.wait().expect("our child");
    }
}

impl Drop for InProcess {
    fn drop(&mut self) {
        // It may have exited already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
