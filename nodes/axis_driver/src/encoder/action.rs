//! All that is not motion of the contour, as grbl says it or cannot.

use super::port::begins_motion;
use super::probe::no_motion;
use super::words::{to_grid, write_word};
use super::{
    EncodeProblem, EncodedLine, Encoder, EncoderStep, HeldSpeed, Homing, Modal, PREAMBLE_IN_FRAME,
    StartFurther, spindle_word,
};
use crate::link::LineKind;
use cnc_msgs::contour::{Action, CoolantMode, Source, work_system};
use cnc_msgs::further::{FurtherAxes, FurtherMode, FurtherMove};
use cnc_msgs::geometry::{AXIS_LETTERS, AxisSet, Position, Shape};
use cnc_msgs::path::{PathElement, PathEvent, Role};

/// The longest dwell that is sent, s.
pub(super) const DWELL_S_MAX: f64 = 86_400.0;

impl Encoder {
    pub(super) fn encode_action(&mut self, event: &PathEvent) -> Result<(), EncodeProblem> {
        let source = event.source;
        // The driver shows it when it is reached.
        if matches!(event.action, Action::Message { .. }) {
            return Ok(());
        }
        self.refuse_after_end(&event.action.text())?;
        let goes_along =
            matches!(event.action, Action::Further(FurtherMove { mode: FurtherMode::Along, .. }));
        if begins_motion(&event.action) {
            self.push_outputs(source)?;
        }
        if !goes_along && !matches!(event.action, Action::SelectTool { .. }) {
            self.push_speed()?;
        }
        if !matches!(
            event.action,
            Action::MachineMove { .. } | Action::SetWorkOffset { .. } | Action::Reference { .. }
        ) {
            self.refuse_held_further()?;
        }
        if !self.relative.is_empty() && !matches!(event.action, Action::Probe(_)) {
            return Err(no_motion(self.relative));
        }
        match event.action {
            Action::Relative { axes } => {
                self.relative = axes;
                Ok(())
            }
            Action::SpindleSpeed { rpm } => {
                let max = self.config.spindle_rpm_max;
                if !(0.0..=max).contains(&rpm) {
                    return Err(EncodeProblem::SpindleSpeed { value: rpm, max });
                }
                self.speed = Some(HeldSpeed { word: word('S', rpm), source });
                Ok(())
            }
            Action::Spindle(mode) => {
                self.push_action(spindle_word(mode).into(), LineKind::Slow, false, source)
            }
            Action::Coolant(mode) => self.encode_coolant(mode, source),
            // grbl keeps no tool; the number comes with the change.
            Action::SelectTool { .. } | Action::Message { .. } => Ok(()),
            Action::ChangeTool { tool } => {
                self.push_action("M5".into(), LineKind::Slow, false, source)?;
                if self.config.controller_changes_tools {
                    // It may measure the tool and set its length.
                    self.modal.forget(AxisSet::from_bits(0b100), "M6");
                    self.push_action(format!("M6T{tool}"), LineKind::Slow, true, source)?;
                    self.pending.push_back(EncoderStep::ControllerChange { tool, source });
                    return Ok(());
                }
                self.pending.push_back(EncoderStep::ToolChange { tool, source });
                Ok(())
            }
            Action::ToolLength { offset, length_mm, .. } => {
                self.checked_position('Z', length_mm)?;
                self.modal.forget(AxisSet::from_bits(0b100), &event.action.text());
                let text = match offset {
                    Some(_) => word_after("G43.1", 'Z', length_mm),
                    None => "G49".into(),
                };
                self.modal.tool_length = offset.map(|_| text.clone()).unwrap_or_default();
                self.modal.tool_length_mm = if offset.is_some() { length_mm } else { 0.0 };
                self.push_action(text, LineKind::Motion, false, source)
            }
            Action::WorkOffset { system } => {
                self.check_work_system(system)?;
                self.modal.forget(AxisSet::ALL, &event.action.text());
                self.modal.further_at = FurtherAxes::NONE;
                self.modal.work_system = system;
                self.push_action(work_system(system), LineKind::Motion, true, source)
            }
            Action::Dwell { seconds } => {
                if !(0.0..=DWELL_S_MAX).contains(&seconds) {
                    return Err(EncodeProblem::Dwell { value: seconds, max: DWELL_S_MAX });
                }
                // The range was checked: it fits.
                let kind = LineKind::Dwell { milliseconds: (seconds * 1e3) as u32 };
                self.push_action(word_after("G4", 'P', seconds), kind, false, source)
            }
            Action::Stop { optional } => {
                if optional && !self.config.optional_stop {
                    return Ok(());
                }
                self.push_action("M0".into(), LineKind::Slow, false, source)
            }
            Action::Reference { axes, second } => self.encode_reference(axes, second, source),
            Action::MachineMove { target, axes, rapid, feed_mm_per_min } => {
                let feed = (!rapid).then_some(feed_mm_per_min);
                self.encode_machine_move(target, axes, feed, source)
            }
            Action::SetWorkOffset { system, axes, origin, by_position } => {
                self.encode_work_offset(system, axes, origin, by_position, source)
            }
            Action::Further(further) => self.encode_further(further, source),
            Action::Probe(probe) => self.encode_probe(probe, source),
            Action::SpindleSync { pitch_mm } => self.encode_thread(pitch_mm, source),
            Action::Stretch { .. } => {
                self.pending.push_back(EncoderStep::Stretch { source });
                Ok(())
            }
            Action::StoreReference { second } => {
                let text = if second { "G30.1" } else { "G28.1" };
                // The firmware writes it to its memory, and hears nothing meanwhile.
                self.push_action(text.into(), LineKind::Slow, true, source)
            }
            Action::ProgramEnd { rewind } => {
                let text = if rewind { "M30" } else { "M2" };
                self.modal.reset_at_end(source);
                self.push_action(text.into(), LineKind::Slow, false, source)
            }
            Action::ExactStop => {
                // A dwell of no length: the firmware waits until the axes stand still.
                let kind = LineKind::Dwell { milliseconds: 0 };
                self.push_action("G4P0".into(), kind, false, source)
            }
            Action::Home { axes } => self.encode_home(axes, source),
            Action::Auxiliary { .. } => self.encode_auxiliary(&event.action, source),
        }
    }

    /// Sends a speed that waits for a move on a line of its own: something else comes first.
    pub(super) fn push_speed(&mut self) -> Result<(), EncodeProblem> {
        match self.speed.take() {
            Some(HeldSpeed { word, source }) => {
                self.push_action(word, LineKind::Slow, false, source)
            }
            None => Ok(()),
        }
    }

    /// Homing ends with the words that the owner of the controller has stored for its
    /// start (`$N0`), whatever they are: those in force are said again after it.
    fn encode_home(&mut self, axes: AxisSet, source: Source) -> Result<(), EncodeProblem> {
        let axes = if axes.is_empty() { AxisSet::ALL } else { axes };
        let word = Action::Home { axes }.text();
        let unsupported =
            |why: &str| Err(EncodeProblem::Unsupported { word: format!("{word}: {why}") });
        let letters = axes.letters();
        let lines: Vec<String> = match self.config.homing {
            Homing::Off => return unsupported("its homing is switched off ($22=0)"),
            _ if axes == AxisSet::ALL => vec!["$H".into()],
            Homing::Together => return unsupported("it homes all axes together, so home XYZ"),
            Homing::OneByOne => letters.chars().map(|letter| format!("$H{letter}")).collect(),
        };
        for text in lines {
            self.pending.push_back(EncoderStep::Home { text, axes, source });
        }
        let work_system = self.modal.work_system.max(1);
        let tool_length = std::mem::take(&mut self.modal.tool_length);
        let tool_length_mm = self.modal.tool_length_mm;
        self.modal = Modal { work_system, tool_length, tool_length_mm, ..Modal::default() };
        self.modal.forget(axes, &word);
        let words = format!("{PREAMBLE_IN_FRAME}{}", self::work_system(work_system));
        self.push_action(words, LineKind::Motion, true, source)?;
        match self.modal.tool_length.clone() {
            text if text.is_empty() => Ok(()),
            text => self.push_action(text, LineKind::Motion, false, source),
        }
    }

    fn check_work_system(&self, system: u8) -> Result<(), EncodeProblem> {
        match (1..=self.config.board.work_systems).contains(&system) {
            true => Ok(()),
            false => Err(EncodeProblem::WorkOffset { system }),
        }
    }

    /// G10 L2 and L20.
    fn encode_work_offset(
        &mut self,
        system: u8,
        axes: AxisSet,
        origin: Position,
        by_position: bool,
        source: Source,
    ) -> Result<(), EncodeProblem> {
        self.check_work_system(system)?;
        let further = self.take_further(source)?;
        let mut text = format!("G10L{}P{system}", if by_position { 20 } else { 2 });
        for axis in (0..3).filter(|&axis| axes.contains(axis)) {
            let steps = self.checked_position(AXIS_LETTERS[axis], origin[axis])?;
            write_word(&mut text, AXIS_LETTERS[axis], steps);
        }
        if axes.is_empty() && further.is_empty() {
            return Ok(());
        }
        self.write_further(&mut text, further);
        self.forget_further(further);
        if let Some(stored) = self.config.board.work_offsets.get_mut(usize::from(system) - 1)
            && !by_position
        {
            for axis in (0..3).filter(|&axis| axes.contains(axis)) {
                stored[axis] = origin[axis];
            }
        }
        if system == self.modal.work_system.max(1) {
            self.modal.forget(axes, "G10");
        }
        // The firmware writes it to its memory, and hears nothing meanwhile.
        self.push_action(text, LineKind::Slow, true, source)?;
        if by_position && self.next_of_block(source).is_some_and(|it| it.feed_mm_per_min.is_none())
        {
            // It says where the tool is now, and moves nothing.
            self.next_element += 1;
            self.modal.unknown = self.modal.unknown.without(axes);
        }
        Ok(())
    }

    /// The element that comes next, if it is of this block and nothing stands in between.
    pub(super) fn next_of_block(&self, source: Source) -> Option<PathElement> {
        let index = self.next_element;
        let is_next = self.path.events.get(self.next_event).is_none_or(|it| it.at_element > index);
        let element = self.path.elements.get(index).copied();
        element.filter(|it| is_next && it.source == source && it.shape == Shape::Line)
    }

    fn encode_coolant(&mut self, mode: CoolantMode, source: Source) -> Result<(), EncodeProblem> {
        let text = match mode {
            CoolantMode::Mist if !self.config.has_mist => {
                let word = "mist coolant (M7): its firmware is built without".into();
                return Err(EncodeProblem::Unsupported { word });
            }
            CoolantMode::Mist => "M7",
            CoolantMode::Flood => "M8",
            CoolantMode::Off => "M9",
        };
        self.push_action(text.into(), LineKind::Slow, false, source)
    }

    /// G28 goes by way of a point; a step of nothing makes that point where the tool is.
    fn encode_reference(
        &mut self,
        axes: AxisSet,
        second: bool,
        source: Source,
    ) -> Result<(), EncodeProblem> {
        let axes = if axes.is_empty() { AxisSet::ALL } else { axes };
        let further = self.take_further(source)?;
        let number = if second { 30 } else { 28 };
        let mut text = format!("G91G{number}");
        for letter in axes.letters().chars().chain(further.letters().chars()) {
            write_word(&mut text, letter, 0);
        }
        self.forget_further(further);
        self.modal.forget(axes, &format!("G{number}"));
        self.push_action(text, LineKind::Motion, true, source)?;
        self.push_action("G90".into(), LineKind::Motion, false, source)
    }

    pub(super) fn encode_machine_move(
        &mut self,
        target: Position,
        axes: AxisSet,
        feed: Option<f64>,
        source: Source,
    ) -> Result<(), EncodeProblem> {
        let further = self.take_further(source)?;
        if !further.is_empty() && feed.is_some() {
            return Err(EncodeProblem::UnknownRate { words: further.words().trim().to_owned() });
        }
        let mut text = String::from(if feed.is_none() { "G53G0" } else { "G53G1" });
        for axis in (0..3).filter(|&axis| axes.contains(axis)) {
            let steps = self.checked_position(AXIS_LETTERS[axis], target[axis])?;
            write_word(&mut text, AXIS_LETTERS[axis], steps);
        }
        if axes.is_empty() && further.is_empty() {
            return Ok(());
        }
        self.write_further(&mut text, further);
        self.forget_further(further);
        self.write_feed(&mut text, feed)?;
        self.modal.motion = Some(u8::from(feed.is_some()));
        self.modal.forget(axes, "G53");
        self.push_action(text, LineKind::Motion, false, source)
    }

    /// Lifts the tool to a height of the machine frame, says what is in force, turns A to W there, and
    /// brings the axes that are `given` to the start of an element; Z stays up otherwise.
    pub(super) fn push_approach(
        &mut self,
        height: f64,
        actions: &[PathEvent],
        index: usize,
        (given, further): (AxisSet, FurtherAxes),
    ) -> Result<(), EncodeProblem> {
        self.is_lifted = true;
        let (path, z_alone) = (self.path.clone(), AxisSet::NONE.with(2));
        let element = &path.elements[index];
        let (source, start) = (element.source, path.start_of(index));
        self.encode_machine_move([0.0, 0.0, height], z_alone, None, source)?;
        for event in actions {
            self.encode_action(event)?;
        }
        self.push_speed()?;
        // First, and alone: the part may turn towards the tool, which is still clear of everything.
        let further = self.checked_further(further)?;
        if !further.is_empty() {
            let mut text = String::from("G0");
            self.write_further(&mut text, further);
            self.push_action(text, LineKind::Motion, false, source)?;
        }
        let mut words = [String::new(), String::new()];
        for axis in (0..3).filter(|&axis| given.contains(axis)) {
            let steps = self.checked_position(AXIS_LETTERS[axis], start[axis])?;
            write_word(&mut words[usize::from(axis == 2)], AXIS_LETTERS[axis], steps);
        }
        let [over, down] = words;
        if !over.is_empty() {
            self.push_action(format!("G0{over}"), LineKind::Motion, false, source)?;
        }
        self.modal.motion = None;
        self.modal.forget(AxisSet::ALL, "the approach");
        self.modal.unknown = AxisSet::ALL.without(given);
        if down.is_empty() {
            return Ok(());
        }
        let mut text = format!("G1{down}");
        self.write_feed(&mut text, self.plunge_feed(index))?;
        self.modal.motion = Some(1);
        self.push_action(text, LineKind::Motion, false, source)?;
        // Whether it got there is looked at before anything is cut.
        self.start_axes = given;
        self.start_further = StartFurther { at: further, is_sent: true };
        self.pending.push_back(EncoderStep::CheckStart);
        Ok(())
    }

    pub(super) fn push_action(
        &mut self,
        text: String,
        kind: LineKind,
        is_alone: bool,
        source: Source,
    ) -> Result<(), EncodeProblem> {
        let role = Role::None;
        let events = self.next_event;
        self.push(EncodedLine { text, kind, is_alone, element: None, source, role, events })
    }

    /// What the words before an element have set, sent anew when a run begins there; A to W have to stand
    /// at `further`.
    pub(super) fn push_restored(
        &mut self,
        actions: &[PathEvent],
        further: FurtherAxes,
    ) -> Result<(), EncodeProblem> {
        let moves_frame = |event: &PathEvent| match event.action {
            // The words that every run begins with say G54 and G49.
            Action::WorkOffset { system } => system != 1,
            Action::SetWorkOffset { .. } => true,
            Action::ToolLength { offset, .. } => offset.is_some(),
            _ => false,
        };
        let last = actions.iter().rposition(moves_frame);
        for (index, event) in actions.iter().enumerate() {
            self.encode_action(event)?;
            if Some(index) == last {
                self.pending.push_back(EncoderStep::CheckStart);
            }
        }
        self.push_speed()?;
        // The tool stands where the path says; that was asked of the operator.
        self.modal.unknown = AxisSet::NONE;
        self.modal.further_at = self.checked_further(further)?;
        self.start_further = StartFurther { at: self.modal.further_at, is_sent: false };
        Ok(())
    }
}

/// `S1000`
fn word(letter: char, value: f64) -> String {
    word_after("", letter, value)
}

/// `G4P.5`
pub(super) fn word_after(prefix: &str, letter: char, value: f64) -> String {
    let mut text = prefix.to_owned();
    write_word(&mut text, letter, to_grid(value));
    text
}
