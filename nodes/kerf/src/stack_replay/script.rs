//! What is done to the stack, and when: the commands of a recorded run as cues.
//!
//! Each command is due where the stack was when it came, see `place`. What cannot be played is
//! rejected by name before anything is started. Pure.

use super::place::{Position, SLACK_ANSWERS, Stand, Watch, WatchPlace};
use super::run::{Event, Happened, RunHistory};
use super::track::{REPORT_MM, Track};
use axis_driver::driver::{COMMANDER_LOST, Command, Overrides, PATH_DEVIATION};
use axis_driver::encoder::PREAMBLE;
use axis_driver::link::realtime::{FEED_HOLD, RESUME, SOFT_RESET};
use axis_driver::report::{ControllerState, Report, StatusReport};
use cnc_msgs::cdr::{self, LITTLE_ENDIAN};
use cnc_msgs::convert::mode_from_wire;
use cnc_msgs::interface::Service;
use cnc_msgs::units::position_from_point;
use cnc_msgs::wire::cnc_msgs::msg::MachineState;
use cnc_msgs::wire::cnc_msgs::srv::{SetTool, SetToolRequest};
use replay::ReplayError;
use replay::recording::{Recording, nanoseconds};
use std::sync::Arc;

/// Something that a commander did.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Act {
    FeedHold,
    DoorHold,
    Resume,
    SoftReset,
    ConfirmToolChange,
    /// Cancels the goal, as an action client does.
    CancelGoal,
    /// Cancels any motion, by the service.
    Cancel,
    SetOverrides(Overrides),
    SetSingleBlock(bool),
    SetTool(SetToolRequest),
}

impl Act {
    /// The service or action that it uses.
    pub(super) const fn name(&self) -> &'static str {
        match self {
            Self::FeedHold => "feed_hold",
            Self::DoorHold => "door_hold",
            Self::Resume => "resume",
            Self::SoftReset => "soft_reset",
            Self::ConfirmToolChange => "confirm_tool_change",
            Self::CancelGoal => "cancel of run_program",
            Self::Cancel => "cancel",
            Self::SetOverrides(_) => "set_overrides",
            Self::SetSingleBlock(_) => "single_block",
            Self::SetTool(_) => "set_tool",
        }
    }
}

/// When it is done.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum When {
    /// When the machine reaches a place.
    Moving(Watch),
    /// When the machine stands in a state.
    Standing(Stand),
}

/// One entry of the script.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cue {
    pub(super) act: Act,
    pub(super) when: When,
    /// The source line that was being cut.
    pub(super) line: u32,
}

impl When {
    /// For people: the place or the state of the stack.
    pub(super) fn text(&self) -> String {
        let xyz = |[x, y, z]: Position| format!("X{x:.3} Y{y:.3} Z{z:.3}");
        match self {
            Self::Moving(Watch { place, along_mm, answers, .. }) => {
                let place = match place {
                    WatchPlace::StopsAt(place) => format!("to stop at {}", xyz(*place)),
                    WatchPlace::Passes(place) => format!("at {}", xyz(*place)),
                };
                let along =
                    along_mm.map_or(String::new(), |mm| format!(", {mm:.3} mm along its path"));
                format!("{place} (machine){along}, after {answers} lines")
            }
            Self::Standing(Stand { state, tool_wanted, answers, .. }) => {
                let tool =
                    if *tool_wanted > 0 { format!(" for T{tool_wanted}") } else { String::new() };
                format!("in {}{tool}, after {answers} lines", mode_from_wire(*state).name())
            }
        }
    }
}

impl Cue {
    /// Whether the machine is stopped at the place.
    pub(super) fn stops(&self) -> bool {
        matches!(&self.when, When::Moving(watch) if matches!(watch.place, WatchPlace::StopsAt(_)))
    }
}

/// What is done, and the path of the machine at the start.
#[derive(Debug)]
pub(super) struct Script {
    pub(super) cues: Vec<Cue>,
    pub(super) track: Arc<Track>,
}

/// The script of a run.
///
/// # Errors
/// Something happened that the stack level does not play; the error names it.
pub(super) fn script(recording: &Recording, run: &RunHistory<'_>) -> Result<Script, ReplayError> {
    let end_ns = run.ended_ns().unwrap_or(i64::MAX);
    let mut asked = Vec::new();
    for (index, event) in run.events.iter().enumerate() {
        if event.stamp_ns > end_ns {
            break;
        }
        if let Some(what) = unplayable(run, index) {
            let line = run.state_at(event.stamp_ns).map_or(0, |state| state.line);
            let after_s = (event.stamp_ns - run.began_ns) as f64 / 1e9;
            return Err(ReplayError::Unplayable {
                what: format!("{what} at line {line}, {after_s:.3} s after the goal"),
            });
        }
        if let Happened::Asked(command) = &event.what
            && let Some(act) = act(command)
        {
            asked.push((event.stamp_ns, index, act));
        }
    }
    for (at_ns, state) in &run.states {
        for (word, what) in [
            (COMMANDER_LOST, "a lost commander"),
            ("LINK_LOST", "a lost link"),
            (PATH_DEVIATION, "a deviation from the path"),
        ] {
            if *at_ns <= end_ns && state.reason.starts_with(word) {
                let line = state.line;
                return Err(ReplayError::Unplayable { what: format!("{what} at line {line}") });
            }
        }
    }
    // The time of the last `set_tool`.
    let mut set_ns = run.began_ns;
    for command in &recording.commands {
        let stamp_ns = nanoseconds(&command.stamp);
        let is_meant = command.endpoint_type == SetTool::TYPE_NAME && command.success;
        if is_meant && (run.began_ns..=end_ns).contains(&stamp_ns) {
            let request = decode_request(&command.request)
                .map_err(|error| ReplayError::request(command, error))?;
            let (came_ns, index) = before_its_rest(&run.events, set_ns, stamp_ns);
            asked.push((came_ns, index, Act::SetTool(request)));
            set_ns = stamp_ns;
        }
    }
    asked.sort_by_key(|(stamp_ns, index, _)| (*stamp_ns, *index));
    let mut progress = PathProgress::begin(run)?;
    let track = Arc::clone(&progress.track);
    let mut cues: Vec<Cue> = Vec::new();
    for (stamp_ns, index, act) in asked {
        let is_after_motion = cues.last().is_some_and(|it| matches!(it.when, When::Moving(_)));
        let Some(state) = run.state_at(stamp_ns) else { continue };
        let stops = matches!(act, Act::FeedHold | Act::DoorHold | Act::Cancel | Act::CancelGoal);
        let (before, after) = run.events.split_at(index.min(run.events.len()));
        progress.follow(run, before);
        let when = match place(before, after, stops, progress.offset) {
            Some((mut place, line_ns)) => When::Moving(Watch {
                along_mm: progress.place(run, &mut place, line_ns),
                place,
                track: Arc::clone(&progress.track),
                answers: answers(before),
                state: state.state,
            }),
            None => When::Standing(Stand {
                state: state.state,
                tool_wanted: state.tool_wanted,
                // At a stop, one more or one less answer may have been in transit.
                answers: answers(before).saturating_sub(if is_after_motion {
                    SLACK_ANSWERS
                } else {
                    0
                }),
                paths: run.paths_at(stamp_ns),
            }),
        };
        cues.push(Cue { act, when, line: state.line });
    }
    Ok(Script { cues, track })
}

/// How far along its path the machine was, by its reports.
struct PathProgress {
    track: Arc<Track>,
    start: Position,
    /// Machine position = work position + this, mm.
    offset: Position,
    /// Number of events processed.
    seen: usize,
    known_mm: f64,
    /// From the last report; `None`: it was not on the path.
    along_mm: Option<f64>,
}

impl PathProgress {
    fn begin(run: &RunHistory<'_>) -> Result<Self, ReplayError> {
        let start = start_in_machine(run)?;
        let known = run.states.iter().find(|(_, state)| state.position_known);
        let offset = known.map_or([0.0; 3], |(_, state)| {
            let (machine, work) = (machine_position(state), work_position(state));
            [0, 1, 2].map(|axis| machine[axis] - work[axis])
        });
        let track = Arc::new(Track::new(start, &run.goal.path, offset));
        Ok(Self { track, start, offset, seen: 0, known_mm: 0.0, along_mm: None })
    }

    /// The distance of a command's place along the path. For a stop off the path, with the tool
    /// lifted, it becomes the last reported place of the machine.
    fn place(&self, run: &RunHistory<'_>, place: &mut WatchPlace, reported_ns: i64) -> Option<f64> {
        let (WatchPlace::StopsAt(position) | WatchPlace::Passes(position)) = *place;
        let along_mm = match place {
            WatchPlace::StopsAt(_) => self.on(run, position, reported_ns),
            WatchPlace::Passes(_) => self.along_mm,
        };
        if along_mm.is_none() && self.along_mm.is_some() {
            *place = WatchPlace::Passes(position);
        }
        along_mm.or(self.along_mm)
    }

    /// The distance along the path of a place that was reported at this time.
    fn on(&self, run: &RunHistory<'_>, place: Position, reported_ns: i64) -> Option<f64> {
        self.track.follow(self.known_mm, place, REPORT_MM, run.line_after(reported_ns))
    }

    /// Processes the events up to now.
    fn follow(&mut self, run: &RunHistory<'_>, events: &[Event]) {
        for event in events.get(self.seen..).unwrap_or_default() {
            if let Happened::Asked(Command::Replan(rest)) = &event.what
                && run.states.iter().any(|(_, state)| state.path_revision == rest.revision)
            {
                self.track = Arc::new(Track::new(self.start, &rest.path, self.offset));
            }
            let position = report(event).and_then(|report| position(report, self.offset));
            let Some(position) = position else { continue };
            self.along_mm = self.on(run, position, event.stamp_ns);
            self.known_mm = self.along_mm.unwrap_or(self.known_mm);
        }
        self.seen = self.seen.max(events.len());
    }
}

/// A request as it is in a recording: without its encapsulation.
fn decode_request(body: &[u8]) -> Result<SetToolRequest, cdr::CdrError> {
    cdr::decode(&[&LITTLE_ENDIAN, body].concat())
}

/// When a `set_tool` came whose answer was recorded at `answered_ns`: the rest of the run may have
/// been planned, and taken by the driver, before that. Not before `after_ns`.
fn before_its_rest(events: &[Event], after_ns: i64, answered_ns: i64) -> (i64, usize) {
    let end = events.partition_point(|event| event.stamp_ns <= answered_ns);
    let is_cue = |event: &Event| matches!(&event.what, Happened::Asked(it) if act(it).is_some());
    let after = events[..end].partition_point(|event| event.stamp_ns <= after_ns);
    let begin = events[..end].iter().rposition(is_cue).map_or(0, |at| at + 1).max(after);
    match (begin..end).find(|&at| is_rest(events, &events[at])) {
        Some(at) => (events[at].stamp_ns, at),
        None => (answered_ns, end),
    }
}

/// Whether another path for the rest came here, and not what was planned from the result of a probe.
fn is_rest(events: &[Event], event: &Event) -> bool {
    let Happened::Asked(Command::Replan(rest)) = &event.what else { return false };
    !events.iter().any(|event| match &event.what {
        Happened::Asked(Command::ProgramContinued { of, answer: Ok(id) }) => {
            (*of, id) == (rest.of, &rest.program_id)
        }
        _ => false,
    })
}

/// The number of answered lines.
fn answers(events: &[Event]) -> u64 {
    let is_answer =
        |it: &&Event| matches!(it.what, Happened::Received(Report::Ok | Report::Error(_)));
    events.iter().filter(is_answer).count() as u64
}

/// Where to wait for the machine, and when that was reported; `None` if it stood still.
fn place(
    before: &[Event],
    after: &[Event],
    stops: bool,
    offset: Position,
) -> Option<(WatchPlace, i64)> {
    let mut reports = before.iter().rev().filter(|event| report(event).is_some());
    let last = reports.next()?;
    if report(last).is_none_or(stands) {
        return None;
    }
    let passed = position(report(last)?, offset)?;
    let mut stop = after.iter().filter(|event| report(event).is_some_and(stands));
    let stop = stop.next().filter(|_| stops);
    let stop = stop.and_then(|event| Some((position(report(event)?, offset)?, event.stamp_ns)));
    Some(match stop {
        Some((stop, reported_ns)) => (WatchPlace::StopsAt(stop), reported_ns),
        None => (WatchPlace::Passes(passed), last.stamp_ns),
    })
}

fn report(event: &Event) -> Option<&StatusReport> {
    match &event.what {
        Happened::Received(Report::Status(report)) => Some(report.as_ref()),
        _ => None,
    }
}

/// Whether the controller reports that nothing moves.
fn stands(report: &StatusReport) -> bool {
    match report.state {
        ControllerState::Idle | ControllerState::Check | ControllerState::Tool => true,
        ControllerState::Hold => report.substate.is_none_or(|it| it == 0),
        // 2: still stopping; 3: restoring.
        ControllerState::Door => report.substate.is_none_or(|it| it < 2),
        _ => false,
    }
}

/// In the machine frame, whichever frame the controller reports.
fn position(report: &StatusReport, offset: Position) -> Option<Position> {
    let in_work = report.work_position;
    let of_work = in_work.map(|work| [0, 1, 2].map(|axis| work[axis] + offset[axis]));
    report.machine_position.or(of_work)
}

/// What a commander did; `None`: nothing that has to be repeated.
fn act(command: &Command) -> Option<Act> {
    Some(match command {
        Command::FeedHold => Act::FeedHold,
        Command::DoorHold => Act::DoorHold,
        Command::Resume => Act::Resume,
        Command::SoftReset => Act::SoftReset,
        Command::ConfirmToolChange { .. } => Act::ConfirmToolChange,
        Command::CancelRun { run: Some(_) } => Act::CancelGoal,
        Command::CancelRun { run: None } => Act::Cancel,
        Command::SetOverrides(wanted) => Act::SetOverrides(*wanted),
        Command::SetSingleBlock(on) => Act::SetSingleBlock(*on),
        _ => return None,
    })
}

/// What the stack level cannot play, in words.
fn unplayable(run: &RunHistory<'_>, index: usize) -> Option<String> {
    let before = &run.events[..index];
    let asked = |wanted: fn(&Command) -> bool| {
        before.iter().any(|it| matches!(&it.what, Happened::Asked(asked) if wanted(asked)))
    };
    let was_reset = before.iter().any(|it| it.what == Happened::Acted(SOFT_RESET));
    match &run.events[index].what {
        Happened::Received(Report::Alarm(code)) => Some(format!("an ALARM:{code}")),
        Happened::Received(Report::Error(code)) => {
            Some(format!("an error:{code} of the controller"))
        }
        Happened::Received(Report::Banner { .. }) if !was_reset => {
            Some("a controller that restarted".into())
        }
        // The recording begins in the middle of a line.
        Happened::Received(Report::Damaged(_))
            if !before.iter().any(|it| matches!(it.what, Happened::Received(_))) =>
        {
            None
        }
        Happened::Received(Report::Damaged(text)) => Some(format!("a damaged line {text:?}")),
        Happened::Received(Report::Status(report)) => match report.state {
            ControllerState::Alarm => Some("an alarm".into()),
            ControllerState::Door if !asked(|it| *it == Command::DoorHold) => {
                Some("an opened door".into())
            }
            _ => None,
        },
        Happened::Acted(FEED_HOLD) if !is_asked_to_stop(before) => {
            Some("a hold that the driver gave by itself".into())
        }
        // Lifting the tool is the first line sent, and the machine here is not homed.
        Happened::Sent(text) if run.goal.start_line > 1 && text.starts_with("G53G0Z") => {
            let is_first = last_line(before) == Some(PREAMBLE);
            is_first.then(|| "an approach (it needs a homed machine)".into())
        }
        Happened::Opened => Some("a port that was opened again".into()),
        Happened::Closed(reason) => Some(format!("a cut link ({reason})")),
        Happened::Asked(command) => match command {
            Command::Home => Some("homing".into()),
            Command::Jog(_) => Some("a jog".into()),
            Command::Probe(_) => Some("a probe".into()),
            Command::SetWorkOffset(_) => Some("a work offset that was set".into()),
            Command::ExecuteMdi { .. } => Some("an MDI block".into()),
            Command::Unlock => Some("an unlock".into()),
            Command::Sleep => Some("a controller that was put to sleep".into()),
            Command::Activate | Command::Deactivate | Command::Shutdown => {
                Some("a change of the driver's lifecycle".into())
            }
            _ => None,
        },
        _ => None,
    }
}

/// The last line that was sent, except checks.
fn last_line(before: &[Event]) -> Option<&str> {
    before.iter().rev().find_map(|event| match &event.what {
        Happened::Sent(text) if !text.starts_with('$') => Some(text.as_str()),
        _ => None,
    })
}

/// Whether a stop was requested since the machine last moved on.
fn is_asked_to_stop(before: &[Event]) -> bool {
    let since = before.iter().rev().take_while(|event| event.what != Happened::Acted(RESUME));
    let mut asked = since.filter_map(|event| match &event.what {
        Happened::Asked(command) => Some(command),
        _ => None,
    });
    asked.any(|it| matches!(it, Command::FeedHold | Command::CancelRun { .. }))
}

/// Where the machine was when the goal came, mm.
pub(super) fn start_in_machine(run: &RunHistory<'_>) -> Result<Position, ReplayError> {
    let known = run.states.iter().find(|(_, state)| state.position_known);
    let (_, known) = known.ok_or_else(|| ReplayError::Incomplete {
        what: "a position of the machine",
        of: "the run".into(),
    })?;
    Ok(machine_position(known))
}

fn work_position(state: &MachineState) -> Position {
    position_from_point(&state.work_position)
}

pub(super) fn machine_position(state: &MachineState) -> Position {
    position_from_point(&state.machine_position)
}

#[cfg(test)]
mod tests;
