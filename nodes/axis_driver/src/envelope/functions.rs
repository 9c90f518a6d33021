//! Settings of the controller that change what a program asks for.
//!
//! Warnings only: the firmware limits a speed or a feed by itself, and laser mode may be meant. But a thread
//! that the axes cannot cut at the pace of the spindle is an error, as it is for the encoder.

use super::{EnvelopeReport, Workplace, place};
use crate::encoder::{
    AllowedOverrides, EncodeProblem, UserFunction, check_pace, no_spindle_sync, shares,
};
use crate::firmware::THREAD_SHARE;
use crate::machine_limits::{MachineLimits, direction};
use crate::machine_path::{FurtherStep, MachineMove};
use crate::vectors::{minus, norm, unit};
use cnc_msgs::contour::{Action, Source, SpindleMode};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes, FurtherMode, further_distance};
use cnc_msgs::geometry::{AXIS_LETTERS, Arc, Position};
use cnc_msgs::port_word::PortWord;
use std::collections::BTreeMap;

/// A tool of at least this diameter is a cutter and no laser, mm.
const CUTTER_MM: f64 = 1.0;
/// S changes this often between cuts on one level only where it is the power of a laser.
const POWER_CHANGES: u32 = 3;

/// Collects what the settings change.
#[derive(Debug, Clone)]
pub(super) struct FunctionCheck {
    limits: MachineLimits,
    diameters_mm: BTreeMap<u32, f64>,
    above: Seen,
    below: Seen,
    feed: Option<TooFast>,
    /// Of the move that comes next.
    along: Option<FurtherStep>,
    /// The first block that starts the spindle, and how.
    started: Option<(Source, SpindleMode)>,
    is_on: bool,
    tool: u32,
    cutter: Option<(Source, u32, f64)>,
    has_moved_z: bool,
    power_changes: u32,
    has_cut_since: bool,
    /// Of the move that comes next, if it has this source: its pitch, mm.
    pitch: Option<(Source, f64)>,
    first_thread: Option<Source>,
    /// The first word that the controller does not take, and why.
    missing: Option<(Source, EncodeProblem)>,
    /// The last word that switches an output with the next motion, which has not come.
    held: Option<(Source, EncodeProblem)>,
    /// The first word that needs an output or an input, where it is not known which there are.
    first_port: Option<(Source, String)>,
    thread: Option<(Source, EncodeProblem)>,
    /// The first whose direction is not known.
    thread_without_way: Option<Source>,
}

/// A feed that the axes cannot follow.
#[derive(Debug, Clone)]
struct TooFast {
    source: Source,
    /// mm or degrees a minute, as the block has it.
    feed: f64,
    /// What the axes can do.
    rate: f64,
    unit: &'static str,
    settings: String,
}

/// A value that is out of range: the first block with it, and how many there are.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    first: Option<(Source, f64)>,
    blocks: u32,
}

impl Seen {
    fn add(&mut self, source: Source, value: f64) {
        self.first.get_or_insert((source, value));
        self.blocks += 1;
    }

    fn more(self) -> String {
        match self.blocks {
            0 | 1 => String::new(),
            blocks => format!("; {blocks} blocks ask for such a speed"),
        }
    }
}

impl FunctionCheck {
    pub(super) fn new(limits: &MachineLimits, workplace: Workplace<'_>) -> Self {
        Self {
            limits: limits.clone(),
            diameters_mm: workplace.tool_diameters_mm.clone(),
            above: Seen::default(),
            below: Seen::default(),
            feed: None,
            along: None,
            started: None,
            is_on: false,
            tool: 0,
            cutter: None,
            has_moved_z: false,
            power_changes: 0,
            has_cut_since: false,
            pitch: None,
            first_thread: None,
            missing: None,
            held: None,
            first_port: None,
            thread: None,
            thread_without_way: None,
        }
    }

    /// `is_run`: it is in the part of the program that is run, and not before it.
    pub(super) fn see(&mut self, action: Action, source: Source, is_run: bool) {
        match action {
            Action::SpindleSpeed { rpm } if is_run => {
                if self.is_on && std::mem::take(&mut self.has_cut_since) {
                    self.power_changes += 1;
                }
                match self.limits.spindle_rpm {
                    Some([_, max]) if rpm > max => self.above.add(source, rpm),
                    Some([min, _]) if rpm > 0.0 && rpm < min => self.below.add(source, rpm),
                    _ => {}
                }
            }
            Action::Spindle(mode) => {
                self.is_on = mode != SpindleMode::Off;
                if self.is_on {
                    self.started.get_or_insert((source, mode));
                    let diameter = self.diameters_mm.get(&self.tool).copied().unwrap_or(0.0);
                    if diameter >= CUTTER_MM {
                        self.cutter.get_or_insert((source, self.tool, diameter));
                    }
                }
            }
            Action::ChangeTool { tool } => self.tool = tool,
            Action::WorkOffset { system: 7.. }
                if !self.limits.firmware.traits().has_nine_work_systems =>
            {
                self.refuse(source, EncodeProblem::Unsupported { word: action.text() });
            }
            Action::Auxiliary { .. } if UserFunction::of(&action).is_none() => {
                let word = PortWord::of(&action);
                if word.is_some_and(|it| it.is_with_motion()) {
                    let word = action.text();
                    self.held = Some((source, EncodeProblem::NoMotionAfter { word }));
                }
                let known = self.limits.ports;
                match word.map(|word| known.map(|it| it.check(&word, &action))) {
                    Some(Some(Ok(()))) => {}
                    Some(Some(Err(problem))) => self.refuse(source, problem),
                    Some(None) => {
                        self.first_port.get_or_insert_with(|| (source, action.text()));
                    }
                    None => {
                        let after = AllowedOverrides::default().after(&action);
                        if let Err(problem) = after.unwrap_or(Err(EncodeProblem::not_here(&action)))
                        {
                            self.refuse(source, problem);
                        }
                    }
                }
            }
            Action::SpindleSync { pitch_mm } => self.pitch = Some((source, pitch_mm)),
            // A motion may follow when it is planned on.
            Action::Stretch { .. } => self.held = None,
            _ => {}
        }
    }

    /// Axes that move, of which the board may lack one. One that stays at 0 is left out.
    fn see_axes(&mut self, axes: FurtherAxes, source: Source) {
        let lacks =
            |(axis, value): &(usize, f64)| *value != 0.0 && self.limits.further[*axis].is_none();
        let Some((axis, _)) = axes.iter().find(lacks) else { return };
        let there = (0..FURTHER_LETTERS.len()).filter(|&axis| self.limits.further[axis].is_some());
        let letters = AXIS_LETTERS.into_iter().chain(there.map(|axis| FURTHER_LETTERS[axis]));
        let axes = letters.map(String::from).collect::<Vec<_>>().join(" ");
        self.refuse(source, EncodeProblem::NoAxis { letter: FURTHER_LETTERS[axis], axes });
    }

    fn refuse(&mut self, source: Source, problem: EncodeProblem) {
        self.missing.get_or_insert((source, problem));
    }

    pub(super) fn see_move(&mut self, it: &MachineMove) {
        self.held = None;
        let along = self.along.take();
        self.has_moved_z |= it.from[2].is_some_and(|from| it.to[2] != Some(from));
        let Some(feed) = it.feed_mm_per_min else { return };
        self.has_cut_since = true;
        if let Some((_, pitch_mm)) = self.pitch.take().filter(|thread| thread.0 == it.source) {
            return self.see_thread(it, pitch_mm, feed);
        }
        if self.feed.is_some() {
            return;
        }
        let Some((from, to)) = whole(it.from).zip(whole(it.to)) else { return };
        let rate = self.slowest(from, to, it.arc.as_ref());
        let (mut rate, mut settings) = (rate, "$110 to $112".to_owned());
        if let Some((minutes, setting)) = along.and_then(|along| self.shortest(&along)) {
            // No arc is sent with them.
            let way = norm(minus(to, from));
            if way / minutes < rate {
                (rate, settings) = (way / minutes, setting);
            }
        }
        self.compare(TooFast { source: it.source, feed, rate, unit: "mm", settings });
    }

    /// A move that keeps pace with the spindle.
    fn see_thread(&mut self, it: &MachineMove, pitch_mm: f64, feed: f64) {
        self.first_thread.get_or_insert(it.source);
        if self.thread.is_some() {
            return;
        }
        let shares = shares(std::array::from_fn(|axis| match it.axes.contains(axis) {
            true => Some(it.to[axis]? - it.from[axis]?),
            false => Some(0.0),
        }));
        if shares.contains(&None) {
            self.thread_without_way.get_or_insert(it.source);
        }
        let shares = shares.map(|share| share.unwrap_or(0.0));
        let rates = self.limits.rate_mm_per_min.map(|rate| Some(rate * THREAD_SHARE));
        let problem = match self.limits.spindle_sync {
            Some(false) => Some(no_spindle_sync(pitch_mm)),
            Some(true) | None => check_pace(pitch_mm, shares, feed, rates).err(),
        };
        self.thread = problem.map(|problem| (it.source, problem));
    }

    /// A move of A to W.
    pub(super) fn see_further(&mut self, it: &FurtherStep) {
        self.held = None;
        self.see_axes(it.named, it.source);
        match it.mode {
            FurtherMode::Along => self.along = Some(*it),
            FurtherMode::Rapid => {}
            FurtherMode::Feed(feed) => {
                let Some((minutes, settings)) = self.shortest(it) else { return };
                let rate = further_distance(it.from, it.to) / minutes;
                let unit = if it.named.only_turns() { "degrees" } else { "mm" };
                self.compare(TooFast { source: it.source, feed, rate, unit, settings });
            }
        }
    }

    fn compare(&mut self, it: TooFast) {
        if self.feed.is_none() && it.feed > it.rate * (1.0 + 1e-9) {
            self.feed = Some(it);
        }
    }

    /// The shortest time of a move of A to W, minutes, and the setting that makes it so; `None` where
    /// none is known to move.
    fn shortest(&self, it: &FurtherStep) -> Option<(f64, String)> {
        let minutes = |(axis, to): (usize, f64)| {
            let limits = self.limits.further[axis]?;
            let minutes = (to - it.from.get(axis)?).abs() / limits.rate_per_min;
            (minutes > 0.0).then_some((minutes, axis, limits.place))
        };
        let (minutes, axis, place) =
            it.to.iter().filter_map(minutes).max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((minutes, format!("${} of {}", 110 + place, FURTHER_LETTERS[axis])))
    }

    /// The least of what the axes can do along a move, mm/min.
    fn slowest(&self, from: Position, to: Position, arc: Option<&Arc>) -> f64 {
        let along = |unit| self.limits.rate_along(direction(unit, FurtherAxes::NONE));
        let Some(arc) = arc else { return along(unit(minus(to, from))) };
        let [a, b, _] = arc.plane.axes();
        let tangent = |at: Position| {
            let mut direction = [0.0; 3];
            direction[a] = arc.center[b] - at[b];
            direction[b] = at[a] - arc.center[a];
            unit(direction)
        };
        // Where an arc passes a quadrant, one axis moves alone.
        let quadrants = arc.outermost(from, to).map(|(axis, _)| {
            let mut direction = [0.0; 3];
            direction[if axis == a { b } else { a }] = 1.0;
            direction
        });
        let directions = [tangent(from), tangent(to)].into_iter().chain(quadrants);
        directions.map(along).fold(f64::INFINITY, f64::min)
    }

    pub(super) fn report(&self, report: &mut EnvelopeReport) {
        let warn =
            |source, message: String| Finding::warning(Code::MachineSetting, source, message);
        let [min, max] = self.limits.spindle_rpm.unwrap_or_default();
        if let Some((source, problem)) = self.missing.as_ref().or(self.held.as_ref()) {
            report.findings.push(Finding::error(
                Code::MachineSetting,
                *source,
                problem.to_string(),
            ));
        }
        if let Some((source, word)) = &self.first_port {
            report.not_judged.push(format!(
                "whether there is what {word} of {} needs: the machine file has no aux_io",
                place(*source)
            ));
        }
        if let Some((source, problem)) = &self.thread {
            let text = format!("{problem}; later threads are not looked at");
            report.findings.push(Finding::error(Code::MachineSetting, *source, text));
        }
        if let Some(source) = self.thread_without_way {
            report.not_judged.push(format!(
                "whether X and Y keep pace with the thread of {}: where it begins or ends in the machine is not known",
                place(source)
            ));
        }
        if let Some(source) = self.first_thread.filter(|_| self.limits.spindle_sync.is_none()) {
            report.not_judged.push(format!(
                "whether the spindle has an encoder, which {} needs: the machine file has no spindle_sync",
                place(source)
            ));
        }
        if let Some((source, rpm)) = self.above.first {
            let more = self.above.more();
            let text = format!(
                "S{rpm} is above the greatest speed of the controller: it turns at {max} rev/min \
                 ($30){more}"
            );
            report.findings.push(warn(source, text).help("program a lower speed, or correct $30"));
        }
        if let Some((source, rpm)) = self.below.first {
            let more = self.below.more();
            let text = format!(
                "S{rpm} is below the least speed of the controller: it turns at {min} rev/min \
                 ($31){more}"
            );
            report.findings.push(warn(source, text).help("program a higher speed, or correct $31"));
        }
        if let Some(TooFast { source, feed, rate, unit, settings }) = &self.feed {
            let text = format!(
                "F{feed} is faster than the axes: the controller moves at {rate:.0} {unit}/min here \
                 ({settings}); later blocks are not listed"
            );
            let help = "program a lower feed; the part takes longer than its feeds say";
            report.findings.push(warn(*source, text).help(help));
        }
        if let Some((source, tool, diameter)) = self.cutter.filter(|_| self.limits.is_laser) {
            let text = format!(
                "the controller is in laser mode ($32=1), and T{tool} is a cutter of {diameter:.3} \
                 mm: the spindle is not waited for, and M4 stops it in rapids"
            );
            report.findings.push(warn(source, text).help("set $32=0 for a spindle"));
        }
        let is_of_a_laser = self.power_changes >= POWER_CHANGES && !self.has_moved_z;
        if let Some((source, _)) = self.started.filter(|_| is_of_a_laser && !self.limits.is_laser) {
            let text = format!(
                "S changes {} times between cuts and Z stays, as in a program for a laser, and the \
                 controller is not in laser mode ($32=0): it stops at each S, and the beam stays \
                 on in rapids (on since {})",
                self.power_changes,
                place(source)
            );
            report.findings.push(warn(source, text).help("set $32=1 for a laser"));
        }
    }
}

fn whole([x, y, z]: [Option<f64>; 3]) -> Option<Position> {
    Some([x?, y?, z?])
}
