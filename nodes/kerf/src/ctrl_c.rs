//! Ctrl-C in a command that moves the machine.
//!
//! The first one cancels the operation; the command still waits for its end. A second one exits.
//! If the cancel failed, the next one tries again.

use crate::exit::{Failure, Status};
use std::future::{Future, pending};
use std::pin::Pin;
use tokio::signal::unix::{Signal, SignalKind, signal};

type Canceling = Pin<Box<dyn Future<Output = Result<(), Failure>>>>;

/// The key, and what it has done so far.
pub(crate) struct CtrlC {
    interrupt: Signal,
    is_asked: bool,
    /// Asks the node to cancel.
    canceling: Option<Canceling>,
}

impl CtrlC {
    /// Starts to listen; called before the operation begins, so that no key is missed.
    pub(crate) fn listen() -> Result<Self, Failure> {
        let interrupt = signal(SignalKind::interrupt()).map_err(Failure::usage)?;
        Ok(Self { interrupt, is_asked: false, canceling: None })
    }

    /// Waits until it is time to [`Self::cancel`]. May be dropped while it waits.
    ///
    /// # Errors
    /// It is time to exit.
    pub(crate) async fn next(&mut self) -> Result<(), Failure> {
        loop {
            let answer = async {
                match &mut self.canceling {
                    Some(canceling) => canceling.await,
                    None => pending().await,
                }
            };
            tokio::select! {
                _ = self.interrupt.recv() => {
                    if std::mem::replace(&mut self.is_asked, true) {
                        let text = "exiting without canceling; the machine may still be moving, check with `kerf status`";
                        return Err(Failure::new(Status::NodeRefused, text));
                    }
                    return Ok(());
                }
                answer = answer => {
                    self.canceling = None;
                    if let Err(Failure { message, .. }) = answer {
                        eprintln!("kerf: NOT CANCELED, the machine is still running: {message}; press Ctrl-C to try again");
                        self.is_asked = false;
                    }
                }
            }
        }
    }

    /// Cancels while the caller waits for the end.
    pub(crate) fn cancel(
        &mut self,
        canceling: impl Future<Output = Result<(), Failure>> + 'static,
    ) {
        eprintln!(
            "kerf: canceling; press Ctrl-C again to exit without waiting; the machine may keep moving"
        );
        self.canceling = Some(Box::pin(canceling));
    }

    /// Cancels over a new connection, if the old one ended without an answer.
    pub(crate) fn reconnect(
        &mut self,
        canceling: impl Future<Output = Result<(), Failure>> + 'static,
    ) {
        if self.canceling.is_some() {
            self.canceling = Some(Box::pin(canceling));
        }
    }
}
