//! Scenarios: which controller, and what goes wrong with it, in one text.
//!
//! YAML. Every key may be left out; what each means is in the README of this
//! crate, and `config/examples/shop_floor.yaml` is one to begin with. Knows texts
//! and places in them; reading files is the shell's.

mod form;
#[cfg(test)]
mod tests;

use intake::yaml::{Limits, from_str};
use std::str::FromStr;

use serde::Deserialize;

use crate::axes::Vector;
use crate::codes::ErrorCode;
use crate::controller::Build;
use crate::fault::Fault;
use crate::firmware::Firmware;
use crate::paced::Pace;
use crate::settings::Settings;

#[cfg(feature = "node")]
pub(crate) use form::{COORDINATE_MM_MAX, RECEIVE_BUFFER_BYTES, TIME_FACTORS};

/// A controller and its faults. What is `None` is as usual.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Scenario {
    /// The family it speaks as.
    #[serde(deserialize_with = "form::by_name")]
    pub firmware: Option<Firmware>,
    /// The settings to start from.
    #[serde(deserialize_with = "form::by_name")]
    pub machine: Option<Machine>,
    /// `$n` and value, in the order in which they are set.
    #[serde(deserialize_with = "form::settings")]
    pub settings: Vec<(u16, f64)>,
    /// `$22=1`.
    pub homing: bool,
    /// Bytes of the receive buffer as `$I` tells them.
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
    /// Bits per second; 0: bytes take no time.
    pub baud: Option<u32>,
    /// How many times faster than real time the machine lives.
    #[serde(deserialize_with = "form::time_factor")]
    pub time_factor: Option<f64>,
    /// Do bytes go faster by the same factor?
    pub fast_bytes: bool,
    /// Does the board reset when its port is opened?
    pub resets_on_open: bool,
    /// Decides what happens by chance.
    pub seed: Option<u64>,
    /// What goes wrong.
    #[serde(deserialize_with = "form::faults")]
    pub faults: Vec<Fault>,
}

/// Settings to start from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Machine {
    /// 600 x 400 x 100 mm, 5 m/min, 24 000 rpm.
    #[default]
    Router,
    /// The defaults of freshly flashed firmware.
    Generic,
}

/// A text that names no machine.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no machine; there are router and generic")]
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

/// Why a text is no scenario.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ScenarioError {
    /// Not YAML, or not of the form.
    #[error("{}{reason}", place(*at))]
    Form {
        /// Line and column from 1, where known.
        at: Option<(usize, usize)>,
        /// What is wrong, and what is allowed.
        reason: String,
    },
    /// The firmware refuses a setting.
    #[error("settings: {firmware} does not take ${number}={value} ({code})")]
    Setting {
        /// Whose settings they are.
        firmware: Firmware,
        /// The n of `$n`.
        number: u16,
        /// As given.
        value: String,
        /// What the firmware would answer.
        code: ErrorCode,
    },
}

fn place(at: Option<(usize, usize)>) -> String {
    at.map(|(line, column)| format!("{line}:{column}: ")).unwrap_or_default()
}

impl Scenario {
    /// Reads a scenario. An empty text is the usual controller without faults.
    pub fn from_yaml(text: &str) -> Result<Self, ScenarioError> {
        let scenario: Option<Self> = from_str(text, &Limits::FILE).map_err(|error| {
            // The place is told in front, where editors find it.
            let at = error.line.zip(error.column);
            ScenarioError::Form { at, reason: error.reason }
        })?;
        let scenario = scenario.unwrap_or_default();
        scenario.settings()?;
        Ok(scenario)
    }

    /// The settings the controller starts with.
    pub fn settings(&self) -> Result<Settings, ScenarioError> {
        let firmware = self.firmware.unwrap_or_default();
        let mut settings = match self.machine.unwrap_or_default() {
            Machine::Router => Settings::small_router_of(firmware),
            Machine::Generic => Settings::of(firmware),
        };
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
            ..Build::new(settings)
        }
    }

    /// The line and the clock.
    pub fn pace(&self) -> Pace {
        let usual = Pace::default();
        Pace {
            baud: match self.baud {
                None => usual.baud,
                Some(baud) => Some(baud).filter(|baud| *baud > 0),
            },
            time_factor: self.time_factor.unwrap_or(usual.time_factor),
            scales_bytes: self.fast_bytes,
        }
    }
}
