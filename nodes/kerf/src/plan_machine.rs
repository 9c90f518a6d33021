//! `kerf plan --machine`: the path against one machine, and how long it takes there.

use crate::exit::Failure;
use axis_driver::cycle_time::CycleTime;
pub(crate) use axis_driver::cycle_time::duration;
use axis_driver::driver::ControllerSettings;
use axis_driver::envelope::{Beginning, Envelope, EnvelopeReport, Workplace};
use axis_driver::machine_limits::{MachineLimits, settings_of_file};
use clap::Args;
use cnc_msgs::keep_out::KeepOut;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::tool_table::ToolTable;
use report::plan::OnMachine;
use settings::{MachineText, load_keep_out};
use std::path::{Path, PathBuf};

/// The options of `kerf plan` about the machine.
#[derive(Debug, Args)]
pub(crate) struct MachineArgs {
    /// Settings and offsets of the controller, as `kerf controller dump` writes them: also judge
    /// travel, speeds and feeds, and print the time that the program takes
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    /// Boxes that the tool must not touch: clamps, vices and fixtures
    #[arg(long, value_name = "FILE", requires = "machine")]
    keep_out: Option<PathBuf>,
}

/// One machine and what is clamped on it.
#[derive(Debug)]
pub(crate) struct Machine {
    file: String,
    limits: MachineLimits,
    keep_out: KeepOut,
}

impl MachineArgs {
    /// The files that are read.
    pub(crate) fn files(&self) -> [Option<&Path>; 2] {
        [self.machine.as_deref(), self.keep_out.as_deref()]
    }

    /// Reads the machine, if one is named.
    pub(crate) fn read(&self) -> Result<Option<Machine>, Failure> {
        let Some(path) = &self.machine else { return Ok(None) };
        let text = MachineText::load(path).map_err(Failure::usage)?;
        let limits = settings_of_file(&text.machine)
            .and_then(|settings: ControllerSettings| MachineLimits::of(&settings))
            .map_err(|problem| {
                Failure::usage(text.error_at(&problem.place(), problem.to_string()))
            })?;
        let keep_out = match &self.keep_out {
            Some(path) => load_keep_out(path).map_err(Failure::usage)?,
            None => KeepOut::default(),
        };
        Ok(Some(Machine { file: crate::files::file_name(path), limits, keep_out }))
    }
}

impl Machine {
    /// Judges a path from where it begins, and times it.
    pub(crate) fn judge(
        &self,
        path: &CompensatedPath,
        tools: &ToolTable,
        beginning: Beginning,
    ) -> (EnvelopeReport, OnMachine) {
        let diameters = tools.tools.iter();
        let diameters =
            diameters.map(|(number, it)| (*number, it.diameter_mm + it.wear_diameter_mm));
        let workplace = Workplace {
            keep_out: &self.keep_out,
            tool_diameters_mm: &diameters.collect(),
            start_in_machine: None,
            spindle_tool: None,
            is_judged_again: false,
        };
        let mut envelope = Envelope::new(&self.limits, path, beginning, workplace);
        envelope.advance_to(path, path.elements.len());
        let report = envelope.report();
        let mut time = CycleTime::new(&self.limits, path, beginning.element, None);
        let doubts = CycleTime::doubts(&self.limits, path);
        let on_machine = OnMachine {
            file: self.file.clone(),
            firmware: self.limits.firmware.traits().name,
            not_judged: report.not_judged.iter().cloned().chain(doubts).collect(),
            seconds: time.advance_to(path, path.elements.len()),
        };
        (report, on_machine)
    }
}

/// For people: two spaces before each line, a line feed before the first.
pub(crate) fn text(on_machine: &OnMachine, fits: bool) -> String {
    let OnMachine { file, firmware, seconds, not_judged } = on_machine;
    let fits = if fits { "fits" } else { "does not fit" };
    let mut text =
        format!("\n  {fits} the machine of {file} ({firmware}); takes {}", duration(*seconds));
    for what in not_judged {
        text += &format!("\n  not judged: {what}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_duration_has_two_units_at_most() {
        for (seconds, text) in [
            (0.04, "0.0 s"),
            (59.2, "59.2 s"),
            (59.8, "1 min 00 s"),
            (754.4, "12 min 34 s"),
            (7_410.0, "2 h 03 min"),
        ] {
            assert_eq!(duration(seconds), text);
        }
    }
}
