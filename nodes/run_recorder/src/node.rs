//! The ROS shell of the recorder: one bag for each run, automatically.
//!
//! Subscribes to the bytes of every topic of its machine when it is discovered.
//! While a goal of `run_program` is active, and a little longer, all messages are
//! written. Between runs only latched and very recent messages are kept.

mod definitions;
mod fetch;
mod fleet;
mod goals;
mod health;
mod inputs;
mod lifecycle;
mod numbers;
mod parameters;
mod prelude;
mod remove_old_bags;
mod run_id;
mod store;
mod watch;

use cnc_msgs::wire::cnc_msgs::msg::Recording;
use fetch::Sources;
use runtime::{Declared, DiscoveredPublisher, Handle, Publisher, Qos, RawSample};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use store::{OpenRun, Store};
use tokio::task::JoinError;
use watch::RunWatch;

/// How often the graph is searched for new topics.
const DISCOVERY_PERIOD: Duration = Duration::from_millis(100);
/// How long messages still belong to a run that has ended.
const TAIL: Duration = Duration::from_millis(700);
/// How much longer a run is recorded while the machine may still move, as after the line is
/// cut, and how often that is checked.
const MOTION_WITHIN: Duration = Duration::from_secs(30);
const MOTION_PERIOD: Duration = Duration::from_millis(100);
/// How long fetching the inputs may take after the end of a run.
const INPUTS_WITHIN: Duration = Duration::from_secs(30);
/// How long the disk may take for the beginning of a bag, and how often that is checked.
const BEGUN_WITHIN: Duration = Duration::from_secs(4);
const BEGUN_PERIOD: Duration = Duration::from_millis(5);
/// How long closing a bag may take.
const CLOSE_WITHIN: Duration = Duration::from_secs(20);

/// Runs the node until it is asked to stop.
pub fn main(args: Vec<String>) -> ExitCode {
    runtime::run_managed("run_recorder", parameters(), &args, start)
}

/// The node's parameters.
pub fn parameters() -> Vec<Declared> {
    parameters::declared()
}

async fn start(node: Handle) -> Result<lifecycle::Shell, runtime::Error> {
    parameters::guard(&node);
    let recorder = Arc::new(Recorder {
        node: node.clone(),
        goals: node.names().resolve("run_program/_action/status")?,
        extra_topics: node.parameter("extra_topics"),
        includes_feedback: node.parameter("include_action_feedback"),
        sources: Sources::new(&node)?,
        recording: node.publisher("recording", Qos::LATCHED)?,
        newest: Mutex::default(),
        stuck: Mutex::default(),
        removal_lock: Mutex::default(),
        pushes: fleet::FleetPushes::default(),
        state: Mutex::default(),
    });
    recorder.publish(Recording::default());

    let shared = Arc::clone(&recorder);
    node.spawn("discovery", async move {
        loop {
            // Making an endpoint may have to wait for the DDS layer.
            let seeking = Arc::clone(&shared);
            let sought = tokio::task::spawn_blocking(move || seeking.subscribe_new_topics()).await;
            match sought.map_err(JoinError::try_into_panic) {
                Ok(()) => tokio::time::sleep(DISCOVERY_PERIOD).await,
                Err(Ok(panic)) => std::panic::resume_unwind(panic),
                Err(Err(_)) => return,
            }
        }
    });
    let shared = Arc::clone(&recorder);
    node.spawn("recording", async move {
        loop {
            tokio::time::sleep(Duration::from_secs(1)).await;
            shared.publish_progress();
        }
    });
    let (shared, mut changes) = (Arc::clone(&recorder), node.parameter_changes());
    node.spawn("fleet store", async move {
        let mut store: String = shared.node.parameter("fleet_store");
        loop {
            let changed = tokio::time::timeout(fleet::TRY_AGAIN_AFTER, changes.changed()).await;
            match changed {
                Ok(Err(_)) => return,
                Err(_) if shared.pushes.has_problem() => shared.push_to_fleet(),
                _ => {}
            }
            let now: String = shared.node.parameter("fleet_store");
            if store != now {
                store = now;
                shared.push_to_fleet();
            }
        }
    });
    Ok(lifecycle::Shell(recorder))
}

struct Recorder {
    node: Handle,
    /// The status topic of `run_program`. It has only one reader, as any other topic: with
    /// security, a second reader made during the handshake of the first leaves both deaf.
    goals: String,
    extra_topics: Vec<String>,
    includes_feedback: bool,
    sources: Sources,
    recording: Publisher<Recording>,
    /// The newest published status.
    newest: Mutex<Recording>,
    /// Bags that could not be removed, a sentence each.
    stuck: Mutex<Vec<String>>,
    /// Held while bags are removed.
    removal_lock: Mutex<()>,
    pushes: fleet::FleetPushes,
    state: Mutex<RecorderState>,
}

#[derive(Default)]
struct RecorderState {
    store: Store,
    watch: RunWatch,
    open: Option<OpenRun>,
    /// Counts the runs, so that a late end of one does not close the bag of the next.
    run: u64,
}

impl RecorderState {
    /// Whether the inputs of this run are still being fetched.
    fn is_fetching(&self, run: u64) -> bool {
        self.run == run && self.open.as_ref().is_some_and(|open| !open.has_inputs)
    }
}

impl Recorder {
    fn state(&self) -> MutexGuard<'_, RecorderState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn directory(&self) -> PathBuf {
        parameters::directory(&self.node)
    }

    /// Whether a topic is one of this machine, or one of `extra_topics`.
    fn is_in_scope(&self, topic: &str) -> bool {
        let namespace = self.node.names().namespace();
        namespace == "/"
            || topic.strip_prefix(namespace).is_some_and(|rest| rest.starts_with('/'))
            || self.extra_topics.iter().any(|extra| extra == topic)
    }

    /// Whether a publisher's topic is recorded.
    ///
    /// The feedback of actions has a type that other bag readers cannot handle, and its
    /// content is in other topics too.
    fn is_wanted(&self, found: &DiscoveredPublisher) -> bool {
        let is_feedback = found.type_name.ends_with("_FeedbackMessage");
        self.is_in_scope(&found.topic) && (self.includes_feedback || !is_feedback)
    }

    fn subscribe_new_topics(self: &Arc<Self>) {
        let publishers = self.node.discovered_publishers();
        for publisher in publishers.iter().filter(|found| self.is_wanted(found)) {
            let mut state = self.state();
            if state.store.knows(&publisher.topic) {
                continue;
            }
            let offers: Vec<_> =
                publishers.iter().filter(|other| other.topic == publisher.topic).collect();
            let spec = definitions::channel(&publisher.topic, &publisher.type_name, &offers);
            let qos = Qos {
                // Only QoS that all publishers offer, or some would not match.
                reliable: offers.iter().all(|offer| offer.qos.reliable),
                transient_local: offers.iter().all(|offer| offer.qos.transient_local),
                depth: definitions::depth(&spec),
            };
            let index = state.store.add(spec, qos.transient_local);
            let RecorderState { store, open, .. } = &mut *state;
            if let Some(open) = open {
                open.add_channel(store, index);
            }
            drop(state);
            let subscription =
                self.node.raw_subscription(&publisher.topic, &publisher.type_name, qos);
            match subscription {
                Err(error) => tracing::error!("{} is not recorded: {error}", publisher.topic),
                Ok(mut subscription) => {
                    let shared = Arc::clone(self);
                    let is_goals = publisher.topic == self.goals;
                    let since = self.node.now();
                    self.node.spawn(&publisher.topic, async move {
                        if is_goals {
                            let newest = shared.keep_newest(index, &mut subscription).await;
                            shared.follow(&newest, Some(since));
                        }
                        loop {
                            let sample = subscription.next().await;
                            if is_goals {
                                let status = sample.bytes.clone();
                                shared.keep(index, sample);
                                shared.follow(&status, None);
                            } else {
                                shared.keep(index, sample);
                            }
                        }
                    });
                }
            }
        }
    }

    fn keep(&self, index: usize, sample: RawSample) {
        let mut state = self.state();
        let RecorderState { store, open, .. } = &mut *state;
        store.take(open.as_mut(), index, sample);
    }

    /// Begins the bag of a goal; `is_late`: the goal began before it was noticed.
    fn begin(self: &Arc<Self>, goal: [u8; 16], is_late: bool) {
        let mut state = self.state();
        // Both a new goal and the activation of the node begin a bag.
        if state.open.as_ref().is_some_and(|open| open.goal == goal) {
            return;
        }
        state.run += 1;
        let before = state.open.take();
        let wanted = state.store.wanted();
        let opened = self.node.require_active().and_then(|()| {
            let (now, split) = (self.node.now(), parameters::split(&self.node));
            OpenRun::create(&self.directory(), now, goal, &wanted, split, &mut state.store)
                .map_err(|error| error.to_string())
        });
        match opened {
            Ok(mut open) => {
                open.is_beginning_unclear = is_late;
                tracing::info!("recording to {}", open.bag.path().display());
                state.open = Some(open);
                let run = state.run;
                drop(state);
                let shared = Arc::clone(self);
                self.node.spawn("inputs of the run", async move {
                    shared.judge_beginning(run).await;
                    shared.report_beginning(run).await;
                    shared.fetch_inputs(run, wanted).await;
                });
            }
            Err(reason) => {
                drop(state);
                tracing::error!("the run is not recorded: {reason}");
                let now = self.node.now();
                self.publish(Recording {
                    run_id: run_id::run_id(now, goal),
                    reason,
                    stamp: now.into(),
                    ..Recording::default()
                });
            }
        }
        if let Some(before) = before {
            let shared = Arc::clone(self);
            self.node.spawn("bag of the run before", async move { shared.finish(before).await });
        }
    }

    /// Publishes whether the recording works, when the disk has taken the beginning of the bag
    /// or failed. The driver waits for this before it begins.
    async fn report_beginning(&self, run: u64) {
        let end = tokio::time::Instant::now() + BEGUN_WITHIN;
        loop {
            let is_decided = {
                let state = self.state();
                let open = state.open.as_ref().filter(|_| state.run == run);
                open.is_none_or(OpenRun::is_decided)
            };
            if is_decided || tokio::time::Instant::now() >= end {
                break;
            }
            tokio::time::sleep(BEGUN_PERIOD).await;
        }
        self.publish_progress();
    }

    fn end(self: &Arc<Self>) {
        let run = self.state().run;
        let shared = Arc::clone(self);
        self.node.spawn("end of the run", async move {
            shared.wait_for_standstill(run).await;
            tokio::time::sleep(TAIL).await;
            // A run may be shorter than fetching its inputs.
            let end = tokio::time::Instant::now() + INPUTS_WITHIN;
            while shared.state().is_fetching(run) && tokio::time::Instant::now() < end {
                tokio::time::sleep(DISCOVERY_PERIOD).await;
            }
            let open = {
                let mut state = shared.state();
                if state.run == run { state.open.take() } else { None }
            };
            if let Some(open) = open {
                shared.finish(open).await;
            }
        });
    }

    /// Waits after the end of a goal while the machine may still move.
    async fn wait_for_standstill(&self, run: u64) {
        let end = tokio::time::Instant::now() + MOTION_WITHIN;
        loop {
            let may_move = {
                let state = self.state();
                state.run == run && state.store.motion_possible()
            };
            if !may_move {
                return;
            }
            if tokio::time::Instant::now() >= end {
                let seconds = MOTION_WITHIN.as_secs();
                tracing::warn!("the machine may still be moving, {seconds} s after the run's end");
                return;
            }
            tokio::time::sleep(MOTION_PERIOD).await;
        }
    }

    /// Fetches what is missing, closes the bag and logs the outcome.
    async fn finish(self: &Arc<Self>, mut open: OpenRun) {
        let problem = if open.driver_restarted {
            // A restarted driver no longer has the old traffic.
            Some("the driver that sent it is gone".to_owned())
        } else {
            self.fetch_rest(&mut open).await
        };
        open.note_gaps(problem);
        let run_id = open.run_id.clone();
        let stamp = self.node.now().into();
        let closed = tokio::task::spawn_blocking(move || open.bag.finish(CLOSE_WITHIN)).await;
        let Ok(status) = closed else {
            tracing::error!("closing the bag of {run_id} failed");
            return;
        };
        if status.complete {
            tracing::info!("{} is complete", status.path.display());
        } else {
            tracing::error!("{}: {}", status.path.display(), status.reasons.join("; "));
        }
        self.publish(store::recording_message(stamp, run_id, false, &status));
        self.spawn_removal_of_old_bags();
        self.push_to_fleet();
    }

    fn publish_progress(&self) {
        let now = self.node.now();
        self.publish_what(|| {
            let state = self.state();
            state.open.as_ref().filter(|open| open.is_decided()).map(|open| open.message(now))
        });
    }

    fn health(&self) -> runtime::Health {
        health::health(&self.newest.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn publish(&self, message: Recording) {
        self.publish_what(|| Some(message));
    }

    /// Makes and publishes the status under one lock, so that the kept status is always the one
    /// that was published last.
    fn publish_what(&self, what: impl FnOnce() -> Option<Recording>) {
        let mut newest = self.newest.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(message) = what() {
            newest.clone_from(&message);
            self.recording.publish(message);
        }
    }
}
