//! Collects what the audit finds, as messages with numbers and with the severity that the profile
//! sets.

use cnc_msgs::contour::{Action, Motion, Source};
use cnc_msgs::finding::{Code, Finding, Severity};
use cnc_msgs::geometry::{AXIS_LETTERS, Plane, Position};
use cnc_msgs::path::{PathElement, PathEvent};
use cnc_msgs::profile::{Profile, Reaction};
use std::ops::RangeInclusive;

/// Findings listed for each severity; more help nobody.
const FINDINGS_MAX: usize = 100;

#[derive(Debug)]
pub(crate) struct Report<'a> {
    pub profile: &'a Profile,
    /// What the planner has reported already, and where: each line with the index of a finding.
    said: &'a [Finding],
    said_at: Vec<(u32, u32)>,
    /// The lines of contours that the tool does not fit and that the control still runs.
    pub misfits: Vec<RangeInclusive<u32>>,
    pub findings: Vec<Finding>,
    errors: usize,
    /// Whether errors were left out.
    is_cut_off: bool,
}

impl<'a> Report<'a> {
    pub(crate) fn new(profile: &'a Profile, said: &'a [Finding]) -> Self {
        let (misfits, findings) = (Vec::new(), Vec::new());
        let at = |(index, said): (u32, &Finding)| lines_of(said).map(move |line| (line, index));
        let mut said_at: Vec<(u32, u32)> = (0..).zip(said).flat_map(at).collect();
        said_at.sort_unstable();
        Self { profile, said, said_at, misfits, findings, errors: 0, is_cut_off: false }
    }

    /// What the planner has reported about a line. Programs may have a finding in each of a hundred
    /// thousand contours.
    fn said_of(&self, line: u32) -> impl Iterator<Item = &'a Finding> + '_ {
        let from = self.said_at.partition_point(|(at, _)| *at < line);
        let here = self.said_at[from..].iter().take_while(move |(at, _)| *at == line);
        here.map(|(_, index)| &self.said[*index as usize])
    }

    /// Whether the tool does not fit a contour at this line, and the control still runs it.
    fn is_misfit(&self, line: u32) -> bool {
        self.misfits.iter().any(|lines| lines.contains(&line))
    }

    /// Errors and warnings are counted apart, so that no number of warnings hides an error.
    pub(crate) fn push(&mut self, finding: Finding) {
        let (is_error, warnings) = (finding.is_error(), self.findings.len() - self.errors);
        let is_full = if is_error { self.is_cut_off } else { warnings >= FINDINGS_MAX };
        let mut lines = lines_of(&finding);
        if is_full || lines.any(|line| self.said_of(line).any(|said| is_same(said, &finding))) {
            return;
        }
        self.errors += usize::from(is_error);
        if is_error && self.errors > FINDINGS_MAX {
            self.is_cut_off = true;
            let message = format!(
                "the path is wrong at more places from here on; only the first {FINDINGS_MAX} are \
                 listed"
            );
            self.findings.push(Finding::error(Code::Limit, finding.source, message));
        } else {
            self.findings.push(finding);
        }
    }

    /// A finding about the distance of the path from its contour, and about nothing else.
    pub(crate) fn push_shape(&mut self, mut finding: Finding) {
        if self.is_misfit(finding.source.line) {
            finding.severity = Severity::Warning;
            finding.help = HELP_OF_MISFIT.into();
        }
        self.push(finding);
    }

    /// Reports a cut. If it is into blocks that the planner has called unreachable, it gets the
    /// severity that the profile sets for those: what is not followed is not cut either.
    pub(crate) fn push_cut(&mut self, cut: &Cut) {
        let mut finding = self::cut(cut, self.profile);
        let is_of = |said: &&Finding| said.code == Code::Unreachable && !said.is_error();
        let lines = |said: &Finding| {
            let (line, other) = (said.source.line, said.other.map(|other| other.line));
            line.min(other.unwrap_or(line))..=line.max(other.unwrap_or(line))
        };
        let mut lost = self.said.iter().filter(is_of).map(lines);
        let is_run = self.is_misfit(finding.source.line);
        if cut.code == Code::Gouge && is_run && lost.any(|lines| lines.contains(&cut.into.line)) {
            finding.severity = Severity::Warning;
        }
        self.push(finding);
    }

    /// Whether the planner has warned that a lead skips this block and that at least as much of it
    /// stays as the audit finds, mm.
    pub(crate) fn is_known_uncut(&self, source: Source, off_mm: f64) -> bool {
        self.said_of(source.line).any(|said| {
            let line = said.other.map_or(said.source.line, |other| other.line);
            said.code == Code::Uncut
                && line == source.line
                && said.available_mm.is_some_and(|stays_mm| stays_mm >= off_mm)
        })
    }

    pub(crate) fn is_full(&self) -> bool {
        self.is_cut_off
    }
}

/// The lines of a finding: its own, and that of the other block.
fn lines_of(of: &Finding) -> impl Iterator<Item = u32> + use<> {
    [Some(of.source.line), of.other.map(|other| other.line)].into_iter().flatten()
}

/// Whether a finding has been reported already. A path may have more faults than it was warned of.
fn is_same(said: &Finding, finding: &Finding) -> bool {
    let lines = |of: &Finding| [Some(of.source.line), of.other.map(|other| other.line)];
    let (known, found) = (lines(said), lines(finding));
    let mut found = found.iter().flatten();
    let is_known = |line: &u32| known.contains(&Some(*line));
    let is_worse = finding.is_error() && !said.is_error();
    // A lead that cuts is reported once, at its deepest place.
    let is_of_lead = (said.code, finding.code) == (Code::LeadGouge, Code::LeadNick);
    (said.code == finding.code || is_of_lead && said.source.line == finding.source.line)
        && match finding.code {
            Code::PathMismatch if said.severity != finding.severity => false,
            // A known cut into a block says nothing about another place on it.
            Code::Gouge if is_worse => found.any(is_known) && is_one_place(said, finding),
            _ => found.any(is_known),
        }
}

/// Whether the tool touches the places of two cuts at the same time.
fn is_one_place(a: &Finding, b: &Finding) -> bool {
    let (Some(at), Some(other), Some(radius_mm)) = (a.position, b.position, b.needed_mm) else {
        return false;
    };
    let apart_squared: f64 = (0..3).map(|axis| (at[axis] - other[axis]).powi(2)).sum();
    apart_squared <= (2.0 * radius_mm).powi(2)
}

/// The codes for a contour that the tool does not fit.
pub(crate) const fn is_misfit(code: Code) -> bool {
    matches!(code, Code::Gouge | Code::Unreachable | Code::ArcOver360)
}

const HELP_OF_MISFIT: &str = "the tool does not fit this contour, and the profile lets the \
                              control run it; look at the path there, or use a smaller tool";
const HELP: &str = "do not run this path; plan the program again";

pub(crate) fn block_name(source: Source) -> String {
    match source.block {
        Some(block) => format!("block N{block}"),
        None => format!("line {}", source.line),
    }
}

fn mismatch(source: Source, message: String) -> Finding {
    Finding::error(Code::PathMismatch, source, message).help(HELP)
}

pub(crate) fn unknown_block(element: &PathElement, index: usize) -> Finding {
    let message = format!(
        "element {index} of the path is a {} of {}, but the program has no such move there",
        element.role.name(),
        block_name(element.source)
    );
    mismatch(element.source, message)
}

pub(crate) fn not_as_programmed(element: &PathElement, motion: &Motion) -> Finding {
    let message = format!(
        "the path goes to {} in {}, which is programmed to {}",
        all_axes(element.end),
        block_name(element.source),
        all_axes(motion.end)
    );
    let mut finding = mismatch(element.source, message);
    finding.position = Some(element.end);
    finding
}

pub(crate) fn dropped(source: Source, motion: &Motion) -> Finding {
    let message = format!(
        "the path leaves out {}, which goes to {}",
        block_name(source),
        all_axes(motion.end)
    );
    let mut finding = mismatch(source, message);
    finding.position = Some(motion.end);
    finding
}

pub(crate) fn lost(source: Source, action: &Action) -> Finding {
    mismatch(source, format!("{} of {} is not in the path", action.text(), block_name(source)))
}

pub(crate) fn extra(event: &PathEvent) -> Finding {
    let (text, name) = (event.action.text(), block_name(event.source));
    mismatch(event.source, format!("the path has {text} of {name} more often than the program"))
}

pub(crate) fn other_event(source: Source, action: &Action, found: &PathEvent) -> Finding {
    let message = format!(
        "the path has {} of {} where {} of {} should be",
        found.action.text(),
        block_name(found.source),
        action.text(),
        block_name(source)
    );
    let mut finding = mismatch(source, message);
    finding.other = Some(found.source).filter(|other| !other.is_same_place(source));
    finding
}

pub(crate) fn misplaced(event: &PathEvent, due: usize) -> Finding {
    let message = format!(
        "{} of {} happens before element {} of the path; it should happen before element {due}",
        event.action.text(),
        block_name(event.source),
        event.at_element
    );
    mismatch(event.source, message)
}

pub(crate) fn without_motion(event: &PathEvent) -> Finding {
    let message = format!(
        "{} of {} moves with no motion of its block before element {} of the path",
        event.action.text(),
        block_name(event.source),
        event.at_element
    );
    mismatch(event.source, message)
}

pub(crate) fn not_finite(element: &PathElement, index: usize) -> Finding {
    let message = format!(
        "element {index} of the path, of {}, has a coordinate or feed that is not a finite number",
        block_name(element.source)
    );
    Finding::error(Code::BadNumber, element.source, message).help(HELP)
}

pub(crate) fn no_length(element: &PathElement, index: usize) -> Finding {
    let name = block_name(element.source);
    mismatch(element.source, format!("element {index} of the path, of {name}, has no length"))
}

pub(crate) fn uneven(element: &PathElement, radii: (f64, f64)) -> Finding {
    let message = format!(
        "the arc of the path in {} begins {:.6} mm and ends {:.6} mm from its centre",
        block_name(element.source),
        radii.0,
        radii.1
    );
    let mut finding = Finding::error(Code::ArcRadius, element.source, message).help(HELP);
    (finding.needed_mm, finding.available_mm) = (Some(radii.0), Some(radii.1));
    finding.position = Some(element.end);
    finding
}

/// The tool does not run at its radius along its own block.
pub(crate) fn wrong_offset(element: &PathElement, needed_mm: f64, found_mm: f64) -> Finding {
    let is_near = found_mm < needed_mm;
    let (code, word) =
        if is_near { (Code::Gouge, "near to") } else { (Code::Unreachable, "far from") };
    let message = format!(
        "the tool runs too {word} {}: its centre is {found_mm:.6} mm away instead of {needed_mm:.6} mm",
        block_name(element.source)
    );
    let mut finding = Finding::error(code, element.source, message).help(HELP);
    (finding.needed_mm, finding.available_mm) = (Some(needed_mm), Some(found_mm));
    finding.depth_mm = is_near.then_some(needed_mm - found_mm);
    finding.position = Some(element.end);
    finding
}

/// An element that does not follow its block.
pub(crate) fn wrong_place(element: &PathElement, what: &str) -> Finding {
    let message = format!("the path does not follow {}: it {what}", block_name(element.source));
    let mut finding = mismatch(element.source, message);
    finding.position = Some(element.end);
    finding
}

/// A cut into a wall, or a move past what the tool reaches: two blocks, and how many legs apart
/// they are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cut {
    pub code: Code,
    pub on: Source,
    pub into: Source,
    pub legs_apart: usize,
    pub at: Position,
    pub plane: Plane,
    pub radius_mm: f64,
    pub distance_mm: f64,
    /// The cut is where the contour closes, and the profile forgives that.
    pub is_forgiven: bool,
}

pub(crate) fn cut(cut: &Cut, profile: &Profile) -> Finding {
    let depth_mm = cut.radius_mm - cut.distance_mm;
    let later = if cut.into.line > cut.on.line { cut.into } else { cut.on };
    let source = if is_lead(cut.code) { cut.on } else { later };
    let message = format!(
        "the tool (radius {:.3} mm) cuts {depth_mm:.4} mm into {} at {} while it follows {}",
        cut.radius_mm,
        block_name(cut.into),
        place(cut.plane, cut.at),
        block_name(cut.on)
    );
    let mut finding = Finding::error(cut.code, source, message)
        .help("use a smaller tool, or change the contour or its lead there");
    finding.alarm.clone_from(&profile.interference.alarm);
    finding.other = [cut.into, cut.on].into_iter().find(|other| !other.is_same_place(source));
    finding.position = Some(cut.at);
    finding.depth_mm = Some(depth_mm);
    finding.needed_mm = Some(cut.radius_mm);
    finding.available_mm = Some(cut.distance_mm);
    finding.severity = match cut.code {
        Code::LeadNick => profile.interference.lead_nick.severity(),
        Code::LeadGouge | Code::LinkGouge => profile.interference.leads.severity(),
        Code::CutsOtherPass => Severity::Warning,
        Code::Gouge if cut.is_forgiven => Severity::Warning,
        _ => contour_severity(cut.legs_apart, profile),
    };
    finding
}

fn is_lead(code: Code) -> bool {
    matches!(code, Code::LeadGouge | Code::LeadNick | Code::LinkGouge)
}

/// The severity that the profile sets for a contour that the tool does not fit, and for one that
/// its control cannot see because it looks too few blocks ahead.
fn contour_severity(legs_apart: usize, profile: &Profile) -> Severity {
    let severity = match profile.interference.react {
        Reaction::Ignore => Severity::Warning,
        // The planner has left out what does not fit, so nothing is cut.
        Reaction::Alarm | Reaction::Trim => Severity::Error,
    };
    match profile.lookahead.blocks {
        Some(blocks) if legs_apart > blocks as usize => {
            severity.min(profile.lookahead.strictness.severity())
        }
        _ => severity,
    }
}

/// Blocks that the path leaves out although they are more than noise.
pub(crate) fn left_out(
    (source, other): (Source, Source),
    (off_mm, legs): (f64, usize),
    at: Position,
    profile: &Profile,
) -> Finding {
    let blocks = match legs {
        1 => block_name(source),
        _ => format!("{legs} blocks around {}", block_name(source)),
    };
    let message = match profile.interference.react {
        Reaction::Trim => {
            format!("the path leaves out {blocks} and passes at a distance of {off_mm:.4} mm")
        }
        Reaction::Alarm | Reaction::Ignore => format!(
            "the path leaves out {blocks} and goes straight on, {off_mm:.4} mm off; at most {} mm \
             are accepted",
            profile.accept_tolerance_mm
        ),
    };
    let mut finding = Finding::error(Code::Unreachable, source, message)
        .help("use a smaller tool, or take the blocks out of the program");
    finding.severity = match profile.interference.react {
        Reaction::Trim => Severity::Warning,
        Reaction::Alarm | Reaction::Ignore => contour_severity(legs + 1, profile),
    };
    finding.alarm.clone_from(&profile.interference.alarm);
    finding.other = Some(other).filter(|other| !other.is_same_place(source));
    finding.position = Some(at);
    finding.needed_mm = Some(profile.accept_tolerance_mm);
    finding.available_mm = Some(off_mm);
    finding
}

pub(crate) fn too_entangled(source: Source) -> Finding {
    let message = "the contour after this block comes near to itself in so many places that the \
                   audit cannot check them all";
    Finding::error(Code::Limit, source, message)
        .help("split the contour into several, each with its own selection and cancel")
}

fn place(plane: Plane, position: Position) -> String {
    let [u, v, _] = plane.axes();
    let (first, second) = (u.min(v), u.max(v));
    format!(
        "{}{:.3} {}{:.3}",
        AXIS_LETTERS[first], position[first], AXIS_LETTERS[second], position[second]
    )
}

fn all_axes(position: Position) -> String {
    let [x, y, z] = position;
    format!("X{x:.4} Y{y:.4} Z{z:.4}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_was_said_of_its_own_lines_is_compared_with_a_finding() {
        let at = |line: u32| Source { line, ..Source::default() };
        let said = |line: u32| {
            let mut nick = Finding::warning(Code::LeadNick, at(2 * line), "");
            nick.other = Some(at(2 * line + 1));
            nick
        };
        let said: Vec<Finding> = (1..10_000).map(said).collect();
        let profile = settings::load_profile("rs274").expect("a profile");
        let mut report = Report::new(&profile, &said);
        for line in [0, 1, 2, 3, 5_001, 19_999, 20_000] {
            let expected = usize::from((2..20_000).contains(&line));
            assert_eq!(report.said_of(line).count(), expected, "{line}");
            report.push(Finding::warning(Code::LeadNick, at(line), ""));
        }
        let new: Vec<u32> = report.findings.iter().map(|finding| finding.source.line).collect();
        assert_eq!(new, [0, 1, 20_000]);
    }
}
