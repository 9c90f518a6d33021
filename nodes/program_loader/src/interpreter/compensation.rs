//! G40, G41, G42, D and P: the side of compensation, and the source of the radius.
//!
//! The planner decides what the tool does then. Emits the radius first, then the selection or the
//! cancel.
//!
//! D0 selects nothing (S22). While compensation is on it either deselects (S29), or only suspends,
//! so that the next D that is not 0 selects again (N06); the profile decides.

use super::axes::Cause;
use super::moves::{AXIS_WORDS, CENTER_WORDS};
use super::{Interpreter, Scene};
use crate::dialect::{ApproachWords, GWord, Group, Mode, RadiusWord};
use crate::limits::COORDINATE_MM_MAX;
use cnc_msgs::contour::{Action, Approach, ContourEventKind, CutterSide, RadiusSource, Source};
use cnc_msgs::finding::{Code, Finding, Severity};
use cnc_msgs::geometry::{AXIS_LETTERS, AxisSet, Direction, Plane};
use cnc_msgs::profile::ZeroOffset;

#[derive(Debug, Clone, Default)]
pub(super) struct Compensation {
    /// G41 or G42 in force.
    side: Option<CutterSide>,
    /// The block of the selection that was emitted last.
    selected: Option<Source>,
    was_selected: bool,
    /// The D in force, where D is modal.
    offset: Option<u32>,
    /// The D whose length is selected, where D selects lengths.
    length: Option<u32>,
    /// The axes of compensation and of corner rounding, if words set them.
    axes: Option<[usize; 2]>,
    rounding_axes: Option<[usize; 2]>,
    /// The D that was emitted last.
    emitted_offset: Option<u32>,
    /// The block where D0 deselected, until the next G40, G41 or G42.
    deselected: Option<Source>,
    /// A D after that, which selects nothing.
    vain_offset: Option<Source>,
}

/// The tip direction of the tool table for each of LinuxCNC, whose numbers go around the other way.
pub(super) const TIPS: [u8; 10] = [0, 4, 3, 2, 1, 5, 8, 7, 6, 9];

impl Compensation {
    /// The block that selected compensation, while it is on.
    #[inline]
    pub(super) fn selected_at(&self) -> Option<Source> {
        self.selected
    }

    /// Whether it has ever been selected.
    #[inline]
    pub(super) fn was_selected(&self) -> bool {
        self.was_selected
    }

    /// The side in force.
    pub(super) fn side(&self) -> Option<CutterSide> {
        self.side
    }

    #[inline]
    pub(super) fn is_selected(&self) -> bool {
        self.selected.is_some()
    }
}

impl Interpreter<'_> {
    /// A block that calculates. The compensation may end later than it is cancelled, with the move
    /// after that, which the planner knows.
    pub(crate) fn calculate(&mut self, source: Source) {
        if self.modal.compensation.was_selected() {
            self.source = source;
            self.emit(ContourEventKind::Calculation);
        }
    }

    #[inline]
    pub(super) fn compensation(&mut self, scene: &mut Scene<'_>) {
        let word = self.request.g(Group::Compensation);
        let is_modal_offset = self.rules.radius_word == RadiusWord::ModalOffset;
        let offset = if is_modal_offset { self.take_number(scene, b'D') } else { None };
        if let Some(number) = offset {
            if self.rules.d_selects_length {
                self.select_length(number);
            }
            self.modal.compensation.offset = offset;
        }
        if word.is_some() {
            (self.modal.compensation.deselected, self.modal.compensation.vain_offset) =
                (None, None);
        }
        match word {
            None => {
                if offset.is_some() {
                    self.change_offset(scene);
                }
                if self.request.approach.is_some() {
                    let at = self.request.g_place(Group::Approach);
                    let message = format!("{} stands without G40, G41 or G42", scene.quote(at));
                    let help = "write it into the block that selects or cancels compensation";
                    self.report_at(scene, at, Code::MissingWord, message, help);
                }
            }
            Some((GWord::CompensationOn { side, is_dynamic }, at)) => {
                self.select(scene, side, is_dynamic, at);
            }
            Some(_) => {
                self.modal.compensation.side = None;
                self.cancel(self.request.approach);
            }
        }
    }

    fn cancel(&mut self, exit: Option<Approach>) {
        if self.modal.compensation.selected.take().is_some() {
            self.modal.compensation.emitted_offset = None;
            self.emit(ContourEventKind::Cancel { exit });
        }
    }

    /// A new D while G41 or G42 may be in force.
    fn change_offset(&mut self, scene: &mut Scene<'_>) {
        let is_zero =
            self.modal.compensation.offset == Some(0) && self.rules.d0 != ZeroOffset::None;
        let Some(side) = self.modal.compensation.side else {
            if !is_zero && self.modal.compensation.deselected.is_some() {
                let word = self.request.word(b'D');
                self.modal.compensation.vain_offset = Some(scene.source_of(word));
            }
            return;
        };
        if is_zero {
            self.cancel(None);
            if self.rules.d0 == ZeroOffset::Deselect {
                self.modal.compensation.side = None;
                self.modal.compensation.deselected = Some(self.source);
            }
        } else if self.modal.compensation.is_selected() {
            self.emit_offset();
        } else {
            self.emit_offset();
            self.emit_selection(scene, side);
        }
    }

    /// Reports a move at feed that is not compensated after D0 and another D (S29): a control that
    /// only suspends with D0 would compensate it.
    #[inline]
    pub(super) fn lost_compensation(&mut self, scene: &mut Scene<'_>) {
        if self.modal.compensation.vain_offset.is_none() {
            return;
        }
        let [u, v, _] = self.modal.plane.axes();
        let has = |letter| self.request.present.contains(letter);
        let is_in_plane = has(AXIS_WORDS[u]) || has(AXIS_WORDS[v]);
        if is_in_plane || !matches!(self.modal.mode, Some(Mode::Feed)) {
            self.report_lost_compensation(scene);
        }
    }

    #[cold]
    fn report_lost_compensation(&mut self, scene: &mut Scene<'_>) {
        let Some(at) = self.modal.compensation.vain_offset.take() else { return };
        let Some(deselected) = self.modal.compensation.deselected.take() else { return };
        let message = format!(
            "this D does not bring back the compensation that D0 in line {} has ended: {} runs uncompensated",
            deselected.line,
            match self.source.block {
                Some(block) => format!("N{block}"),
                None => format!("line {}", self.source.line),
            }
        );
        let mut finding = Finding::warning(Code::NeverActive, at, message)
            .help("write G41 or G42 with this D, or G40 in place of D0");
        finding.other = Some(deselected);
        scene.findings.push(finding);
    }

    /// Takes I, J and K as a direction; a missing one counts as 0.
    fn take_direction(&mut self, scene: &mut Scene<'_>) -> Option<Direction> {
        if CENTER_WORDS.iter().all(|&letter| !self.request.present.contains(letter)) {
            return None;
        }
        let along = CENTER_WORDS.map(|letter| {
            self.take_within(scene, letter, 1.0, COORDINATE_MM_MAX, "mm").unwrap_or(0.0)
        });
        (along != [0.0; 3] && along.iter().all(|part| part.is_finite())).then_some(along)
    }

    /// Sets the radius that is in force from here on (A13).
    #[cold]
    pub(super) fn set_radius(&mut self, scene: &mut Scene<'_>, at: usize) {
        let scale = self.scale();
        let Some(radius) = self.take_within(scene, b'P', scale, COORDINATE_MM_MAX, "mm") else {
            if scene.block.is_damaged {
                return;
            }
            let message = format!("{} has no P", scene.quote(at));
            return self.report_at(
                scene,
                at,
                Code::MissingWord,
                message,
                "write the radius after P",
            );
        };
        if radius < 0.0 {
            return self.negative(scene, b'P');
        }
        self.emit(ContourEventKind::Radius(RadiusSource::Radius(radius)));
    }

    /// Sets the axes of compensation or of corner rounding, in their order (A09 to A12).
    #[cold]
    pub(super) fn set_axes(&mut self, scene: &mut Scene<'_>, at: usize, rounds_corners: bool) {
        let axes = self.take_axis_names(scene);
        if !(2..=3).contains(&axes.len()) {
            let message =
                format!("{} names {} axes; 2 or 3 are needed", scene.quote(at), axes.len());
            let help =
                "name the axes of the plane in its order: X Y in G17, Z X in G18, Y Z in G19";
            return self.report_at(scene, at, Code::Axes, message, help);
        }
        let pair = [axes[0], axes[1]];
        let state = &mut self.modal.compensation;
        if rounds_corners {
            state.rounding_axes = Some(pair);
        } else {
            state.axes = Some(pair);
        }
        if self.modal.compensation.axes.is_some() || self.modal.compensation.is_selected() {
            self.axes_agree(scene, at);
        }
    }

    /// Checks that the axes of compensation (by default those of the plane) are the axes of the
    /// plane and of corner rounding.
    fn axes_agree(&mut self, scene: &mut Scene<'_>, at: usize) -> bool {
        let name = |axes: [usize; 2]| axes.map(|axis| AXIS_LETTERS[axis].to_string()).join(" ");
        let [u, v, _] = self.modal.plane.axes();
        let axes = self.modal.compensation.axes.unwrap_or([u, v]);
        let message = match self.modal.compensation.rounding_axes {
            _ if axes != [u, v] => format!(
                "compensation uses the axes {}, but the plane {} has {}",
                name(axes),
                self.modal.plane.name(),
                name([u, v])
            ),
            Some(rounding) if rounding != axes => format!(
                "compensation uses the axes {}, but corner rounding uses {}",
                name(axes),
                name(rounding)
            ),
            _ => return true,
        };
        let help = "give both the axes of the plane, in its order";
        self.report_at(scene, at, Code::Axes, message, help);
        false
    }

    /// Homing switches compensation off at once (A05).
    #[cold]
    pub(super) fn home_axes(&mut self) {
        let mut named = AxisSet::NONE;
        for (axis, letter) in AXIS_WORDS.into_iter().enumerate() {
            if self.take(letter).is_some() {
                named = named.with(axis);
            }
        }
        if self.request.is_damaged {
            return self.axes.poison(named);
        }
        let state = &mut self.modal.compensation;
        (state.side, state.selected, state.emitted_offset) = (None, None, None);
        self.emit(ContourEventKind::Action(Action::Home { axes: named }));
        self.axes.lose(named, Cause { source: self.source, word: "Home" });
    }

    /// A corner arc, which is alone in its block.
    #[cold]
    pub(super) fn corner_arc(&mut self, scene: &mut Scene<'_>, at: usize) {
        let along = self.take_direction(scene);
        if !self.modal.compensation.is_selected() {
            let message = format!("{} without compensation selected", scene.quote(at));
            let mut finding = Finding::error(Code::ModalConflict, scene.source_of(at), message)
                .help("select compensation before, or delete it");
            finding.alarm = Some("3036".into());
            self.request.is_damaged = true;
            scene.findings.push(finding);
            return;
        }
        self.emit(ContourEventKind::CornerArc { along });
    }

    /// D also selects the length of its offset, with or without G41; D0 selects none (S34).
    fn select_length(&mut self, number: u32) {
        let number = (number != 0 || self.rules.d0 == ZeroOffset::None).then_some(number);
        let before = std::mem::replace(&mut self.modal.compensation.length, number);
        if before != number {
            let action = Action::ToolLength { offset: number, length_mm: 0.0, second: None };
            self.emit(ContourEventKind::Action(action));
        }
    }

    fn emit_offset(&mut self) {
        let state = &mut self.modal.compensation;
        if state.offset != state.emitted_offset
            && let Some(offset) = state.offset
        {
            state.emitted_offset = Some(offset);
            self.emit(ContourEventKind::Radius(RadiusSource::Offset(offset)));
        }
    }

    fn emit_selection(&mut self, scene: &mut Scene<'_>, side: CutterSide) {
        self.modal.compensation.selected.get_or_insert(self.source);
        self.modal.compensation.was_selected = true;
        let is_arc =
            matches!(self.request.g(Group::Motion), Some((GWord::Motion(Mode::Arc { .. }), _)));
        let along = match self.rules.dialect.approach {
            ApproachWords::Direction if !is_arc => self.take_direction(scene),
            ApproachWords::Point if !is_arc => {
                self.take_direction(scene).map(|point| point.map(|part| 0.0 - part))
            }
            _ => None,
        };
        let approach = self.request.approach;
        self.emit(ContourEventKind::Select { side, approach, along });
    }

    #[cold]
    fn select(&mut self, scene: &mut Scene<'_>, side: CutterSide, is_dynamic: bool, at: usize) {
        // Its first move relies on where the tool is, and no stretch begins then.
        let [first, second, _] = self.modal.plane.axes();
        let drifting = self.axes.drifting(AxisSet::NONE.with(first).with(second));
        if !drifting.is_empty() {
            self.asks_for_stretch(scene, drifting);
        }
        match self.rules.radius_word {
            RadiusWord::ModalOffset => return self.select_with_offset(scene, side, at),
            RadiusWord::Set => {
                if !self.axes_agree(scene, at) {
                    return;
                }
            }
            // It came with the T word.
            RadiusWord::Nose => {}
            RadiusWord::Addend => {
                let radius = self.take_within(scene, b'P', self.scale(), COORDINATE_MM_MAX, "mm");
                let radius = RadiusSource::SpindleToolPlus(radius.unwrap_or(0.0));
                self.emit(ContourEventKind::Radius(radius));
            }
            RadiusWord::Tool if is_dynamic => {
                self.check_plane(scene, "cutter radius compensation");
                let scale = self.scale();
                let Some(diameter) = self.take_within(scene, b'D', scale, COORDINATE_MM_MAX, "mm")
                else {
                    let message = format!("{} has no D", scene.quote(at));
                    let help = "write the diameter of the tool after D";
                    return self.report_at(scene, at, Code::MissingWord, message, help);
                };
                let tip = self.take_tip(scene);
                let radius = RadiusSource::Diameter { mm: diameter, tip };
                self.emit(ContourEventKind::Radius(radius));
            }
            RadiusWord::Tool => {
                self.check_plane(scene, "cutter radius compensation");
                // LinuxCNC: no D, and D0, mean the tool in the spindle.
                let tool = self.take_number(scene, b'D').filter(|&tool| tool > 0);
                let radius = self.radius_of(scene, tool, at);
                self.emit(ContourEventKind::Radius(radius));
            }
        }
        self.modal.compensation.side = Some(side);
        self.emit_selection(scene, side);
    }

    /// The tip direction of a turning tool that L names; 0 without one, and out of the plane ZX,
    /// where L has no meaning.
    fn take_tip(&mut self, scene: &mut Scene<'_>) -> u8 {
        if self.modal.plane != Plane::Zx {
            return 0;
        }
        let Some(direction) = self.take_number(scene, b'L') else { return 0 };
        if let Some(&tip) = TIPS.get(direction as usize) {
            return tip;
        }
        let word = scene.quote(self.request.word(b'L'));
        let message = format!("{word} is not the direction of a tip");
        let help = "write L1 to L8, or L0 for the centre of the tool";
        self.report(scene, b'L', Code::BadNumber, message, help);
        0
    }

    fn select_with_offset(&mut self, scene: &mut Scene<'_>, side: CutterSide, at: usize) {
        self.modal.compensation.side = Some(side);
        match self.modal.compensation.offset {
            None if self.request.present.contains(b'D') => {}
            // The planner reports that there is no radius.
            None if self.rules.no_radius == Severity::Warning => self.emit_selection(scene, side),
            None => {
                let message =
                    format!("{} without a D: no offset has been selected", scene.quote(at));
                let help =
                    "write D with the number of the tool offset into this block or before it";
                self.report_at(scene, at, Code::MissingWord, message, help);
            }
            Some(0) if self.rules.d0 != ZeroOffset::None => {
                self.cancel(self.request.approach);
                let message = format!("{} has no effect while D0 is in force", scene.quote(at));
                scene.findings.push(
                    Finding::warning(Code::NeverActive, scene.source_of(at), message)
                        .help("the next D that is not 0 selects compensation"),
                );
            }
            Some(_) => {
                self.emit_offset();
                self.emit_selection(scene, side);
            }
        }
    }
}
