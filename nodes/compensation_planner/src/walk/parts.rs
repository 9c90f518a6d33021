//! Plans a contour whose events come in parts, of which none is kept.
//!
//! A part ends where nothing is compensated, so no span needs the events of two parts.

use super::{Walk, WalkState};
use crate::geometry::tolerance::LENGTH_MM;
use crate::walk::motions::is_lead;
use crate::walk::plan::{Plan, Workers};
use cnc_msgs::contour::{ContourEvent, ContourEventKind, Motion, RadiusSource};
use cnc_msgs::geometry::{Plane, Position, Shape};
use cnc_msgs::profile::{LeadMove, OutputPoint, Profile};
use cnc_msgs::tool_table::ToolTable;

impl<'a> Walk<'a> {
    /// Ends a part: its plan, and the walk that goes on. Within a span there is none, and the plan ends there.
    pub(crate) fn next_part<'b>(
        mut self,
        profile: &'b Profile,
        tools: &'b ToolTable,
        workers: &'b dyn Workers,
    ) -> Result<(Plan, Walk<'b>), Box<Plan>> {
        if !matches!(self.state, WalkState::Off) {
            return Err(Box::new(self.finish()));
        }
        let plan = self.take_plan();
        let walk = Walk {
            calls: self.calls,
            profile,
            tools,
            out: self.out.for_next_part(profile, workers),
            report: self.report,
            plane: self.plane,
            corner: self.corner,
            radius: self.radius,
            radius_value_mm: self.radius_value_mm,
            spindle_tool: self.spindle_tool,
            lengths: self.lengths,
            reported_lengths: self.reported_lengths,
            refused_tool: self.refused_tool,
            led_off_in: self.led_off_in,
            programmed: self.programmed,
            state: WalkState::Off,
        };
        Ok((plan, walk))
    }

    /// The memory of what goes from part to part, bytes.
    pub(crate) fn kept_bytes(&self) -> usize {
        self.out.kept_bytes()
    }
}

/// Where a part may end: a quick look at events, which may miss places. [`Walk::next_part`] decides.
#[derive(Debug)]
pub(crate) struct PartEnd {
    lead: LeadMove,
    plane: Plane,
    at: Position,
    state: State,
    /// The path is that of the tip somewhere, which moves from one end of the nose to the other between two spans.
    has_tip: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Off,
    On,
    /// A cancel waits for its move.
    Cancelled,
}

impl PartEnd {
    pub(crate) fn new(start: Position, profile: &Profile) -> Self {
        Self {
            lead: profile.cancel.lead,
            plane: Plane::default(),
            at: start,
            state: State::Off,
            has_tip: profile.output == OutputPoint::Tip,
        }
    }

    /// Reads the next events; whether the part may end after them.
    pub(crate) fn may_end_after(&mut self, events: &[ContourEvent]) -> bool {
        for event in events {
            match &event.kind {
                ContourEventKind::Plane(plane) => self.plane = *plane,
                ContourEventKind::Radius(RadiusSource::Diameter { tip: 1.., .. }) => {
                    self.has_tip = true;
                }
                ContourEventKind::Select { .. } => self.state = State::On,
                ContourEventKind::Cancel { .. } if self.state == State::On => {
                    self.state = State::Cancelled;
                }
                ContourEventKind::Motion(motion) => {
                    if self.state == State::Cancelled && self.leads_off(motion) {
                        self.state = State::Off;
                    }
                    self.at = motion.end;
                }
                _ => {}
            }
        }
        self.state == State::Off && !self.has_tip
    }

    fn leads_off(&self, motion: &Motion) -> bool {
        let [u, v, _] = self.plane.axes();
        let far = (motion.end[u] - self.at[u]).abs().max((motion.end[v] - self.at[v]).abs());
        is_lead(motion, self.lead) && motion.shape == Shape::Line && far > LENGTH_MM
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::walk::plan::{Alone, plan};
    use cnc_msgs::contour::{
        Action, CoolantMode, CutterSide, MotionClass, ProgrammedContour, Source,
    };
    use cnc_msgs::finding::Finding;
    use cnc_msgs::geometry::AxisSet;
    use cnc_msgs::tool_table::Offset;

    fn sinumerik() -> Profile {
        settings::load_profile("sinumerik_840c").expect("a profile")
    }

    /// D1 of this radius.
    fn offset(radius_mm: f64) -> ToolTable {
        let mut tools = ToolTable::default();
        tools.offsets.insert(1, Offset { radius_mm, ..Offset::default() });
        tools
    }

    /// Squares of 9 mm with the tool outside, one above the other from these X on; after each of
    /// them coolant.
    fn squares(at: &[f64]) -> ProgrammedContour {
        let mut contour = ProgrammedContour::default();
        let mut line = 0;
        for (row, x0) in at.iter().enumerate() {
            let y0 = 30.0 * row as f64;
            let corners = [[0.0, -9.0], [0.0, 0.0], [0.0, 9.0], [9.0, 9.0], [9.0, 0.0], [0.0, 0.0]];
            for (number, [x, y]) in corners.into_iter().chain([[-9.0, -9.0]]).enumerate() {
                line += 1;
                let source = Source { line, ..Source::default() };
                let mut push = |kind| contour.events.push(ContourEvent { source, kind });
                match number {
                    1 => {
                        push(ContourEventKind::Radius(RadiusSource::Offset(1)));
                        let side = CutterSide::Left;
                        push(ContourEventKind::Select { side, approach: None, along: None });
                    }
                    6 => push(ContourEventKind::Cancel { exit: None }),
                    _ => {}
                }
                push(ContourEventKind::Motion(Motion {
                    shape: Shape::Line,
                    end: [x0 + x, y0 + y, 0.0],
                    class: MotionClass::Feed,
                    feed_mm_per_min: 100.0,
                    axes: AxisSet::default(),
                }));
                if number == 6 {
                    push(ContourEventKind::Action(Action::Coolant(CoolantMode::Mist)));
                }
            }
        }
        contour
    }

    /// The plans of all parts as one, and how many parts there were.
    fn planned_in_parts(contour: &ProgrammedContour, tools: &ToolTable) -> (Plan, usize) {
        let profile = sinumerik();
        let mut end = PartEnd::new(contour.start, &profile);
        let mut walk = Walk::new(contour, &profile, tools, &Alone, None);
        let (mut all, mut parts) = (Plan::default(), 0);
        let mut add = |part: Plan| {
            let offset = all.path.elements.len();
            parts += 1;
            all.path.elements.extend(part.path.elements.into_iter().chain(part.refused));
            all.path.events.extend(part.path.events.into_iter().map(|mut event| {
                event.at_element += offset;
                event
            }));
            all.findings.extend(part.findings);
        };
        for event in &contour.events {
            walk.event(&event.kind, event.source);
            if end.may_end_after(std::slice::from_ref(event)) {
                let (part, next) =
                    walk.next_part(&profile, tools, &Alone).expect("no span is open");
                add(part);
                walk = next;
            }
        }
        add(walk.finish());
        (all, parts)
    }

    #[test]
    fn where_the_path_is_that_of_the_tip_no_part_ends() {
        let radius = |tip| ContourEvent {
            source: Source::default(),
            kind: ContourEventKind::Radius(RadiusSource::Diameter { mm: 4.0, tip }),
        };
        for (tip, ends) in [(0, true), (2, false)] {
            let mut end = PartEnd::new([0.0; 3], &sinumerik());
            assert_eq!(end.may_end_after(&[radius(tip)]), ends, "{tip}");
            // The centre again, later.
            assert_eq!(end.may_end_after(&[radius(0)]), ends, "{tip}");
        }
    }

    #[test]
    fn the_parts_of_a_path_are_the_whole_path() {
        // 21 mm are between them: a tool that is wider cuts into the one before.
        for (at, radius_mm, cuts) in [
            (&[0.0, 0.0, 0.0][..], 2.0, false),
            (&[0.0, 5.0, 90.0, 2.0], 2.0, false),
            (&[0.0, 5.0, 90.0, 2.0], 20.5, true),
        ] {
            let (contour, tools) = (squares(at), offset(radius_mm));
            let whole = plan(&contour, &sinumerik(), &tools);
            let (parts, count) = planned_in_parts(&contour, &tools);
            assert!(count > 2 * at.len(), "{count}");
            let square = |source: Source| (source.line - 1) / 7;
            let is_cut = |finding: &Finding| {
                finding.other.is_some_and(|other| square(other) != square(finding.source))
            };
            assert_eq!(whole.findings.iter().any(is_cut), cuts, "{:?}", whole.findings);
            assert_eq!(parts.findings, whole.findings);
            assert_eq!(parts.path.events.len(), at.len());
            if whole.accepted() {
                assert_eq!(parts.path, whole.path);
            } else {
                assert_eq!(parts.path.elements, whole.refused);
            }
        }
    }
}
