//! The signals that end a command which runs until then: Ctrl-C, SIGTERM and a closed terminal.

use crate::exit::Failure;
use tokio::signal::unix::{Signal, SignalKind, signal};

/// They are caught from [`EndSignals::listen`] on.
pub(crate) struct EndSignals([Signal; 3]);

impl EndSignals {
    pub(crate) fn listen() -> Result<Self, Failure> {
        let on = |kind| signal(kind).map_err(Failure::usage);
        Ok(Self([
            on(SignalKind::interrupt())?,
            on(SignalKind::terminate())?,
            on(SignalKind::hangup())?,
        ]))
    }

    /// Waits for one of them.
    pub(crate) async fn next(&mut self) {
        let [interrupt, terminate, hangup] = &mut self.0;
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
            _ = hangup.recv() => {}
        }
    }
}
