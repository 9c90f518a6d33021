//! One opened port: its settings, its reader, its writer.

use super::SerialConfig;
use super::inbox::{FromPort, Inbox};
use rustix::fd::OwnedFd;
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::termios::{ControlModes, OptionalActions, tcgetattr, tcsetattr};
use serialport::{ClearBuffer, DataBits, FlowControl, Parity, SerialPort, StopBits, TTYPort};
use std::io::{ErrorKind, Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How often a reader looks whether it is still wanted.
const READ_PATIENCE: Duration = Duration::from_millis(50);
/// How long the system may refuse to take bytes.
const WRITE_PATIENCE: Duration = Duration::from_millis(500);
/// Writes that wait; the link keeps far less than this under way.
const WRITES_MAX: usize = 64;
/// How long the end of the threads is waited for before they are left alone.
const END_PATIENCE: Duration = Duration::from_millis(300);

/// A port that is open. Dropping it closes it.
#[derive(Debug)]
pub(super) struct Port {
    /// The same port, for writes that wait for nothing.
    at_once: OwnedFd,
    writes: Option<SyncSender<Vec<u8>>>,
    /// Writes that the writer has not finished.
    waiting: Arc<AtomicUsize>,
    is_over: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Port {
    /// Opens the port for this process alone, 8N1, raw, without flow control, and
    /// starts its reader and writer. The error is for people.
    pub(super) fn open(
        config: &SerialConfig,
        number: u64,
        inbox: &Arc<Inbox>,
    ) -> Result<Self, String> {
        let problem =
            |error: &dyn std::fmt::Display| format!("cannot open {}: {error}", config.path);
        let (mut port, at_once) = open_tty(config).map_err(|error| problem(&error))?;
        let mut writer = port.try_clone_native().map_err(|error| problem(&error))?;
        // What came before belongs to nobody. A pseudo-terminal may not know this.
        let _ = port.clear(ClearBuffer::All);
        let is_over = Arc::new(AtomicBool::new(false));
        let (writes, wanted) = sync_channel(WRITES_MAX);
        let _ = port.set_timeout(READ_PATIENCE);
        let _ = writer.set_timeout(WRITE_PATIENCE);
        let (writes, waiting) = (Some(writes), Arc::default());
        let mut opened = Self { at_once, writes, waiting, is_over, threads: Vec::new() };
        let (over, to) = (opened.is_over.clone(), inbox.clone());
        opened.spawn("axis-driver-rx", move || read(port, number, &to, &over))?;
        let (to, waiting) = (inbox.clone(), opened.waiting.clone());
        opened.spawn("axis-driver-tx", move || write(writer, number, &to, &wanted, &waiting))?;
        Ok(opened)
    }

    fn spawn(&mut self, name: &str, work: impl FnOnce() + Send + 'static) -> Result<(), String> {
        let thread = std::thread::Builder::new().name(name.into()).spawn(work);
        self.threads.push(thread.map_err(|error| format!("cannot start {name}: {error}"))?);
        Ok(())
    }

    /// Writes bytes, or hands what the system does not take now to the writer; never waits.
    pub(super) fn write(&self, mut bytes: Vec<u8>) -> Result<(), String> {
        // Behind what waits already, or they would overtake it. A thread less to wake is a
        // thread less that has to wait for a processor.
        if self.waiting.load(Ordering::Acquire) == 0 {
            match rustix::io::write(&self.at_once, &bytes) {
                Ok(count) if count == bytes.len() => return Ok(()),
                Ok(count) => drop(bytes.drain(..count)),
                Err(Errno::AGAIN | Errno::INTR) => {}
                Err(error) => return Err(format!("unplugged: {}", std::io::Error::from(error))),
            }
        }
        self.waiting.fetch_add(1, Ordering::Relaxed);
        match self.writes.as_ref().map(|writes| writes.try_send(bytes)) {
            Some(Ok(())) => Ok(()),
            Some(Err(TrySendError::Full(_))) => {
                Err("the port takes no more bytes: the controller does not read".into())
            }
            Some(Err(TrySendError::Disconnected(_))) | None => {
                Err("unplugged: the port is gone".into())
            }
        }
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        self.writes = None;
        // The port can be opened again when both have let go of it. A writer that the
        // system holds is left: it ends with the device.
        let patience = Instant::now();
        while self.threads.iter().any(|thread| !thread.is_finished())
            && patience.elapsed() < END_PATIENCE
        {
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

/// Opens the port twice; who writes to the second one never waits.
fn open_tty(config: &SerialConfig) -> serialport::Result<(TTYPort, OwnedFd)> {
    // With HUPCL the last close drops DTR, and the next open resets the board. This
    // descriptor is there before the real one is, so that there is no close between.
    let at_once = rustix::fs::open(
        &config.path,
        OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC,
        Mode::empty(),
    )
    .map_err(|error| std::io::Error::from_raw_os_error(error.raw_os_error()))?;
    if let Ok(mut termios) = tcgetattr(&at_once) {
        termios.control_modes.remove(ControlModes::HUPCL);
        // A device without modem lines has nothing to keep.
        let _ = tcsetattr(&at_once, OptionalActions::Now, &termios);
    }
    let mut port = serialport::new(&config.path, config.driver.baud)
        .data_bits(DataBits::Eight)
        .parity(Parity::None)
        .stop_bits(StopBits::One)
        .flow_control(FlowControl::None)
        .exclusive(true)
        .open_native()?;
    // A pseudo-terminal has no such lines and says so; that is no obstacle.
    if let Some(level) = config.dtr {
        let _ = port.write_data_terminal_ready(level);
    }
    if let Some(level) = config.rts {
        let _ = port.write_request_to_send(level);
    }
    Ok((port, at_once))
}

fn read(mut port: TTYPort, number: u64, inbox: &Inbox, is_over: &AtomicBool) {
    let mut buffer = [0; 4096];
    while !is_over.load(Ordering::Relaxed) {
        let what = match port.read(&mut buffer) {
            Ok(0) => Err("unplugged: the port has ended".to_owned()),
            Ok(count) => Ok(buffer[..count].to_vec()),
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {
                continue;
            }
            Err(error) => Err(format!("unplugged: {error}")),
        };
        let is_end = what.is_err();
        inbox.push_read(FromPort { port: number, what }, WRITE_PATIENCE);
        if is_end {
            return;
        }
    }
}

fn write(
    mut port: TTYPort,
    number: u64,
    inbox: &Inbox,
    wanted: &Receiver<Vec<u8>>,
    waiting: &AtomicUsize,
) {
    for bytes in wanted {
        if let Err(error) = port.write_all(&bytes) {
            let what = Err(match error.kind() {
                ErrorKind::TimedOut => "the controller does not read".to_owned(),
                _ => format!("unplugged: {error}"),
            });
            inbox.push_read(FromPort { port: number, what }, WRITE_PATIENCE);
            return;
        }
        waiting.fetch_sub(1, Ordering::Release);
    }
}
