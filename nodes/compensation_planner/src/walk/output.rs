//! Writes spans and everything else in the order of the program.
//!
//! A span that ends with a lead-off depends on nothing else. Such spans wait, with everything after
//! them, until there are enough to solve together. How many that is depends on the program alone,
//! and so does the result.

use crate::check::certificate::Certificate;
use crate::check::lead::PreviousWall;
use crate::span::{ItemKind, Span};
use crate::walk::compensate::{Exit, Solution, SpanReport, certify, empty_span, solve};
use crate::walk::emitter::Emitter;
use crate::walk::other_spans::EarlierSpans;
use crate::walk::plan::{SpanSummary, Workers};
use cnc_msgs::contour::{Action, CutterSide, Motion, ProgrammedContour, Source};
use cnc_msgs::finding::Finding;
use cnc_msgs::path::{CompensatedPath, Role};
use cnc_msgs::profile::Profile;
use std::sync::{Mutex, PoisonError};

/// The most blocks of spans, and other orders after them, that wait.
const WAITING_MAX: usize = 65_536;

pub(super) struct Output<'a> {
    profile: &'a Profile,
    workers: &'a dyn Workers,
    /// Set where only certificates are wanted; then no path is written.
    certificates: Option<Certificates<'a>>,
    emitter: Emitter,
    spans: Vec<SpanSummary>,
    earlier: EarlierSpans<'a>,
    /// The first is a span, if there is any.
    waiting: Vec<Order<'a>>,
    /// The number of orders, and of the blocks of spans among them.
    weight: usize,
}

/// The certificates of the spans so far.
pub(super) struct Certificates<'a> {
    found: Vec<Certificate>,
    /// Asked before each trial; once it says no, no more certificates are found.
    goes_on: &'a (dyn Fn() -> bool + Sync),
}

/// Something to write.
enum Order<'a> {
    Programmed(Motion, Source, Role),
    Action(Action, Source),
    StopExactlyIn(Source),
    Span(Box<Job<'a>>),
}

/// A span that is complete.
struct Job<'a> {
    span: Span<'a>,
    exit: Exit,
    previous_wall: Option<PreviousWall>,
    /// The findings before it was complete.
    said: Vec<Finding>,
}

impl<'a> Output<'a> {
    pub(super) fn new(
        contour: &ProgrammedContour,
        profile: &'a Profile,
        workers: &'a dyn Workers,
        goes_on: Option<&'a (dyn Fn() -> bool + Sync)>,
    ) -> Self {
        let mut emitter = Emitter::new(contour.start, contour.assumed_axes);
        if goes_on.is_none() {
            emitter.path.elements.reserve(contour.events.len() + contour.events.len() / 2);
        }
        Self {
            profile,
            workers,
            certificates: goes_on.map(|goes_on| Certificates { found: Vec::new(), goes_on }),
            emitter,
            spans: Vec::new(),
            earlier: EarlierSpans::new(),
            waiting: Vec::new(),
            weight: 0,
        }
    }

    /// A motion as it is programmed.
    pub(super) fn programmed(&mut self, motion: &Motion, source: Source, role: Role) {
        self.order(Order::Programmed(*motion, source, role));
    }

    pub(super) fn action(&mut self, action: Action, source: Source) {
        self.order(Order::Action(action, source));
    }

    /// Makes every element of this block end in an exact stop.
    pub(super) fn stop_exactly_in(&mut self, source: Source) {
        self.order(Order::StopExactlyIn(source));
    }

    /// A span; returns the wall at its end, unless it ends with a lead-off.
    pub(super) fn span(
        &mut self,
        span: Span<'a>,
        exit: Exit,
        previous_wall: Option<PreviousWall>,
        report: &mut SpanReport,
    ) -> Option<PreviousWall> {
        let said = std::mem::take(&mut report.findings);
        let waits = matches!(exit, Exit::LeadOff(_)) || self.certificates.is_some();
        self.weight += span.legs.len();
        self.waiting.push(Order::Span(Box::new(Job { span, exit, previous_wall, said })));
        if waits && self.weight < WAITING_MAX {
            return None;
        }
        self.put_out_waiting(report)
    }

    /// The path since the last one, and its spans.
    pub(super) fn take_path(
        &mut self,
        report: &mut SpanReport,
    ) -> (CompensatedPath, Vec<SpanSummary>) {
        self.put_out_waiting(report);
        (self.emitter.take_path(), std::mem::take(&mut self.spans))
    }

    /// The same for more events; nothing of those so far may wait.
    pub(super) fn for_next_part<'b>(
        self,
        profile: &'b Profile,
        workers: &'b dyn Workers,
    ) -> Output<'b> {
        let Self { emitter, spans, earlier, weight, .. } = self;
        let (earlier, waiting) = (earlier.for_next_part(), Vec::new());
        Output { profile, workers, certificates: None, emitter, spans, earlier, waiting, weight }
    }

    /// The memory of the walls of all contours so far, bytes.
    pub(super) fn kept_bytes(&self) -> usize {
        self.earlier.kept_bytes()
    }

    /// The certificates of all spans, as far as they were found.
    pub(super) fn finish_certificates(mut self, report: &mut SpanReport) -> Vec<Certificate> {
        self.put_out_waiting(report);
        self.certificates.map_or_else(Vec::new, |certificates| certificates.found)
    }

    /// Writes what waits, if it is enough.
    pub(super) fn put_out_much(&mut self, report: &mut SpanReport) {
        if self.weight >= WAITING_MAX {
            self.put_out_waiting(report);
        }
    }

    fn order(&mut self, order: Order<'a>) {
        if self.certificates.is_some() {
            return;
        }
        if self.waiting.is_empty() {
            self.put_out(order);
            return;
        }
        self.weight += 1;
        self.waiting.push(order);
    }

    /// Writes everything that waits; returns the wall at the end of the last span.
    fn put_out_waiting(&mut self, report: &mut SpanReport) -> Option<PreviousWall> {
        self.weight = 0;
        let mut orders = std::mem::take(&mut self.waiting);
        let (profile, workers) = (self.profile, self.workers);
        if let Some(Certificates { found, goes_on }) = &mut self.certificates {
            let certify = |job: &mut Job<'_>| certify(&mut job.span, &job.exit, profile, *goes_on);
            found.extend(of_spans(workers, &mut orders, certify).into_iter().flatten().flatten());
            return None;
        }
        let solve = |job: &mut Job<'_>| solve(&mut job.span, &job.exit, profile);
        let mut solutions = of_spans(workers, &mut orders, solve).into_iter();
        // Findings since the last span was complete come after the findings of that span.
        let said = std::mem::take(&mut report.findings);
        let mut last_wall = None;
        for order in orders {
            match order {
                Order::Span(job) => {
                    let solution = solutions.next().flatten();
                    last_wall = self.put_out_span(*job, solution, report);
                }
                order => self.put_out(order),
            }
        }
        report.findings.extend(said);
        last_wall
    }

    /// Writes an order that is no span.
    fn put_out(&mut self, order: Order<'_>) {
        match order {
            Order::Programmed(motion, source, role) => {
                self.emitter.programmed(&motion, source, role);
            }
            Order::Action(action, source) => {
                self.earlier.action(&action);
                self.emitter.action(action, source);
            }
            Order::StopExactlyIn(source) => self.emitter.stop_exactly_in(source),
            Order::Span(_) => {}
        }
    }

    fn put_out_span(
        &mut self,
        job: Job<'a>,
        solution: Option<Solution>,
        report: &mut SpanReport,
    ) -> Option<PreviousWall> {
        let Job { span, exit, previous_wall, said } = job;
        report.findings.extend(said);
        let found = report.findings.len();
        let before = self.emitter.path.elements.len();
        let (Some(mut solution), [first, ..], [.., last]) =
            (solution, &span.legs[..], &span.legs[..])
        else {
            self.without_contour(&span, &exit, report);
            return None;
        };
        let rest =
            solution.put_out(&span, &exit, previous_wall, self.profile, &mut self.emitter, report);
        let elements = &self.emitter.path.elements[before..];
        let is_contour = |role| matches!(role, Role::Contour | Role::Corner | Role::OffPlane);
        let inside = |element: &cnc_msgs::path::PathElement| is_contour(element.role);
        if let Some(first_element) = elements.iter().position(inside) {
            let last_element = elements.iter().rposition(inside).unwrap_or(first_element);
            self.spans.push(SpanSummary {
                first_line: first.source.line,
                last_line: last.source.line,
                side: if span.d_mm < 0.0 { CutterSide::Right } else { CutterSide::Left },
                radius_mm: span.d_mm.abs(),
                first_element: before + first_element,
                last_element: before + last_element,
            });
        }
        let found = &report.findings[found..];
        let cut = self.earlier.compare(span, &exit, solution, self.profile, found);
        report.findings.extend(cut);
        rest
    }

    /// Writes the moves of a span without a contour as programmed, and reports it.
    fn without_contour(&mut self, span: &Span<'_>, exit: &Exit, report: &mut SpanReport) {
        report.findings.push(empty_span(span));
        let out = &mut self.emitter;
        out.programmed(&span.entry.lead.motion, span.entry.lead.source, Role::LeadOn);
        for item in &span.items {
            match item.what {
                ItemKind::Action(action) => out.action(action, item.source),
                ItemKind::OffPlane(motion) => out.off_plane(span.plane, &motion, item.source),
            }
        }
        if let Exit::LeadOff(lead) = exit {
            out.programmed(&lead.motion, lead.source, Role::LeadOff);
        }
    }
}

/// What `work` makes of each span among these orders; `None` for a span without a contour.
fn of_spans<'a, T: Send>(
    workers: &dyn Workers,
    orders: &mut [Order<'a>],
    work: impl Fn(&mut Job<'a>) -> T + Sync,
) -> Vec<Option<T>> {
    let jobs = orders.iter_mut().filter_map(|order| match order {
        Order::Span(job) => Some(job.as_mut()),
        _ => None,
    });
    let slots: Vec<_> = jobs.map(|job| Mutex::new((job, None))).collect();
    workers.run(slots.len(), &|index| {
        let mut slot = slots[index].lock().unwrap_or_else(PoisonError::into_inner);
        let (job, result) = &mut *slot;
        if !job.span.legs.is_empty() {
            *result = Some(work(job));
        }
    });
    let result = |slot: Mutex<(_, _)>| slot.into_inner().unwrap_or_else(PoisonError::into_inner).1;
    slots.into_iter().map(result).collect()
}
