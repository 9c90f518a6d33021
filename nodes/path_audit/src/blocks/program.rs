//! Reads what each motion of a contour means for compensation, from its events alone.
//!
//! A second, smaller reading than the planner's: it separates leads, legs and free moves, and knows
//! the offset of each leg. It judges nothing; `align` compares it with a path.

use crate::geometry::planar::{Point, flat};
use cnc_msgs::contour::{
    Action, ContourEventKind, CutterSide, Motion, MotionClass, ProgrammedContour, RadiusSource,
    Source,
};
use cnc_msgs::finding::Severity;
use cnc_msgs::geometry::{Plane, Position, Shape};
use cnc_msgs::profile::{
    ChangeAt, LeadMove, LengthOfD, Profile, RapidMode, Reselect, SelectTarget, SideChange,
};
use cnc_msgs::radius;
use cnc_msgs::tool_table::ToolTable;

/// No index.
pub(crate) const NONE: u32 = u32::MAX;

/// Shorter moves count as none, mm.
const STILL_MM: f64 = 1e-9;

/// What a motion means for compensation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum BlockKind {
    /// Not compensated.
    Free,
    LeadOn,
    /// It moves in the plane, between lead-on and lead-off.
    Leg,
    /// It moves out of the plane, between lead-on and lead-off.
    OffPlane,
    LeadOff,
    /// It ends one contour and begins the next.
    Link,
    /// It moves nothing, between lead-on and lead-off.
    Still,
}

/// One motion of the contour.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Block {
    /// Its event, and the event of the motion before it.
    pub event: u32,
    pub before: u32,
    /// Its own element, and where the elements that belong to it begin.
    pub element: u32,
    /// Index of its offset.
    pub offset: u32,
    pub kind: BlockKind,
    /// A contour begins with it although no move leads to it.
    pub begins: bool,
    /// How far the path may be off it, mm: the slack of merging and of the accepted tolerance.
    pub slack_mm: f32,
    /// The path has no element of it, and that has been reported.
    pub is_lost: bool,
}

/// Offsets at both ends of legs, mm, positive to the left.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Offset {
    pub d_in: f64,
    pub d_out: f64,
    /// Tip directions before and in the leg.
    pub tip_in: u8,
    pub tip: u8,
    pub plane: Plane,
    /// The lead-on meets the first leg in a corner, so that the contour may begin anywhere along
    /// it.
    pub is_joined: bool,
}

#[derive(Debug)]
pub(crate) struct Program<'a> {
    pub contour: &'a ProgrammedContour,
    pub blocks: Vec<Block>,
    /// The events that are actions.
    pub actions: Vec<u32>,
    /// Tool lengths that D has selected, each before the event that activates it (S34).
    pub lengths: Vec<(u32, Action)>,
    pub offsets: Vec<Offset>,
    /// Loops or subroutines execute a line again.
    pub repeats_lines: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum CompensationState {
    Off,
    Selected {
        side: CutterSide,
        is_along: bool,
    },
    Active {
        side: CutterSide,
        cancels: bool,
        relinks: Option<CutterSide>,
        changes: Option<CutterSide>,
    },
}

impl Program<'_> {
    pub(crate) fn motion(&self, block: u32) -> &Motion {
        let event = self.blocks[block as usize].event as usize;
        match &self.contour.events[event].kind {
            ContourEventKind::Motion(motion) => motion,
            _ => unreachable!("blocks are motions"),
        }
    }

    pub(crate) fn source(&self, block: u32) -> Source {
        self.contour.events[self.blocks[block as usize].event as usize].source
    }

    /// The programmed position before a block.
    pub(crate) fn start(&self, block: u32) -> Position {
        let before = self.blocks[block as usize].before;
        match self.contour.events.get(before as usize).map(|event| &event.kind) {
            Some(ContourEventKind::Motion(motion)) => motion.end,
            _ => self.contour.start,
        }
    }

    pub(crate) fn offset(&self, block: u32) -> &Offset {
        &self.offsets[self.blocks[block as usize].offset as usize]
    }

    /// Where a block starts and ends in its plane.
    pub(crate) fn ends(&self, block: u32) -> (Point, Point) {
        let plane = self.offset(block).plane;
        (flat(plane, self.start(block)), flat(plane, self.motion(block).end))
    }
}

/// Reads the events once; of a contour in parts, one part after another.
#[derive(Debug)]
pub(crate) struct Reader<'a> {
    profile: &'a Profile,
    tools: &'a ToolTable,
    state: CompensationState,
    plane: Plane,
    word: Option<RadiusSource>,
    value_mm: Option<f64>,
    spindle_tool: Option<u32>,
    /// The length of the last D, and the length at the last move of Z (S34).
    length: (Option<u32>, f64),
    length_in_force: f64,
    /// A new radius waits for the next leg, or for this many more legs.
    radius_changes: bool,
    value_waits: Option<u32>,
    offset: Offset,
    legs: usize,
}

/// The offset of free moves.
const NO_OFFSET: Offset =
    Offset { d_in: 0.0, d_out: 0.0, tip_in: 0, tip: 0, plane: Plane::Xy, is_joined: false };

impl<'r> Reader<'r> {
    pub(crate) fn new(profile: &'r Profile, tools: &'r ToolTable) -> Self {
        Self {
            profile,
            tools,
            state: CompensationState::Off,
            plane: Plane::default(),
            word: None,
            value_mm: None,
            spindle_tool: None,
            length: (None, 0.0),
            length_in_force: 0.0,
            radius_changes: false,
            value_waits: None,
            offset: NO_OFFSET,
            legs: 0,
        }
    }
}

pub(crate) fn read<'a>(reader: &mut Reader<'_>, contour: &'a ProgrammedContour) -> Program<'a> {
    let blocks = Vec::with_capacity(contour.events.len());
    let mut program = Program {
        contour,
        blocks,
        actions: Vec::new(),
        lengths: Vec::new(),
        offsets: vec![NO_OFFSET],
        repeats_lines: false,
    };
    let mut line = 0;
    let mut before = NONE;
    let mut at = contour.start;
    for (index, event) in contour.events.iter().enumerate() {
        let ContourEventKind::Motion(motion) = &event.kind else {
            reader.word(&event.kind);
            if matches!(event.kind, ContourEventKind::Action(_)) {
                program.actions.push(index as u32);
            }
            continue;
        };
        program.repeats_lines |= event.source.line < line;
        line = event.source.line;
        let length = reader.length_that_acts(motion);
        program.lengths.extend(length.map(|action| (index as u32, action)));
        let (kind, begins) = reader.motion(at, motion, event.source, length.is_some());
        reader.offset.plane = reader.plane;
        if program.offsets.last() != Some(&reader.offset) {
            program.offsets.push(reader.offset);
        }
        program.blocks.push(Block {
            event: index as u32,
            before,
            element: NONE,
            offset: program.offsets.len() as u32 - 1,
            kind,
            begins,
            slack_mm: 0.0,
            is_lost: false,
        });
        before = index as u32;
        at = motion.end;
        reader.offset.d_in = reader.offset.d_out;
        reader.offset.tip_in = reader.offset.tip;
    }
    program
}

impl Reader<'_> {
    fn word(&mut self, kind: &ContourEventKind) {
        let is_active = matches!(self.state, CompensationState::Active { .. });
        match *kind {
            ContourEventKind::Plane(plane) if self.state == CompensationState::Off => {
                self.plane = plane
            }
            ContourEventKind::Radius(word) => {
                (self.word, self.value_mm) = (Some(word), None);
                self.radius_changes |= is_active;
            }
            ContourEventKind::RadiusValue { radius_mm } => {
                self.value_mm = Some(radius_mm);
                if is_active {
                    self.value_waits = Some(self.profile.radius.value_latency_blocks);
                }
            }
            ContourEventKind::Action(Action::ToolLength { offset, .. }) => {
                let length_mm = offset.map_or(0.0, |number| length_of(number, self.tools));
                self.length = (offset, length_mm);
            }
            ContourEventKind::Action(Action::ChangeTool { tool }) => self.spindle_tool = Some(tool),
            ContourEventKind::Action(Action::Home { .. }) => self.state = CompensationState::Off,
            ContourEventKind::Select { side, approach, along } => {
                self.select(side, approach.is_some(), along.is_some());
            }
            ContourEventKind::Cancel { .. } => match &mut self.state {
                CompensationState::Active { cancels, relinks, .. } => {
                    (*cancels, *relinks) = (true, None)
                }
                state => *state = CompensationState::Off,
            },
            _ => {}
        }
    }

    fn select(&mut self, new: CutterSide, has_approach: bool, is_along: bool) {
        let CompensationState::Active { side, cancels, relinks, changes } = &mut self.state else {
            self.state = CompensationState::Selected { side: new, is_along };
            return;
        };
        let is_repeat = *side == new && !*cancels;
        let rules = self.profile;
        let is_refused = if is_repeat {
            rules.reselect.rule == Reselect::Forbidden
                && rules.reselect.severity() == Severity::Error
        } else {
            let change = &rules.side_change;
            change.rule == SideChange::Forbidden && change.strictness.severity() == Severity::Error
        };
        if is_refused {
            return;
        }
        let at_intersection = !is_repeat
            && !*cancels
            && !has_approach
            && rules.side_change.rule == SideChange::Intersection;
        if is_repeat {
            *changes = None;
        }
        if at_intersection {
            *changes = Some(new);
        } else if !is_repeat || has_approach {
            *cancels = false;
            *relinks = Some(new);
        }
    }

    /// The length that D has selected, if this motion of Z activates it (S34).
    fn length_that_acts(&mut self, motion: &Motion) -> Option<Action> {
        let (offset, length_mm) = self.length;
        let acts = self.profile.radius.length_of_d == LengthOfD::WithZ
            && self.plane == Plane::Xy
            && motion.axes.contains(2)
            && length_mm != self.length_in_force;
        acts.then(|| {
            self.length_in_force = length_mm;
            Action::ToolLength { offset, second: None, length_mm }
        })
    }

    /// The kind of a motion, and whether a contour begins with it although no move leads to it.
    fn motion(
        &mut self,
        start: Position,
        motion: &Motion,
        source: Source,
        shifts_z: bool,
    ) -> (BlockKind, bool) {
        let [u, v, w] = self.plane.axes();
        let moved = (motion.end[u] - start[u]).abs().max((motion.end[v] - start[v]).abs());
        let turns =
            matches!(motion.shape, Shape::Arc(arc) if arc.turns > 0 && arc.plane == self.plane);
        let shifts = moved > STILL_MM || turns;
        let names = motion.axes.contains(u) || motion.axes.contains(v);
        let rises = shifts_z || motion.end[w] != start[w];
        match self.state {
            CompensationState::Off => (BlockKind::Free, false),
            CompensationState::Selected { side, is_along } => {
                if (!shifts && !names) || self.is_too_fast(motion, self.profile.select.lead) {
                    return (BlockKind::Free, false);
                }
                self.open(side, source);
                self.offset.is_joined =
                    is_along || self.profile.select.target == SelectTarget::NormalEntry;
                (BlockKind::LeadOn, false)
            }
            CompensationState::Active { side, cancels, relinks, changes } => {
                let rules = self.profile;
                let lead = if cancels { rules.cancel.lead } else { rules.select.lead };
                let leads = (cancels || relinks.is_some()) && !self.is_too_fast(motion, lead);
                if leads && (shifts || (names && !rises)) {
                    let Some(new) = relinks.filter(|_| !cancels) else {
                        self.state = CompensationState::Off;
                        return (BlockKind::LeadOff, false);
                    };
                    self.open(new, source);
                    self.offset.is_joined = false;
                    return (BlockKind::Link, false);
                }
                if moved <= 0.0 && !turns {
                    return (if rises { BlockKind::OffPlane } else { BlockKind::Still }, false);
                }
                if motion.class != MotionClass::Feed && self.profile.rapid.rule == RapidMode::Raw {
                    let side = relinks.unwrap_or(side);
                    self.state = match cancels {
                        true => CompensationState::Off,
                        false => CompensationState::Selected { side, is_along: false },
                    };
                    return (BlockKind::LeadOff, false);
                }
                if let Some(new) = changes {
                    self.change_side(new, source);
                }
                let is_line = matches!(motion.shape, Shape::Line);
                let is_perpendicular = self.profile.radius.change_at == ChangeAt::Perpendicular;
                if self.radius_changes && is_perpendicular && is_line && self.legs > 0 {
                    self.open(side, source);
                    self.offset.is_joined = true;
                    return (BlockKind::Link, false);
                }
                self.leg(is_line, source);
                (BlockKind::Leg, changes.is_some())
            }
        }
    }

    /// Whether a motion is a rapid where leads must be feed moves.
    fn is_too_fast(&self, motion: &Motion, lead: LeadMove) -> bool {
        lead == LeadMove::Coordinated && motion.class != MotionClass::Feed
    }

    fn open(&mut self, side: CutterSide, source: Source) {
        let d_mm = self.signed(side, source);
        let tip = radius::tip(self.word, self.spindle_tool, self.profile, self.tools);
        self.offset = Offset { d_in: d_mm, d_out: d_mm, tip_in: tip, tip, ..self.offset };
        self.state =
            CompensationState::Active { side, cancels: false, relinks: None, changes: None };
        (self.radius_changes, self.value_waits, self.legs) = (false, None, 0);
    }

    /// Changes the side without a move: the next leg begins another contour.
    fn change_side(&mut self, new: CutterSide, source: Source) {
        self.open(new, source);
        self.offset.is_joined = true;
    }

    fn leg(&mut self, is_line: bool, source: Source) {
        self.value_waits = match self.value_waits {
            Some(0) => {
                self.radius_changes = true;
                None
            }
            waits => waits.map(|blocks| blocks - 1),
        };
        self.legs += 1;
        self.offset.tip = radius::tip(self.word, self.spindle_tool, self.profile, self.tools);
        if self.radius_changes && is_line {
            self.radius_changes = false;
            if let CompensationState::Active { side, .. } = self.state {
                let d_mm = self.signed(side, source);
                // A smaller difference is no change.
                if (d_mm - self.offset.d_out).abs() >= 1e-9 {
                    self.offset.d_out = d_mm;
                }
            }
        } else if self.radius_changes {
            let now = match self.state {
                CompensationState::Active { side, .. } => self.signed(side, source),
                _ => self.offset.d_out,
            };
            self.radius_changes = (now - self.offset.d_out).abs() >= 1e-9;
        }
    }

    fn signed(&self, side: CutterSide, at: Source) -> f64 {
        let word = radius::resolve(self.word, self.spindle_tool, self.profile, self.tools, at).0;
        let radius_mm = self.value_mm.unwrap_or(word);
        if side == CutterSide::Left { radius_mm } else { -radius_mm }
    }
}

/// The length of register D, or of the tool of that number if there is no such register.
fn length_of(number: u32, tools: &ToolTable) -> f64 {
    match (tools.offsets.get(&number), tools.tools.get(&number)) {
        (Some(register), _) => register.length_mm,
        (None, Some(tool)) => tool.length_mm,
        (None, None) => 0.0,
    }
}
