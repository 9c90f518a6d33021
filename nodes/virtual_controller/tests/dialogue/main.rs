//! Conversations with the controller, as a terminal would show them.
//!
//! One module for each firmware and topic. Comments name the row of the transcripts of real
//! firmware that a dialogue repeats.

#[path = "../common/mod.rs"]
mod common;
mod fluidnc;
mod grbl_reports;
mod grbl_resets;
mod grbl_stops;
mod grbl_switches;
mod grblhal_lines;
mod grblhal_parking;
mod grblhal_reports;
mod grblhal_stops;
mod grblhal_switches;
mod script;
