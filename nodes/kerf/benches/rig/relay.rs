//! A serial line between the driver and a controller, under control of a bench.
//!
//! Passes bytes on in both directions at once. Notes when a feed hold is read from the driver, and
//! how many bytes written before it are still in transit at the line's baud rate. The controller at
//! the other end paces its bytes itself.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags, fcntl_getfl, fcntl_setfl, open};
use rustix::io::Errno;
use rustix::process::setpriority_process;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

pub(crate) const FEED_HOLD: u8 = b'!';
/// How often the thread checks whether to stop.
const LOOK: Timespec = Timespec { tv_sec: 0, tv_nsec: 100_000_000 };

/// A feed hold in transit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hold {
    /// When it was read from the driver.
    pub(crate) at: Instant,
    /// How long the bytes written before it still take on the line.
    pub(crate) queued: Duration,
    /// The number of these bytes, a partly sent one included.
    pub(crate) bytes: usize,
}

/// The line. It is closed when this is dropped.
#[derive(Debug)]
pub(crate) struct Relay {
    /// The port for the driver.
    pub(crate) port: PathBuf,
    pub(crate) holds: Receiver<Hold>,
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Relay {
    /// A line to the controller at this port.
    pub(crate) fn new(controller: &Path, baud: u32) -> Self {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pseudo-terminal");
        grantpt(&master).and_then(|()| unlockpt(&master)).expect("it is ours");
        let name = ptsname(&master, Vec::new()).expect("it has a name");
        let port = PathBuf::from(name.into_string().expect("names of terminals are ASCII"));
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK;
        // Stays open, so that the driver may close and open it.
        let slave = open(&port, flags, Mode::empty()).expect("the other side");
        make_raw(&slave);
        fcntl_setfl(&master, fcntl_getfl(&master).expect("flags") | OFlags::NONBLOCK)
            .expect("it need not wait");
        let controller = open(controller, flags, Mode::empty()).expect("the controller's port");
        make_raw(&controller);
        let (sender, holds) = channel();
        let is_over = Arc::new(AtomicBool::new(false));
        let over = Arc::clone(&is_over);
        let ends = Ends {
            driver: master,
            _slave: slave,
            controller,
            line: Busy { byte: Duration::from_secs(10) / baud, until: Instant::now() },
            hold_sender: sender,
        };
        let thread = std::thread::Builder::new().name("relay".into());
        let thread = thread.spawn(move || ends.run(&over)).expect("a thread");
        Self { port, holds, is_over, thread: Some(thread) }
    }
}

impl Drop for Relay {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // Its error is on standard error.
            let _ = thread.join();
        }
    }
}

fn make_raw(port: &OwnedFd) {
    let mut termios = tcgetattr(port).expect("a terminal");
    termios.make_raw();
    tcsetattr(port, OptionalActions::Now, &termios).expect("a terminal");
}

/// Until when the line is busy with written bytes.
struct Busy {
    /// Time of one byte.
    byte: Duration,
    until: Instant,
}

impl Busy {
    fn write(&mut self, now: Instant, count: usize) {
        let bytes = u32::try_from(count).expect("a read is small");
        self.until = self.until.max(now) + self.byte * bytes;
    }

    fn hold(&self, now: Instant) -> Hold {
        let queued = self.until.saturating_duration_since(now);
        let bytes = queued.as_nanos().div_ceil(self.byte.as_nanos());
        Hold { at: now, queued, bytes: usize::try_from(bytes).expect("a line holds little") }
    }
}

struct Ends {
    driver: OwnedFd,
    _slave: OwnedFd,
    controller: OwnedFd,
    line: Busy,
    hold_sender: Sender<Hold>,
}

impl Ends {
    fn run(mut self, is_over: &AtomicBool) {
        // Its own wait for a processor must not be measured. Without the right to raise the
        // priority the figures are a little worse.
        let _ = setpriority_process(None, -20);
        let mut buffer = [0; 4096];
        while !is_over.load(Ordering::Relaxed) {
            let mut fds = [
                PollFd::new(&self.driver, PollFlags::IN),
                PollFd::new(&self.controller, PollFlags::IN),
            ];
            poll(&mut fds, Some(&LOOK)).expect("terminals can be waited for");
            let count = read(&self.driver, &mut buffer);
            let now = Instant::now();
            let bytes = &buffer[..count];
            let hold = bytes.iter().position(|byte| *byte == FEED_HOLD);
            if let Some(at) = hold {
                self.line.write(now, at);
                // The receiver is gone: the bench is done.
                let _ = self.hold_sender.send(self.line.hold(now));
            }
            self.line.write(now, count - hold.unwrap_or(0));
            write(&self.controller, bytes);
            let count = read(&self.controller, &mut buffer);
            write(&self.driver, &buffer[..count]);
        }
    }
}

fn read(from: &OwnedFd, buffer: &mut [u8]) -> usize {
    match rustix::io::read(from, buffer) {
        Ok(count) => count,
        Err(Errno::AGAIN | Errno::INTR) => 0,
        // The peer has closed; nothing will come.
        Err(_) => 0,
    }
}

/// The buffers are far larger than what either side sends without an answer.
fn write(to: &OwnedFd, mut bytes: &[u8]) {
    while !bytes.is_empty() {
        match rustix::io::write(to, bytes) {
            Ok(count) => bytes = &bytes[count..],
            Err(Errno::AGAIN | Errno::INTR) => std::thread::yield_now(),
            Err(_) => return,
        }
    }
}
