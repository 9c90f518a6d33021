//! G38.2 to G38.5: moves that end where a probe touches, or lets go.
//!
//! Where that is, a plan does not know. So the axes of a probe are not known after it, and can only be
//! moved from there by so much (G91), until a block names them absolutely, or a work offset is set there by the position (G10 L20), which is the
//! machine's to compute.
//!
//! A block that reads the result begins a new stretch. What is before it stays as it is when the results
//! are there, so that a run goes on where it stands.

use super::axes::{Cause, Reliance};
use super::further::FURTHER_WORDS;
use super::{Interpreter, Scene};
use crate::dialect::FeedMode;
use crate::expression::Trouble;
use crate::limits::STAYS_MM;
use cnc_msgs::contour::{Action, MotionClass, Probe, Source};
use cnc_msgs::finding::Code;
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::{AxisSet, Position, Shape};
use cnc_msgs::probing::{Measured, ProbeResult};
use cnc_msgs::units::received_mm;
use std::cell::Cell;
use std::sync::Arc;

/// `#5061`.
const FIRST_RESULT: u32 = 5061;
/// `#5399`.
const INPUT: u32 = 5399;

/// The probes of a program, and what is known of them.
#[derive(Debug, Clone, Default)]
pub(super) struct Probes {
    /// Of the run, in its order.
    results: Arc<[ProbeResult]>,
    /// M66, in the same way.
    inputs: Inputs,
    /// At which share of its way a probe is taken to touch that has no result.
    touch_at: Option<f64>,
    /// The first block that reads a result which was made up so.
    made_up_at: Option<Source>,
    /// Probes so far.
    count: usize,
    /// `#5061` to `#5070` after the last probe, if its result is there; nothing for an axis that is not known.
    values: Option<[Option<f64>; 10]>,
    /// Those that the program has set itself since.
    assigned: [Option<f64>; 10],
    /// How far the axes of the probes have stopped from the ends of their ways, mm.
    off: Position,
    /// No stretch has begun since the last probe.
    is_open: bool,
    /// The last stretch needs the result of a probe.
    waits_for_probe: bool,
    /// What is being read needs one, for this.
    is_asked: Cell<Asked>,
}

/// What a stretch is needed for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Asked {
    probe: bool,
    input: bool,
}

impl Asked {
    const PROBE: Self = Self { probe: true, input: false };
    const INPUT: Self = Self { probe: false, input: true };

    const fn and(self, other: Self) -> Self {
        Self { probe: self.probe || other.probe, input: self.input || other.input }
    }
}

/// The readings of inputs of a program.
#[derive(Debug, Clone, Default)]
struct Inputs {
    results: Arc<[i32]>,
    /// M66 so far.
    count: usize,
    /// No stretch has begun since the last one.
    is_open: bool,
    /// What the program has set itself since.
    assigned: Option<f64>,
}

impl Inputs {
    /// `#5399` after the last M66, if it has one.
    fn value(&self) -> Option<f64> {
        let last = self.count.checked_sub(1)?;
        self.results.get(last).map(|value| f64::from(*value))
    }
}

impl Interpreter<'_> {
    #[cold]
    pub(super) fn probe(&mut self, scene: &mut Scene<'_>, probe: Probe) {
        let word = probe.word();
        let end = self.turned_end(scene);
        if let Some(since) = self.modal.compensation.selected_at() {
            let message = format!(
                "{word} under cutter radius compensation, which is on since line {}",
                since.line
            );
            let help = "cancel with G40 and a straight move before it";
            self.report_block(scene, Code::ForbiddenUnderCompensation, message, help);
        } else if self.modal.feed_mode != FeedMode::PerMinute {
            let message =
                format!("{word} needs a feed rate in units a minute, and G94 is not in force");
            let help = "write G94 and F into this block";
            self.report_block(scene, Code::ModalConflict, message, help);
        }
        let by_so_much = self.by_so_much(&end);
        let is_sound = self.relies(scene, end.relative.without(by_so_much))
            & self.has_feed(scene, MotionClass::Feed);
        let from = self.axes.position;
        let relied = self.turned_axes(end.named.without(by_so_much));
        let stays = self.axes.rely_on(relied) == Reliance::Known
            && (0..3).all(|axis| (from[axis] - end.position[axis]).abs() < STAYS_MM);
        if stays && is_sound && !self.request.is_damaged {
            let message = format!("{word} ends where it begins");
            let help = "name a place beyond the one where the probe is to touch";
            self.report_block(scene, Code::BadNumber, message, help);
        }
        if self.arrive(&end) && is_sound {
            self.act_relative(by_so_much);
            self.act(Action::Probe(probe));
            self.add_to_bounds(from, Shape::Line, end.position, self.placed(&end));
            self.emit_motion(Shape::Line, end.position, MotionClass::Feed, end.named);
        }
        self.axes.drift(end.named, Cause { source: self.source, word });
        if !self.count_probe(from, end.named) {
            self.axes.miss(end.named);
        }
    }

    /// A probe has moved these axes, at the most to where they are now. False if it is known not to have
    /// touched.
    fn count_probe(&mut self, from: Position, named: AxisSet) -> bool {
        let end = self.axes.position;
        let made_up = |share: f64| {
            let contact = std::array::from_fn(|axis| from[axis] + share * (end[axis] - from[axis]));
            ProbeResult { has_touched: true, contact, stands: contact }
        };
        let measured = self.probes.results.get(self.probes.count).map(|result| ProbeResult {
            contact: self.back(result.contact),
            stands: self.back(result.stands),
            ..*result
        });
        let result = measured.or_else(|| self.probes.touch_at.map(made_up));
        self.probes.count += 1;
        self.probes.is_open = true;
        self.probes.values = result.map(|result| self.values_of(&result));
        self.probes.assigned = [None; 10];
        for axis in (0..3).filter(|&axis| named.contains(axis)) {
            self.probes.off[axis] = result.map_or(0.0, |result| result.stands[axis] - end[axis]);
        }
        result.is_none_or(|result| result.has_touched)
    }

    /// A result as the program reads it.
    fn values_of(&self, result: &ProbeResult) -> [Option<f64>; 10] {
        std::array::from_fn(|index| match index {
            0..3 => Some((result.contact[index] - self.modal.shift[index]) / self.scale()),
            9 => Some(f64::from(u8::from(result.has_touched))),
            _ => {
                let axis = index - 3;
                let scale = if FurtherAxes::is_rotary(axis) { 1.0 } else { self.scale() };
                self.further.programmed(axis).map(|place| place / scale)
            }
        })
    }

    /// Takes what the probes of a run have found so far, and at which share of its way each other one is
    /// taken to touch.
    pub(crate) fn take_results(&mut self, measured: Measured, touch_at: Option<f64>) {
        (self.probes.results, self.probes.touch_at) = (measured.probes.into(), touch_at);
        self.probes.inputs.results = measured.inputs.into();
    }

    /// Whether the last stretch waits for the result of a probe.
    pub(crate) fn waits_for_probe(&self) -> bool {
        self.probes.waits_for_probe
    }

    /// M66: `#5399` is another one.
    pub(super) fn count_input(&mut self) {
        self.probes.inputs.count += 1;
        self.probes.inputs.is_open = true;
        self.probes.inputs.assigned = None;
    }

    /// `#5399`.
    pub(super) fn input_value(&self) -> Result<f64, Trouble> {
        let Inputs { count, is_open, assigned, .. } = self.probes.inputs;
        if let Some(assigned) = assigned {
            return Ok(assigned);
        }
        if count == 0 {
            return Err(Trouble::NotRead);
        }
        if is_open {
            if self.modal.compensation.is_selected() {
                return Err(Trouble::CompensatedPosition);
            }
            self.ask(Asked::INPUT);
        }
        self.probes.inputs.value().ok_or(Trouble::NotRead)
    }

    /// The first block that reads a result which no probe has found.
    pub(crate) fn made_up_at(&self) -> Option<Source> {
        self.probes.made_up_at
    }

    /// `#5061` to `#5070`.
    pub(super) fn probe_value(&self, number: u32) -> Option<Result<f64, Trouble>> {
        let Probes { count, values, is_open, assigned, .. } = &self.probes;
        let index = (number - FIRST_RESULT) as usize;
        if let Some(value) = assigned[index] {
            return Some(Ok(value));
        }
        if *count > 0 && *is_open {
            if self.modal.compensation.is_selected() {
                return Some(Err(Trouble::CompensatedPosition));
            }
            self.ask(Asked::PROBE);
        }
        let Some(values) = values else { return Some(Err(Trouble::Probed)) };
        let unknown = || Trouble::UnknownPosition { axis: char::from(FURTHER_WORDS[index - 3]) };
        Some(values[index].ok_or_else(unknown))
    }

    /// Gives one of `#5061` to `#5070` a value until the next probe, or `#5399` until the next M66; whether the number
    /// is one of them.
    pub(crate) fn set_measured(&mut self, number: u32, value: f64) -> bool {
        if number == INPUT {
            self.probes.inputs.assigned = Some(value);
            return true;
        }
        let index = number.checked_sub(FIRST_RESULT).map(|index| index as usize);
        match index.and_then(|index| self.probes.assigned.get_mut(index)) {
            Some(assigned) => {
                *assigned = Some(value);
                true
            }
            None => false,
        }
    }

    /// Where an axis stands after a probe, in the work frame, mm.
    pub(super) fn measured(&self, axis: usize) -> Option<f64> {
        self.ask(Asked::PROBE);
        self.probes.values.map(|_| self.axes.position[axis] + self.probes.off[axis])
    }

    /// Whether what is being read needs the result of a probe, and no stretch has begun since.
    #[inline]
    pub(crate) fn needs_stretch(&self) -> bool {
        self.probes.is_asked.get() != Asked::default()
    }

    fn ask(&self, asked: Asked) {
        self.probes.is_asked.set(self.probes.is_asked.get().and(asked));
    }

    /// A block relies on axes that are not known: whether a stretch before it would give their places.
    #[cold]
    pub(super) fn asks_for_stretch(&mut self, scene: &Scene<'_>, unknown: AxisSet) -> bool {
        let is_asked = self.axes.drifting(unknown) == unknown && scene.under_compensation.is_none();
        if is_asked {
            self.ask(Asked::PROBE);
            self.request.is_damaged = true;
        }
        is_asked
    }

    /// Refuses to take the place of the tool for that of the workpiece, where a probe has not touched.
    pub(super) fn check_touched(&mut self, scene: &mut Scene<'_>, named: AxisSet, at: usize) {
        let missed = self.axes.missed(self.turned_axes(named));
        if missed.is_empty() {
            return;
        }
        let message = format!(
            "{} counts {} from where the tool is, and the probe there has not touched",
            scene.quote(at),
            missed.letters()
        );
        let help = "test #5070 before it: 0 says that the probe has not touched; or use G38.2 or G38.4, \
                    which end the run then";
        self.report_at(scene, at, Code::Axes, message, help);
    }

    /// The state before a block that may need a stretch, without the events; `None` for other blocks.
    #[inline]
    pub(crate) fn before_stretch(&mut self) -> Option<Self> {
        if self.axes.drifting(AxisSet::ALL).is_empty() {
            return None;
        }
        let events = std::mem::take(&mut self.contour.events);
        let state = self.clone();
        self.contour.events = events;
        Some(state)
    }

    /// No stretch begins, because of an error that has been reported.
    pub(crate) fn forget_stretch(&mut self) {
        self.probes.is_asked.take();
        self.axes.poison(self.axes.drifting(AxisSet::ALL));
    }

    /// As if the block had not been executed, but for its events.
    pub(crate) fn back_to(&mut self, state: Self) {
        let events = std::mem::take(&mut self.contour.events);
        *self = state;
        self.contour.events = events;
        self.probes.is_asked.take();
    }

    /// Begins a stretch after so many events; whether the results that it needs are there. The place of
    /// the tool is known then.
    #[cold]
    pub(crate) fn begin_stretch(&mut self, source: Source, events: usize) -> bool {
        self.contour.events.truncate(events);
        self.source = source;
        let asked = match self.probes.is_asked.take() {
            // The state was restored: a block needs where an axis is that was probed.
            asked if asked == Asked::default() => Asked::PROBE,
            asked => asked,
        };
        self.probes.waits_for_probe = asked.probe;
        // A run gives all that was measured so far, and `kerf plan` may have no more than assumptions of probes.
        self.probes.is_open &= self.probes.values.is_none();
        self.probes.inputs.is_open &= self.probes.inputs.value().is_none();
        let drifting = self.axes.drifting(AxisSet::ALL);
        self.act(Action::Stretch { axes: drifting });
        let lacks_probe = asked.probe && self.probes.values.is_none();
        let lacks_input = asked.input && self.probes.inputs.value().is_none();
        if lacks_probe || lacks_input {
            return false;
        }
        if asked.probe && self.probes.count > self.probes.results.len() {
            self.probes.made_up_at.get_or_insert(source);
        }
        if !drifting.is_empty() && self.probes.values.is_some() {
            let place = std::array::from_fn(|axis| {
                received_mm(self.axes.position[axis] + self.probes.off[axis])
            });
            let missed = self.axes.missed(drifting);
            self.stand(drifting, place, FurtherAxes::NONE);
            self.axes.miss(missed);
        }
        true
    }

    #[cold]
    pub(super) fn probe_without_axes(&mut self, scene: &mut Scene<'_>, at: usize) {
        let message = format!("{} without X, Y or Z", scene.quote(at));
        let help = "name the axes that move, and how far they go at most";
        self.report_at(scene, at, Code::MissingWord, message, help);
    }
}
