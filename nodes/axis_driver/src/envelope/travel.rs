//! The travel: where the machine zero is known, each coordinate; else the span of the program.
//!
//! Knows moves in the machine frame. Arcs count where they reach out furthest, not by their ends.

use super::{EnvelopeReport, place};
use crate::machine_limits::{MachineLimits, MachineZero};
use crate::machine_path::{FurtherStep, Known, MachineMove, MoveFrame};
use cnc_msgs::contour::Source;
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes};
use cnc_msgs::geometry::{AXIS_LETTERS, Position};
use std::collections::BTreeSet;

/// What is not known more closely, mm: stored positions have three decimals, and the axes stand on
/// whole steps.
const TOLERANCE_MM: f64 = 0.01;

/// Collects how far each axis goes.
#[derive(Debug, Clone)]
pub(super) struct TravelCheck {
    /// X, Y, Z, A, B, C, U, V and W.
    axes: [AxisReach; 9],
    zero_unknown: Option<&'static str>,
    /// Why nothing is judged.
    is_no_box: Option<String>,
    /// Moves in frames whose place is not known.
    unplaced: BTreeSet<String>,
}

/// How far one axis goes, and may go.
#[derive(Debug, Clone, Default)]
struct AxisReach {
    room: Room,
    /// A program moves it.
    is_named: bool,
    least: Option<Reach>,
    greatest: Option<Reach>,
    /// Below the travel, and above it.
    beyond: [Option<Beyond>; 2],
}

/// What one axis has.
#[derive(Debug, Clone, Copy, Default)]
struct Room {
    letter: char,
    /// `mm` or `degrees`.
    unit: &'static str,
    /// Of its travel: 130 for X.
    setting: u16,
    travel: Option<f64>,
    /// Least and greatest coordinate, where they are known.
    bounds: Option<[f64; 2]>,
    /// Nothing but homing says what its coordinates mean: not even its span is judged without.
    turns: bool,
}

/// A coordinate that an axis reaches.
#[derive(Debug, Clone, Copy)]
struct Reach {
    in_machine: f64,
    /// In the frame that the move is written in, with the tool length.
    in_work: Option<f64>,
    /// The whole place, work frame, mm.
    position: Option<Position>,
    frame: MoveFrame,
    source: Source,
}

/// All blocks that leave the travel at one end.
#[derive(Debug, Clone, Copy)]
struct Beyond {
    first: Reach,
    farthest: Reach,
    blocks: usize,
    /// Only where all are written in this work system, the work zero alone is to blame.
    system: Option<u8>,
    last_line: u32,
}

impl TravelCheck {
    pub(super) fn new(limits: &MachineLimits, start: Known) -> Self {
        let (bounds, zero_unknown) = match limits.zero {
            MachineZero::Placed { bounds_mm } => (bounds_mm, None),
            MachineZero::Unplaced { because } | MachineZero::Unknown { because } => {
                ([None; 3], Some(because))
            }
        };
        let room = |axis: usize| match axis.checked_sub(3) {
            None => Room {
                letter: AXIS_LETTERS[axis],
                unit: "mm",
                setting: 130 + axis as u16,
                travel: limits.travel_mm[axis],
                bounds: bounds[axis],
                turns: false,
            },
            Some(further) => {
                let turns = FurtherAxes::is_rotary(further);
                let it = limits.further[further];
                Room {
                    letter: FURTHER_LETTERS[further],
                    unit: if turns { "degrees" } else { "mm" },
                    setting: it.map_or(0, |it| 130 + it.place),
                    travel: it.and_then(|it| it.travel),
                    bounds: it.and_then(|it| it.bounds),
                    turns,
                }
            }
        };
        let axis = |axis: usize| AxisReach { room: room(axis), ..AxisReach::default() };
        let axes = std::array::from_fn(axis);
        let is_no_box = limits.other_kinematics.as_ref();
        let is_no_box = is_no_box.map(|name| format!("with {name} kinematics it is no box"));
        let mut check = Self { axes, zero_unknown, is_no_box, unplaced: BTreeSet::new() };
        // The tool stands within the machine: that counts for the span.
        for (reach, at) in check.axes.iter_mut().zip(start) {
            if let (Some(in_machine), None) = (at, reach.room.bounds) {
                let frame = MoveFrame::Machine("the start");
                let source = Source::default();
                let (in_work, position) = (None, None);
                reach.widen(Reach { in_machine, in_work, position, frame, source });
            }
        }
        check
    }

    /// A move of A to W.
    pub(super) fn see_further(&mut self, it: &FurtherStep) {
        for (axis, value) in it.named.iter() {
            let reach = &mut self.axes[3 + axis];
            reach.is_named = true;
            let FurtherStep { frame, source, .. } = *it;
            match it.to.get(axis) {
                Some(in_machine) => {
                    let in_work = matches!(frame, MoveFrame::Work { .. }).then_some(value);
                    reach.see(Reach { in_machine, in_work, position: None, frame, source });
                }
                None if reach.room.is_judged() => {
                    let letter = reach.room.letter;
                    self.unplaced.insert(format!("moves of {letter} in {}", frame.name()));
                }
                None => {}
            }
        }
    }

    pub(super) fn see(&mut self, it: &MachineMove) {
        for axis in (0..3).filter(|&axis| it.axes.contains(axis)) {
            match it.to[axis] {
                Some(_) => self.reach(axis, it.to, it),
                None => {
                    self.unplaced.insert(format!("moves in {}", it.frame.name()));
                }
            }
        }
        let Some(arc) = it.arc else { return };
        let [first, second, third] = arc.plane.axes();
        if [first, second].iter().any(|&axis| it.from[axis].is_none() || it.to[axis].is_none()) {
            return;
        }
        // The third axis does not count here.
        let [from, to] = [it.from, it.to].map(|at| at.map(|value| value.unwrap_or(0.0)));
        for (axis, value) in arc.outermost(from, to) {
            let mut at = arc.center.map(Some);
            (at[axis], at[third]) = (Some(value), it.to[third]);
            self.reach(axis, at, it);
        }
    }

    fn reach(&mut self, axis: usize, at: Known, it: &MachineMove) {
        let Some(in_machine) = at[axis] else { return };
        let (in_work, position) = match it.frame {
            MoveFrame::Work { offset, .. } => {
                let work: Known = std::array::from_fn(|axis| Some(at[axis]? - offset[axis]?));
                let whole = (work[0].zip(work[1])).zip(work[2]);
                (work[axis], whole.map(|((x, y), z)| [x, y, z]))
            }
            MoveFrame::Machine(_) => (None, None),
        };
        let reach = Reach { in_machine, in_work, position, frame: it.frame, source: it.source };
        self.axes[axis].see(reach);
    }

    pub(super) fn report(&self, report: &mut EnvelopeReport) {
        if let Some(because) = &self.is_no_box {
            report.not_judged.push(format!("the travel: {because}"));
            return;
        }
        let (cartesian, further) = self.axes.split_at(3);
        let named = further.iter().filter(|reach| reach.is_named);
        for reach in cartesian.iter().chain(named) {
            let Room { letter, setting, bounds, .. } = reach.room;
            let Some(travel) = reach.room.travel else {
                // An axis that the board lacks has no setting; a program that moves it is refused.
                if setting > 0 {
                    report.not_judged.push(format!(
                        "the travel of {letter}: ${setting} is 0, or as grbl is delivered while \
                         soft limits are off ($20=0)"
                    ));
                }
                continue;
            };
            if bounds.is_none() && self.zero_unknown.is_none() {
                let rest = match reach.room.is_judged() {
                    true => "; only its length was compared",
                    false => "",
                };
                report.not_judged.push(format!(
                    "where {letter} lies in its travel: no setting says that it is homed ($44 to \
                     $49){rest}"
                ));
            }
            let span = reach.greatest.zip(reach.least).filter(|_| reach.room.is_judged());
            let span = span.map(|(most, least)| (most.in_machine - least.in_machine, most, least));
            let room = bounds.map_or(travel, |[min, max]| max - min);
            match span {
                Some((span, most, least)) if span > room + TOLERANCE_MM => {
                    report.findings.push(too_long(&reach.room, span, room, most, least));
                }
                _ => {
                    let beyond = reach.beyond.iter().enumerate();
                    let found = beyond.filter_map(|(end, it)| Some((end, it.as_ref()?)));
                    let found = found.map(|(end, it)| outside(&reach.room, end, it));
                    report.findings.extend(found);
                }
            }
        }
        if let Some(because) = self.zero_unknown {
            let text = format!(
                "where the program lies in the travel: {because}; only its length was compared"
            );
            report.not_judged.push(text);
        }
        for moves in &self.unplaced {
            report
                .not_judged
                .push(format!("{moves}: where they are in the machine is known only in the run"));
        }
    }
}

impl Room {
    /// Whether anything is known that its moves can be compared with.
    fn is_judged(&self) -> bool {
        self.travel.is_some() && (self.bounds.is_some() || !self.turns)
    }
}

impl AxisReach {
    fn see(&mut self, reach: Reach) {
        self.widen(reach);
        let Some([min, max]) = self.room.bounds.filter(|_| self.room.travel.is_some()) else {
            return;
        };
        let at = reach.in_machine;
        for (end, by) in [min - at, at - max].into_iter().enumerate() {
            if by > TOLERANCE_MM {
                self.leave(end, reach);
            }
        }
    }

    fn widen(&mut self, reach: Reach) {
        if self.least.is_none_or(|least| reach.in_machine < least.in_machine) {
            self.least = Some(reach);
        }
        if self.greatest.is_none_or(|greatest| reach.in_machine > greatest.in_machine) {
            self.greatest = Some(reach);
        }
    }

    /// `end` is 0 below the travel, 1 above it.
    fn leave(&mut self, end: usize, reach: Reach) {
        let system = match reach.frame {
            MoveFrame::Work { system, .. } => Some(system),
            MoveFrame::Machine(_) => None,
        };
        let line = reach.source.line;
        let Some(beyond) = &mut self.beyond[end] else {
            let (first, farthest) = (reach, reach);
            let beyond = Beyond { first, farthest, blocks: 1, system, last_line: line };
            self.beyond[end] = Some(beyond);
            return;
        };
        // An arc is seen at several places.
        beyond.blocks += usize::from(line != beyond.last_line);
        beyond.last_line = line;
        beyond.system = beyond.system.filter(|before| Some(*before) == system);
        let is_farther = match end {
            0 => reach.in_machine < beyond.farthest.in_machine,
            _ => reach.in_machine > beyond.farthest.in_machine,
        };
        if is_farther {
            beyond.farthest = reach;
        }
    }
}

impl Reach {
    /// `X-612.500 in the machine frame (X112.500 in G54)`
    fn text(&self, letter: char) -> String {
        let machine = format!("{letter}{:.3} in the machine frame", self.in_machine);
        match self.in_work {
            Some(work) => format!("{machine} ({letter}{work:.3} in {})", self.frame.name()),
            None => format!("{machine} ({})", self.frame.name()),
        }
    }

    /// `line 12 (N70)`
    fn place(&self) -> String {
        match self.source.line {
            0 => self.frame.name(),
            _ => place(self.source),
        }
    }
}

fn too_long(of: &Room, span: f64, room: f64, most: Reach, least: Reach) -> Finding {
    let Room { letter, unit, setting: number, .. } = of;
    let source = if most.source.line == 0 { least.source } else { most.source };
    let message = format!(
        "the program needs {span:.3} {unit} in {letter}, from {} to {}; the machine has {room:.3} \
         {unit} (${number}), {:.3} {unit} less",
        least.place(),
        most.place(),
        span - room
    );
    let remedy = match of.turns {
        true => format!("turn {letter} back between the cuts"),
        false => "split the program or turn the part".to_owned(),
    };
    let help = format!("{remedy}; if the travel is wrong, correct ${number}");
    let mut finding = Finding::error(Code::Travel, source, message).help(help);
    let mm = |value| (!of.turns).then_some(value);
    (finding.needed_mm, finding.available_mm) = (mm(span), mm(room));
    finding
}

fn outside(of: &Room, end: usize, it: &Beyond) -> Finding {
    let &Room { letter, unit, setting: number, .. } = of;
    let [min, max] = of.bounds.unwrap_or_default();
    let by = |reach: &Reach| match end {
        0 => min - reach.in_machine,
        _ => reach.in_machine - max,
    };
    let mut message = format!(
        "the move goes to {}, {:.3} {unit} beyond the travel from {letter}{min:.3} to {letter}{max:.3}",
        it.first.text(letter),
        by(&it.first)
    );
    if it.blocks > 1 {
        message += &format!(
            "; {} blocks do so, {} the farthest, by {:.3} {unit}",
            it.blocks,
            it.farthest.place(),
            by(&it.farthest)
        );
    }
    let towards = if end == 0 { '+' } else { '-' };
    let help = match it.system {
        Some(system) => format!(
            "move the work zero of {} by at least {:.3} {unit} towards {letter}{towards}; if the \
             travel is wrong, correct ${number}",
            cnc_msgs::contour::work_system(system),
            by(&it.farthest)
        ),
        None => format!(
            "change the position that the block names; if the travel is wrong, correct ${number}"
        ),
    };
    let mut finding = Finding::error(Code::Travel, it.first.source, message).help(help);
    finding.position = it.first.position;
    finding
}
