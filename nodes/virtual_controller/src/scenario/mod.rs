//! Scenarios: a controller and its faults, in one text.
//!
//! YAML. Every key is optional; the README of this crate explains each, and
//! `config/examples/shop_floor.yaml` is one to start from. This module parses text; the shell
//! reads files.

mod form;
#[cfg(test)]
mod tests;

use intake::yaml::{Limits, from_str};
use std::str::FromStr;

use serde::Deserialize;

use crate::axes::{AxisLetters, Vector};
use crate::codes::ErrorCode;
use crate::controller::Build;
use crate::fault::Fault;
use crate::firmware::Firmware;
use crate::paced::LineTiming;
use crate::settings::Settings;

#[cfg(feature = "node")]
pub(crate) use form::{COORDINATE_MM_MAX, RECEIVE_BUFFER_BYTES, TIME_FACTORS};

/// A controller and its faults. `None` means the default.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Scenario {
    /// The firmware family.
    #[serde(deserialize_with = "form::by_name")]
    pub firmware: Option<Firmware>,
    /// The initial settings.
    #[serde(deserialize_with = "form::by_name")]
    pub machine: Option<Machine>,
    /// `$n` and value, in the order in which they are set.
    #[serde(deserialize_with = "form::settings")]
    pub settings: Vec<(u16, f64)>,
    /// `$22=1`.
    pub homing: bool,
    /// The axes of the board.
    #[serde(deserialize_with = "form::by_name")]
    pub axes: Option<AxisLetters>,
    /// Bytes of the receive buffer as `$I` reports them.
    #[serde(deserialize_with = "form::receive_buffer_bytes")]
    pub receive_buffer_bytes: Option<usize>,
    /// Machine position at power-up, mm.
    #[serde(deserialize_with = "form::start_mm")]
    pub start_mm: Option<Vector>,
    /// Height of the surface that a probe finds, mm.
    #[serde(deserialize_with = "form::probe_z_mm")]
    pub probe_z_mm: Option<f64>,
    /// Built with `Ln`.
    pub line_numbers: bool,
    /// Built with M7.
    pub mist: bool,
    /// The spindle has an encoder.
    pub spindle_encoder: bool,
    /// Digital inputs and outputs, then analog ones, for programs.
    pub aux_io: [u8; 4],
    /// Built with an echo of each line.
    pub echo: bool,
    /// Bits per second; 0: bytes take no time.
    pub baud: Option<u32>,
    /// How many times faster than real time the machine runs.
    #[serde(deserialize_with = "form::time_factor")]
    pub time_factor: Option<f64>,
    /// Are bytes sped up by the same factor?
    pub fast_bytes: bool,
    /// Does the board reset when its port is opened?
    pub resets_on_open: bool,
    /// Seed of the random faults.
    pub seed: Option<u64>,
    /// Faults.
    #[serde(deserialize_with = "form::faults")]
    pub faults: Vec<Fault>,
}

/// Initial settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Machine {
    /// 600 x 400 x 100 mm, 5 m/min, 24 000 rpm.
    #[default]
    Router,
    /// The defaults of freshly flashed firmware.
    Generic,
}

/// A text that is not the name of a machine.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown machine `{0}`; use router or generic")]
pub struct UnknownMachine(String);

impl FromStr for Machine {
    type Err = UnknownMachine;

    fn from_str(text: &str) -> Result<Self, UnknownMachine> {
        match text {
            "router" => Ok(Self::Router),
            "generic" => Ok(Self::Generic),
            _ => Err(UnknownMachine(text.to_string())),
        }
    }
}

/// Why a text is not a scenario.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ScenarioError {
    /// Not YAML, or not in the form of a scenario.
    #[error("{}{reason}", place(*at))]
    Form {
        /// Line and column from 1, where known.
        at: Option<(usize, usize)>,
        /// What is wrong, and what is allowed.
        reason: String,
    },
    /// The firmware rejects a setting.
    #[error("settings: {firmware} rejects ${number}={value} ({code})")]
    Setting {
        /// The firmware.
        firmware: Firmware,
        /// The n of `$n`.
        number: u16,
        /// The value.
        value: String,
        /// The firmware's answer.
        code: ErrorCode,
    },
}

fn place(at: Option<(usize, usize)>) -> String {
    at.map(|(line, column)| format!("{line}:{column}: ")).unwrap_or_default()
}

impl Scenario {
    /// Reads a scenario. An empty text is the default controller without faults.
    ///
    /// # Errors
    /// The text is not YAML, or has an unknown key or a value that is not allowed.
    pub fn from_yaml(text: &str) -> Result<Self, ScenarioError> {
        Self::from_yaml_with(text, |_| {})
    }

    /// Reads a scenario of which some values are then replaced: its settings are those of that board.
    ///
    /// # Errors
    /// As of [`Self::from_yaml`].
    pub fn from_yaml_with(
        text: &str,
        replace: impl FnOnce(&mut Self),
    ) -> Result<Self, ScenarioError> {
        let scenario: Option<Self> = from_str(text, &Limits::FILE).map_err(|error| {
            // The place comes first, where editors look for it.
            let at = error.line.zip(error.column);
            ScenarioError::Form { at, reason: error.reason }
        })?;
        let mut scenario = scenario.unwrap_or_default();
        replace(&mut scenario);
        scenario.settings()?;
        Ok(scenario)
    }

    /// The initial settings of the controller.
    ///
    /// # Errors
    /// The firmware rejects one of them.
    pub fn settings(&self) -> Result<Settings, ScenarioError> {
        let firmware = self.firmware.unwrap_or_default();
        let mut settings = match self.machine.unwrap_or_default() {
            Machine::Router => Settings::small_router_of(firmware),
            Machine::Generic => Settings::of(firmware),
        };
        settings = settings.with_axes(self.axes.unwrap_or_default());
        if self.homing {
            settings.set(22, 1.0).expect("homing may always be switched on");
        }
        for &(number, value) in &self.settings {
            settings.set(number, value).map_err(|code| {
                let value = value.to_string();
                ScenarioError::Setting { firmware, number, value, code }
            })?;
        }
        Ok(settings)
    }

    /// The controller, built and wired like this, with these settings.
    pub fn build(&self, settings: Settings) -> Build {
        Build {
            receive_buffer_bytes: self.receive_buffer_bytes,
            start_in_machine: self.start_mm,
            probe_surface_z_mm: self.probe_z_mm,
            has_line_numbers: self.line_numbers,
            has_mist: self.mist,
            has_spindle_encoder: self.spindle_encoder,
            ports: self.aux_io,
            echoes_lines: self.echo,
            ..Build::new(settings)
        }
    }

    /// The line and the clock.
    pub fn timing(&self) -> LineTiming {
        let usual = LineTiming::default();
        LineTiming {
            baud: match self.baud {
                None => usual.baud,
                Some(baud) => Some(baud).filter(|baud| *baud > 0),
            },
            time_factor: self.time_factor.unwrap_or(usual.time_factor),
            scales_bytes: self.fast_bytes,
        }
    }
}
