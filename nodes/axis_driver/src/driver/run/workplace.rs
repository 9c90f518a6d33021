//! A run against the machine: its travel, and what is clamped on it.

use super::request::RunRequest;
use crate::codes::error_code;
use crate::driver::answer::Refusal;
use crate::driver::context::Context;
use crate::driver::context::limits::{CheckTravel, KnownLimits};
use crate::driver::output::LogLevel;
use crate::encoder::Encoder;
use crate::envelope::{Beginning, Envelope, EnvelopeReport, Workplace};
use crate::machine_limits::StoredOffsets;
use cnc_msgs::calls::chain_after;
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::path::CompensatedPath;

/// Judges the path of a run while it is proved.
#[derive(Debug)]
pub(in crate::driver) struct WorkplaceCheck {
    envelope: Envelope,
    /// The stored positions that it is judged by.
    pub(in crate::driver) offsets: StoredOffsets,
    /// Why the travel cannot be read, where it is wanted.
    unreadable: Option<String>,
    /// The controller has reported settings; else only a check is possible.
    has_reported: bool,
    check_travel: CheckTravel,
    /// Part of a run, not a check that runs next to one.
    is_of_run: bool,
    /// Which tool is in the spindle is not known: any of them has to pass.
    is_mdi: bool,
    pub(in crate::driver) beginning: Beginning,
    /// Elements that were judged in slices, and how many are to be.
    judged: usize,
    until: usize,
}

/// A check says it each time, a run once for all of its parts.
fn log_not_checked(context: &mut Context, is_of_run: bool, level: LogLevel, text: String) {
    match is_of_run {
        true => context.log_not_checked(level, text),
        false => context.log(level, text),
    }
}

/// Elements that are judged in one go, where nothing else is done with them.
const ELEMENTS_PER_SLICE: usize = 2_000;

impl WorkplaceCheck {
    /// `None` where nothing is to be judged. `began_with`: the stored positions when the run began, if
    /// it has: boxes stay where they were then.
    pub(in crate::driver) fn begin(
        context: &mut Context,
        request: &RunRequest,
        beginning: Beginning,
        began_with: Option<StoredOffsets>,
    ) -> Option<Self> {
        let check_travel = context.config.check_travel;
        if check_travel == CheckTravel::Off && context.config.keep_out.keep_out.is_empty() {
            return None;
        }
        let is_of_run = !request.is_only_encoded(context);
        let machine = &context.machine;
        let KnownLimits { now: mut limits, mut when_homed, unreadable } = machine.known_limits();
        let workplace = Workplace {
            keep_out: &context.config.keep_out,
            tool_diameters_mm: &request.tool_diameters_mm,
            start_in_machine: machine.machine_position(),
            spindle_tool: machine.spindle_tool,
            is_judged_again: true,
        };
        let offsets = limits.offsets;
        limits.offsets = began_with.unwrap_or(offsets);
        when_homed.offsets = limits.offsets;
        let mut envelope = Envelope::new(&limits, &request.path, beginning, workplace);
        if !machine.is_homed {
            envelope = envelope.homed_by_path(&when_homed, workplace);
        }
        let (until, is_mdi) = (request.path.elements.len(), request.is_mdi());
        let unreadable = unreadable.filter(|_| check_travel != CheckTravel::Off);
        Some(Self {
            envelope,
            offsets,
            unreadable,
            has_reported: !machine.reported.is_empty(),
            check_travel,
            is_of_run,
            is_mdi,
            beginning,
            judged: 0,
            until,
        })
    }

    /// Whether it is judged by settings that could not be read.
    pub(in crate::driver) fn is_unreadable(&self) -> bool {
        self.unreadable.is_some()
    }

    /// The same for the rest of a run that is under way: the path has set offsets before it.
    pub(in crate::driver) fn begin_rest(
        context: &mut Context,
        request: &RunRequest,
        encoder: &Encoder,
        began_with: Option<StoredOffsets>,
    ) -> Option<Self> {
        let beginning = Beginning::of_rest(encoder);
        let mut check = Self::begin(context, request, beginning, began_with)?;
        check.envelope.go_on_with(&request.path, &check.offsets, None);
        Some(check)
    }

    /// The same after a probe or homing, for the elements before `until`: the tool is where it stands.
    pub(in crate::driver) fn begin_from_here(
        context: &mut Context,
        request: &RunRequest,
        (encoder, until): (&Encoder, usize),
        began_with: Option<StoredOffsets>,
    ) -> Option<Self> {
        let check = Self::begin_stretch(context, request, encoder, began_with)?;
        Some(Self { until, ..check })
    }

    /// The same for what was planned from the result of a probe: the tool is where it stands.
    pub(in crate::driver) fn begin_stretch(
        context: &mut Context,
        request: &RunRequest,
        encoder: &Encoder,
        began_with: Option<StoredOffsets>,
    ) -> Option<Self> {
        let Some(here) = context.machine.machine_position() else {
            let text = "not checked: what follows here, since the place of the tool is not known";
            context.log_not_checked(LogLevel::Warn, text.into());
            return None;
        };
        let beginning = Beginning::of_rest(encoder);
        let mut check = Self::begin(context, request, beginning, began_with)?;
        check.envelope.go_on_with(&request.path, &check.offsets, Some(here));
        Some(check)
    }

    /// Judges a slice; true at the end.
    pub(in crate::driver) fn step(&mut self, path: &CompensatedPath) -> bool {
        self.judged = (self.judged + ELEMENTS_PER_SLICE).min(self.until);
        self.envelope.advance_to(path, self.judged);
        self.judged == self.until
    }

    pub(in crate::driver) fn advance_to(&mut self, path: &CompensatedPath, element: usize) {
        self.envelope.advance_to(path, element);
    }

    /// All of it was judged: whether the run is refused.
    pub(in crate::driver) fn refuses(&self) -> bool {
        self.unreadable_refusal().is_some()
            || self.envelope.report().findings.iter().any(|finding| self.refuses_for(finding))
    }

    fn refuses_for(&self, finding: &Finding) -> bool {
        match finding.code {
            Code::Travel => finding.is_error() && self.check_travel == CheckTravel::Refuse,
            // Whoever types a block has no program to correct, and may not look at the log before it moves.
            Code::KeepOut => finding.is_error() || self.is_mdi,
            // A thread that the controller cannot cut is not encoded.
            _ => false,
        }
    }

    /// Who wants programs refused that leave the travel wants none to run whose travel nobody knows.
    fn unreadable_refusal(&self) -> Option<Refusal> {
        let is_wanted = self.check_travel == CheckTravel::Refuse && self.has_reported;
        let because = self.unreadable.as_ref().filter(|_| is_wanted)?;
        let message = format!(
            "the travel cannot be checked: {because}; correct it in the controller, or set \
             check_travel to warn to run without"
        );
        Some(Refusal::new(error_code::TRAVEL, message))
    }

    /// All of it was judged: logs what is worth knowing, and gives why the run is refused.
    pub(in crate::driver) fn refusal(&self, context: &mut Context) -> Option<Refusal> {
        if let Some(refusal) = self.unreadable_refusal() {
            return Some(refusal);
        }
        if let Some(because) = &self.unreadable {
            let text = format!("the travel was not checked: {because}");
            log_not_checked(context, self.is_of_run, LogLevel::Warn, text);
        }
        let EnvelopeReport { findings, not_judged } = self.envelope.report();
        let is_judged = |finding: &Finding| {
            self.check_travel != CheckTravel::Off || finding.code == Code::KeepOut
        };
        let (errors, others): (Vec<_>, Vec<_>) =
            findings.into_iter().filter(is_judged).partition(|it| self.refuses_for(it));
        for finding in others {
            context.log(LogLevel::Warn, text(&finding));
        }
        // Who has entered boxes relies on them.
        let level = match context.config.keep_out.keep_out.is_empty() {
            true => LogLevel::Info,
            false => LogLevel::Warn,
        };
        for what in not_judged {
            log_not_checked(context, self.is_of_run, level, format!("not checked: {what}"));
        }
        let first = errors.first()?;
        let code = match first.code {
            Code::KeepOut => error_code::KEEP_OUT,
            _ => error_code::TRAVEL,
        };
        let mut message = text(first);
        if errors.len() > 1 {
            message += &format!("; {} more like this: the log has them", errors.len() - 1);
            errors.iter().for_each(|it| context.log(LogLevel::Error, text(it)));
        }
        Some(Refusal::new(code, message))
    }

    /// What was not compared with boxes, for whoever types a block: `; not checked: …`, or nothing.
    pub(in crate::driver) fn remark(&self) -> String {
        let said = self.envelope.not_compared().into_iter().filter(|_| self.is_mdi);
        said.map(|it| format!("; not checked: {it}")).collect()
    }
}

/// `line 12: what is wrong; what to do`
fn text(finding: &Finding) -> String {
    let Finding { source, message, help, calls, .. } = finding;
    let place = match source.block {
        Some(block) => format!("line {} (N{block})", source.line),
        None => format!("line {}", source.line),
    };
    let place = place + &chain_after(calls);
    match help.as_str() {
        "" => format!("{place}: {message}"),
        help => format!("{place}: {message}; {help}"),
    }
}
