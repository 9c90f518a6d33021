//! Solves one span: from its legs to compensated elements.
//!
//! Calls the parts in order: runs, leads, joints, what cannot be reached, and back from runs to
//! blocks. Each part has its own rules.

use crate::check::certificate::{Certificate, Subject};
use crate::check::finding;
use crate::check::interference::{self, Cut, Cuts, Joined};
use crate::check::lead::{self, PreviousWall};
use crate::check::reach::{self, is_any_unreachable, unreachable};
use crate::check::trim::trim;
use crate::check::uncut::{self, UncutRegion};
use crate::check::walls::{Layout, Walls};
use crate::geometry::bounds::Bounds;
use crate::geometry::frame::{height, in_plane, plane_axes};
use crate::geometry::tolerance::{GOUGE_MM, MERGE_MM, RADIUS_MM};
use crate::span::chain::{Placed, Role as LinkRole, join};
use crate::span::chain_links::links;
use crate::span::corner::Corners;
use crate::span::feed;
use crate::span::links::{ChainLinks, Links};
use crate::span::runs::runs;
use crate::span::{Lead, Run, Span};
use crate::walk::emitter::{Emitter, Label};
use crate::walk::span_writer::SpanWriter;
use crate::walk::tool_tip;
use cnc_msgs::contour::CutterSide;
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::path::Role;
use cnc_msgs::profile::{Profile, Reaction};

/// The most findings of one kind in a span; more help nobody, and each takes a search.
const FINDINGS_MAX: usize = 100;

/// How a span ends.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Exit {
    /// By a move back to the programmed path.
    LeadOff(Lead),
    /// By a move that also begins the next span, which writes it.
    Link(Lead),
    /// Not at all: the program ends.
    None,
}

impl Exit {
    pub(crate) fn lead(&self) -> Option<&Lead> {
        match self {
            Self::LeadOff(lead) | Self::Link(lead) => Some(lead),
            Self::None => None,
        }
    }
}

/// The findings about the spans of a contour, and what comes with them.
#[derive(Debug, Default)]
pub(crate) struct SpanReport {
    pub findings: Vec<Finding>,
    pub uncut: Vec<UncutRegion>,
}

impl SpanReport {
    /// Adds the report of a later span.
    fn extend(&mut self, later: Self) {
        self.findings.extend(later.findings);
        self.uncut.extend(later.uncut);
    }
}

/// The tool path along a span and its findings: everything that depends on this span alone.
#[derive(Debug)]
pub(crate) struct Solution {
    runs: Vec<Run>,
    links: ChainLinks,
    placed: Vec<Placed>,
    layout: Layout,
    is_identity: bool,
    report: SpanReport,
    /// The lead-on and the lead-off, once written: radius, mm, and path.
    leads: [Option<(f64, lead::LeadPath)>; 2],
}

/// Finds the radii that a span is good for; `None` without an offset, and when `goes_on` says no.
pub(crate) fn certify(
    span: &mut Span<'_>,
    exit: &Exit,
    profile: &Profile,
    goes_on: &dyn Fn() -> bool,
) -> Option<Certificate> {
    if is_zero(span.d_mm) {
        return None;
    }
    let runs = runs(span, MERGE_MM);
    let lead_off = exit.lead().filter(|_| matches!(exit, Exit::LeadOff(_)));
    Subject::new(span, &runs, lead_off, profile, goes_on).certificate()
}

/// Finds the tool path along a span.
pub(crate) fn solve(span: &mut Span<'_>, exit: &Exit, profile: &Profile) -> Solution {
    let mut report = SpanReport::default();
    let SpanReport { findings, uncut } = &mut report;
    let is_identity = is_zero(span.d_mm) && span.legs.iter().all(|leg| is_zero(leg.d_out_mm));
    let tolerance = profile.accept_tolerance_mm;
    let mut straight_mm = MERGE_MM;
    let mut chain = Chain::new(span, straight_mm, exit.lead(), is_identity, profile);
    if is_any_unreachable(chain.links(), &chain.placed, tolerance) {
        // Rounded coordinates bend short chords so much that the tool loses them, and break
        // straight walls. Straightened within the accepted tolerance, the contour shows what is
        // really too narrow.
        let exact = chain.runs;
        straight_mm = tolerance;
        chain = Chain::new(span, straight_mm, exit.lead(), is_identity, profile);
        chain.measure_straights(&exact);
        unreachable_places(span, &chain, profile, findings);
        if profile.interference.react == Reaction::Trim
            && is_any_unreachable(chain.links(), &chain.placed, tolerance)
        {
            // What is cut in spite of that has to be exact.
            straight_mm = MERGE_MM;
            chain = Chain::new(span, straight_mm, exit.lead(), is_identity, profile);
        }
    }
    let (mut layout, mut cuts) = chain.cuts(span, profile);
    if chain.is_cut_by_noise(&cuts, tolerance) {
        let mut straight = Chain::new(span, tolerance, exit.lead(), is_identity, profile);
        straight.measure_straights(&chain.runs);
        let (other_layout, other_cuts) = straight.cuts(span, profile);
        if other_cuts.cuts.len() < cuts.cuts.len()
            && !is_any_unreachable(straight.links(), &straight.placed, tolerance)
        {
            (chain, layout, cuts) = (straight, other_layout, other_cuts);
        } else {
            chain = Chain::new(span, straight_mm, exit.lead(), is_identity, profile);
        }
    }
    let Chain { runs, links: own_links, mut placed } = chain;
    let links = own_links.of(&runs);
    for skipped in reach::skipped_by_leads(links, &placed, tolerance) {
        findings.push(finding::skipped_by_lead(span, &runs, &skipped, exit.lead()));
    }
    let corners = Corners { span, short_mm: profile.corner.short_block_mm };
    let joined = Joined { links, placed: &placed, corners };
    if let Some(lengths_mm) = lead::starts_past(&joined) {
        findings.push(finding::lead_starts_past(span, lengths_mm));
    }
    for cut in cuts.cuts.iter().take(FINDINGS_MAX) {
        findings.push(finding::cut(span, &runs, cut, profile));
    }
    if !cuts.is_complete {
        findings.push(finding::too_entangled(span));
    }
    if profile.interference.react == Reaction::Trim
        && (!cuts.cuts.is_empty() || reach::left_out(links, &placed, tolerance).next().is_some())
    {
        let rule = profile.interference.at_closing;
        let walls = Walls::all(&runs, links, &placed).forgiving_closing(rule);
        let trimmed = trim(&walls, &joined, tolerance);
        for cut in &trimmed.cuts {
            findings.push(finding::not_trimmed(span, &runs, cut, profile));
        }
        if !trimmed.placed.iter().any(|p| matches!(links.role(p.link), LinkRole::Run(_))) {
            findings.push(finding::nothing_left(span));
        }
        let joined = Joined { placed: &trimmed.placed, ..joined };
        uncut.extend(uncut::regions(&joined, &runs, &trimmed.loops, tolerance));
        placed = trimmed.placed;
        layout = walls.into_layout();
    }
    let links = own_links;
    Solution { runs, links, placed, layout, is_identity, report, leads: [None; 2] }
}

impl Solution {
    /// Writes the span. `previous_wall` is the wall that a link at its start leaves; returns the
    /// wall that a link at its end leaves.
    pub(crate) fn put_out(
        &mut self,
        span: &Span<'_>,
        exit: &Exit,
        previous_wall: Option<PreviousWall>,
        profile: &Profile,
        out: &mut Emitter,
        report: &mut SpanReport,
    ) -> Option<PreviousWall> {
        let Self { runs, links, placed, layout, is_identity, report: own, leads } = self;
        let (runs, links) = (&*runs, links.of(runs));
        report.extend(std::mem::take(own));
        let findings = &mut report.findings;
        let corners = Corners { span, short_mm: profile.corner.short_block_mm };
        let joined = Joined { links, placed, corners };
        out.side = side_of(span.d_mm);
        // The path is computed at the tool centre, and written there or at the tip.
        let to_tip = tool_tip::TipShift::new(span);
        out.position = to_tip.centre(span.plane, out.position, to_tip.first);
        let mut writer = SpanWriter {
            span,
            corners,
            profile,
            out,
            findings,
            item: 0,
            exit_source: exit.lead().map(|lead| lead.source),
        };
        let first_element = writer.out.path.elements.len();
        let lead_start = in_plane(span.plane, writer.out.position);
        writer.lead_on(links, placed);
        if *is_identity {
            writer.as_programmed();
        } else {
            writer.links(runs, links, placed, exit.lead());
        }
        writer.items_before(span.legs.len(), false);
        to_tip.apply(span, &mut out.path.elements[first_element..]);
        out.position = to_tip.tip(span.plane, out.position, to_tip.last);
        let walls = Walls::of_layout(runs, layout);
        let mut check = lead::Check { profile, plane: span.plane, walls: &walls, findings };
        if span.entry.from.is_none()
            && let Some(path) = lead::LeadPath::on(&joined, lead_start)
        {
            check.lead_on(span, runs, &path, previous_wall);
            // A link begins with the offset of the span before.
            let from_mm = previous_wall.map_or(f64::INFINITY, |wall| wall.d_mm.abs());
            leads[0] = Some((span.d_mm.abs().min(from_mm), path));
        }
        let path_of = |run: usize| {
            let place = placed.iter().find(|place| links.role(place.link) == LinkRole::Run(run))?;
            interference::lengthened(&links.at(place.link), place)
        };
        if let (Some(wall), Some(_)) = (previous_wall, span.entry.from) {
            check.change_of_side(span, path_of(0), wall);
        }
        for (at_end, other_side) in [(false, span.entry.from), (true, span.next)] {
            let run = if at_end { runs.len() - 1 } else { 0 };
            let place = placed.iter().find(|it| links.role(it.link) == LinkRole::Run(run));
            let beyond =
                |place: &Placed| interference::beyond(&links.at(place.link), place, at_end);
            if let Some(path) = place.filter(|_| other_side.is_some()).and_then(beyond) {
                check.beyond(span, runs, &path, run);
            }
        }
        if let Exit::LeadOff(lead) = exit {
            let label = Label {
                role: Role::LeadOff,
                source: lead.source,
                feed_mm_per_min: feed(&lead.motion),
                axes: lead.motion.axes.union(plane_axes(span.plane)),
            };
            let end = in_plane(span.plane, lead.motion.end);
            out.line_to(span.plane, end, height(span.plane, lead.motion.end), label);
            let centre = to_tip.centre(span.plane, lead.motion.end, to_tip.last);
            if let Some(path) = lead::LeadPath::off(&joined, in_plane(span.plane, centre)) {
                check.lead_off(span, runs, &path, lead);
                leads[1] = Some((span.d_out_mm.abs(), path));
            }
        }
        out.side = None;
        check.last_wall(span, runs, runs.len().checked_sub(1).and_then(path_of))
    }
}

impl Solution {
    pub(crate) fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// The walls of the contour.
    pub(crate) fn walls(&self) -> Walls<'_> {
        Walls::of_layout(&self.runs, &self.layout)
    }

    /// The tool path between the leads.
    pub(crate) fn joined<'a>(&'a self, span: &'a Span<'_>, profile: &Profile) -> Joined<'a> {
        let corners = Corners { span, short_mm: profile.corner.short_block_mm };
        Joined { links: self.links.of(&self.runs), placed: &self.placed, corners }
    }

    /// A box around the tool path and its leads, and the greatest radius, mm. `None` where the tool
    /// goes around a corner in lines, which may be long.
    pub(crate) fn bounds(&self, span: &Span<'_>, profile: &Profile) -> Option<(Bounds, f64)> {
        let Joined { links, placed, corners } = self.joined(span, profile);
        let has_lines = |index: usize| {
            matches!(links.role(placed[index].link), LinkRole::Corner { .. })
                && corners.lines(links, placed, index).is_some()
        };
        if (0..placed.len()).any(has_lines) {
            return None;
        }
        let mut reach = 0.0_f64;
        let (mut walls, mut bounds) = (Bounds::EMPTY, Bounds::EMPTY);
        for run in &self.runs {
            walls = walls.union(Bounds::of(&run.element));
            reach = reach.max(run.d_in_mm.abs()).max(run.d_out_mm.abs());
        }
        for place in placed {
            bounds = bounds.with(place.start).with(place.end);
        }
        for (radius_mm, path) in self.leads.iter().flatten() {
            reach = reach.max(*radius_mm);
            bounds = path.elements().fold(bounds, |all, path| all.union(Bounds::of(&path)));
        }
        // Each point of an arc has its foot on a wall, or goes around a corner of it.
        Some((bounds.union(walls.wider(reach)), reach))
    }

    /// The lead-on and the lead-off, once written: radius, mm, and path.
    pub(crate) fn leads(&self) -> [Option<(f64, lead::LeadPath)>; 2] {
        self.leads
    }

    /// Whether the path is as programmed: nothing is compensated.
    pub(crate) fn is_identity(&self) -> bool {
        self.is_identity
    }
}

/// Reports what the tool does not reach.
fn unreachable_places(
    span: &Span<'_>,
    chain: &Chain,
    profile: &Profile,
    findings: &mut Vec<Finding>,
) {
    let (runs, links, placed) = (&chain.runs, chain.links(), &chain.placed);
    let mut places = unreachable(links, placed, profile.accept_tolerance_mm);
    for place in places.by_ref().take(FINDINGS_MAX) {
        findings.push(finding::unreachable(span, runs, &place, profile));
    }
    if let Some(place) = places.next() {
        findings.push(finding::more_unreachable(span, runs, &place, FINDINGS_MAX, profile));
    }
}

/// The runs of a span, joined.
struct Chain {
    runs: Vec<Run>,
    links: ChainLinks,
    placed: Vec<Placed>,
}

impl Chain {
    /// Points within `straight_mm` of a line are on it; `is_identity` joins nothing.
    fn new(
        span: &mut Span<'_>,
        straight_mm: f64,
        exit: Option<&Lead>,
        is_identity: bool,
        profile: &Profile,
    ) -> Self {
        let runs = runs(span, straight_mm.max(MERGE_MM));
        let links = match is_identity {
            true => ChainLinks::default(),
            false => links(span, &runs, exit, profile, 1.0),
        };
        let placed = join(links.of(&runs), profile.accept_tolerance_mm);
        Self { runs, links, placed }
    }

    fn links(&self) -> Links<'_> {
        self.links.of(&self.runs)
    }

    /// Where the tool cuts into walls, and what bounds it.
    fn cuts(&self, span: &Span<'_>, profile: &Profile) -> (Layout, Cuts) {
        let (runs, links, placed) = (&self.runs, self.links(), &self.placed);
        let corners = Corners { span, short_mm: profile.corner.short_block_mm };
        let joined = Joined { links, placed, corners };
        let rule = profile.interference.at_closing;
        let walls = Walls::new(runs, links, placed).forgiving_closing(rule);
        let cuts = interference::cuts(&walls, &joined, profile.accept_tolerance_mm, GOUGE_MM);
        (walls.into_layout(), cuts)
    }

    /// Whether a cut is made from a run as short as the noise of posted coordinates: around such a
    /// run the tool may turn anywhere.
    fn is_cut_by_noise(&self, cuts: &Cuts, tolerance: f64) -> bool {
        let is_short = |cut: &Cut| self.runs[cut.on].element.length() <= 2.0 * tolerance;
        cuts.cuts.iter().any(is_short)
    }

    /// Measures the straights of runs in the exact runs that they were merged from.
    fn measure_straights(&mut self, exact: &[Run]) {
        let mut next = 0;
        let runs = &self.runs;
        self.links.measure_straights(|run| {
            let end = runs[run].legs.end;
            let mut straight_mm = 0.0_f32;
            while let Some(part) = exact.get(next).filter(|part| part.legs.end <= end) {
                if part.element.is_line() {
                    straight_mm = straight_mm.max(part.element.length() as f32);
                }
                next += 1;
            }
            straight_mm
        });
    }
}

/// The side that the tool runs on; `None` without an offset.
pub(crate) fn side_of(d_mm: f64) -> Option<CutterSide> {
    match d_mm {
        _ if is_zero(d_mm) => None,
        _ if d_mm < 0.0 => Some(CutterSide::Right),
        _ => Some(CutterSide::Left),
    }
}

fn is_zero(d_mm: f64) -> bool {
    d_mm.abs() < RADIUS_MM
}

/// Reports a span that has no contour between its leads.
pub(crate) fn empty_span(span: &Span<'_>) -> Finding {
    Finding::error(
        Code::NeverActive,
        span.entry.lead.source,
        "compensation is selected and cancelled with no contour in between",
    )
    .help("put at least one move in the plane between the lead-on and the lead-off")
}
