//! The rules of controls about where compensation begins and ends and what may happen in between,
//! with their findings.
//!
//! Each rule is one function with the values of the profile that it obeys. `walk` decides what
//! happens to the program afterwards.

mod blocks_between;
mod findings;

pub(crate) use blocks_between::BlocksBetween;
pub(crate) use findings::*;

use crate::geometry::element::{Arc, Element};
use crate::geometry::frame::{element, in_plane};
use crate::geometry::tolerance::{LEAD_ARC_GROWTH_MAX, RADIUS_MM};
use crate::span::Lead;
use crate::span::lead_arc::{NoLeadArc, lead_arc};
use cnc_msgs::contour::{Action, Motion, MotionClass, Source};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::{AXIS_LETTERS, Plane, Shape};
use cnc_msgs::numbers::with_enough_digits;
use cnc_msgs::profile::{
    ArcLead, CancelAxes, FullCircle, LeadLength, LeadMove, Permission, Profile, RapidMode, Rule,
    Strictness,
};
use std::f64::consts::TAU;

/// The finding about a broken rule.
fn of(strictness: Strictness, code: Code, source: Source, message: impl Into<String>) -> Finding {
    let mut finding = Finding::error(code, source, message);
    finding.severity = strictness.severity();
    finding
}

/// Applies a profile's rules.
pub(crate) struct Rules<'a> {
    pub profile: &'a Profile,
    pub findings: &'a mut Vec<Finding>,
}

impl Rules<'_> {
    /// The first move after the selection (M21, M23, M24, S20), with its signed offset and tip
    /// direction. Returns the arc that it programs, if it is run as one.
    pub(crate) fn lead_on(self, lead: &Lead, plane: Plane, d_mm: f64, tip: u8) -> Option<Arc> {
        let rules = &self.profile.select;
        if let Shape::Arc(shape) = lead.motion.shape
            && rules.arc_lead == ArcLead::Arc
            && lead.along.is_none()
        {
            if shape.plane != plane {
                self.wrong_arc_plane(lead.source, &lead.motion, plane);
                return None;
            }
            return self.arc_lead(lead, plane, d_mm, tip);
        }
        let straight = (rules.length, rules.arc_lead.strictness());
        self.lead(lead, plane, d_mm.abs(), straight, "lead-on");
        None
    }

    /// A lead-on that is an arc and is run as one (LinuxCNC).
    fn arc_lead(self, lead: &Lead, plane: Plane, d_mm: f64, tip: u8) -> Option<Arc> {
        // Directions 0 and 9 are those of the centre.
        let is_centre = matches!(tip, 0 | 9);
        let element = element(plane, lead.start, &lead.motion);
        let arc = match element {
            Some(Element::Arc(arc)) if is_centre => Some(arc),
            _ => None,
        };
        let mut found = match arc.map(|arc| lead_arc(&arc, d_mm)) {
            Some(Ok(_)) => None,
            _ if !is_centre => Some(arc_lead_of_tip(lead.source, tip)),
            Some(Err(why)) => Some(no_lead_arc(lead.source, why, d_mm)),
            None => Some(no_lead_arc(lead.source, NoLeadArc::FullCircle, d_mm)),
        };
        if let (None, Some(element)) = (&found, &element) {
            let end = in_plane(plane, lead.motion.end);
            found = uneven_arc(lead.source, element, end, d_mm, self.profile);
        }
        let run = arc.and_then(|arc| lead_arc(&arc, d_mm).ok());
        if let (None, Some(arc), Some(run)) = (&found, arc, run)
            && run.radius > LEAD_ARC_GROWTH_MAX * arc.radius
        {
            let run_mm = run.radius - d_mm * run.turn;
            found = Some(grown_lead_arc(lead.source, &arc, run_mm, d_mm.abs()));
        }
        self.findings.extend(found.map(|mut finding| {
            finding.position = Some(lead.motion.end);
            finding
        }));
        arc
    }

    /// The first move after the cancel (M22, M24, M27, S29).
    pub(crate) fn lead_off(self, lead: &Lead, plane: Plane, radius_mm: f64) {
        let [u, v, _] = plane.axes();
        let (axes, profile) = (lead.motion.axes, self.profile);
        if profile.cancel.axes.rule == CancelAxes::Both && !(axes.contains(u) && axes.contains(v)) {
            let names = axes.letters();
            self.findings.push(
                of(
                    profile.cancel.axes.strictness,
                    Code::Cancel,
                    lead.source,
                    format!(
                        "the first move after the cancel names {}; {} needs both {} and {}",
                        if names.is_empty() { "no axis" } else { &names },
                        profile.name,
                        AXIS_LETTERS[u],
                        AXIS_LETTERS[v]
                    ),
                )
                .help("write both axes of the plane in this block, even if one does not change"),
            );
        }
        let rules = &profile.cancel;
        self.lead(lead, plane, radius_mm, (rules.length, rules.arc_lead), "lead-off");
    }

    /// A move that ends one contour and begins the next (S36 to S42).
    pub(crate) fn link(self, lead: &Lead) {
        let strictness = self.profile.select.arc_lead.strictness();
        self.lead_type(lead, strictness, "link");
    }

    fn lead(
        self,
        lead: &Lead,
        plane: Plane,
        radius_mm: f64,
        (rule, arc_lead): (Rule<LeadLength>, Strictness),
        name: &str,
    ) {
        let length_mm = lead.length(plane);
        if rule.rule == LeadLength::LongerThanRadius
            && radius_mm > RADIUS_MM
            && length_mm <= radius_mm + RADIUS_MM
        {
            // The resolution of programs: the next longer length that three decimals can show.
            let enough_mm = (radius_mm * 1e3).floor() / 1e3 + 1e-3;
            let [length, radius] = with_enough_digits(length_mm, radius_mm);
            let mut finding = of(
                rule.strictness,
                Code::LeadLength,
                lead.source,
                format!(
                    "the {name} is {length} mm long; {} needs it longer than the radius of \
                     {radius} mm: {enough_mm:.3} mm or more",
                    self.profile.name
                ),
            )
            .help(format!(
                "make the {name} {enough_mm:.3} mm long or longer, or use a smaller tool"
            ));
            finding.needed_mm = Some(radius_mm);
            finding.available_mm = Some(length_mm);
            finding.position = Some(lead.motion.end);
            self.findings.push(finding);
        }
        self.lead_type(lead, arc_lead, name);
    }

    fn lead_type(self, lead: &Lead, strictness: Strictness, name: &str) {
        let what = match (lead.motion.shape, lead.motion.class) {
            (Shape::Arc(_), _) => "an arc",
            (_, MotionClass::NonCoordinated) => "a rapid whose axes move independently",
            _ => return,
        };
        let needed = match self.profile.select.lead {
            LeadMove::Any => "it must be a straight line".into(),
            LeadMove::Coordinated => {
                format!("{} does not say how the offset grows along it", self.profile.name)
            }
        };
        let instead = match strictness {
            Strictness::Error => "",
            Strictness::Warn | Strictness::Emulate => "; it is run as a straight line",
        };
        self.findings.push(
            of(
                strictness,
                Code::LeadType,
                lead.source,
                format!("the {name} is {what}; {needed}{instead}"),
            )
            .help("put a straight move in the plane before the arc"),
        );
    }

    /// A block with motion in the plane (M26).
    pub(crate) fn leg(self, source: Source, motion: &Motion, element: &Element) {
        if motion.class == MotionClass::NonCoordinated
            && self.profile.rapid.rule == RapidMode::Compensated
        {
            self.findings.push(
                Finding::error(
                    Code::Unsupported,
                    source,
                    "under compensation a move must follow a line or an arc; here each axis moves \
                     independently",
                )
                .help("use a feed move, or cancel the compensation before"),
            );
        }
        let Element::Arc(arc) = element else { return };
        if self.profile.full_circle.rule == FullCircle::Forbidden && arc.sweep >= TAU - 1e-9 {
            self.findings.push(
                of(
                    self.profile.full_circle.strictness,
                    Code::FullCircle,
                    source,
                    format!(
                        "an arc of {:.1} degrees in one block; {} takes less than a full circle under compensation",
                        arc.sweep.to_degrees(),
                        self.profile.name
                    ),
                )
                .help("write it as two arcs"),
            );
        }
    }

    /// An arc that is not in the plane of compensation.
    pub(crate) fn wrong_arc_plane(self, source: Source, motion: &Motion, plane: Plane) {
        if let Shape::Arc(arc) = motion.shape
            && arc.plane != plane
        {
            self.findings.push(Finding::error(
                Code::Plane,
                source,
                format!(
                    "an arc in the {} plane while the compensation is in {}",
                    arc.plane.name(),
                    plane.name()
                ),
            ));
        }
    }

    /// A move of the third axis while compensation is selected (M18, M19).
    pub(crate) fn off_plane_move(self, source: Source, plane: Plane) {
        let [_, _, third] = plane.axes();
        let permission = self.profile.auxiliary.moves;
        let what = format!("a move of {}", AXIS_LETTERS[third]);
        let help = "bring the tool to depth before the selection, and retract after the lead-off";
        let _ = self.permit(permission, source, &what, help);
    }

    /// An action while compensation is selected (M20, S27); returns whether it is refused.
    pub(crate) fn action(self, action: &Action, source: Source, selected: Source) -> bool {
        let always = Rule {
            rule: Permission::Forbidden,
            strictness: self.profile.forbidden_under_compensation.strictness,
        };
        match action {
            Action::ProgramEnd { .. } | Action::Message { .. } => false,
            Action::WorkOffset { .. }
            | Action::SetWorkOffset { .. }
            | Action::Reference { .. }
            | Action::MachineMove { .. }
            | Action::Probe(_)
            | Action::Relative { .. }
            | Action::Stretch { .. }
            | Action::ChangeTool { .. } => self.permit(
                always,
                source,
                &name(action),
                "cancel the compensation before, and select it again after",
            ),
            Action::SpindleSync { .. } => self.permit(
                always,
                source,
                &name(action),
                "cancel the compensation, and end it with a straight move before",
            ),
            // Whatever the profile allows: the offset path would meet them elsewhere.
            Action::Further(further) => {
                let letters = further.axes.letters();
                let message = format!("{letters} moves while cutter compensation is active");
                let help = format!("move {letters} before the selection or after the lead-off");
                let code = Code::ForbiddenUnderCompensation;
                let mut finding = Finding::error(code, source, message).help(help);
                finding.other = Some(selected).filter(|selected| *selected != source);
                self.findings.push(finding);
                true
            }
            // The walk has ended the compensation and reported it.
            Action::Home { .. } => false,
            // An action in the block of the selection happens before it.
            _ if source == selected => false,
            _ => {
                let permission = self.profile.auxiliary.functions;
                let help = "put it before the selection or after the lead-off";
                self.permit(permission, source, &name(action), help)
            }
        }
    }

    /// Reports a forbidden action; returns whether it is refused.
    fn permit(self, permission: Rule<Permission>, source: Source, what: &str, help: &str) -> bool {
        if permission.rule == Permission::Allowed {
            return false;
        }
        let mut finding = Finding::error(
            Code::ForbiddenUnderCompensation,
            source,
            format!(
                "{what} while cutter compensation is active, which {} forbids",
                self.profile.name
            ),
        )
        .help(help);
        finding.severity = permission.severity();
        let is_refused = finding.is_error();
        self.findings.push(finding);
        is_refused
    }
}

/// What is to be done about actions between a cancel and its move, which have been reported.
pub(crate) fn before_lead_off(findings: &mut [Finding], cancelled: Source) {
    for finding in findings {
        finding.help = format!(
            "put a move in the plane before it: the cancel in line {} takes effect with that move",
            cancelled.line
        );
        finding.other = Some(cancelled);
    }
}

/// An action by the name that users know, whatever the program's words are.
fn name(action: &Action) -> String {
    match action {
        Action::SelectTool { tool } => format!("the selection of tool {tool}"),
        Action::ChangeTool { tool } => format!("the change to tool {tool}"),
        Action::Dwell { seconds } => format!("a dwell of {seconds} s"),
        Action::ToolLength { .. } => "a change of the length offset".into(),
        Action::Reference { .. } => "a move to the reference point".into(),
        Action::MachineMove { .. } => "a move in machine coordinates".into(),
        Action::SetWorkOffset { .. } => "a change of a work offset".into(),
        Action::Probe(_) => "a probe".into(),
        Action::SpindleSync { .. } => "a thread (G33, G76)".into(),
        Action::Relative { .. } => {
            "an incremental move from a place that only the machine knows".into()
        }
        Action::Stretch { .. } => "the result of a probe or of M66".into(),
        _ => action.text(),
    }
}
