//! A recorded run: states over time, the dialogue with the controller, and the sheets of a bag.

use super::{Layer, Page, Pin, PinKind, Sheet};
use crate::picture::view::{Point, View};
use axis_driver::journal::EntryKind;
use axis_driver::journal::kind_from_wire;
use axis_driver::link::realtime;
use cnc_msgs::convert::mode_from_wire;
use cnc_msgs::finding::Finding;
use cnc_msgs::geometry::Plane;
use cnc_msgs::machine::Mode;
use cnc_msgs::units::{mm_per_min_from_m_per_s, position_from_point};
use cnc_msgs::wire::builtin_interfaces::msg::Time;
use cnc_msgs::wire::cnc_msgs::msg::{MachineState, TrafficEntry};
use replay::ReplayError;
use replay::planner::PlannedToday;
use replay::recording::{RecordedPlan, RecordedProgram, RecordedState, Recording};
use serde::Serialize;
use std::collections::BTreeMap;

/// What happened, by seconds since the start.
#[derive(Debug, Serialize)]
pub(crate) struct RunLog {
    states: Vec<StateRow>,
    /// Time, direction, text.
    dialogue: Vec<(f64, &'static str, String)>,
    /// When the run ended.
    end: f64,
}

#[derive(Debug, Serialize)]
struct StateRow {
    t: f64,
    state: &'static str,
    reason: String,
    feed: f64,
    line: u32,
    /// Position of the tool on the paper.
    at: Option<Point>,
}

impl RunLog {
    fn new(recording: &Recording, view: View) -> Self {
        let stamps = recording.traffic.values().map(|(_, entry)| seconds(&entry.stamp));
        let stamps =
            stamps.chain(recording.states.iter().map(|it| seconds(&it.state.header.stamp)));
        let (begin, end) = stamps.fold((f64::INFINITY, f64::NEG_INFINITY), |(first, last), at| {
            (first.min(at), last.max(at))
        });
        let mut states: Vec<StateRow> =
            recording.states.iter().map(|it| state(&it.state, begin, view)).collect();
        // The topic repeats each state.
        states.dedup_by(|next, before| {
            (next.state, &next.reason, next.feed, next.line, next.at)
                == (before.state, &before.reason, before.feed, before.line, before.at)
        });
        states.sort_by(|a, b| a.t.total_cmp(&b.t));
        Self { states, dialogue: dialogue(recording, begin), end: (end - begin).max(0.0) }
    }
}

fn seconds(stamp: &Time) -> f64 {
    f64::from(stamp.sec) + f64::from(stamp.nanosec) * 1e-9
}

fn place(state: &MachineState, view: View) -> Option<Point> {
    let position = position_from_point(&state.work_position);
    state.position_known.then(|| view.project(position))
}

fn state(state: &MachineState, begin: f64, view: View) -> StateRow {
    StateRow {
        t: seconds(&state.header.stamp) - begin,
        state: mode_from_wire(state.state).name(),
        reason: state.reason.clone(),
        feed: mm_per_min_from_m_per_s(state.feed_rate),
        line: state.line,
        at: place(state, view),
    }
}

/// Bytes as lines, and commands.
fn dialogue(recording: &Recording, begin: f64) -> Vec<(f64, &'static str, String)> {
    let mut rows = Vec::new();
    let (mut sent, mut received) = (Vec::new(), Vec::new());
    for (_, entry) in recording.traffic.values() {
        let t = seconds(&entry.stamp) - begin;
        match kind_from_wire(entry.kind) {
            Some(EntryKind::Tx) => lines(&mut sent, entry, |line| rows.push((t, "tx", line))),
            Some(EntryKind::Rx) => lines(&mut received, entry, |line| rows.push((t, "rx", line))),
            Some(EntryKind::Command) => {
                rows.push((t, "command", String::from_utf8_lossy(&entry.data).into_owned()));
            }
            Some(EntryKind::Opened) => rows.push((t, "command", "the port is open".into())),
            Some(EntryKind::Closed) => {
                let why = String::from_utf8_lossy(&entry.data);
                rows.push((t, "error", format!("the port is closed: {why}")));
            }
            // Entries of the driver's clock are not shown.
            Some(EntryKind::Timer | EntryKind::Checkpoint) | None => {}
        }
    }
    for (kind, rest) in [("tx", sent), ("rx", received)] {
        if !rest.is_empty() {
            let t = rows.last().map_or(0.0, |row| row.0);
            rows.push((t, kind, rest.escape_ascii().to_string()));
        }
    }
    rows
}

/// Passes on the lines that an entry ends; a real-time byte is a line of its own.
fn lines(rest: &mut Vec<u8>, entry: &TrafficEntry, mut take: impl FnMut(String)) {
    let is_sent = entry.kind == TrafficEntry::KIND_TRANSMITTED;
    for &byte in &entry.data {
        match byte {
            b'\n' => {
                take(String::from_utf8_lossy(rest).trim_end().to_owned());
                rest.clear();
            }
            _ if is_sent && realtime::is_named(byte) => take(name(byte)),
            _ => rest.push(byte),
        }
    }
}

/// The name of a real-time byte.
fn name(byte: u8) -> String {
    let name = match byte {
        realtime::STATUS => return "?".into(),
        realtime::FEED_HOLD => "feed hold",
        realtime::RESUME => "resume",
        realtime::SOFT_RESET => "soft reset",
        realtime::SAFETY_DOOR => "door",
        realtime::JOG_CANCEL => "jog cancel",
        _ => return format!("{byte:#04x}"),
    };
    match byte.is_ascii_graphic() {
        true => format!("{} ({name})", char::from(byte)),
        false => format!("{byte:#04x} ({name})"),
    }
}

/// One sheet for each plan in a bag, executed ones first; only those have the run. A run whose plan
/// is not in the bag has its own sheet, so that there is always one. `now` is empty when nothing
/// was replayed.
pub(crate) fn of_recording(
    page: &mut Page<'static>,
    name: &str,
    recording: &Recording,
    now: &[PlannedToday],
    finish: impl Fn(&mut Sheet<'static>),
) -> Result<(), ReplayError> {
    let run_of = |revision| recording.states.iter().any(|it| it.state.path_revision == revision);
    // What was planned on from the result of a probe shows all of what was run before it.
    let is_read_on = |revision, plan: &RecordedPlan| {
        let whole = recording.plans.values().filter(|later| later.path.is_some());
        let later = whole.filter_map(|later| later.manifest.as_ref());
        later
            .filter(|it| it.continues_revision == revision && run_of(it.revision))
            .any(|it| it.program_id != plan.report.program_id)
    };
    let sheets_before = page.sheets.len();
    // Plans of one run share one log, seen on the plane of the program.
    let mut logs: BTreeMap<&str, Option<usize>> = BTreeMap::new();
    let mut plans: Vec<(&u64, &RecordedPlan)> = recording.plans.iter().collect();
    plans.sort_by_key(|(revision, _)| !run_of(**revision));
    for (&revision, plan) in plans {
        if is_read_on(revision, plan) {
            continue;
        }
        let Some(program) = recording.programs.get(&plan.report.program_id) else { continue };
        let view = view(program)?;
        let title = match recording.plans.len() {
            1 => name.to_owned(),
            _ => format!("{name}, plan {revision}"),
        };
        let text = String::from_utf8_lossy(&program.text).into_owned();
        let mut sheet = Sheet::new(title, view, text.into());
        sheet.call(&program.contour.calls);
        sheet.turn(&program.contour, view);
        sheet.layers.push(Layer::programmed(&program.contour, view).into_owned());
        if let Some(path) = &plan.path {
            let layer = Layer::compensated("compensated", path.start, &path.elements, view);
            sheet.layers.push(layer.into_owned());
        }
        let findings: Vec<Finding> =
            plan.report.findings.iter().filter_map(|it| Finding::try_from(it).ok()).collect();
        sheet.find(&findings, view);
        if let Some(now) = now.iter().find(|now| now.revision == revision) {
            sheet.fill(&now.uncut, view);
            let layer = Layer::now(now.path.start, &now.path.elements, view);
            sheet.layers.push(layer.into_owned());
            if let Some(path) = &plan.path {
                sheet.pin_difference(path, &now.path, view);
            }
        }
        if run_of(revision) {
            let id = plan.report.program_id.as_str();
            sheet.pins.extend(alarms(recording, view, Some(id), &sheet.program));
            // With the results of probes a program has another id; the run keeps that of the goal.
            let mut states = recording.states.iter().map(|it| &it.state);
            let run = states.find(|state| state.path_revision == revision);
            let run = run.map_or(id, |state| &state.program_id);
            sheet.run = *logs.entry(run).or_insert_with(|| page.log(recording, view));
            sheet.end = end(recording);
        }
        finish(&mut sheet);
        page.sheets.push(sheet);
    }
    if logs.is_empty() {
        let view = View { plane: Plane::default(), is_mirrored: false };
        let is_alone = page.sheets.len() == sheets_before;
        let title = if is_alone { name.to_owned() } else { format!("{name}, the run") };
        let mut sheet = Sheet::new(title, view, "".into());
        sheet.pins = alarms(recording, view, None, "");
        sheet.run = page.log(recording, view);
        sheet.end = end(recording);
        if is_alone || sheet.run.is_some() {
            finish(&mut sheet);
            page.sheets.push(sheet);
        }
    }
    Ok(())
}

fn end(recording: &Recording) -> String {
    recording.end().map_or(String::new(), |end| format!("The run: {end}"))
}

impl Page<'_> {
    /// Adds the run to the page, if there was one; returns its index.
    fn log(&mut self, recording: &Recording, view: View) -> Option<usize> {
        let log = RunLog::new(recording, view);
        if log.states.is_empty() && log.dialogue.is_empty() {
            return None;
        }
        self.runs.push(log);
        Some(self.runs.len() - 1)
    }
}

fn view(program: &RecordedProgram) -> Result<View, ReplayError> {
    let profile = program.profile()?;
    Ok(View::of(&program.contour, &profile))
}

/// Pins where the machine went into an alarm, was stopped, or did not answer any more: from the
/// start of this program on, or during the whole recording when there is none.
fn alarms(recording: &Recording, view: View, program_id: Option<&str>, program: &str) -> Vec<Pin> {
    let mut pins: Vec<Pin> = Vec::new();
    let mut before = false;
    let mut at = None;
    let mut ran = "";
    for RecordedState { state, .. } in &recording.states {
        if let Some(plan) = recording.plans.get(&state.path_revision) {
            ran = &plan.report.program_id;
        } else if state.path_revision > 0 {
            ran = &state.program_id;
        }
        // Without contact, the last reported position counts.
        at = place(state, view).or(at);
        let is_alarm = mode_from_wire(state.state) == Mode::Alarm
            || state.needs_reset
            || state.motion_possible;
        let is_meant = program_id.is_none_or(|id| ran.is_empty() || ran == id);
        if is_alarm && !before && is_meant {
            let block = usize::try_from(state.line).ok().and_then(|line| line.checked_sub(1));
            let block = block.and_then(|index| program.lines().nth(index));
            let block = block.map_or(String::new(), |text| format!(" ({})", text.trim()));
            let mode = mode_from_wire(state.state).name();
            // No line of the program was under way.
            let [label, place] = match state.line {
                0 => [mode.to_owned(), String::new()],
                line => [format!("{mode} line {line}"), format!(" at line {line}{block}")],
            };
            pins.push(Pin {
                kind: PinKind::Alarm,
                label,
                text: format!("{mode}{place}: {}", state.reason),
                line: state.line,
                at,
            });
        }
        before = is_alarm;
    }
    pins
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_become_lines_and_real_time_bytes_are_named() {
        let entry =
            |kind, data: &[u8]| TrafficEntry { kind, data: data.to_vec(), ..Default::default() };
        let mut rest = Vec::new();
        let mut said = |entry: &TrafficEntry| {
            let mut found = Vec::new();
            lines(&mut rest, entry, |line| found.push(line));
            found
        };
        let sent = TrafficEntry::KIND_TRANSMITTED;
        assert_eq!(said(&entry(sent, b"G1X!1\nX2")), ["! (feed hold)", "G1X1"]);
        assert_eq!(said(&entry(sent, b"?0\n\x18\x91")), ["?", "X20", "0x18 (soft reset)", "0x91"]);
        // Lines from the controller have no real-time bytes.
        let received = TrafficEntry::KIND_RECEIVED;
        assert_eq!(said(&entry(received, b"[MSG:what?]\r\nok\r\n")), ["[MSG:what?]", "ok"]);
    }
}
