//! G43, G43.1, G43.2, G49, and G10 L1, L10 and L11: tool lengths.
//!
//! The tool table is the planner's. What a program sets is kept here from then on, as the length of
//! a tool in the table and what is added to it; a radius reaches the planner as the diameter of the
//! selection. The table itself is never changed.

use super::axes::Cause;
use super::further::FURTHER_WORDS;
use super::{Interpreter, Scene};
use crate::dialect::{GWord, Group, LengthWord};
use crate::limits::COORDINATE_MM_MAX;
use cnc_msgs::contour::{Action, RadiusSource};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::further::FURTHER_LETTERS;
use cnc_msgs::geometry::AxisSet;
use std::collections::BTreeMap;

/// G59.3, where G10 L11 measures.
const FIXTURE: u32 = 9;

/// A tool length along Z.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Length {
    /// The tools whose lengths in the table are a part of it; the second one only with the first.
    pub(super) tool: Option<u32>,
    pub(super) second: Option<u32>,
    /// What is added to that, mm.
    pub(super) added_mm: f64,
}

impl Length {
    /// The whole length, mm.
    fn given(added_mm: f64) -> Self {
        Self { added_mm, ..Self::default() }
    }
}

/// What the program has set for a tool.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ToolEntry {
    pub(super) length: Option<Length>,
    pub(super) radius_mm: Option<f64>,
}

pub(super) type ToolEntries = BTreeMap<u32, ToolEntry>;

impl Interpreter<'_> {
    #[inline]
    pub(super) fn tool_length(&mut self, scene: &mut Scene<'_>) {
        match self.request.g(Group::Length) {
            None => {}
            Some((GWord::Length(word), at)) => self.length_on(scene, word, at),
            Some(_) => self.set_length(None, "G49"),
        }
    }

    #[cold]
    fn length_on(&mut self, scene: &mut Scene<'_>, word: LengthWord, at: usize) {
        let length = match word {
            LengthWord::Tool | LengthWord::Offset => {
                self.length_of_h(scene, word, at).map(|length| (length, "G43"))
            }
            LengthWord::Given => self.given_length(scene, at).map(|length| (length, "G43.1")),
            LengthWord::Added => self.added_length(scene, at).map(|length| (length, "G43.2")),
        };
        if let Some((length, word)) = length
            && !self.request.is_damaged
        {
            self.set_length(Some(length), word);
        }
    }

    /// H, or the tool in the spindle.
    fn length_of_h(
        &mut self,
        scene: &mut Scene<'_>,
        word: LengthWord,
        at: usize,
    ) -> Option<Length> {
        let h = match self.request.present.contains(b'H') {
            true => Some(self.take_number(scene, b'H')?),
            false => None,
        };
        if h == Some(0) && word != LengthWord::Offset && self.modal.spindle_tool.is_some() {
            let message = format!("{} H0 takes the tool in the spindle", scene.quote(at));
            let help = "leave out H0 if that is meant; where other controls cancel the length with \
                        it, write G49";
            let source = scene.source_of(self.request.word(b'H'));
            let finding = Finding::warning(Code::SuspiciousValue, source, message);
            scene.findings.push(finding.help(help));
        }
        let tool = if let Some(tool) = h.filter(|tool| *tool != 0 || word == LengthWord::Offset) {
            if tool == 0 {
                let message = "G43 H0 has a different meaning on each control".to_owned();
                let help = "write G49 to cancel the length offset, or H with the number of a tool";
                self.report(scene, b'H', Code::BadNumber, message, help);
                return None;
            }
            tool
        } else if let Some(tool) = self.modal.spindle_tool {
            // LinuxCNC: without H, the tool in the spindle.
            tool
        } else {
            let h = if h.is_some() { "with H0" } else { "without H" };
            let message = format!("{} {h}, and no M6 has put in a tool", scene.quote(at));
            let help = "write H with the number of the tool";
            self.report_at(scene, at, Code::MissingWord, message, help);
            return None;
        };
        Some(self.length_of(tool))
    }

    /// The length of a tool: from the program, else from the table.
    pub(super) fn length_of(&self, tool: u32) -> Length {
        let entry = self.tool_entries.get(&tool).and_then(|entry| entry.length);
        // No tool has no length.
        let none = (tool == 0).then(Length::default);
        entry.or(none).unwrap_or(Length { tool: Some(tool), ..Length::default() })
    }

    /// Z of G43.1 and G43.2; lengths along X and Y are those of turning tools, which no board has.
    fn length_words(&mut self, scene: &mut Scene<'_>) -> Option<f64> {
        let scale = self.scale();
        for letter in [b'X', b'Y'] {
            let value = self.take_within(scene, letter, scale, COORDINATE_MM_MAX, "mm");
            if value.is_some_and(|value| value != 0.0) {
                let message = "a tool length along X or Y is not supported".to_owned();
                let help = "write Z only, and move the work offset by the others";
                self.report(scene, letter, Code::Unsupported, message, help);
            }
        }
        for (axis, value) in self.further_values(scene).iter() {
            if value != 0.0 {
                let letter = FURTHER_LETTERS[axis];
                let message = format!("a tool length along {letter} is not supported");
                let help = "write Z only, and move the work offset by the others";
                self.report(scene, FURTHER_WORDS[axis], Code::Unsupported, message, help);
            }
        }
        self.take_within(scene, b'Z', scale, COORDINATE_MM_MAX, "mm")
    }

    fn given_length(&mut self, scene: &mut Scene<'_>, at: usize) -> Option<Length> {
        let named = self.has_axis_word();
        let z = self.length_words(scene);
        if !named {
            let message = format!("{} without Z", scene.quote(at));
            let help = "write Z with the tool length, or G43 H with the number of a tool";
            self.report_at(scene, at, Code::MissingWord, message, help);
        }
        // LinuxCNC: the axes that are not named keep their offset.
        let kept = self.modal.length.unwrap_or_default();
        Some(z.map_or(kept, Length::given))
    }

    fn added_length(&mut self, scene: &mut Scene<'_>, at: usize) -> Option<Length> {
        let base = self.modal.length.unwrap_or_default();
        let more = if self.request.present.contains(b'H') {
            self.length_of_h(scene, LengthWord::Added, at)?
        } else if self.has_axis_word() {
            Length::given(self.length_words(scene).unwrap_or(0.0))
        } else {
            let message = format!("{} without H and without Z", scene.quote(at));
            let help = "write H with the number of a tool, or Z with a length";
            self.report_at(scene, at, Code::MissingWord, message, help);
            return None;
        };
        let mut tools = [base, more].into_iter().flat_map(|it| [it.tool, it.second]).flatten();
        let (tool, second) = (tools.next(), tools.next());
        if tools.next().is_some() {
            let message = "no more than two lengths of the tool table are added".to_owned();
            let help = "write one of them into the program: G43.2 Z";
            self.report_at(scene, at, Code::Unsupported, message, help);
            return None;
        }
        Some(Length { tool, second, added_mm: base.added_mm + more.added_mm })
    }

    fn has_axis_word(&self) -> bool {
        super::moves::AXIS_WORDS.iter().any(|&letter| self.request.present.contains(letter))
    }

    /// Sets the length offset; it moves the work frame along Z by a length that only the table has.
    pub(super) fn set_length(&mut self, length: Option<Length>, word: &'static str) {
        let (offset, second, length_mm) = match length {
            None => (None, None, 0.0),
            Some(Length { tool, second, added_mm }) => (Some(tool.unwrap_or(0)), second, added_mm),
        };
        self.act(Action::ToolLength { offset, second, length_mm });
        if self.modal.length != length {
            let before = std::mem::replace(&mut self.modal.length, length);
            self.axes.lose_by_length(before, Cause { source: self.source, word });
        }
    }

    /// G10 L1, L10 and L11, with P and the words of the tool.
    #[cold]
    pub(super) fn set_tool(
        &mut self,
        scene: &mut Scene<'_>,
        mode: u32,
        tool: Option<u32>,
        at: usize,
    ) {
        let scale = self.scale();
        let radius = self.take_within(scene, b'R', scale, COORDINATE_MM_MAX, "mm");
        for letter in [b'I', b'J', b'Q'] {
            if self.take(letter).is_some() {
                let message =
                    "the angles and the orientation of a turning tool are in the tool table";
                let help = "write them there (set_tool, or its file)";
                self.report(scene, letter, Code::Unsupported, message.to_owned(), help);
            }
        }
        let z = self.length_words(scene);
        let Some(tool) = tool else {
            if !self.request.present.contains(b'P') {
                let message = format!("{} without P", scene.quote(at));
                let help = "write P with the number of the tool";
                self.report_at(scene, at, Code::MissingWord, message, help);
            }
            return;
        };
        if tool == 0 {
            let message = "P0 is not the number of a tool".to_owned();
            let help = "write P with the number of the tool";
            return self.report(scene, b'P', Code::BadNumber, message, help);
        }
        if radius.is_some_and(|radius| radius < 0.0) {
            return self.negative(scene, b'R');
        }
        let length = match z {
            None => None,
            Some(z) if mode == 1 => Some(Length::given(z)),
            // With this length the position would read Z.
            Some(z) => {
                if !self.relies(scene, AxisSet::NONE.with(2)) {
                    return;
                }
                let now = self.modal.length.unwrap_or_default();
                let position_mm = self.axes.position[2];
                let at_mm = match (mode, self.above_fixture()) {
                    (10, _) => position_mm - self.modal.shift[2],
                    (_, Some(above_mm)) => position_mm + above_mm,
                    (_, None) => return self.report_fixture(scene),
                };
                Some(Length { added_mm: now.added_mm + at_mm - z, ..now })
            }
        };
        if self.request.is_damaged {
            return;
        }
        let entry = self.tool_entries.entry(tool).or_default();
        entry.length = length.or(entry.length);
        entry.radius_mm = radius.or(entry.radius_mm);
    }

    /// How far the zero of the work system in force is above that of G59.3, mm; `None` if the program does
    /// not know both.
    fn above_fixture(&self) -> Option<f64> {
        let active = u32::from(self.modal.work_offset);
        if active == FIXTURE {
            return Some(0.0);
        }
        let zero = |system: u32| self.stored.get(&(5223 + 20 * (system - 1)));
        Some(zero(active)? - zero(FIXTURE)?)
    }

    fn report_fixture(&mut self, scene: &mut Scene<'_>) {
        let message = "G10 L11 measures in the work system G59.3: its zero, or that of the one in \
                       force, is known only by the machine";
        let help = "write G10 L10, which measures in the work system in force, or give their zeros \
                    in a parameter file";
        self.report(scene, b'L', Code::Unsupported, message.to_owned(), help);
    }

    /// The radius that compensation takes with D, or without one from the tool in the spindle.
    pub(super) fn radius_of(
        &mut self,
        scene: &mut Scene<'_>,
        tool: Option<u32>,
        at: usize,
    ) -> RadiusSource {
        let number = tool.or(self.modal.spindle_tool);
        let entry = |number| self.tool_entries.get(&number)?.radius_mm;
        if let Some(radius_mm) = number.and_then(entry) {
            return RadiusSource::Diameter { mm: 2.0 * radius_mm, tip: 0 };
        }
        if number.is_none() && self.tool_entries.values().any(|entry| entry.radius_mm.is_some()) {
            let message =
                "the program has set radii, and which tool is in the spindle is not known";
            let help = "write D with the number of the tool, or change the tool before it: T1 M6";
            self.report_at(scene, at, Code::MissingWord, message.to_owned(), help);
        }
        match (tool, self.modal.spindle_tool) {
            (Some(tool), _) => RadiusSource::Tool(tool),
            // M61 has said so; the path has no change to it.
            (None, Some(tool)) if self.modal.is_tool_named => RadiusSource::Tool(tool),
            _ => RadiusSource::SpindleTool,
        }
    }
}
