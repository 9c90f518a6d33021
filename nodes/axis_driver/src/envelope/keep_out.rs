//! Keep-out boxes: whether the tool touches a clamp.
//!
//! The boxes are placed with the offsets that are stored when the program begins: a clamp does not
//! move with a work zero that the program sets. The Z of a box is that of a tip without a tool
//! length (G49).

use super::distance::{Bounds, Nearest, of_arc, of_line};
use super::{EnvelopeReport, Workplace, place};
use crate::machine_limits::{MachineLimits, MachineZero};
use crate::machine_path::{MachineMove, MoveFrame};
use cnc_msgs::contour::Source;
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::Position;
use cnc_msgs::keep_out::{Frame, KeepOutBox};
use std::collections::{BTreeMap, BTreeSet};

/// What counts as touching, mm.
const TOUCH_MM: f64 = 1e-6;

/// Compares each move with each box.
#[derive(Debug, Clone)]
pub(super) struct KeepOutCheck {
    boxes: Vec<PlacedBox>,
    diameters_mm: BTreeMap<u32, f64>,
    not_judged: Vec<String>,
    /// Blocks whose start is not known on all axes.
    first_unknown: Option<Source>,
    tools_unknown: BTreeSet<u32>,
}

/// A box in the machine frame.
#[derive(Debug, Clone)]
struct PlacedBox {
    name: String,
    bounds: Bounds,
    hit: Option<Hit>,
}

/// The blocks that touch a box.
#[derive(Debug, Clone, Copy)]
struct Hit {
    source: Source,
    nearest: Nearest,
    tool: u32,
    radius_mm: f64,
    in_work: Option<Position>,
    frame: MoveFrame,
    blocks: usize,
    last_line: u32,
}

impl KeepOutCheck {
    pub(super) fn new(limits: &MachineLimits, workplace: Workplace<'_>) -> Self {
        let mut check = Self {
            boxes: Vec::new(),
            diameters_mm: workplace.tool_diameters_mm.clone(),
            not_judged: Vec::new(),
            first_unknown: None,
            tools_unknown: BTreeSet::new(),
        };
        for (name, it) in &workplace.keep_out.keep_out {
            match placed(it, limits) {
                Ok(bounds) => check.boxes.push(PlacedBox { name: name.clone(), bounds, hit: None }),
                Err(because) => check.not_judged.push(format!("keep-out {name:?}: {because}")),
            }
        }
        check
    }

    pub(super) fn see(&mut self, it: &MachineMove) {
        if self.boxes.is_empty() {
            return;
        }
        let whole = |[x, y, z]: [Option<f64>; 3]| Some([x?, y?, z? - it.tool_length_mm]);
        let Some(to) = whole(it.to) else {
            self.first_unknown.get_or_insert(it.source);
            return;
        };
        let from = whole(it.from).unwrap_or_else(|| {
            // Only the end of the first move is known.
            self.first_unknown.get_or_insert(it.source);
            to
        });
        let radius_mm = match self.diameters_mm.get(&it.tool) {
            Some(diameter) => diameter / 2.0,
            None => {
                self.tools_unknown.insert(it.tool);
                0.0
            }
        };
        for each in &mut self.boxes {
            each.see(it, from, to, radius_mm);
        }
    }

    pub(super) fn report(&self, report: &mut EnvelopeReport) {
        report.not_judged.extend(self.not_judged.iter().cloned());
        if let Some(source) = self.first_unknown {
            report.not_judged.push(format!(
                "the way to the end of {}: where the tool is before it is not known",
                place(source)
            ));
        }
        for tool in &self.tools_unknown {
            let name =
                if *tool == 0 { "the tool in the spindle".into() } else { format!("T{tool}") };
            report.not_judged.push(format!(
                "the diameter of {name} at keep-outs: it is not in the tool table, so that only \
                 its axis was compared"
            ));
        }
        report.findings.extend(self.boxes.iter().filter_map(PlacedBox::finding));
    }
}

/// Where a box is in the machine frame.
fn placed(it: &KeepOutBox, limits: &MachineLimits) -> Result<Bounds, String> {
    let offset = match it.frame {
        Frame::Machine => match limits.zero {
            MachineZero::Unknown { because } if limits.frame_is_unknown() => {
                return Err(because.to_owned());
            }
            _ => match limits.axes_not_homed().next() {
                Some(letter) => {
                    return Err(format!("no setting says that {letter} is homed ($44 to $49)"));
                }
                None => [0.0; 3],
            },
        },
        Frame::Work(system) => {
            let stored = limits.offsets.systems[usize::from(system) - 1];
            let Some(stored) = stored else {
                return Err(format!("the stored position of {} is not known", it.frame.name()));
            };
            std::array::from_fn(|axis| stored[axis] + limits.offsets.shift[axis])
        }
    };
    let shifted = |at: Position| std::array::from_fn(|axis| at[axis] + offset[axis]);
    Ok(Bounds { min: shifted(it.min_mm), max: shifted(it.max_mm) })
}

impl PlacedBox {
    fn see(&mut self, it: &MachineMove, from: Position, to: Position, radius_mm: f64) {
        let nearest = match &it.arc {
            Some(arc) if from != to || arc.turns > 0 => {
                let mut arc = *arc;
                arc.center[2] -= it.tool_length_mm;
                of_arc(from, to, &arc, &self.bounds)
            }
            _ if is_apart(from, to, radius_mm, &self.bounds) => None,
            _ => of_line(from, to, &self.bounds),
        };
        let Some(nearest) = nearest.filter(|it| it.distance_mm <= radius_mm + TOUCH_MM) else {
            return;
        };
        let line = it.source.line;
        match &mut self.hit {
            Some(hit) => {
                hit.blocks += usize::from(line != hit.last_line);
                hit.last_line = line;
            }
            None => {
                let in_work = match it.frame {
                    MoveFrame::Work { offset: [Some(x), Some(y), Some(z)], .. } => {
                        let [tip_x, tip_y, tip_z] = nearest.tip;
                        Some([tip_x - x, tip_y - y, tip_z - (z - it.tool_length_mm)])
                    }
                    _ => None,
                };
                let (source, tool, frame) = (it.source, it.tool, it.frame);
                let (blocks, last_line) = (1, line);
                self.hit = Some(Hit {
                    source,
                    nearest,
                    tool,
                    radius_mm,
                    in_work,
                    frame,
                    blocks,
                    last_line,
                });
            }
        }
    }

    fn finding(&self) -> Option<Finding> {
        let hit = self.hit?;
        let Bounds { max, .. } = self.bounds;
        let [x, y, z] = hit.nearest.tip;
        let tool = match (hit.tool, hit.radius_mm) {
            (0, radius) if radius <= 0.0 => "the axis of the tool".to_owned(),
            (tool, radius) if radius <= 0.0 => format!("the axis of T{tool}"),
            (tool, radius) => format!("T{tool} (radius {radius:.3} mm)"),
        };
        let mut message = format!(
            "{tool} touches the keep-out {:?}: its tip is at X{x:.3} Y{y:.3} Z{z:.3} in the machine \
             frame",
            self.name
        );
        if let Some([x, y, z]) = hit.in_work {
            message += &format!(" (X{x:.3} Y{y:.3} Z{z:.3} in {})", hit.frame.name());
        }
        let overlap = hit.radius_mm - hit.nearest.distance_mm;
        message += &match hit.nearest.distance_mm > 0.0 {
            true => format!(", {:.3} mm from the side", hit.nearest.distance_mm),
            false => ", within its sides".to_owned(),
        };
        message += &format!(", and {:.3} mm below the top", (max[2] - z).max(0.0));
        if hit.blocks > 1 {
            message += &format!("; {} blocks do so", hit.blocks);
        }
        let help = match hit.nearest.distance_mm > 0.0 {
            true => format!(
                "keep {:.3} mm more distance, or lift the tip above Z{:.3} in the machine frame",
                overlap.max(0.001),
                max[2]
            ),
            false => format!(
                "lead around it, move the clamp, or lift the tip above Z{:.3} in the machine frame",
                max[2]
            ),
        };
        let mut finding = Finding::error(Code::KeepOut, hit.source, message).help(help);
        finding.position = hit.in_work;
        if hit.radius_mm > 0.0 {
            finding.needed_mm = Some(hit.radius_mm);
            finding.available_mm = Some(hit.nearest.distance_mm);
        }
        Some(finding)
    }
}

/// Whether a straight move passes well beside a box.
fn is_apart(from: Position, to: Position, radius_mm: f64, bounds: &Bounds) -> bool {
    let reach = radius_mm + 1.0;
    (0..2).any(|axis| {
        from[axis].max(to[axis]) + reach < bounds.min[axis]
            || from[axis].min(to[axis]) - reach > bounds.max[axis]
    })
}
