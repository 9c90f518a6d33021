//! Managed nodes: what a node does at each lifecycle transition.
//!
//! A node makes its endpoints once, at its start, and keeps them for life; what
//! a state means is in the methods of [`Managed`]. `process/lifecycle_states.rs` has the transitions,
//! `services` the endpoints. [`Handle::require_active`] refuses requests that only an
//! active node serves.
//!
//! With the parameter `autostart` a node makes itself active, and ends when it
//! cannot; without it, it waits for others. A signal to stop, or the transition
//! `shutdown`, finalizes the node and then ends its process.

mod services;

pub use crate::parameters::common::AUTOSTART;
pub use crate::process::lifecycle_states::LifecycleState;

use crate::endpoints::error::NodeError;
use crate::endpoints::node::Handle;
use crate::endpoints::publisher::Publisher;
use crate::managed::diagnostics::{Health, HealthLevel};
use crate::process::lifecycle_states::{self, Transition, TransitionOutcome, ended, requested};
use crate::process::shutdown::NodeResult;
use cnc_msgs::wire::lifecycle_msgs::msg as wire;
use std::future::{Future, ready};
use std::sync::Arc;
use tokio::sync::{Mutex, watch};

/// Under this name the state is kept, where the node has a memory.
const KEPT_STATE: &str = "lifecycle";

/// The outcome of a step: done, or why not.
pub type TransitionResult = Result<(), Trouble>;

/// Why a step was not done.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Trouble {
    /// Nothing has changed; the node stays in its previous state.
    #[error("{0}")]
    Failure(String),
    /// It is half done, and the node cannot continue.
    #[error("{0}")]
    Error(String),
}

impl Trouble {
    /// Nothing has changed, for this reason.
    pub fn failure(reason: impl std::fmt::Display) -> Self {
        Self::Failure(reason.to_string())
    }
}

/// What a node does at each transition.
///
/// One step runs at a time. A step that panics stops the node.
pub trait Managed: Send + Sync + 'static {
    /// Opens the resources of the node, without using them yet.
    fn configure(&self) -> impl Future<Output = TransitionResult> + Send {
        ready(Ok(()))
    }

    /// Starts to serve requests.
    fn activate(&self) -> impl Future<Output = TransitionResult> + Send {
        ready(Ok(()))
    }

    /// Ends running work and accepts no more.
    fn deactivate(&self) -> impl Future<Output = TransitionResult> + Send {
        ready(Ok(()))
    }

    /// Releases what `configure` opened.
    fn cleanup(&self) -> impl Future<Output = TransitionResult> + Send {
        ready(Ok(()))
    }

    /// Ends everything, from any state; the process ends afterwards.
    fn shutdown(&self) -> impl Future<Output = TransitionResult> + Send {
        ready(Ok(()))
    }

    /// Continues in the state of the previous process; see [`crate::Memory`].
    /// What the state needs exists already.
    fn go_on(&self, state: LifecycleState) -> impl Future<Output = TransitionResult> + Send {
        let _ = state;
        ready(Ok(()))
    }

    /// The health of the node's parts; called once a second.
    fn health(&self) -> Vec<Health> {
        Vec::new()
    }
}

impl<M: Managed> Managed for Arc<M> {
    fn configure(&self) -> impl Future<Output = TransitionResult> + Send {
        (**self).configure()
    }

    fn activate(&self) -> impl Future<Output = TransitionResult> + Send {
        (**self).activate()
    }

    fn deactivate(&self) -> impl Future<Output = TransitionResult> + Send {
        (**self).deactivate()
    }

    fn cleanup(&self) -> impl Future<Output = TransitionResult> + Send {
        (**self).cleanup()
    }

    fn shutdown(&self) -> impl Future<Output = TransitionResult> + Send {
        (**self).shutdown()
    }

    fn go_on(&self, state: LifecycleState) -> impl Future<Output = TransitionResult> + Send {
        (**self).go_on(state)
    }

    fn health(&self) -> Vec<Health> {
        (**self).health()
    }
}

impl Handle {
    /// The node's state; `None` when it is not managed.
    pub fn lifecycle_state(&self) -> Option<LifecycleState> {
        *self.inner.lifecycle.borrow()
    }

    /// Receives every later change of the node's state.
    pub fn lifecycle_changes(&self) -> watch::Receiver<Option<LifecycleState>> {
        self.inner.lifecycle.subscribe()
    }

    /// Whether the node serves requests.
    ///
    /// # Errors
    /// It is managed and not active; with what to do about that.
    pub fn require_active(&self) -> Result<(), String> {
        match self.lifecycle_state() {
            None | Some(LifecycleState::Active) => Ok(()),
            Some(state) => {
                let (node, full) = (self.names().node(), self.names().fully_qualified());
                let label = state.label();
                let help = match state {
                    LifecycleState::Unconfigured => {
                        format!("lifecycle set {full} configure, then activate")
                    }
                    LifecycleState::Inactive => format!("lifecycle set {full} activate"),
                    LifecycleState::Configuring | LifecycleState::Activating => {
                        "it starts: ask again in a moment".to_owned()
                    }
                    _ => return Err(format!("{node} is {label}, not active")),
                };
                Err(format!("{node} is {label}, not active: {help}"))
            }
        }
    }
}

/// A node that waits to be activated does nothing, but looks as if it ran.
fn health(state: LifecycleState) -> Health {
    let level = match state {
        LifecycleState::Active => HealthLevel::Ok,
        _ => HealthLevel::Warn,
    };
    let message = state.label().to_owned();
    Health { component: "lifecycle".into(), level, message, ..Health::default() }
}

/// A managed node while it lives.
pub(crate) struct Lifecycle<M> {
    node: Handle,
    managed: M,
    events: Publisher<wire::TransitionEvent>,
    /// Held for a whole step: requests wait for each other.
    step: Mutex<()>,
}

/// Offers the services, makes the node active if it is asked to, and finalizes
/// it when it is time to stop.
///
/// # Errors
/// An endpoint cannot be made, or the node could not make itself active.
pub(crate) async fn live<M: Managed>(node: &Handle, managed: M) -> NodeResult {
    let lifecycle = Lifecycle::offer(node, managed)?;
    let started = tokio::select! {
        started = lifecycle.start() => started,
        () = node.shutdown().requested() => Ok(()),
    };
    if started.is_ok() {
        node.shutdown().requested().await;
    }
    lifecycle.finalize().await;
    if let (Some(memory), Err(_)) = (node.memory(), &started) {
        // The next process starts from the beginning.
        memory.forget(KEPT_STATE);
    }
    started
}

impl<M: Managed> Lifecycle<M> {
    fn offer(node: &Handle, managed: M) -> Result<Arc<Self>, NodeError> {
        node.inner.lifecycle.send_replace(Some(LifecycleState::Unconfigured));
        let events = services::events(node)?;
        let lifecycle =
            Arc::new(Self { node: node.clone(), managed, events, step: Mutex::new(()) });
        services::offer(node, &lifecycle)?;
        let shared = Arc::clone(&lifecycle);
        node.diagnostics(move || {
            let mut parts = shared.managed.health();
            parts.push(health(shared.state()));
            parts
        })?;
        Ok(lifecycle)
    }

    /// Continues in the state of the previous process; else activates the node, with `autostart`.
    async fn start(&self) -> NodeResult {
        if let Some(state) = self.state_before() {
            let _alone = self.step.lock().await;
            self.node.inner.lifecycle.send_replace(Some(state));
            tracing::info!("{}, as before", state.label());
            if state == LifecycleState::Finalized {
                self.node.shutdown().request("it was shut down");
                return Ok(());
            }
            return Ok(self.managed.go_on(state).await?);
        }
        if !self.node.parameter::<bool>(AUTOSTART) {
            tracing::info!(
                "unconfigured: {AUTOSTART} is false, so others configure and activate it"
            );
            return Ok(());
        }
        for label in ["configure", "activate"] {
            self.request(0, label).await.map_err(|reason| format!("{label}: {reason}"))?;
        }
        Ok(())
    }

    /// Runs a transition to its end.
    ///
    /// # Errors
    /// There is no such transition from here, or it failed.
    async fn request(&self, id: u8, label: &str) -> Result<(), String> {
        let _alone = self.step.lock().await;
        let transition = requested(self.state(), id, label)?;
        self.go(transition).await
    }

    /// Finalizes the node. Waits for a step that is running; a step that was cut off does not
    /// prevent it.
    async fn finalize(&self) {
        let _alone = self.step.lock().await;
        let state = self.state();
        if state == LifecycleState::Finalized {
            return;
        }
        if let Ok(transition) = requested(state, 0, "shutdown") {
            // The reason is in the log.
            let _ = self.go(transition).await;
            return;
        }
        if let Err(trouble) = self.managed.shutdown().await {
            tracing::error!("shutdown: {trouble}");
        }
        if state != LifecycleState::ErrorProcessing {
            self.take(ended(state, TransitionOutcome::Error));
        }
        self.take(ended(LifecycleState::ErrorProcessing, TransitionOutcome::Failure));
    }

    async fn go(&self, transition: Transition) -> Result<(), String> {
        self.take(transition);
        let went = match transition.goal {
            LifecycleState::Configuring => self.managed.configure().await,
            LifecycleState::Activating => self.managed.activate().await,
            LifecycleState::Deactivating => self.managed.deactivate().await,
            LifecycleState::CleaningUp => self.managed.cleanup().await,
            _ => self.managed.shutdown().await,
        };
        let outcome = match &went {
            Ok(()) => TransitionOutcome::Success,
            Err(Trouble::Failure(_)) => TransitionOutcome::Failure,
            Err(Trouble::Error(_)) => TransitionOutcome::Error,
        };
        if let Err(trouble) = &went {
            tracing::error!("{} failed: {trouble}", transition.label);
        }
        self.take(ended(transition.goal, outcome));
        if self.state() == LifecycleState::ErrorProcessing {
            // Only a new process recovers from a step that is half done.
            self.take(ended(LifecycleState::ErrorProcessing, TransitionOutcome::Failure));
            self.node.shutdown().fail(&format!("{} failed", transition.label));
        }
        if self.state() == LifecycleState::Finalized {
            self.node.shutdown().request("it was shut down");
        }
        went.map_err(|trouble| trouble.to_string())
    }

    /// The last lasting state of the previous process.
    fn state_before(&self) -> Option<LifecycleState> {
        let kept = self.node.memory()?.get(KEPT_STATE)?;
        let [id] = kept.as_slice() else { return None };
        lifecycle_states::STATES
            .into_iter()
            .find(|state| state.id() == *id && !state.is_transitional())
    }

    fn state(&self) -> LifecycleState {
        self.node.lifecycle_state().unwrap_or(LifecycleState::Unknown)
    }

    fn take(&self, transition: Transition) {
        self.node.inner.lifecycle.send_replace(Some(transition.goal));
        if !transition.goal.is_transitional() {
            tracing::info!("{}", transition.goal.label());
        }
        let kept = match transition.goal {
            // If the process ends during this transition, the next one does not activate the node.
            LifecycleState::Deactivating => Some(LifecycleState::Inactive),
            state => (!state.is_transitional()).then_some(state),
        };
        if let (Some(memory), Some(state)) = (self.node.memory(), kept) {
            memory.keep(KEPT_STATE, vec![state.id()]);
        }
        self.events.publish(services::event(self.node.now(), transition));
    }
}
