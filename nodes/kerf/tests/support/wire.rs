//! A serial line in the hands of a test: it lies between the driver and a controller.
//!
//! To the driver it is a pseudo-terminal with a link, or a TCP port. It can be unplugged in the
//! middle of a byte sequence, and a terminal comes back as another device; to the controller it is
//! the process that has opened its port. It knows lines and marks, and injects faults;
//! it knows nothing of what the lines mean. All that passes is kept.

#[path = "wire/ends.rs"]
mod ends;
#[path = "wire/near.rs"]
mod near;
#[path = "wire/trouble.rs"]
mod trouble;

pub(crate) use trouble::Trouble;

use super::cable::Cable;
use super::machine::until;
use ends::{Ends, open_controller};
use rustix::pipe::{PipeFlags, pipe_with};
use std::collections::VecDeque;
use std::os::fd::{AsFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Who wrote it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Writer {
    Driver,
    Controller,
}

/// What was written, as the other end was given it.
#[derive(Debug, Clone)]
pub(crate) struct Passed {
    pub(crate) from: Writer,
    /// What was written.
    pub(crate) said: Vec<u8>,
    /// What of it arrived.
    pub(crate) arrived: Vec<u8>,
}

/// What is to become of the cable.
#[derive(Debug)]
enum Wanted {
    Pulled,
    PluggedIn,
    /// Plugs it into an existing device, with this controller.
    MovedTo(OwnedFd),
}

/// What resets a board.
pub(crate) type Reset = Box<dyn Fn() + Send>;

#[derive(Default)]
struct Line {
    log: Vec<Passed>,
    troubles: VecDeque<Trouble>,
    /// Nothing of what the controller says arrives.
    is_mute: bool,
    wanted: Option<Wanted>,
    /// Bytes of the test itself for the controller.
    asides: Vec<u8>,
    /// Where the port is.
    device: Option<PathBuf>,
    /// How often it was opened.
    openings: usize,
    is_open: bool,
    /// Whether closing it would let DTR fall.
    hangs_up: bool,
    /// Resets the board when DTR rises.
    reset: Option<Reset>,
    is_over: bool,
}

/// The line. It goes when this is dropped.
pub(crate) struct Wire {
    link: PathBuf,
    line: Arc<Mutex<Line>>,
    wake: OwnedFd,
    thread: Option<JoinHandle<()>>,
}

impl Wire {
    /// A line from `link`, or from a TCP port, to the controller's port. With `reset` it ends at a
    /// board that does so whenever DTR rises.
    pub(crate) fn new(link: &Path, controller: &Path, reset: Option<Reset>, cable: Cable) -> Self {
        let controller = open_controller(controller);
        let (woken, wake) =
            pipe_with(PipeFlags::CLOEXEC | PipeFlags::NONBLOCK).expect("a pipe for the wire");
        let line = Arc::new(Mutex::new(Line { reset, ..Line::default() }));
        let mut ends = Ends::new(&line, link, controller, woken, cable);
        ends.plug_in();
        let thread = std::thread::Builder::new()
            .name("wire".into())
            .spawn(move || ends.run())
            .expect("a thread for the wire");
        Self { link: link.to_owned(), line, wake, thread: Some(thread) }
    }

    fn line(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Line)) {
        change(&mut self.line());
        // A full pipe wakes as well.
        let _ = rustix::io::write(&self.wake, b"x");
    }

    /// Where the link leads; `None` while it is unplugged.
    pub(crate) fn device(&self) -> Option<PathBuf> {
        self.line().device.clone()
    }

    /// What the driver opens.
    pub(crate) fn port(&self) -> PathBuf {
        match self.device() {
            Some(url) if url.starts_with("tcp:") => url,
            _ => self.link.clone(),
        }
    }

    /// Everything from here on is younger than this.
    pub(crate) fn mark(&self) -> usize {
        self.line().log.len()
    }

    /// What has passed since then.
    pub(crate) fn passed_since(&self, mark: usize) -> Vec<Passed> {
        self.line().log[mark..].to_vec()
    }

    /// What the driver has written since then, without its questions for status.
    pub(crate) fn sent_since(&self, mark: usize) -> String {
        let passed = self.passed_since(mark).into_iter();
        let bytes = passed.filter(|passed| passed.from == Writer::Driver).flat_map(|it| it.said);
        let bytes: Vec<u8> = bytes.filter(|byte| *byte != b'?').collect();
        bytes.escape_ascii().to_string()
    }

    /// What the driver was given since then.
    pub(crate) fn received_since(&self, mark: usize) -> String {
        let passed = self.passed_since(mark).into_iter();
        let bytes =
            passed.filter(|passed| passed.from == Writer::Controller).flat_map(|it| it.arrived);
        String::from_utf8_lossy(&bytes.collect::<Vec<_>>()).into_owned()
    }

    /// Lets this happen to what passes next.
    pub(crate) fn trouble(&self, trouble: Trouble) {
        self.change(|line| line.troubles.push_back(trouble));
    }

    /// Whether everything that was asked for has happened.
    pub(crate) fn is_done(&self) -> bool {
        self.line().troubles.is_empty()
    }

    /// Whether nothing of what the controller says arrives.
    pub(crate) fn mute(&self, is_mute: bool) {
        self.change(|line| line.is_mute = is_mute);
    }

    /// Plugs it in again.
    pub(crate) fn plug_in(&self) {
        self.want(Wanted::PluggedIn);
    }

    /// Plugs it in with another controller and another device.
    pub(crate) fn plug_into(&self, controller: &Path) {
        self.want(Wanted::MovedTo(open_controller(controller)));
    }

    /// Pulls it.
    pub(crate) fn unplug(&self) {
        self.want(Wanted::Pulled);
    }

    fn want(&self, wanted: Wanted) {
        let is_plugged = !matches!(wanted, Wanted::Pulled);
        self.change(|line| line.wanted = Some(wanted));
        until("the cable", || (self.line().device.is_some() == is_plugged).then_some(()));
    }

    /// Sends this to the controller without the driver's knowledge.
    pub(crate) fn say_to_controller(&self, bytes: &[u8]) {
        self.change(|line| line.asides.extend_from_slice(bytes));
    }

    /// The last status report that the controller has given, whether it arrived or not.
    pub(crate) fn last_report(&self) -> Option<String> {
        let line = self.line();
        let mut reports = line.log.iter().rev().filter(|it| it.said.starts_with(b"<"));
        reports.next().map(|report| String::from_utf8_lossy(&report.said).into_owned())
    }

    /// How often it was opened.
    pub(crate) fn openings(&self) -> usize {
        self.line().openings
    }

    /// Whether anybody has it open.
    pub(crate) fn is_open(&self) -> bool {
        self.line().is_open
    }

    /// Whether the last one to close it would let DTR fall.
    pub(crate) fn hangs_up(&self) -> bool {
        self.line().hangs_up
    }
}

impl Drop for Wire {
    fn drop(&mut self) {
        self.change(|line| line.is_over = true);
        if let Some(thread) = self.thread.take() {
            // What it panicked with is in the log.
            let _ = thread.join();
        }
        let _ = std::fs::remove_file(&self.link);
    }
}

impl std::fmt::Debug for Wire {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Wire").field("link", &self.link).finish_non_exhaustive()
    }
}

/// Writes what the system takes.
fn push(to: impl AsFd, bytes: &mut Vec<u8>) {
    if let Ok(count) = rustix::io::write(to, bytes) {
        bytes.drain(..count);
    }
}
