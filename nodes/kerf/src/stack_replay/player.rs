//! The player of a replay: waits for the place of each command and gives it.
//!
//! Plumbing, like the conductor. Every wait ends when nothing has changed for [`STILL`]; the error
//! says what was awaited and where the stack was.

use super::gate::{Gate, Machine};
use super::place::Stand;
use super::script::{Act, Cue, When};
use crate::exit::{Failure, Status};
use cnc_msgs::convert::mode_from_wire;
use cnc_msgs::wire::cnc_msgs::action::{RunProgram, RunProgramResult};
use cnc_msgs::wire::cnc_msgs::msg::MachineState;
use cnc_msgs::wire::cnc_msgs::srv::{SetOverrides, SetOverridesRequest, SetTool};
use cnc_msgs::wire::std_srvs::srv::{SetBool, SetBoolRequest, Trigger, TriggerRequest};
use runtime::action::{GoalError, GoalHandle, GoalOutcome};
use runtime::{Client, Handle, Subscription};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep, timeout};

/// A run without any change for this long is stuck.
const STILL: Duration = Duration::from_secs(60);
/// How long planning the rest of a run may take.
const PLAN_WITHIN: Duration = Duration::from_secs(300);
/// How long the driver may take to report the state of a machine whose time stands still.
const REPORTED_WITHIN: Duration = Duration::from_secs(20);
/// How often the position of the machine is checked.
const LOOK: Duration = Duration::from_millis(5);

/// The driver's states, collected as they arrive.
#[derive(Debug, Clone, Default)]
pub(super) struct Seen(Arc<Mutex<DriverStates>>);

#[derive(Debug, Default)]
struct DriverStates {
    last: Option<MachineState>,
    count: u64,
    /// Revisions since the goal, one for each change.
    revisions: Vec<u64>,
}

impl Seen {
    pub(super) fn follow(node: &Handle, mut states: Subscription<MachineState>) -> Self {
        let seen = Self::default();
        let shared = seen.clone();
        node.spawn("states of the replay", async move {
            loop {
                let (state, _) = states.next().await;
                let mut known = shared.lock();
                if state.path_revision > 0 {
                    known.revisions.push(state.path_revision);
                    known.revisions.dedup();
                }
                known.count += 1;
                known.last = Some(state);
            }
        });
        seen
    }

    fn lock(&self) -> MutexGuard<'_, DriverStates> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn begin(&self) {
        self.lock().revisions.clear();
    }

    pub(super) fn last(&self) -> Option<MachineState> {
        self.lock().last.clone()
    }

    fn count(&self) -> u64 {
        self.lock().count
    }

    fn paths(&self) -> usize {
        self.lock().revisions.len()
    }
}

/// Gives commands at their time.
pub(super) struct Player<'a> {
    node: &'a Handle,
    gate: &'a Gate,
    pub(super) seen: Seen,
    clients: BTreeMap<&'static str, Client<Trigger>>,
}

/// The end of a run, in its own task.
pub(super) type Ending = JoinHandle<Result<(GoalOutcome, RunProgramResult), GoalError>>;

impl<'a> Player<'a> {
    pub(super) fn new(node: &'a Handle, gate: &'a Gate, seen: Seen) -> Self {
        Self { node, gate, seen, clients: BTreeMap::new() }
    }

    /// Waits for a cue and gives its command; `false` if its place was not reached.
    pub(super) async fn give(
        &mut self,
        cue: &Cue,
        goal: &GoalHandle<RunProgram>,
        ending: &Ending,
    ) -> Result<bool, Failure> {
        let what = format!("{} (line {})", cue.act.name(), cue.line);
        let gate = self.gate.clone();
        match &cue.when {
            When::Moving(watch) => {
                gate.arm(watch.clone());
                self.until(&what, || gate.machine().is_due || ending.is_finished()).await?;
                if !gate.machine().is_due {
                    gate.release();
                    return Ok(false);
                }
                // Time stands still: give the driver time to learn where the machine is.
                let old = self.seen.count();
                let is_reported = async {
                    while self.seen.count() < old + 2
                        || self.seen.last().is_none_or(|it| it.state != watch.state)
                    {
                        sleep(LOOK).await;
                    }
                };
                if timeout(REPORTED_WITHIN, is_reported).await.is_err() {
                    eprintln!("kerf: {what}: the driver reports another state of the machine");
                }
            }
            When::Standing(stand) => {
                // States from before the last command do not count.
                let old = self.seen.count();
                self.until(&what, || {
                    self.stands(stand, old, gate.machine()) || ending.is_finished()
                })
                .await?;
                if !self.stands(stand, old, gate.machine()) {
                    return Ok(false);
                }
            }
        }
        let given = self.act(&cue.act, goal).await;
        if given.is_ok() && cue.stops() {
            // A cancel is answered before its byte is sent, and that byte lets time continue.
            let has_come = async {
                while gate.machine().is_due {
                    sleep(LOOK).await;
                }
            };
            // If the driver accepted but sent nothing, the comparison will find it.
            let _ = timeout(REPORTED_WITHIN, has_come).await;
        }
        gate.release();
        if let Err(Failure { status: Status::NodeRefused, message }) = &given {
            eprintln!("kerf: {what} is refused: {message}");
            return Ok(true);
        }
        eprintln!("kerf: {what}");
        given.map(|()| true)
    }

    fn stands(&self, wanted: &Stand, old: u64, machine: Machine) -> bool {
        let Some(last) = self.seen.last().filter(|_| self.seen.count() > old) else { return false };
        let seen = Stand {
            state: last.state,
            tool_wanted: last.tool_wanted,
            answers: machine.answers,
            paths: self.seen.paths(),
        };
        wanted.is_reached(&seen, machine.speed_mm_per_min)
    }

    pub(super) async fn until(
        &self,
        what: &str,
        is_there: impl Fn() -> bool,
    ) -> Result<(), Failure> {
        until(what, STILL, &self.seen, self.gate, is_there).await
    }

    async fn act(&mut self, act: &Act, goal: &GoalHandle<RunProgram>) -> Result<(), Failure> {
        match act {
            Act::CancelGoal => goal.cancel().await.map(|_| ()).map_err(Failure::from),
            Act::SetOverrides(wanted) => {
                let bit = |value: Option<u8>, bit: u8| value.map_or(0, |_| bit);
                let ratio = |value: Option<u8>| f64::from(value.unwrap_or(100)) / 100.0;
                let request = SetOverridesRequest {
                    which: bit(wanted.feed, 1) | bit(wanted.rapid, 2) | bit(wanted.spindle, 4),
                    feed: ratio(wanted.feed),
                    rapid: ratio(wanted.rapid),
                    spindle: ratio(wanted.spindle),
                };
                let client = self.node.client::<SetOverrides>(act.name())?;
                let answer = client.call(request).await?;
                said(answer.success, answer.message)
            }
            Act::SetTool(request) => {
                let client = self.node.client::<SetTool>(act.name())?;
                let answer = client.call_within(request.clone(), PLAN_WITHIN).await?;
                said(answer.success, answer.message)
            }
            Act::SetSingleBlock(on) => self.single_block(*on).await,
            Act::FeedHold
            | Act::DoorHold
            | Act::Resume
            | Act::SoftReset
            | Act::ConfirmToolChange
            | Act::Cancel => {
                let name = act.name();
                let client = match self.clients.get(name) {
                    Some(client) => client.clone(),
                    None => {
                        let client = self.node.client::<Trigger>(name)?;
                        self.clients.insert(name, client.clone());
                        client
                    }
                };
                let answer = client.call(TriggerRequest::default()).await?;
                said(answer.success, answer.message)
            }
        }
    }

    pub(super) async fn single_block(&self, on: bool) -> Result<(), Failure> {
        let client = self.node.client::<SetBool>("single_block")?;
        let answer = client.call(SetBoolRequest { data: on }).await?;
        said(answer.success, answer.message)
    }
}

fn said(success: bool, message: String) -> Result<(), Failure> {
    if success { Ok(()) } else { Err(Failure::new(Status::NodeRefused, message)) }
}

/// Waits until a condition holds, as long as anything still changes.
pub(super) async fn until(
    what: &str,
    still: Duration,
    seen: &Seen,
    gate: &Gate,
    is_there: impl Fn() -> bool,
) -> Result<(), Failure> {
    let now = || {
        let Machine { answers, position, is_due, .. } = gate.machine();
        let state = seen.last().map(|it| (it.state, it.tool_wanted, it.line));
        (answers, position.map(f64::to_bits), is_due, state, seen.paths())
    };
    let mut last = (now(), Instant::now());
    while !is_there() {
        sleep(LOOK).await;
        let now = now();
        if now != last.0 {
            last = (now, Instant::now());
        } else if last.1.elapsed() > still {
            return Err(Failure::new(Status::NoAnswer, stuck(what, still, seen, gate)));
        }
    }
    Ok(())
}

fn stuck(what: &str, still: Duration, seen: &Seen, gate: &Gate) -> String {
    let Machine { answers, position: [x, y, z], .. } = gate.machine();
    let state = match seen.last() {
        None => "no machine_state was received".to_owned(),
        Some(MachineState { state, reason, line, .. }) => {
            format!("{} {reason} at line {line}", mode_from_wire(state).name())
        }
    };
    format!(
        "waited for {what}, but nothing changed for {} s: {state}; {answers} lines \
         answered, machine at X{x:.3} Y{y:.3} Z{z:.3}",
        still.as_secs()
    )
}
