//! A serial line: its settings, what is read from it, and its writer.

use super::{OnFailure, Transport};
use crate::serial::SerialConfig;
use rustix::fd::{AsFd, BorrowedFd, OwnedFd};
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::termios::{ControlModes, OptionalActions, tcgetattr, tcsetattr};
use serialport::{ClearBuffer, DataBits, FlowControl, Parity, SerialPort, StopBits, TTYPort};
use std::io::{ErrorKind, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Bytes that are read in one go.
const READ_BYTES_MAX: usize = 4096;
/// How long the system may refuse to take bytes.
const WRITE_PATIENCE: Duration = Duration::from_millis(500);
/// Writes that wait; the link keeps far less than this under way.
const WRITES_MAX: usize = 64;
/// How long the end of the writer is waited for before it is left alone.
const END_PATIENCE: Duration = Duration::from_millis(300);

/// A port that is open. Dropping it closes it.
#[derive(Debug)]
pub(super) struct Port {
    /// The same port, for reads and writes that wait for nothing.
    at_once: OwnedFd,
    /// Keeps the port for this process alone.
    _exclusive: TTYPort,
    writes: Option<SyncSender<Vec<u8>>>,
    /// Writes that the writer has not finished.
    waiting: Arc<AtomicUsize>,
    writer: Option<JoinHandle<()>>,
}

impl Port {
    /// Opens the port for this process alone, 8N1, raw, without flow control, and starts
    /// its writer. The error is for people.
    pub(super) fn open(
        config: &SerialConfig,
        path: &str,
        on_failure: OnFailure,
    ) -> Result<Self, String> {
        let (port, at_once) = open_tty(config, path).map_err(|error| error.to_string())?;
        let mut writer = port.try_clone_native().map_err(|error| error.to_string())?;
        // What came before belongs to nobody. A pseudo-terminal may not know this.
        let _ = port.clear(ClearBuffer::All);
        let (writes, wanted) = sync_channel(WRITES_MAX);
        let _ = writer.set_timeout(WRITE_PATIENCE);
        let waiting = Arc::<AtomicUsize>::default();
        let left = waiting.clone();
        let writer = std::thread::Builder::new()
            .name("axis-driver-tx".into())
            .spawn(move || write(writer, on_failure, &wanted, &left))
            .map_err(|error| format!("cannot start axis-driver-tx: {error}"))?;
        let (writes, writer) = (Some(writes), Some(writer));
        Ok(Self { at_once, _exclusive: port, writes, waiting, writer })
    }
}

impl Transport for Port {
    fn read(&mut self) -> Result<Vec<u8>, String> {
        let mut bytes = vec![0; READ_BYTES_MAX];
        match rustix::io::read(&self.at_once, &mut bytes) {
            Ok(0) => Err("unplugged: the port has ended".into()),
            Ok(count) => {
                bytes.truncate(count);
                Ok(bytes)
            }
            Err(Errno::AGAIN | Errno::INTR) => Ok(Vec::new()),
            Err(error) => Err(format!("unplugged: {}", std::io::Error::from(error))),
        }
    }

    fn write(&mut self, mut bytes: Vec<u8>) -> Result<(), String> {
        // After what waits already, or they would overtake it. A thread less to wake is a
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

impl AsFd for Port {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.at_once.as_fd()
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        self.writes = None;
        // The port can be opened again when the writer has let go of it. One that the
        // system holds is left: it ends with the device.
        let patience = Instant::now();
        while self.writer.as_ref().is_some_and(|writer| !writer.is_finished())
            && patience.elapsed() < END_PATIENCE
        {
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

/// Opens the port twice; who writes to the second one never waits.
fn open_tty(config: &SerialConfig, path: &str) -> serialport::Result<(TTYPort, OwnedFd)> {
    // With HUPCL the last close drops DTR, and the next open resets the board. This
    // descriptor is there before the real one is, so that there is no close between.
    let at_once = rustix::fs::open(
        path,
        OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC,
        Mode::empty(),
    )
    .map_err(|error| std::io::Error::from_raw_os_error(error.raw_os_error()))?;
    if let Ok(mut termios) = tcgetattr(&at_once) {
        termios.control_modes.remove(ControlModes::HUPCL);
        // A device without modem lines has nothing to keep.
        let _ = tcsetattr(&at_once, OptionalActions::Now, &termios);
    }
    let mut port = serialport::new(path, config.driver.baud)
        .data_bits(DataBits::Eight)
        .parity(Parity::None)
        .stop_bits(StopBits::One)
        .flow_control(FlowControl::None)
        .exclusive(true)
        .open_native()?;
    // A pseudo-terminal stays exclusive when the process that opened it is killed, as long as its
    // other side is open: the next driver could not have it. The lock of the file goes with the
    // process.
    if std::fs::canonicalize(path).is_ok_and(|path| path.starts_with("/dev/pts")) {
        let _ = rustix::termios::ioctl_tiocnxcl(&at_once);
    }
    // A pseudo-terminal has no such lines and says so; that is no obstacle.
    if let Some(level) = config.dtr {
        let _ = port.write_data_terminal_ready(level);
    }
    if let Some(level) = config.rts {
        let _ = port.write_request_to_send(level);
    }
    Ok((port, at_once))
}

fn write(
    mut port: TTYPort,
    on_failure: OnFailure,
    wanted: &Receiver<Vec<u8>>,
    waiting: &AtomicUsize,
) {
    for bytes in wanted {
        if let Err(error) = port.write_all(&bytes) {
            let reason = match error.kind() {
                ErrorKind::TimedOut => "the controller does not read".to_owned(),
                _ => format!("unplugged: {error}"),
            };
            return on_failure(reason);
        }
        waiting.fetch_sub(1, Ordering::Release);
    }
}
