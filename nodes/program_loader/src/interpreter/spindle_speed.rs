//! S, G96 and G97: the speed of the spindle, or of the tool along the surface that it turns.
//!
//! Under G96 the machine turns the spindle so fast as the distance of the tool from X0 asks for. That
//! is its own function: the word is passed on. A feed per revolution (G95) is then that of the slowest
//! place of each programmed move.

use super::{Interpreter, Scene};
use crate::dialect::{FeedMode, GWord, Group, Units};
use crate::limits::{FEED_MM_PER_MIN_MAX, SPINDLE_RPM_MAX};
use cnc_msgs::contour::{Action, MotionClass};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::{Arc, Position};
use cnc_msgs::text::Words;
use std::f64::consts::TAU;

/// The fastest surface, m/min.
const M_PER_MIN_MAX: f64 = 10_000.0;
const M_OF_FOOT: f64 = 0.3048;

/// G96.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SurfaceSpeed {
    /// S as it is written.
    pub(super) programmed: f64,
    m_per_min: f64,
    /// D, 1/min.
    rpm_max: Option<f64>,
}

impl SurfaceSpeed {
    /// 1/min where the tool is so far from the axis of the spindle.
    fn rpm(&self, radius_mm: f64) -> f64 {
        if self.m_per_min == 0.0 {
            return 0.0;
        }
        let wanted = self.m_per_min * 1e3 / (TAU * radius_mm);
        wanted.min(self.rpm_max.unwrap_or(SPINDLE_RPM_MAX))
    }

    /// The words after G96, in m/min.
    fn action(&self) -> Action {
        let m_per_min = (self.m_per_min * 1e3).round() / 1e3;
        let mut words = format!("S{m_per_min}");
        if let Some(rpm_max) = self.rpm_max {
            words += &format!(" D{rpm_max}");
        }
        let words = Words::new(&words).unwrap_or_default();
        Action::Auxiliary { letter: 'G', number: 96.0, words }
    }
}

impl Interpreter<'_> {
    /// S, G96 and G97.
    #[inline]
    pub(super) fn spindle_speed(&mut self, scene: &mut Scene<'_>) {
        match self.request.g(Group::SpindleMode) {
            Some((GWord::SurfaceSpeed(true), at)) => return self.surface_speed(scene, at),
            Some((_, at)) => self.surface_speed_off(scene, at),
            None => {}
        }
        if !self.request.present.contains(b'S') {
            return;
        }
        if let Some(mut surface) = self.modal.surface {
            if let Some((programmed, m_per_min)) = self.surface_word(scene) {
                (surface.programmed, surface.m_per_min) = (programmed, m_per_min);
                self.set_surface_speed(Some(surface));
            }
            return;
        }
        if let Some(rpm) = self.take_within(scene, b'S', 1.0, SPINDLE_RPM_MAX, "1/min") {
            self.modal.spindle_is_reported = rpm.is_nan() || rpm < 0.0;
            if rpm < 0.0 {
                self.negative(scene, b'S');
            } else {
                self.modal.rpm = if rpm.is_nan() { 0.0 } else { rpm };
                self.feed_in_mode();
                self.act(Action::SpindleSpeed { rpm });
            }
        }
    }

    /// G96.
    #[cold]
    fn surface_speed(&mut self, scene: &mut Scene<'_>, at: usize) {
        let rpm_max = self.take_within(scene, b'D', 1.0, SPINDLE_RPM_MAX, "1/min");
        if rpm_max.is_some_and(|it| it <= 0.0) {
            let message = format!("{} is not above 0", scene.quote(self.request.word(b'D')));
            let help = "write D with the highest speed in 1/min";
            self.report(scene, b'D', Code::BadNumber, message, help);
        }
        if !self.request.present.contains(b'S') {
            let message = format!("{} without S", scene.quote(at));
            let help = "write S with the speed along the surface: m/min, under G20 feet a minute";
            return self.report_at(scene, at, Code::MissingWord, message, help);
        }
        let Some((programmed, m_per_min)) = self.surface_word(scene) else { return };
        if rpm_max.is_none() {
            let message = format!("{} without D", scene.quote(at));
            let help = "write D with the highest speed in 1/min: without it the spindle turns as fast as it can \
                        where the tool comes near X0";
            let finding = Finding::warning(Code::SuspiciousValue, self.source, message);
            scene.findings.push(finding.help(help));
        }
        self.set_surface_speed(Some(SurfaceSpeed { programmed, m_per_min, rpm_max }));
    }

    /// G97.
    fn surface_speed_off(&mut self, scene: &mut Scene<'_>, at: usize) {
        if self.modal.surface.is_some() && !self.request.present.contains(b'S') {
            let message =
                format!("{} without S: no spindle speed is in force after G96", scene.quote(at));
            let help = "write S with the speed in 1/min";
            let finding = Finding::warning(Code::SuspiciousValue, self.source, message);
            scene.findings.push(finding.help(help));
        }
        self.set_surface_speed(None);
    }

    /// S as it is written, and in m/min.
    fn surface_word(&mut self, scene: &mut Scene<'_>) -> Option<(f64, f64)> {
        let scale = if self.modal.units == Units::Inch { M_OF_FOOT } else { 1.0 };
        let m_per_min = self.take_within(scene, b'S', scale, M_PER_MIN_MAX, "m/min")?;
        if m_per_min < 0.0 {
            self.negative(scene, b'S');
            return None;
        }
        m_per_min.is_finite().then(|| (m_per_min / scale, m_per_min))
    }

    /// Begins or ends G96. How fast the spindle turns after it is not known before S.
    pub(super) fn set_surface_speed(&mut self, surface: Option<SurfaceSpeed>) {
        match surface {
            Some(surface) => self.act(surface.action()),
            None if self.modal.surface.is_some() => {
                self.act(Action::Auxiliary { letter: 'G', number: 97.0, words: Words::EMPTY })
            }
            None => return,
        }
        self.modal.rpm = 0.0;
        self.modal.surface = surface;
        self.feed_in_mode();
    }

    /// 1/min where the tool is so far from X0, mm.
    fn rpm_at(&self, x_mm: f64) -> f64 {
        let from_axis_mm = (x_mm - self.modal.shift[0]).abs();
        self.modal.surface.map_or(self.modal.rpm, |surface| surface.rpm(from_axis_mm))
    }

    /// 1/min where the tool is.
    pub(super) fn rpm_here(&self) -> f64 {
        self.rpm_at(self.axes.position[0])
    }

    /// Whether the feed depends on how far the tool is from X0: G95 and G96.
    #[inline]
    pub(super) fn has_feed_of_radius(&self) -> bool {
        self.modal.surface.is_some() && self.modal.feed_mode == FeedMode::PerRevolution
    }

    /// Under G95 and G96, computes the feed of a move from how far it reaches from X0.
    #[inline]
    pub(super) fn feed_at_surface(
        &mut self,
        class: MotionClass,
        start: Position,
        end: Position,
        arc: Option<&Arc>,
    ) {
        if class == MotionClass::Feed && self.has_feed_of_radius() {
            let along_arc = arc.into_iter().flat_map(|arc| arc.outermost(start, end));
            let along_arc = along_arc.filter(|(axis, _)| *axis == 0).map(|(_, x)| x);
            let rpm = [start[0], end[0]].into_iter().chain(along_arc).map(|x| self.rpm_at(x));
            let slowest = rpm.fold(f64::INFINITY, f64::min);
            let feed = self.modal.programmed_feed_mm * slowest;
            self.modal.feed_mm_per_min = feed.min(FEED_MM_PER_MIN_MAX);
        }
    }
}
