//! The radii that a span is good for.
//!
//! A certificate is the interval about the planned radius in which nothing of the contour is
//! consumed and no wall is nearer than the radius, at zero tolerance, and what limits the interval.
//! Every trial joins and checks the whole span at another radius. What fails shows where to try
//! next, so that few trials are needed.

use crate::check::interference::{self, Cut, Joined};
use crate::check::lead;
use crate::check::reach::{Unreachable, consumed, is_any_unreachable, left_of};
use crate::check::repeated_passes::without_repetitions;
use crate::check::walls::{Layout, Walls};
use crate::geometry::element::{Element, Vec2, cross, left};
use crate::geometry::frame::{height, in_plane, in_work};
use crate::geometry::tolerance::{BEND_RAD, GOUGE_MM, LENGTH_MM};
use crate::span::chain::{ChainBuilder, Placed, join};
use crate::span::chain_links::{links, push_runs};
use crate::span::corner::Corners;
use crate::span::links::{ChainLinks, Links};
use crate::span::{Lead, Run, Span};
use cnc_msgs::calls::{Call, Calls};
use cnc_msgs::contour::{CutterSide, Source};
use cnc_msgs::geometry::Position;
use cnc_msgs::profile::Profile;
use std::borrow::Cow;
use std::cell::OnceCell;

/// The largest tool, mm; an interval that reaches it has no upper end.
const RADIUS_MM_MAX: f64 = 1e4;

/// The precision of an end, mm.
const EXACT_MM: f64 = 1e-7;

/// The same, with the rounding of a difference.
const CLOSED_MM: f64 = 1.01 * EXACT_MM;

/// How much nearer than the radius a wall may be in a trial, mm: rounding.
const TOUCH_MM: f64 = 1e-8;

/// Runs at an end that a lead may depend on.
const END_RUNS: usize = 64;

/// The same for leads. They leave the circle about the contour's end at a tangent, so that on the
/// radius this is squared.
const LEAD_TOUCH_MM: f64 = 1e-12;

/// Trials for each end of a small contour; and elements in all trials of a large one. If it takes
/// more, that is noise, and the certificate ends where it certainly holds.
const TRIALS: (usize, usize) = (100, 30_000_000);

/// The radii that a compensated piece of a program is good for.
#[derive(Debug, Clone, PartialEq)]
pub struct Certificate {
    /// Lines of the first and last block, without the leads.
    pub first_line: u32,
    pub last_line: u32,
    /// The calls and loop passes that led to the first line, by row of the table and as they are
    /// shown.
    pub call: u32,
    pub calls: Vec<Call>,
    /// The side that the tool runs on; the sign of the radius is already applied.
    pub side: CutterSide,
    /// The radius that was planned, mm, never negative.
    pub radius_mm: f64,
    /// The interval of radii, mm. The upper end is infinite when nothing limits it.
    pub valid_from_mm: f64,
    pub valid_to_mm: f64,
    /// What limits the upper end; nothing where larger radii could not be checked.
    pub limited_by: Vec<CertificateLimit>,
    /// The largest radius for which the leads are free, mm.
    pub leads_valid_to_mm: f64,
}

/// A block that limits a certificate, and the place.
#[derive(Debug, Clone, PartialEq)]
pub struct CertificateLimit {
    pub source: Source,
    pub position: Position,
    /// The calls and loop passes that led to the block.
    pub calls: Vec<Call>,
}

impl Certificate {
    /// Takes the calls of its places from the table of the contour.
    pub(crate) fn explain(&mut self, calls: &Calls) {
        self.calls = calls.chain(self.call);
        for limit in &mut self.limited_by {
            limit.calls = calls.chain(limit.source.call);
        }
    }
}

/// A span whose radius is tried.
pub(crate) struct Subject<'a> {
    span: &'a Span<'a>,
    /// All runs, and those that are tried.
    all: &'a [Run],
    runs: Cow<'a, [Run]>,
    lead_off: Option<&'a Lead>,
    profile: &'a Profile,
    goes_on: &'a dyn Fn() -> bool,
    /// The walls of the tried runs wherever all of them are placed: they are the same for each
    /// radius.
    whole: OnceCell<Layout>,
}

/// The lead at which end of a span.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum LeadEnd {
    On,
    Off,
}

impl LeadEnd {
    const BOTH: [Self; 2] = [Self::On, Self::Off];
}

/// The end of the interval lies between two radii, mm; the larger one fails.
struct Bracket {
    valid: f64,
    failing: f64,
    failures: Vec<Failure>,
}

/// What fails in a trial.
#[derive(Debug)]
enum Failure {
    Consumed(Unreachable),
    Cut(Cut),
    /// Not everything could be checked.
    Unknown,
}

impl<'a> Subject<'a> {
    pub(crate) fn new(
        span: &'a Span<'a>,
        runs: &'a [Run],
        lead_off: Option<&'a Lead>,
        profile: &'a Profile,
        goes_on: &'a dyn Fn() -> bool,
    ) -> Self {
        let tried = without_repetitions(span, runs);
        Self { span, all: runs, runs: tried, lead_off, profile, goes_on, whole: OnceCell::new() }
    }

    /// Without its calls; `None` when it was interrupted.
    pub(crate) fn certificate(&self) -> Option<Certificate> {
        let planned = self.span.d_mm.abs();
        let bracket = self.bracket(planned)?;
        let (valid_to_mm, failures) = match bracket {
            Some(bracket) => self.end_within(bracket)?,
            None => (f64::INFINITY, Vec::new()),
        };
        let mut limited_by: Vec<CertificateLimit> =
            failures.iter().flat_map(|failure| self.limits(failure)).collect();
        limited_by.sort_by_key(|limit| (limit.source.line, limit.source.call));
        limited_by.dedup_by_key(|limit| (limit.source.line, limit.source.call));
        let (first, last) = (&self.span.legs[0], &self.span.legs[self.span.legs.len() - 1]);
        Some(Certificate {
            first_line: first.source.line,
            last_line: last.source.line,
            call: first.source.call,
            calls: Vec::new(),
            side: if self.span.d_mm < 0.0 { CutterSide::Right } else { CutterSide::Left },
            radius_mm: planned,
            valid_from_mm: 0.0,
            valid_to_mm,
            limited_by,
            leads_valid_to_mm: self.leads_valid_to(valid_to_mm)?,
        })
    }

    fn joined(&self, runs: &[Run], radius_mm: f64) -> (ChainLinks, Vec<Placed>) {
        let scale = radius_mm / self.span.d_mm.abs();
        let short_mm = self.profile.corner.short_block_mm;
        let mut links = ChainBuilder::new(runs.len(), scale, short_mm);
        push_runs(&mut links, runs, scale);
        let links = links.finish();
        let placed = join(links.of(runs), 0.0);
        (links, placed)
    }

    /// The walls of the tried runs.
    fn walls(&self, links: Links<'_>, placed: &[Placed]) -> Walls<'_> {
        let make = || Walls::new(&self.runs, links, placed);
        if placed.len() < links.len() {
            return make();
        }
        Walls::of_layout(&self.runs, self.whole.get_or_init(|| make().into_layout()))
    }

    fn corners(&self) -> Corners<'_> {
        Corners { span: self.span, short_mm: self.profile.corner.short_block_mm }
    }

    /// What fails at a radius; `None` when the search is to end.
    fn failures(&self, radius_mm: f64) -> Option<Vec<Failure>> {
        const FAILURES_MAX: usize = 32;
        if !(self.goes_on)() {
            return None;
        }
        let (links, placed) = self.joined(&self.runs, radius_mm);
        let links = links.of(&self.runs);
        let gaps = consumed(links, &placed).take(FAILURES_MAX);
        let mut failures: Vec<Failure> = gaps.map(Failure::Consumed).collect();
        if failures.is_empty() {
            let walls = self.walls(links, &placed);
            let corners = self.corners();
            let joined = Joined { links, placed: &placed, corners };
            let cuts = interference::cuts(&walls, &joined, 0.0, TOUCH_MM);
            let within = cuts.cuts.into_iter().filter(|cut| !cut.is_other_pass);
            let within = within.filter(|cut| !self.is_bend(cut));
            failures.extend(within.take(FAILURES_MAX).map(Failure::Cut));
            if failures.is_empty() && !cuts.is_complete {
                failures.push(Failure::Unknown);
            }
        }
        Some(failures)
    }

    /// Whether one wall continues the other with a bend that is noise: only a huge tool would cut
    /// it.
    fn is_bend(&self, cut: &Cut) -> bool {
        let tangent = |run: usize, at: Vec2| match &self.runs[run].element {
            Element::Line(line) => line.tangent,
            Element::Arc(arc) => left(at - arc.center).normalize() * arc.turn,
        };
        let turn = cross(tangent(cut.on, cut.foot), tangent(cut.into, cut.on_wall)).abs();
        let cosine = tangent(cut.on, cut.foot).dot(&tangent(cut.into, cut.on_wall));
        cosine > 0.0 && turn < BEND_RAD && cut.radius_mm - cut.distance_mm < GOUGE_MM
    }

    /// A valid and a failing radius: `Some(None)` when none fails.
    fn bracket(&self, planned: f64) -> Option<Option<Bracket>> {
        let guess = self.vanishing_guess();
        // Joining allows for rounding, so a run may vanish a little late.
        let mut radii = vec![guess + EXACT_MM / 2.0, guess * (1.0 + 1e-3)];
        let far = std::iter::successors(Some(planned * 2.0), |radius| Some(radius * 4.0));
        radii.extend(far.take_while(|radius| *radius <= RADIUS_MM_MAX));
        radii.retain(|radius| *radius <= RADIUS_MM_MAX);
        radii.sort_by(f64::total_cmp);
        // Where no run vanishes, often no tool is too large. Nothing fails then at a smaller radius.
        let largest = radii.last().filter(|_| guess > RADIUS_MM_MAX);
        if let Some(largest) = largest
            && self.failures(*largest)?.is_empty()
        {
            return Some(None);
        }
        let mut valid = 0.0;
        for radius in std::iter::once(planned).chain(radii) {
            if radius <= valid + EXACT_MM {
                continue;
            }
            let failures = self.failures(radius)?;
            if !failures.is_empty() {
                return Some(Some(Bracket { valid, failing: radius, failures }));
            }
            valid = radius;
        }
        Some(None)
    }

    /// The smallest radius at which a run between its neighbours vanishes, roughly, mm: exact for
    /// lines.
    fn vanishing_guess(&self) -> f64 {
        let side = self.span.d_mm.signum();
        // How much of a line the joint with the next run takes, for each mm of the radius.
        let taken = |joint: &[Run]| {
            let (before, after) =
                (joint[0].element.end_tangent(), joint[1].element.start_tangent());
            (cross(before, after) * side).max(0.0) / (1.0 + before.dot(&after)).max(f64::EPSILON)
        };
        let mut at_start = 0.0;
        let mut least = f64::INFINITY;
        for (index, run) in self.runs.iter().enumerate() {
            let at_end = self.runs.get(index..index + 2).map_or(0.0, taken);
            let vanishing = match &run.element {
                Element::Line(line) => line.length / (at_start + at_end),
                Element::Arc(arc) if arc.turn * side > 0.0 => arc.radius,
                Element::Arc(_) => f64::INFINITY,
            };
            least = least.min(vanishing);
            at_start = at_end;
        }
        least
    }

    /// The end of the interval, between a valid and a failing radius, and what fails there.
    fn end_within(&self, bracket: Bracket) -> Option<(f64, Vec<Failure>)> {
        let Bracket { mut valid, mut failing, mut failures } = bracket;
        let (most, elements) = TRIALS;
        let (mut has_estimate, mut creeps) = (true, false);
        // How far below the failing radius the next trial is; half of the interval at most.
        let mut step = EXACT_MM;
        for _ in 0..(elements / self.runs.len().max(1)).clamp(30, most) {
            if matches!(failures[..], [Failure::Unknown]) {
                // So near to itself that every trial would take as long.
                return Some((valid, Vec::new()));
            }
            if failing - valid <= CLOSED_MM {
                break;
            }
            let estimate = failures
                .iter()
                .map(|failure| match failure {
                    Failure::Consumed(place) => place.radius_mm_max,
                    Failure::Cut(cut) => failing - (cut.radius_mm - cut.distance_mm) / 2.0,
                    Failure::Unknown => f64::INFINITY,
                })
                .fold(f64::INFINITY, f64::min);
            // A little beyond the estimate, to close the interval from above.
            let beyond = estimate + EXACT_MM / 2.0;
            let is_estimate = has_estimate && beyond > valid && beyond < failing - EXACT_MM / 4.0;
            let trial = match is_estimate {
                true => beyond,
                false => (failing - step).max(f64::midpoint(valid, failing)),
            };
            let found = self.failures(trial)?;
            if found.is_empty() {
                (valid, step) = (trial, if is_estimate { step } else { f64::INFINITY });
                has_estimate = false;
                continue;
            }
            if is_estimate {
                // Estimates that creep are no better than halving.
                creeps = failing - trial < 0.5 * (failing - valid);
                (has_estimate, step) = (false, EXACT_MM);
            } else {
                (has_estimate, step) = (!creeps, step * 8.0);
            }
            (failing, failures) = (trial, found);
        }
        if failing - valid > CLOSED_MM {
            return Some((valid, failures));
        }
        // Joining allows for rounding, so a run seems to vanish a little late.
        let failures = self.failures(failing + 4.0 * LENGTH_MM)?;
        let end = match failures.first() {
            Some(Failure::Consumed(place)) => self.vanishing(place, failing),
            _ => f64::midpoint(valid, failing),
        };
        Some((end, failures))
    }

    /// The radius at which exactly nothing is left of a run.
    ///
    /// Joining allows for rounding, so the length left at smaller radii is extrapolated to zero.
    fn vanishing(&self, place: &Unreachable, failing: f64) -> f64 {
        let left = |radius_mm: f64| {
            let (links, placed) = self.joined(&self.runs, radius_mm);
            left_of(links.of(&self.runs), &placed, place.longest)
        };
        let (mut far, mut near) = (failing * (1.0 - 1e-3), failing * (1.0 - 1e-4));
        for _ in 0..6 {
            let (Some(at_far), Some(at_near)) = (left(far), left(near)) else { return failing };
            let zero = near + (near - far) * at_near / (at_far - at_near);
            if !zero.is_finite() || (zero - failing).abs() > 1e-4 * failing {
                return failing;
            }
            let step = (zero - near) * 0.01;
            if step.abs() <= EXACT_MM / 10.0 {
                return zero;
            }
            (far, near) = (near, zero - step);
        }
        near
    }

    fn limits(&self, failure: &Failure) -> Vec<CertificateLimit> {
        let limit = |run: usize, at: Vec2| {
            let leg = &self.span.legs[self.runs[run].legs.start];
            let position = in_work(self.span.plane, at, height(self.span.plane, leg.motion.end));
            CertificateLimit { source: leg.source, position, calls: Vec::new() }
        };
        match failure {
            Failure::Consumed(place) => {
                vec![limit(place.longest, self.runs[place.longest].element.start())]
            }
            Failure::Cut(cut) => vec![limit(cut.on, cut.foot), limit(cut.into, cut.on_wall)],
            Failure::Unknown => Vec::new(),
        }
    }

    fn leads_valid_to(&self, limit_mm: f64) -> Option<f64> {
        let planned = self.span.d_mm.abs();
        let (links, placed) = self.joined(self.all, planned);
        let links = links.of(self.all);
        let walls = match self.runs {
            Cow::Borrowed(_) => self.walls(links, &placed),
            Cow::Owned(_) => Walls::new(self.all, links, &placed),
        };
        let exact = self.leads_free_to(&walls, limit_mm, LEAD_TOUCH_MM)?;
        // If a contour closes with the noise of its coordinates, leads cut a little into it.
        let at = planned.min(limit_mm);
        let is_free = |end: &LeadEnd| self.is_lead_free(*end, &walls, at, GOUGE_MM);
        if exact < planned && LeadEnd::BOTH.iter().all(is_free) {
            return self.leads_free_to(&walls, limit_mm, GOUGE_MM);
        }
        Some(exact)
    }

    /// The radius up to which the leads are free.
    ///
    /// A large tool may pass over the free end of a contour where a smaller one cuts into it, so that a lead that is
    /// free for one radius need not be so for all below: where it is free for the planned one, that counts.
    fn leads_free_to(&self, walls: &Walls<'_>, limit_mm: f64, touch_mm: f64) -> Option<f64> {
        let is_free = |end: LeadEnd, radius| self.is_lead_free(end, walls, radius, touch_mm);
        let (mut low, mut first_failing) = (0.0, None);
        let largest = limit_mm.min(RADIUS_MM_MAX);
        let planned = self.span.d_mm.abs().min(largest);
        let is_planned_free = LeadEnd::BOTH.iter().all(|end| is_free(*end, planned));
        for trial in self.lead_trials(is_planned_free, largest) {
            if !(self.goes_on)() {
                return None;
            }
            let mut limiting = LeadEnd::BOTH.to_vec();
            limiting.retain(|end| !is_free(*end, trial));
            if !limiting.is_empty() {
                first_failing = Some((trial, limiting));
                break;
            }
            low = trial;
        }
        let Some((mut high, limiting)) = first_failing else { return Some(limit_mm) };
        while high - low > EXACT_MM {
            if !(self.goes_on)() {
                return None;
            }
            let middle = f64::midpoint(low, high);
            if limiting.iter().all(|end| is_free(*end, middle)) {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(low)
    }

    /// Radii from the smallest one that matters to the largest, close together near the planned one.
    fn lead_trials(&self, is_planned_free: bool, largest: f64) -> impl Iterator<Item = f64> {
        const SHARES: [f64; 8] = [0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0];
        let planned = self.span.d_mm.abs();
        let matters = move |share: &f64| !is_planned_free || *share >= 1.0;
        let near = SHARES.into_iter().filter(matters).map(move |share| share * planned);
        let far = std::iter::successors(Some(4.0 * planned), |radius| Some(2.0 * radius));
        let below = near.chain(far).take_while(move |radius| *radius < largest);
        below.chain(std::iter::once(largest))
    }

    /// Whether the move to the contour, or from it, keeps clear of its walls.
    fn is_lead_free(&self, at: LeadEnd, walls: &Walls<'_>, radius_mm: f64, touch_mm: f64) -> bool {
        let is_on = at == LeadEnd::On;
        let lead = match at {
            LeadEnd::On => Some(&self.span.entry.lead).filter(|_| !self.span.entry.is_link),
            LeadEnd::Off => self.lead_off,
        };
        let Some(lead) = lead else { return true };
        let scale = radius_mm / self.span.d_mm.abs();
        let count = self.all.len().min(END_RUNS);
        let runs = if is_on { &self.all[..count] } else { &self.all[self.all.len() - count..] };
        let links = links(self.span, runs, Some(lead).filter(|_| !is_on), self.profile, scale);
        let links = links.of(runs);
        let placed = join(links, 0.0);
        if is_any_unreachable(links, &placed, self.profile.accept_tolerance_mm) {
            return false;
        }
        let joined = Joined { links, placed: &placed, corners: self.corners() };
        let plane = self.span.plane;
        let (path, end, radius_mm) = match at {
            // An arc leads to this radius only if the chain has it.
            LeadEnd::On
                if self.span.entry.arc.is_some() && lead::arc_on(&joined).is_none()
                    || lead::starts_past(&joined).is_some() =>
            {
                return false;
            }
            LeadEnd::On => {
                let path = lead::LeadPath::on(&joined, in_plane(plane, lead.start));
                (path, lead::FreeEnd::first(walls), radius_mm)
            }
            LeadEnd::Off => {
                let path = lead::LeadPath::off(&joined, in_plane(plane, lead.motion.end));
                (path, lead::FreeEnd::last(walls), self.span.d_out_mm.abs() * scale)
            }
        };
        let Some(path) = path else { return true };
        let cuts = |is_above: &dyn Fn(usize) -> bool| {
            path.cuts(walls, end, radius_mm - touch_mm, is_above).gouge.is_some()
        };
        !cuts(&|_| false) || {
            let below = lead::Below::of(self.span, self.all, walls, lead, self.profile);
            !cuts(&|run| below.is(walls, run))
        }
    }
}
