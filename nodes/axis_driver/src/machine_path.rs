//! A compensated path in the machine frame.
//!
//! The path is written in work systems and with tool lengths; what the axes do follows from the
//! stored offsets. This file walks along a path and keeps both, axis by axis, with what is not
//! known: nobody has said where the tool is before the first move of an axis. Judges nothing.

use crate::encoder::words::to_grid;
use crate::machine_limits::StoredOffsets;
use cnc_msgs::contour::{Action, Source, work_system};
use cnc_msgs::further::{FurtherAxes, FurtherMode, FurtherMove};
use cnc_msgs::geometry::{Arc, AxisSet, Position, Shape};
use cnc_msgs::path::CompensatedPath;

/// A coordinate of each axis, where it is known.
pub(crate) type Known = [Option<f64>; 3];

/// One move of the axes, mm; positions are those of the axes, with the tool length in them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct MachineMove {
    pub(crate) from: Known,
    pub(crate) to: Known,
    /// Its centre is in the machine frame.
    pub(crate) arc: Option<Arc>,
    /// `None` for a rapid.
    pub(crate) feed_mm_per_min: Option<f64>,
    pub(crate) source: Source,
    pub(crate) frame: MoveFrame,
    /// The axes that this move gives.
    pub(crate) axes: AxisSet,
    /// What of Z is the tool length.
    pub(crate) tool_length_mm: f64,
    pub(crate) tool: u32,
}

/// What a move is written in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum MoveFrame {
    /// A work system, 1 to 9, and what is added to its coordinates, mm.
    Work { system: u8, offset: Known },
    /// `G53`, `G28`, `G30`.
    Machine(&'static str),
}

impl MoveFrame {
    /// `G54`, `G53`.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Work { system, .. } => work_system(*system),
            Self::Machine(word) => (*word).to_owned(),
        }
    }
}

/// A move of A, B, C, U, V or W: along with the next move, or alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FurtherStep {
    pub(crate) mode: FurtherMode,
    /// In the machine frame, as far as it is known.
    pub(crate) from: FurtherAxes,
    pub(crate) to: FurtherAxes,
    /// As the program gives them, in this frame.
    pub(crate) named: FurtherAxes,
    pub(crate) frame: MoveFrame,
    pub(crate) source: Source,
}

/// Walks along a path.
#[derive(Debug, Clone)]
pub(crate) struct MachinePath {
    systems: [Known; 9],
    references: [Known; 2],
    shift: Position,
    /// 1 to 9.
    system: u8,
    tool_length_mm: f64,
    tool: u32,
    at: Known,
    further_systems: [FurtherAxes; 9],
    further_shift: FurtherAxes,
    /// In the machine frame, as far as it is known.
    further_at: FurtherAxes,
    /// The next element is the way of a probe.
    is_probe: bool,
    /// Axes that no element has named since their probe.
    probed: AxisSet,
    /// Axes that the next element moves from wherever they are.
    relative: AxisSet,
    /// A probe goes to the end of its way; else nobody knows where it ends.
    misses_probes: bool,
    next_element: usize,
    next_event: usize,
}

/// What comes next along a path.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Step {
    Move(MachineMove),
    Further(FurtherStep),
    /// Something else, before the next move.
    Function(Action, Source),
}

impl MachinePath {
    /// The beginning of a path. `at` is where the axes are, as far as it is known.
    pub(crate) fn new(path: &CompensatedPath, offsets: &StoredOffsets, at: Known) -> Self {
        let known = |place: Option<Position>| match place {
            Some(place) => place.map(Some),
            None => [None; 3],
        };
        let mut begun = Self {
            systems: offsets.systems.map(known),
            references: offsets.references.map(known),
            shift: offsets.shift,
            // The words that every run begins with.
            system: 1,
            tool_length_mm: 0.0,
            tool: 0,
            at,
            further_systems: offsets.further_systems,
            further_shift: offsets.further_shift,
            further_at: FurtherAxes::NONE,
            is_probe: false,
            probed: AxisSet::NONE,
            relative: AxisSet::NONE,
            misses_probes: false,
            next_element: 0,
            next_event: 0,
        };
        // A run begins only where the path relies on it.
        let offset = begun.offset();
        for axis in (0..3).filter(|&axis| path.assumed_axes.contains(axis)) {
            begun.at[axis] = begun.at[axis].or(offset[axis].map(|it| it + path.start[axis]));
        }
        begun
    }

    /// A place of the work system in force; where its offset is not known, the offset is 0.
    pub(crate) fn work_place(&self, place: Position) -> Position {
        let offset = self.offset();
        std::array::from_fn(|axis| place[axis] + offset[axis].unwrap_or(0.0))
    }

    /// These are the stored positions now, whatever the path has made of them up to here.
    pub(crate) fn take_offsets(&mut self, path: &CompensatedPath, offsets: &StoredOffsets) {
        let begun = Self::new(path, offsets, [None; 3]);
        (self.systems, self.references, self.shift) =
            (begun.systems, begun.references, begun.shift);
        (self.further_systems, self.further_shift) = (begun.further_systems, begun.further_shift);
        let (start, offset) = (path.start_of(self.next_element), self.offset());
        // Where a probe has ended, the path does not say.
        let is_probed = self.probed;
        self.at = std::array::from_fn(|axis| {
            offset[axis].filter(|_| !is_probed.contains(axis)).map(|it| it + start[axis])
        });
        self.further_at = FurtherAxes::NONE;
    }

    /// Takes each probe to go to the end of its way.
    pub(crate) fn miss_probes(&mut self) {
        self.misses_probes = true;
    }

    /// The axes are here now.
    pub(crate) fn assume(&mut self, at: Position) {
        self.at = at.map(Some);
    }

    /// The element that comes next.
    pub(crate) fn next_element(&self) -> usize {
        self.next_element
    }

    /// The event that comes next.
    pub(crate) fn next_event(&self) -> usize {
        self.next_event
    }

    /// The way of the tool from `here` to the place that the path has come to: up to a height in the
    /// machine frame, over the place in these axes, and down to it.
    pub(crate) fn way_from_above(
        &self,
        here: Known,
        height_mm: f64,
        axes: AxisSet,
        source: Source,
    ) -> [MachineMove; 3] {
        let [x, y, z] = std::array::from_fn(|axis| match axes.contains(axis) {
            true => self.at[axis],
            false if axis == 2 => Some(height_mm),
            false => here[axis],
        });
        let up = [here[0], here[1], Some(height_mm)];
        let over = [x, y, Some(height_mm)];
        let z_alone = AxisSet::NONE.with(2);
        let (system, offset) = (self.system, self.offset());
        let moved = |from, to, axes: AxisSet| {
            let frame = match axes == z_alone && to == up {
                true => MoveFrame::Machine("the way to the beginning"),
                false => MoveFrame::Work { system, offset },
            };
            MachineMove { to, ..self.moved(from, None, None, source, frame, axes) }
        };
        [
            moved(here, up, z_alone),
            moved(up, over, axes.without(z_alone)),
            moved(over, [x, y, z], z_alone),
        ]
    }

    /// What is added to a coordinate of the work system in force.
    fn offset(&self) -> Known {
        let system = self.systems[usize::from(self.system.clamp(1, 9)) - 1];
        let length = [0.0, 0.0, self.tool_length_mm];
        std::array::from_fn(|axis| Some(system[axis]? + self.shift[axis] + length[axis]))
    }

    /// Gives what comes next; `None` at the end of the path.
    pub(crate) fn next(&mut self, path: &CompensatedPath) -> Option<Step> {
        let event = path.events.get(self.next_event);
        let has_element = self.next_element < path.elements.len();
        match event.filter(|event| event.at_element <= self.next_element || !has_element) {
            Some(event) => {
                self.next_event += 1;
                match event.action {
                    Action::Further(further) => {
                        let next = path.events.get(self.next_event);
                        let owner = next.filter(|next| next.source == event.source);
                        Some(self.further(further, owner.map(|it| it.action), event.source))
                    }
                    action => Some(self.function(action, event.source)),
                }
            }
            None if has_element => {
                self.next_element += 1;
                Some(Step::Move(self.element(path, self.next_element - 1)))
            }
            None => None,
        }
    }

    fn element(&mut self, path: &CompensatedPath, index: usize) -> MachineMove {
        let element = &path.elements[index];
        let (start, offset, from) = (path.start_of(index), self.offset(), self.at);
        let mut axes = AxisSet::NONE;
        let arc = match element.shape {
            Shape::Line => None,
            Shape::Arc(arc) => Some(arc),
        };
        for axis in 0..3 {
            let is_of_arc = arc.is_some_and(|arc| arc.plane.axes()[2] != axis);
            let moves = to_grid(element.end[axis]) != to_grid(start[axis]);
            if is_of_arc || moves || element.axes.contains(axis) {
                axes = axes.with(axis);
                self.at[axis] = match self.relative.contains(axis) {
                    true => from[axis].map(|it| it + element.end[axis] - start[axis]),
                    false => offset[axis].map(|it| it + element.end[axis]),
                };
            }
        }
        let arc = arc.map(|arc| {
            let center = std::array::from_fn(|axis| arc.center[axis] + offset[axis].unwrap_or(0.0));
            Arc { center, ..arc }
        });
        self.probed = self.probed.without(axes.without(self.relative));
        self.relative = AxisSet::NONE;
        let frame = MoveFrame::Work { system: self.system, offset };
        let moved = self.moved(from, arc, element.feed_mm_per_min, element.source, frame, axes);
        if std::mem::take(&mut self.is_probe) && !self.misses_probes {
            (0..3).filter(|&axis| axes.contains(axis)).for_each(|axis| self.at[axis] = None);
            self.probed = self.probed.union(axes);
        }
        moved
    }

    fn moved(
        &self,
        from: Known,
        arc: Option<Arc>,
        feed_mm_per_min: Option<f64>,
        source: Source,
        frame: MoveFrame,
        axes: AxisSet,
    ) -> MachineMove {
        let Self { at, tool, tool_length_mm, .. } = *self;
        MachineMove {
            from,
            to: at,
            arc,
            feed_mm_per_min,
            source,
            frame,
            axes,
            tool_length_mm,
            tool,
        }
    }

    /// Where these axes go, or what they give the action that they belong to.
    fn further(&mut self, it: FurtherMove, owner: Option<Action>, source: Source) -> Step {
        let FurtherMove { axes: named, mode } = it;
        let owner = owner.filter(|_| mode == FurtherMode::Along);
        let (from, shift) = (self.further_at, self.further_shift);
        let (system, offset) = (self.system, self.offset());
        let mut step = FurtherStep {
            mode,
            from,
            to: from,
            named,
            frame: MoveFrame::Work { system, offset },
            source,
        };
        let to = match owner {
            Some(Action::SetWorkOffset { system, by_position, .. }) => {
                let zero = |(axis, value)| match by_position {
                    false => Some((axis, value)),
                    true => Some((axis, from.get(axis)? - shift.get(axis)? - value)),
                };
                if let Some(stored) = self.further_systems.get_mut(usize::from(system.max(1)) - 1) {
                    let zero: FurtherAxes = named.iter().filter_map(zero).collect();
                    *stored = zero.or(stored.without_all(named));
                }
                // Nothing moves.
                step.named = FurtherAxes::NONE;
                return Step::Further(step);
            }
            // Where the controller has stored them is not known here.
            Some(Action::Reference { second, .. }) => {
                step.frame = MoveFrame::Machine(if second { "G30" } else { "G28" });
                FurtherAxes::NONE
            }
            Some(Action::MachineMove { .. }) => {
                step.frame = MoveFrame::Machine("G53");
                named
            }
            _ => {
                let zero = self.further_systems[usize::from(system.clamp(1, 9)) - 1];
                let end = |(axis, value)| Some((axis, value + zero.get(axis)? + shift.get(axis)?));
                named.iter().filter_map(end).collect()
            }
        };
        step.to = to.or(from.without_all(named));
        self.further_at = step.to;
        Step::Further(step)
    }

    fn function(&mut self, action: Action, source: Source) -> Step {
        let from = self.at;
        match action {
            Action::WorkOffset { system } => self.system = system,
            Action::ToolLength { offset, length_mm, .. } => {
                self.tool_length_mm = if offset.is_some() { length_mm } else { 0.0 };
            }
            Action::ChangeTool { tool } => self.tool = tool,
            Action::SetWorkOffset { system, axes, origin, by_position } => {
                self.set_offset(system, axes, origin, by_position);
            }
            Action::Probe(_) => self.is_probe = true,
            Action::Relative { axes } => self.relative = axes,
            Action::StoreReference { second } => self.references[usize::from(second)] = self.at,
            // Where the switches are is the business of the machine.
            Action::Home { axes } => {
                let all = if axes.is_empty() { AxisSet::ALL } else { axes };
                (0..3).filter(|&axis| all.contains(axis)).for_each(|axis| self.at[axis] = None);
                self.further_at = FurtherAxes::NONE;
            }
            Action::MachineMove { target, axes, rapid, feed_mm_per_min } => {
                (0..3)
                    .filter(|&axis| axes.contains(axis))
                    .for_each(|axis| self.at[axis] = Some(target[axis]));
                let feed = (!rapid).then_some(feed_mm_per_min);
                let frame = MoveFrame::Machine("G53");
                return Step::Move(self.moved(from, None, feed, source, frame, axes));
            }
            Action::Reference { axes, second } => {
                let axes = if axes.is_empty() { AxisSet::ALL } else { axes };
                let stored = self.references[usize::from(second)];
                (0..3)
                    .filter(|&axis| axes.contains(axis))
                    .for_each(|axis| self.at[axis] = stored[axis]);
                let frame = MoveFrame::Machine(if second { "G30" } else { "G28" });
                return Step::Move(self.moved(from, None, None, source, frame, axes));
            }
            _ => {}
        }
        Step::Function(action, source)
    }

    fn set_offset(&mut self, system: u8, axes: AxisSet, origin: Position, by_position: bool) {
        let Some(stored) = self.systems.get_mut(usize::from(system.max(1)) - 1) else { return };
        let length = [0.0, 0.0, self.tool_length_mm];
        for axis in (0..3).filter(|&axis| axes.contains(axis)) {
            stored[axis] = match by_position {
                false => Some(origin[axis]),
                true => self.at[axis].map(|at| at - self.shift[axis] - length[axis] - origin[axis]),
            };
        }
    }
}
