//! A compensated path in the machine frame.
//!
//! The path is written in work systems and with tool lengths; what the axes do follows from the
//! stored offsets. This file walks along a path and keeps both, axis by axis, with what is not
//! known: nobody has said where the tool is before the first move of an axis. Judges nothing.

mod moves;

pub(crate) use moves::{FurtherStep, Known, Lost, MachineMove, MoveFrame, Somewhere};

use crate::encoder::words::to_grid;
use crate::machine_limits::StoredOffsets;
use cnc_msgs::contour::{Action, Source};
use cnc_msgs::further::{FurtherAxes, FurtherMode, FurtherMove};
use cnc_msgs::geometry::{Arc, AxisSet, Position, Shape};
use cnc_msgs::path::CompensatedPath;

/// Walks along a path.
#[derive(Debug, Clone)]
pub(crate) struct MachinePath {
    systems: [Known; 9],
    references: [Known; 2],
    shift: Position,
    /// 1 to 9.
    system: u8,
    tool_length_mm: f64,
    tool: Option<u32>,
    at: Known,
    /// Of axes that are not known.
    somewhere: [Somewhere; 3],
    /// Why work systems are not known.
    lost_systems: [[Lost; 3]; 9],
    /// Where homing leaves the axes.
    home: Known,
    /// The frame is that of a work system: where the machine zero lies in it is not known.
    is_floating: bool,
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
            tool: None,
            at,
            somewhere: [Somewhere::of(Lost::Start); 3],
            lost_systems: [[Lost::Frame; 3]; 9],
            home: [None; 3],
            is_floating: false,
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

    /// The same in the frame of one work system, 1 to 9: nothing else is known of the machine.
    pub(crate) fn floating(path: &CompensatedPath, system: u8) -> Self {
        Self { is_floating: true, ..Self::new(path, &floating_offsets(system), [None; 3]) }
    }

    /// This tool is in the spindle at the beginning.
    pub(crate) fn begin_with_tool(&mut self, tool: Option<u32>) {
        self.tool = tool;
    }

    /// Where homing leaves the axes, as far as it is known.
    pub(crate) fn homes_to(&mut self, home: Known) {
        self.home = home;
    }

    /// A place of the work system in force; where its offset is not known, the offset is 0.
    pub(crate) fn work_place(&self, place: Position) -> Position {
        let offset = self.offset();
        std::array::from_fn(|axis| place[axis] + offset[axis].unwrap_or(0.0))
    }

    /// The path may have set offsets up to here: the frame is that of one work system again.
    pub(crate) fn float_again(&mut self, path: &CompensatedPath, system: u8) {
        self.take_offsets(path, &floating_offsets(system));
    }

    /// These are the stored positions now, whatever the path has made of them up to here.
    pub(crate) fn take_offsets(&mut self, path: &CompensatedPath, offsets: &StoredOffsets) {
        let begun = Self::new(path, offsets, [None; 3]);
        (self.systems, self.references, self.shift) =
            (begun.systems, begun.references, begun.shift);
        (self.further_systems, self.further_shift) = (begun.further_systems, begun.further_shift);
        self.lost_systems = begun.lost_systems;
        let (start, offset) = (path.start_of(self.next_element), self.offset());
        // Where a probe has ended, the path does not say.
        let is_probed = self.probed;
        self.at = std::array::from_fn(|axis| {
            offset[axis].filter(|_| !is_probed.contains(axis)).map(|it| it + start[axis])
        });
        self.somewhere = std::array::from_fn(|axis| match is_probed.contains(axis) {
            true => Somewhere::of(Lost::Probe),
            false => Somewhere::of(Lost::Frame),
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
            let before = (from, [Somewhere::of(Lost::Start); 3]);
            MachineMove { to, ..self.moved(before, None, None, source, frame, axes) }
        };
        [
            moved(here, up, z_alone),
            moved(up, over, axes.without(z_alone)),
            moved(over, [x, y, z], z_alone),
        ]
    }

    /// A rapid of A to W alone, to a place of the work system in force.
    pub(crate) fn rapid_to(&self, axes: FurtherAxes, source: Source) -> FurtherStep {
        let (system, offset) = (self.system, self.offset());
        let frame = MoveFrame::Work { system, offset };
        let (from, mode) = (self.further_at, FurtherMode::Rapid);
        let to = self.further_in_machine(axes).or(from.without_all(axes));
        FurtherStep { mode, from, to, named: axes, frame, source }
    }

    /// The places of the machine frame, as far as the work system in force is known.
    fn further_in_machine(&self, named: FurtherAxes) -> FurtherAxes {
        let zero = self.further_systems[usize::from(self.system.clamp(1, 9)) - 1];
        let shift = self.further_shift;
        let end = |(axis, value)| Some((axis, value + zero.get(axis)? + shift.get(axis)?));
        named.iter().filter_map(end).collect()
    }

    /// Goes to before an element and an event of it.
    pub(crate) fn go_before(&mut self, path: &CompensatedPath, element: usize, event: usize) {
        while (self.next_element < element || self.next_event < event)
            && self.next_element <= element
            && self.next(path).is_some()
        {}
    }

    /// What is added to the coordinates of the work system in force, where all of it is known.
    pub(crate) fn whole_offset(&self) -> Option<Position> {
        let [x, y, z] = self.offset();
        Some([x?, y?, z?])
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
        let (start, offset, before) = (path.start_of(index), self.offset(), self.place());
        let from = before.0;
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
                let is_relative = self.relative.contains(axis);
                let way = element.end[axis] - start[axis];
                self.at[axis] = match is_relative {
                    true => from[axis].map(|it| it + way),
                    false => offset[axis].map(|it| it + element.end[axis]),
                };
                self.somewhere[axis] = match is_relative {
                    true => {
                        let within = before.1[axis].within.map(|ends| ends.map(|it| it + way));
                        Somewhere { within, ..before.1[axis] }
                    }
                    false => Somewhere::of(self.lost_system(axis)),
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
        let moved = self.moved(before, arc, element.feed_mm_per_min, element.source, frame, axes);
        if std::mem::take(&mut self.is_probe) && !self.misses_probes {
            for axis in (0..3).filter(|&axis| axes.contains(axis)) {
                // On its way, wherever it touches.
                let ends = from[axis].zip(self.at[axis].take());
                let within = ends.map(|(from, to)| [from.min(to), from.max(to)]);
                self.somewhere[axis] = Somewhere { lost: Lost::Probe, within };
            }
            self.probed = self.probed.union(axes);
        }
        moved
    }

    /// Where the axes are, and what is known of the others.
    fn place(&self) -> (Known, [Somewhere; 3]) {
        (self.at, self.somewhere)
    }

    /// Why the work system in force is not known.
    fn lost_system(&self, axis: usize) -> Lost {
        self.lost_systems[usize::from(self.system.clamp(1, 9)) - 1][axis]
    }

    fn moved(
        &self,
        (from, from_somewhere): (Known, [Somewhere; 3]),
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
            somewhere: [from_somewhere, self.somewhere],
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
            _ => self.further_in_machine(named),
        };
        step.to = to.or(from.without_all(named));
        self.further_at = step.to;
        Step::Further(step)
    }

    fn function(&mut self, action: Action, source: Source) -> Step {
        let before = self.place();
        match action {
            Action::WorkOffset { system } => self.system = system,
            Action::ToolLength { offset, length_mm, .. } => {
                self.tool_length_mm = if offset.is_some() { length_mm } else { 0.0 };
            }
            Action::ChangeTool { tool } => self.tool = Some(tool),
            Action::SetWorkOffset { system, axes, origin, by_position } => {
                self.set_offset(system, axes, origin, by_position);
            }
            Action::Probe(_) => self.is_probe = true,
            Action::Relative { axes } => self.relative = axes,
            Action::StoreReference { second } => self.references[usize::from(second)] = self.at,
            Action::Home { axes } => {
                let all = if axes.is_empty() { AxisSet::ALL } else { axes };
                self.go_to(self.home, all, Lost::Homing);
                self.further_at = FurtherAxes::NONE;
            }
            Action::MachineMove { target, axes, rapid, feed_mm_per_min } => {
                let there = if self.is_floating { [None; 3] } else { target.map(Some) };
                self.go_to(there, axes, Lost::Frame);
                let feed = (!rapid).then_some(feed_mm_per_min);
                let frame = MoveFrame::Machine("G53");
                return Step::Move(self.moved(before, None, feed, source, frame, axes));
            }
            Action::Reference { axes, second } => {
                let axes = if axes.is_empty() { AxisSet::ALL } else { axes };
                self.go_to(self.references[usize::from(second)], axes, Lost::Frame);
                let frame = MoveFrame::Machine(if second { "G30" } else { "G28" });
                return Step::Move(self.moved(before, None, None, source, frame, axes));
            }
            _ => {}
        }
        Step::Function(action, source)
    }

    /// These axes are there now, or nobody knows where, for this reason.
    fn go_to(&mut self, there: Known, axes: AxisSet, lost: Lost) {
        for axis in (0..3).filter(|&axis| axes.contains(axis)) {
            (self.at[axis], self.somewhere[axis]) = (there[axis], Somewhere::of(lost));
        }
    }

    fn set_offset(&mut self, system: u8, axes: AxisSet, origin: Position, by_position: bool) {
        let index = usize::from(system.max(1)) - 1;
        let Some(stored) = self.systems.get_mut(index) else { return };
        let length = [0.0, 0.0, self.tool_length_mm];
        for axis in (0..3).filter(|&axis| axes.contains(axis)) {
            stored[axis] = match by_position {
                false => (!self.is_floating).then_some(origin[axis]),
                true => self.at[axis].map(|at| at - self.shift[axis] - length[axis] - origin[axis]),
            };
            self.lost_systems[index][axis] = match by_position {
                false => Lost::Frame,
                true => self.somewhere[axis].lost,
            };
        }
    }
}

/// The stored positions of a frame whose zero is that of one work system, 1 to 9.
fn floating_offsets(system: u8) -> StoredOffsets {
    let mut offsets = StoredOffsets::default();
    offsets.systems[usize::from(system.clamp(1, 9)) - 1] = Some([0.0; 3]);
    offsets
}
