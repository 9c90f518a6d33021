//! A run against the machine: its travel, and what is clamped on it.

use super::request::RunRequest;
use crate::codes::error_code;
use crate::driver::answer::Refusal;
use crate::driver::context::Context;
use crate::driver::context::limits::CheckTravel;
use crate::driver::context::machine::Machine;
use crate::driver::output::LogLevel;
use crate::envelope::{Beginning, Envelope, Workplace};
use crate::machine_limits::{MachineLimits, StoredOffsets};
use cnc_msgs::calls::chain_after;
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::path::CompensatedPath;

/// Judges the path of a run while it is proved.
#[derive(Debug)]
pub(in crate::driver) struct WorkplaceCheck {
    envelope: Envelope,
    /// The stored positions that it is judged by.
    pub(in crate::driver) offsets: StoredOffsets,
    check_travel: CheckTravel,
    /// It is a part of a run, and no check beside one.
    is_of_run: bool,
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
    /// `None` where nothing is to be judged, or nothing can be; the log says why. `began_with`: the
    /// stored positions when the run began, if it has: boxes stay where they were then.
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
        let (mut limits, mut when_homed) = match limits(machine) {
            Ok(both) => both,
            Err(because) => {
                let what = match context.config.keep_out.keep_out.is_empty() {
                    true => "the travel was",
                    false => "travel and keep-out boxes were",
                };
                let text = format!("{what} not checked: {because}");
                log_not_checked(context, is_of_run, LogLevel::Warn, text);
                return None;
            }
        };
        let workplace = Workplace {
            keep_out: &context.config.keep_out,
            tool_diameters_mm: &request.tool_diameters_mm,
            start_in_machine: machine.machine_position(),
        };
        let offsets = limits.offsets;
        limits.offsets = began_with.unwrap_or(offsets);
        when_homed.offsets = limits.offsets;
        let mut envelope = Envelope::new(&limits, &request.path, beginning, workplace);
        if !machine.is_homed {
            envelope = envelope.homed_by_path(&when_homed, workplace);
        }
        let until = request.path.elements.len();
        Some(Self { envelope, offsets, check_travel, is_of_run, beginning, judged: 0, until })
    }

    /// The same for the rest of a run that is under way: the path has set offsets before it.
    pub(in crate::driver) fn begin_rest(
        context: &mut Context,
        request: &RunRequest,
        first_element: usize,
        began_with: Option<StoredOffsets>,
    ) -> Option<Self> {
        let beginning = Beginning::with_element(&request.path, first_element);
        let mut check = Self::begin(context, request, beginning, began_with)?;
        check.envelope.go_on_with(&request.path, &check.offsets, None);
        Some(check)
    }

    /// The same after a probe, for the elements before `until`: the tool is where it stands.
    pub(in crate::driver) fn begin_after_probe(
        context: &mut Context,
        request: &RunRequest,
        (first_element, until): (usize, usize),
        began_with: Option<StoredOffsets>,
    ) -> Option<Self> {
        let check = Self::begin_stretch(context, request, first_element, began_with)?;
        Some(Self { until, ..check })
    }

    /// The same for what was planned from the result of a probe: the tool is where it stands.
    pub(in crate::driver) fn begin_stretch(
        context: &mut Context,
        request: &RunRequest,
        first_element: usize,
        began_with: Option<StoredOffsets>,
    ) -> Option<Self> {
        let Some(here) = context.machine.machine_position() else {
            let text =
                "not checked: what follows the probe, since the place of the tool is not known";
            context.log_not_checked(LogLevel::Warn, text.into());
            return None;
        };
        let beginning = Beginning::with_element(&request.path, first_element);
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
        self.envelope.report().findings.iter().any(|finding| self.refuses_for(finding))
    }

    fn refuses_for(&self, finding: &Finding) -> bool {
        match finding.code {
            Code::Travel => finding.is_error() && self.check_travel == CheckTravel::Refuse,
            Code::KeepOut => finding.is_error(),
            // A thread that the controller cannot cut is not encoded.
            _ => false,
        }
    }

    /// All of it was judged: logs what is worth knowing, and gives why the run is refused.
    pub(in crate::driver) fn refusal(&self, context: &mut Context) -> Option<Refusal> {
        let report = self.envelope.report();
        let is_judged = |finding: &Finding| {
            self.check_travel != CheckTravel::Off || finding.code == Code::KeepOut
        };
        let (errors, others): (Vec<_>, Vec<_>) =
            report.findings.into_iter().filter(is_judged).partition(|it| self.refuses_for(it));
        for finding in others {
            context.log(LogLevel::Warn, text(&finding));
        }
        // Who has entered boxes relies on them.
        let level = match context.config.keep_out.keep_out.is_empty() {
            true => LogLevel::Info,
            false => LogLevel::Warn,
        };
        for what in report.not_judged {
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
}

/// What the controller has reported about the machine, as it is and once it is homed.
fn limits(machine: &Machine) -> Result<(MachineLimits, MachineLimits), String> {
    if let Some(name) = machine.other_kinematics() {
        return Err(format!("with {name} kinematics the travel is not a box"));
    }
    if !machine.has_units {
        return Err("the controller has not reported its units ($13)".into());
    }
    let limits = machine.limits().and_then(|now| Ok((now, machine.limits_when_homed()?)));
    limits.map_err(|problem| problem.to_string())
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
