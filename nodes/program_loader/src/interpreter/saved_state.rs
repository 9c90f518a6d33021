//! M70, M71, M72 and M73: the words in force are saved, and said again later.
//!
//! Saved are those that LinuxCNC saves: units, plane, distances, feed mode and feed, work system,
//! whether G92 and G52 act, tool length, spindle and coolant, overrides, and where cycles end. Cutter radius
//! compensation is not switched by restoring: that is an error. M73 in a subroutine restores by
//! itself at its end.

use super::machine_words::Overrides;
use super::spindle_speed::SurfaceSpeed;
use super::tool_lengths::Length;
use super::{Interpreter, Scene};
use crate::dialect::{Distance, FeedMode, Units};
use crate::findings::Findings;
use cnc_msgs::contour::{Action, ContourEventKind, CoolantMode, CutterSide, Source, SpindleMode};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::Plane;

/// What an M word does with the words in force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StateWord {
    /// M70, and M73, which restores them at the end of the subroutine.
    Save { returns: bool },
    /// M71.
    Forget,
    /// M72.
    Restore,
}

/// What is wrong where words cannot be restored, and what to do.
const SWITCHES_COMPENSATION: (&str, &str) = (
    "restoring the saved words would switch cutter radius compensation",
    "switch it with G40, G41 or G42 and a straight move before the words are restored",
);

/// Words that were in force.
#[derive(Debug, Clone, Copy)]
pub(super) struct SavedState {
    plane: Plane,
    distance: Distance,
    centers: Distance,
    units: Units,
    feed_mode: FeedMode,
    feed_mm_per_min: f64,
    programmed_feed: f64,
    programmed_feed_mm: f64,
    work_offset: u8,
    x_is_diameter: bool,
    rpm: f64,
    surface: Option<SurfaceSpeed>,
    spindle: SpindleMode,
    mist: bool,
    flood: bool,
    returns_to_r: bool,
    is_shifted: bool,
    length: Option<Length>,
    side: Option<CutterSide>,
    overrides: Overrides,
}

impl Interpreter<'_> {
    /// M70 to M73.
    #[cold]
    pub(super) fn saved_words(&mut self, scene: &mut Scene<'_>, word: StateWord, at: usize) {
        let state = self.saved_state();
        let Some(level) = self.saved.last_mut() else { return };
        match word {
            StateWord::Save { returns } => *level = Some((state, returns)),
            StateWord::Forget => *level = None,
            StateWord::Restore => match *level {
                Some((saved, _)) => {
                    if !self.restore(&saved) {
                        let (message, help) = SWITCHES_COMPENSATION;
                        let code = Code::ForbiddenUnderCompensation;
                        self.report_at(scene, at, code, message.to_owned(), help);
                    }
                }
                None => {
                    let message = "M72 restores words, and M70 has saved none here".to_owned();
                    let help = "write M70 before it, in the same subroutine";
                    self.report_at(scene, at, Code::MissingWord, message, help);
                }
            },
        }
    }

    /// Follows calls and returns: each subroutine saves words of its own. `source` is the place of
    /// the return.
    pub(crate) fn set_depth(&mut self, depth: usize, source: Source, findings: &mut Findings) {
        while self.saved.len() > depth + 1 {
            if let Some(Some((saved, true))) = self.saved.pop() {
                self.source = source;
                if !self.restore(&saved) {
                    let (message, help) = SWITCHES_COMPENSATION;
                    let code = Code::ForbiddenUnderCompensation;
                    findings.push(Finding::error(code, source, message).help(help));
                }
            }
        }
        self.saved.resize(depth + 1, None);
    }

    /// What M70 and M73 save.
    fn saved_state(&self) -> SavedState {
        let modal = &self.modal;
        SavedState {
            plane: modal.plane,
            distance: modal.distance,
            centers: modal.centers,
            units: modal.units,
            feed_mode: modal.feed_mode,
            feed_mm_per_min: modal.feed_mm_per_min,
            programmed_feed: modal.programmed_feed,
            programmed_feed_mm: modal.programmed_feed_mm,
            work_offset: modal.work_offset,
            x_is_diameter: modal.x_is_diameter,
            rpm: modal.rpm,
            surface: modal.surface,
            spindle: modal.spindle,
            mist: modal.mist,
            flood: modal.flood,
            returns_to_r: modal.cycle.returns_to_r,
            is_shifted: self.is_shifted(),
            length: modal.length,
            side: modal.compensation.side(),
            overrides: modal.overrides,
        }
    }

    /// Says the saved words again, as far as they are no longer in force. False, and nothing, if
    /// cutter radius compensation is not as it was.
    fn restore(&mut self, saved: &SavedState) -> bool {
        if self.modal.compensation.side() != saved.side {
            return false;
        }
        if self.modal.plane != saved.plane {
            self.modal.plane = saved.plane;
            self.emit(ContourEventKind::Plane(saved.plane));
        }
        if self.modal.surface != saved.surface {
            self.set_surface_speed(saved.surface);
        }
        if self.modal.rpm != saved.rpm {
            self.act(Action::SpindleSpeed { rpm: saved.rpm });
        }
        if self.modal.spindle != saved.spindle {
            self.act(Action::Spindle(saved.spindle));
        }
        if (self.modal.mist, self.modal.flood) != (saved.mist, saved.flood) {
            if self.modal.mist && !saved.mist || self.modal.flood && !saved.flood {
                self.act(Action::Coolant(CoolantMode::Off));
            }
            for (is_on, mode) in
                [(saved.mist, CoolantMode::Mist), (saved.flood, CoolantMode::Flood)]
            {
                if is_on {
                    self.act(Action::Coolant(mode));
                }
            }
        }
        self.set_overrides(saved.overrides);
        let modal = &mut self.modal;
        modal.distance = saved.distance;
        modal.centers = saved.centers;
        modal.units = saved.units;
        modal.feed_mode = saved.feed_mode;
        modal.feed_mm_per_min = saved.feed_mm_per_min;
        modal.programmed_feed = saved.programmed_feed;
        modal.programmed_feed_mm = saved.programmed_feed_mm;
        modal.x_is_diameter = saved.x_is_diameter;
        modal.rpm = saved.rpm;
        modal.spindle = saved.spindle;
        (modal.mist, modal.flood) = (saved.mist, saved.flood);
        modal.cycle.returns_to_r = saved.returns_to_r;
        match saved.is_shifted {
            true => self.restore_shift(),
            false => self.end_shift(),
        }
        if self.modal.work_offset != saved.work_offset {
            self.select_work_offset(saved.work_offset);
        }
        if self.modal.length != saved.length {
            let word = if saved.length.is_some() { "G43" } else { "G49" };
            self.set_length(saved.length, word);
        }
        true
    }
}
