//! Keep-out boxes: whether the tool touches a clamp.
//!
//! The boxes are placed with the offsets that are stored when the program begins: a clamp does not
//! move with a work zero that the program sets. The Z of a box is that of a tip without a tool
//! length (G49). What touches whatever is not known is an error, what may touch a warning; [`touch`]
//! decides, [`report`] has the words.
//!
//! [`touch`]: super::touch

mod report;

use super::Workplace;
use super::distance::{Bounds, Nearest};
use super::touch::{ANYWHERE, Span, ToolMove, Touch};
use crate::machine_limits::{MachineLimits, MachineZero};
use crate::machine_path::{Lost, MachineMove, MoveFrame, Somewhere};
use cnc_msgs::contour::{Source, work_system};
use cnc_msgs::geometry::{AxisSet, Position};
use cnc_msgs::keep_out::{Frame, KeepOutBox};
use std::collections::{BTreeMap, BTreeSet};

/// Compares each move with each box.
#[derive(Debug, Clone)]
pub(super) struct KeepOutCheck {
    boxes: Vec<PlacedBox>,
    /// What their coordinates are: `the machine frame`, `G54`.
    frame: String,
    /// Where the axes may be when they are homed, as far as it is known.
    travel: [Option<Span>; 3],
    tools: Tools,
    /// What follows homing and probes is judged again when they have ended.
    is_judged_again: bool,
    /// The kinematics, where rapids are no straight lines.
    bows_rapids: Option<String>,
    not_judged: BTreeSet<String>,
    /// Why moves could not be compared: the first one, how many more, and the last line.
    unplaced: BTreeMap<String, (Source, usize, u32)>,
}

/// The tools of the table.
#[derive(Debug, Clone)]
struct Tools {
    diameters_mm: BTreeMap<u32, f64>,
    /// T and radius of the largest.
    largest: Option<(u32, f64)>,
}

/// The tool of a move.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cutter {
    tool: Option<u32>,
    /// The radius is between these, mm.
    radii_mm: [f64; 2],
}

/// A box in the frame of the check.
#[derive(Debug, Clone)]
struct PlacedBox {
    name: String,
    bounds: Bounds,
    /// The blocks that touch it for certain.
    hit: Option<Hit>,
    /// The first one that may.
    chance: Option<Chance>,
}

/// The blocks that touch a box.
#[derive(Debug, Clone, Copy)]
struct Hit {
    source: Source,
    nearest: Nearest,
    cutter: Cutter,
    in_work: Option<Position>,
    frame: MoveFrame,
    blocks: usize,
    last_line: u32,
    /// The axes of which only this is known, that it touches wherever they are.
    unknown: AxisSet,
}

/// The first block that may touch a box.
#[derive(Debug, Clone, Copy)]
struct Chance {
    source: Source,
    because: Doubt,
    unknown: AxisSet,
    cutter: Cutter,
    /// The work system of the move, and its Z in the frame of the check with the tool length off.
    zero: Option<(u8, f64)>,
    /// The least and the greatest Z of the tip at the end.
    tip: Span,
}

/// What would have to be known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Doubt {
    Place(Lost),
    Tool,
}

impl KeepOutCheck {
    /// The boxes that can be placed in the machine frame, and the work systems of others.
    pub(super) fn new(limits: &MachineLimits, workplace: Workplace<'_>) -> (Self, BTreeSet<u8>) {
        let mut check = Self::empty(limits, workplace, "the machine frame".to_owned());
        let mut floating = BTreeSet::new();
        for (name, it) in &workplace.keep_out.keep_out {
            match placed(it, limits) {
                Ok(bounds) => check.add(name, bounds),
                Err(Unplaced::System(system)) => {
                    floating.insert(system);
                }
                Err(Unplaced::Machine(because)) => {
                    check.not_judged.insert(format!("keep-out {name:?}: {because}"));
                }
            }
        }
        (check, floating)
    }

    /// The boxes of a work system whose place in the machine is not known, in its own frame.
    pub(super) fn floating(limits: &MachineLimits, workplace: Workplace<'_>, system: u8) -> Self {
        let mut check = Self::empty(limits, workplace, work_system(system));
        check.travel = [None; 3];
        let boxes = workplace.keep_out.keep_out.iter();
        for (name, it) in boxes.filter(|(_, it)| it.frame == Frame::Work(system)) {
            check.add(name, Bounds { min: it.min_mm, max: it.max_mm });
        }
        check
    }

    fn empty(limits: &MachineLimits, workplace: Workplace<'_>, frame: String) -> Self {
        let bounds = match limits.zero {
            MachineZero::Placed { bounds_mm } => bounds_mm,
            MachineZero::Unplaced { .. } | MachineZero::Unknown { .. } => [None; 3],
        };
        let travel =
            std::array::from_fn(|axis| bounds[axis].filter(|_| limits.travel_mm[axis].is_some()));
        let diameters_mm = workplace.tool_diameters_mm.clone();
        let largest = diameters_mm.iter().max_by(|a, b| a.1.total_cmp(b.1));
        let largest = largest.map(|(tool, diameter)| (*tool, diameter / 2.0));
        Self {
            boxes: Vec::new(),
            frame,
            travel,
            tools: Tools { diameters_mm, largest },
            is_judged_again: workplace.is_judged_again,
            bows_rapids: limits.bows_rapids().map(str::to_owned),
            not_judged: BTreeSet::new(),
            unplaced: BTreeMap::new(),
        }
    }

    fn add(&mut self, name: &str, bounds: Bounds) {
        let (hit, chance) = (None, None);
        self.boxes.push(PlacedBox { name: name.to_owned(), bounds, hit, chance });
    }

    pub(super) fn see(&mut self, it: &MachineMove) {
        if self.boxes.is_empty() {
            return;
        }
        let mut doubts = BTreeSet::new();
        let mut unknown = AxisSet::NONE;
        let [from, to] = [0, 1].map(|end| -> [Span; 3] {
            let at = [it.from, it.to][end];
            std::array::from_fn(|axis| {
                let off = if axis == 2 { it.tool_length_mm } else { 0.0 };
                if let Some(at) = at[axis] {
                    return [at - off; 2];
                }
                let Somewhere { lost, within } = it.somewhere[end][axis];
                doubts.insert(lost);
                unknown = unknown.with(axis);
                within.or(self.travel[axis]).unwrap_or(ANYWHERE).map(|at| at - off)
            })
        });
        let arc = it.arc.map(|mut arc| {
            arc.center[2] -= it.tool_length_mm;
            arc
        });
        let way = ToolMove { from, to, arc: arc.as_ref(), moved: it.axes };
        let cutter = self.tools.cutter(it.tool);
        let doubt = doubts.pop_last().map_or(Doubt::Tool, Doubt::Place);
        for each in &mut self.boxes {
            let touch = way.touch(&each.bounds, cutter.radii_mm);
            match (touch, doubt) {
                (Touch::No, _) => {}
                (Touch::Certain(nearest), _) => each.add_hit(it, nearest, cutter, unknown),
                // It is judged then.
                (Touch::Possible | Touch::Unclear, Doubt::Place(Lost::Homing | Lost::Probe))
                    if self.is_judged_again => {}
                (Touch::Unclear, _)
                | (Touch::Possible, Doubt::Place(Lost::Frame | Lost::Probe)) => {
                    let first = (it.source, 0, it.source.line);
                    let why = report::unplaced(doubt, it.frame);
                    let (_, more, last_line) = self.unplaced.entry(why).or_insert(first);
                    *more += usize::from(*last_line != it.source.line);
                    *last_line = it.source.line;
                }
                (Touch::Possible, _) => {
                    let zero = match it.frame {
                        MoveFrame::Work { system, offset: [.., Some(z)] } => {
                            Some((system, z - it.tool_length_mm))
                        }
                        _ => None,
                    };
                    let (source, because, tip) = (it.source, doubt, way.to[2]);
                    let chance = Chance { source, because, unknown, cutter, zero, tip };
                    each.chance.get_or_insert(chance);
                }
            }
        }
        if let Some(text) = self.tools.missing(it.tool) {
            self.not_judged.insert(text);
        }
        let is_flat = it.axes.contains(0) || it.axes.contains(1);
        if let Some(name) = self.bows_rapids.as_ref().filter(|_| is_flat)
            && it.feed_mm_per_min.is_none()
        {
            self.not_judged.insert(format!(
                "rapids beside keep-outs: with {name} kinematics they bow, and were compared as \
                 straight lines"
            ));
        }
    }
}

impl Tools {
    fn cutter(&self, tool: Option<u32>) -> Cutter {
        let radii_mm = match tool {
            Some(number) => [self.diameters_mm.get(&number).map_or(0.0, |it| it / 2.0); 2],
            None => [0.0, self.largest.map_or(0.0, |largest| largest.1)],
        };
        Cutter { tool, radii_mm }
    }

    /// What is said of a tool whose diameter is not known.
    fn missing(&self, tool: Option<u32>) -> Option<String> {
        let name = match tool {
            Some(0) => return None,
            Some(number) if self.diameters_mm.contains_key(&number) => return None,
            Some(number) => format!("T{number}"),
            None if self.largest.is_some() => return None,
            None => "the tool in the spindle".to_owned(),
        };
        Some(format!(
            "the diameter of {name} at keep-outs: it is not in the tool table, so that only its \
             axis was compared"
        ))
    }
}

/// Why a box has no place in the machine frame.
enum Unplaced {
    /// The stored position of its work system, 1 to 9, is not known.
    System(u8),
    Machine(String),
}

/// Where a box is in the machine frame.
fn placed(it: &KeepOutBox, limits: &MachineLimits) -> Result<Bounds, Unplaced> {
    let offset = match it.frame {
        Frame::Machine => match limits.zero {
            MachineZero::Unknown { because } => return Err(Unplaced::Machine(because.to_owned())),
            _ => match limits.axes_not_homed().next() {
                Some(letter) => {
                    let text = format!("no setting says that {letter} is homed ($44 to $49)");
                    return Err(Unplaced::Machine(text));
                }
                None => [0.0; 3],
            },
        },
        Frame::Work(system) => {
            let stored = limits.offsets.systems[usize::from(system) - 1];
            let Some(stored) = stored else { return Err(Unplaced::System(system)) };
            std::array::from_fn(|axis| stored[axis] + limits.offsets.shift[axis])
        }
    };
    let shifted = |at: Position| std::array::from_fn(|axis| at[axis] + offset[axis]);
    Ok(Bounds { min: shifted(it.min_mm), max: shifted(it.max_mm) })
}

impl PlacedBox {
    fn add_hit(&mut self, it: &MachineMove, nearest: Nearest, cutter: Cutter, unknown: AxisSet) {
        let line = it.source.line;
        if let Some(hit) = &mut self.hit {
            hit.blocks += usize::from(line != hit.last_line);
            hit.last_line = line;
            return;
        }
        let in_work = match it.frame {
            MoveFrame::Work { offset: [Some(x), Some(y), Some(z)], .. } => {
                let [tip_x, tip_y, tip_z] = nearest.tip;
                Some([tip_x - x, tip_y - y, tip_z - (z - it.tool_length_mm)])
            }
            _ => None,
        };
        let (source, frame, blocks, last_line) = (it.source, it.frame, 1, line);
        let hit = Hit { source, nearest, cutter, in_work, frame, blocks, last_line, unknown };
        self.hit = Some(hit);
    }
}
