//! What the states of the driver mean.
//!
//! Configured: the driver owns the port; `machine_state`, not the lifecycle, says whether a
//! controller answers there. The driver reopens a lost line by itself. Active: goals and motion
//! are accepted.

use super::RemoteDriver;
use crate::driver::Command;
use cnc_msgs::machine::{MachineState, Mode};
use runtime::lifecycle::LifecycleState;
use runtime::{Health, Managed, TransitionResult, Trouble};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::oneshot;

/// How long what a controller says of itself may take; it is not waited for longer.
const IDENTIFIED_WITHIN: Duration = Duration::from_secs(5);
/// How long the port may take to close.
const CLOSE_WITHIN: Duration = Duration::from_secs(2);
/// How long bringing the machine to a stop may take; the core gives up before.
const STOP_WITHIN: Duration = Duration::from_secs(25);
/// How long an answer of the core may take that waits for nothing.
const REPLY_WITHIN: Duration = Duration::from_secs(5);

/// The driver as a managed node.
pub(super) struct Shell {
    pub(super) driver: Arc<RemoteDriver>,
    pub(super) has_port: bool,
}

impl Managed for Shell {
    /// Opens the port and waits until the controller is identified, or until it is
    /// known that it cannot: then the port is tried again and again.
    async fn configure(&self) -> TransitionResult {
        if !self.has_port {
            // A driver without a port still proves paths.
            tracing::warn!("no port is set: give one with -p axis_driver:port:=/dev/ttyUSB0");
            return Ok(());
        }
        let states = self.driver.state.subscribe();
        self.driver.motion.open();
        let is_identified = |state: &MachineState| state.mode != Mode::Unknown;
        if !changes_to(states, IDENTIFIED_WITHIN, is_identified).await {
            tracing::warn!("the controller has not been identified; see machine_state");
        }
        Ok(())
    }

    async fn activate(&self) -> TransitionResult {
        let reply = self.driver.ask(Command::Activate, REPLY_WITHIN).await;
        if reply.is_err() {
            // It may be taken up yet: what others hear is that it was not.
            self.driver.begin(Command::Deactivate);
        }
        reply.map(drop).map_err(Trouble::failure)
    }

    /// Holds, waits until the machine stands, and ends the goal.
    async fn deactivate(&self) -> TransitionResult {
        let reply = self.driver.ask(Command::Deactivate, STOP_WITHIN).await;
        let message = reply.map_err(Trouble::failure)?;
        match self.driver.state.borrow().motion_possible {
            true => tracing::warn!("{message}"),
            false => tracing::info!("{message}"),
        }
        Ok(())
    }

    async fn cleanup(&self) -> TransitionResult {
        let states = self.driver.state.subscribe();
        self.driver.motion.close();
        let is_closed = |state: &MachineState| matches!(state.mode, Mode::Disconnected);
        let was_closed = is_closed(&states.borrow());
        if self.has_port && !was_closed && !changes_to(states, CLOSE_WITHIN, is_closed).await {
            tracing::warn!("the port is closing; see machine_state");
        }
        Ok(())
    }

    /// Brings the machine to a stop, if there is one, and closes the port.
    async fn shutdown(&self) -> TransitionResult {
        let (sender, ready) = oneshot::channel();
        self.driver.waiting().leave = Some(sender);
        drop(self.driver.begin(Command::Shutdown));
        if tokio::time::timeout(STOP_WITHIN, ready).await.is_err() {
            tracing::error!("the machine was not brought to a stop; it may still move");
        }
        // The last traffic and the results of goals are on their way.
        tokio::time::sleep(Duration::from_millis(300)).await;
        Ok(())
    }

    /// The driver is in another process, and has gone on meanwhile.
    async fn go_on(&self, state: LifecycleState) -> TransitionResult {
        if state == LifecycleState::Active
            && let Err(refusal) = self.driver.ask(Command::Activate, REPLY_WITHIN).await
        {
            // Nothing is stopped for that: machine_state says if it begins nothing.
            tracing::warn!("the driver is not active as before: {}", refusal.message);
        }
        Ok(())
    }

    fn health(&self) -> Vec<Health> {
        vec![self.driver.health()]
    }
}

/// Waits for a state that comes from now on.
async fn changes_to(
    mut states: tokio::sync::watch::Receiver<MachineState>,
    within: Duration,
    is_it: impl Fn(&MachineState) -> bool,
) -> bool {
    let waiting = async {
        while states.changed().await.is_ok() {
            if is_it(&states.borrow_and_update()) {
                return true;
            }
        }
        false
    };
    tokio::time::timeout(within, waiting).await.unwrap_or(false)
}
