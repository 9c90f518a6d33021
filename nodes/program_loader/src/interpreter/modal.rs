//! What stays in force from one block to the next.

use super::compensation::Compensation;
use super::cycles::CycleWords;
use super::machine_words::Overrides;
use super::polar::Polar;
use super::spindle_speed::SurfaceSpeed;
use super::tool_lengths::Length;
use super::turn::Turn;
use crate::dialect::{Distance, FeedMode, Mode, Units};
use crate::rules::Rules;
use cnc_msgs::contour::SpindleMode;
use cnc_msgs::geometry::{Plane, Position};

/// What stays in force from one block to the next.
#[derive(Debug, Clone)]
pub(super) struct Modal {
    pub(super) mode: Option<Mode>,
    /// The motion word was rejected, or is reported as missing: bare axis words add nothing.
    pub(super) mode_is_poisoned: bool,
    pub(super) plane: Plane,
    pub(super) distance: Distance,
    pub(super) centers: Distance,
    pub(super) units: Units,
    /// 0 before the first F.
    pub(super) feed_mm_per_min: f64,
    pub(super) feed_mode: FeedMode,
    /// F as it is written, and with its unit in mm.
    pub(super) programmed_feed: f64,
    pub(super) programmed_feed_mm: f64,
    /// The feed of the last motion at feed.
    pub(super) emitted_feed_mm_per_min: f64,
    pub(super) feed_is_poisoned: bool,
    /// The number of the last T.
    pub(super) selected_tool: Option<u32>,
    /// The tool of the last M6.
    pub(super) spindle_tool: Option<u32>,
    /// M61 has said which tool that is.
    pub(super) is_tool_named: bool,
    pub(super) overrides: Overrides,
    /// G43.
    pub(super) length: Option<Length>,
    pub(super) work_offset: u8,
    /// How the work system is rotated.
    pub(super) turn: Option<Turn>,
    /// The zero of the program in the work system, mm (G52, G92), and what G92.3 restores.
    pub(super) shift: Position,
    pub(super) kept_shift: Position,
    pub(super) is_shifted: bool,
    /// It has been said that a feed is faster than any machine.
    pub(super) fast_feed_is_reported: bool,
    pub(super) x_is_diameter: bool,
    /// S, 1/min; 0 before the first one, and under G96.
    pub(super) rpm: f64,
    /// G96.
    pub(super) surface: Option<SurfaceSpeed>,
    pub(super) spindle: SpindleMode,
    /// That a thread lacks a spindle which turns has been reported, or why S was rejected.
    pub(super) spindle_is_reported: bool,
    pub(super) mist: bool,
    pub(super) flood: bool,
    pub(super) cycle: CycleWords,
    pub(super) polar: Polar,
    pub(super) compensation: Compensation,
}

impl Modal {
    /// As after switching on: G21, the plane of the dialect, G90, G91.1, G94, G40, G49, G54, no motion mode,
    /// no feed.
    pub(super) fn new(rules: &Rules<'_>) -> Self {
        Self {
            mode: None,
            mode_is_poisoned: false,
            plane: rules.dialect.plane,
            distance: Distance::Absolute,
            centers: Distance::Incremental,
            units: Units::Millimetre,
            feed_mm_per_min: 0.0,
            feed_mode: FeedMode::PerMinute,
            programmed_feed: 0.0,
            programmed_feed_mm: 0.0,
            emitted_feed_mm_per_min: 0.0,
            feed_is_poisoned: false,
            selected_tool: None,
            spindle_tool: None,
            is_tool_named: false,
            overrides: Overrides::default(),
            length: None,
            work_offset: 1,
            turn: None,
            shift: [0.0; 3],
            kept_shift: [0.0; 3],
            is_shifted: false,
            fast_feed_is_reported: false,
            x_is_diameter: rules.x_is_diameter,
            rpm: 0.0,
            surface: None,
            spindle: SpindleMode::Off,
            spindle_is_reported: false,
            mist: false,
            flood: false,
            cycle: CycleWords::default(),
            polar: Polar::default(),
            compensation: Compensation::default(),
        }
    }
}
