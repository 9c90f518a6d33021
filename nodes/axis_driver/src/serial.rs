//! The shell around the driver: the port, the threads, the clock.
//!
//! One thread owns the driver and reads the port; a writer takes what the system does not
//! take at once, so that neither a controller that does not read nor a consumer
//! that does not listen ever stops it. Commands go in and outputs and journal entries come out through bounded
//! queues; what is telemetry is dropped and counted rather than waited for. A port
//! that is opened again is a new port: nothing is resumed. Knows no ROS.

// This is where the clock and the threads are.
#![allow(clippy::disallowed_methods, clippy::disallowed_types)]

mod inbox;
mod outbox;
mod owner;

pub use inbox::Full;
pub use outbox::{Dropped, Event};

use crate::driver::{Command, DriverConfig};
use crate::journal::Entry;
use inbox::{Inbox, InboxCommand};
use outbox::Counters;
use std::io;
use std::sync::Arc;
use std::sync::mpsc::SyncSender;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Which port, and how it is treated.
#[derive(Debug, Clone, PartialEq)]
pub struct SerialConfig {
    /// A device, best a stable name below `/dev/serial/by-id`; or a URL: `tcp://mill:23`,
    /// `ws://mill:81`, `rfc2217://gate:4000`.
    pub path: String,
    /// The level of DTR after opening; `None` leaves what the system does. Some boards
    /// are reset by a change, some stay silent without it.
    pub dtr: Option<bool>,
    /// The level of RTS after opening.
    pub rts: Option<bool>,
    pub reopen: Reopen,
    pub driver: DriverConfig,
}

/// What to do when the port is not there or goes away.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reopen {
    /// Wait for [`Serial::open`].
    WhenTold,
    /// Try again after `first`, then twice as long each time, up to `most`.
    Backoff { first: Duration, most: Duration },
}

/// The running driver. Dropping it closes the port without stopping the machine; send
/// [`Command::Shutdown`] and wait for its answer first.
#[derive(Debug)]
pub struct Serial {
    inbox: Arc<Inbox>,
    counters: Arc<Counters>,
    epoch: Instant,
    owner: Option<JoinHandle<()>>,
}

impl Serial {
    /// Starts the threads; the port is opened by [`Self::open`].
    ///
    /// `events` and `journal` are never waited for: replies and ends of runs are kept
    /// until there is room, all else is dropped and counted.
    pub fn start(
        config: SerialConfig,
        events: SyncSender<Event>,
        journal: SyncSender<Entry>,
    ) -> io::Result<Self> {
        let inbox = Arc::new(Inbox::new()?);
        let counters = Arc::new(Counters::default());
        let epoch = Instant::now();
        let outbox = outbox::Outbox::new(events, journal, counters.clone());
        let owner = owner::Owner::new(config, inbox.clone(), outbox, epoch);
        let owner =
            std::thread::Builder::new().name("axis-driver".into()).spawn(move || owner.run())?;
        Ok(Self { inbox, counters, epoch, owner: Some(owner) })
    }

    /// Opens the port. What happens shows in the state.
    pub fn open(&self) -> Result<(), Full> {
        self.inbox.push_control(InboxCommand::Open)
    }

    /// Closes the port as it is; it is reopened only on request.
    pub fn close(&self) -> Result<(), Full> {
        self.inbox.push_control(InboxCommand::Close)
    }

    /// Hands a command to the driver; the reply comes as an event with the same id.
    pub fn command(&self, id: u64, command: Command) -> Result<(), Full> {
        self.inbox.push_control(InboxCommand::Command { id, command })
    }

    /// The zero of all times in events and entries.
    pub fn epoch(&self) -> Instant {
        self.epoch
    }

    /// Seconds since the last report, infinite when there was none through this port.
    pub fn link_age_s(&self) -> f64 {
        let now = self.epoch.elapsed();
        let last_report_at = self.counters.last_report_at();
        last_report_at.map_or(f64::INFINITY, |at| now.saturating_sub(at).as_secs_f64())
    }

    /// How often the thread that owns the driver has come round: at least once a second.
    pub fn turns(&self) -> u64 {
        self.counters.turns()
    }

    /// What nobody took in time.
    pub fn dropped(&self) -> Dropped {
        self.counters.read()
    }
}

impl Drop for Serial {
    fn drop(&mut self) {
        self.inbox.stop();
        if let Some(owner) = self.owner.take() {
            // A panic of the owner was printed by its own thread.
            let _ = owner.join();
        }
    }
}
