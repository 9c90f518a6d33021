//! Handles what is not motion: actions, homing, the end of the program, and tool lengths.
//!
//! An action that may not stand in a contour is a finding of `rules`. Others keep their place among
//! the blocks.

use super::{Walk, WalkState};
use crate::span::ItemKind;
use crate::walk::compensate::Exit;
use crate::walk::rules::{self, Rules};
use cnc_msgs::contour::{Action, Motion, Source};
use cnc_msgs::finding::Severity;
use cnc_msgs::profile::LengthOfD;
use cnc_msgs::radius;

/// Tool lengths where D selects them: `None` without one (S34).
#[derive(Debug, Default)]
pub(super) struct Lengths {
    /// The length of the last D.
    selected: Option<(u32, f64)>,
    /// The length at the last move of Z.
    in_force: Option<(u32, f64)>,
}

impl Walk<'_> {
    pub(super) fn action(&mut self, action: Action, source: Source) {
        if let Action::ToolLength { offset, .. } = action
            && self.profile.radius.length_of_d == LengthOfD::WithZ
        {
            self.lengths.selected = offset.map(|number| (number, self.length_of(number)));
            return;
        }
        let action = self.with_length(action, source);
        match action {
            Action::ChangeTool { tool } => self.spindle_tool = Some(tool),
            // It applies to the elements of this block, generated ones included (S55).
            Action::ExactStop => return self.out.stop_exactly_in(source),
            Action::Home { .. } => self.home(source),
            Action::ProgramEnd { .. } => self.end_of_program(source),
            _ => {}
        }
        let found = self.report.findings.len();
        let rules = Rules { profile: self.profile, findings: &mut self.report.findings };
        match &mut self.state {
            WalkState::Off => self.out.action(action, source),
            WalkState::Selected(selection) => {
                let _ = rules.action(&action, source, selection.source);
                self.out.action(action, source);
            }
            WalkState::Active(active) => {
                let since = active.span.entry.lead.source;
                let is_refused = rules.action(&action, source, since);
                if let Some((_, cancelled)) = active.cancel {
                    rules::before_lead_off(&mut self.report.findings[found..], cancelled);
                }
                if is_refused && matches!(action, Action::ChangeTool { .. }) {
                    self.refused_tool = Some(source);
                }
                // A comment is no block between two moves.
                if !matches!(action, Action::Message { .. }) {
                    active.between.block(source);
                }
                active.push_item(source, ItemKind::Action(action));
            }
        }
    }

    /// Homing ends compensation at once, without a lead-off (A05).
    fn home(&mut self, source: Source) {
        match std::mem::replace(&mut self.state, WalkState::Off) {
            WalkState::Off => {}
            WalkState::Selected(selection) => {
                let finding = rules::homed(source, selection.source, false, self.profile);
                self.report.findings.push(finding);
            }
            WalkState::Active(active) => {
                let since = active.span.entry.lead.source;
                self.report.findings.push(rules::homed(source, since, true, self.profile));
                self.close(*active, Exit::None);
            }
        }
    }

    /// Compensation is cancelled, with its move, in a block before the end of the program (S32).
    fn end_of_program(&mut self, source: Source) {
        if self.led_off_in == Some(source) && matches!(self.state, WalkState::Off) {
            self.report.findings.extend(rules::cancelled_with_the_end(source, self.profile));
        }
    }

    /// The length of the register D, or of the tool of that number where there is no register.
    fn length_of(&self, number: u32) -> f64 {
        let register = self.tools.offsets.get(&number).map(|offset| offset.length_mm);
        let tool = || self.tools.tools.get(&number).map(|tool| tool.length_mm);
        register.or_else(tool).unwrap_or(0.0)
    }

    /// Applies the length of the last D at the next move of Z (S34); returns whether it does so
    /// now.
    ///
    /// In another plane the control shifts another axis, which no controller can do. That is
    /// reported once for each number.
    pub(super) fn apply_length_of_d(&mut self, motion: &Motion, source: Source) -> bool {
        let Lengths { selected, in_force } = self.lengths;
        let length_mm = |it: Option<(u32, f64)>| it.map_or(0.0, |(_, length_mm)| length_mm);
        let [.., normal] = self.plane.axes();
        if length_mm(selected) == length_mm(in_force) || !motion.axes.contains(normal) {
            return false;
        }
        if normal != 2 {
            if let Some((number, length_mm)) = selected
                && self.reported_lengths.insert(number)
            {
                let finding = rules::length_of_d(source, number, length_mm, normal);
                self.report.findings.push(finding);
            }
            return false;
        }
        self.lengths.in_force = selected;
        let offset = selected.map(|(number, _)| number);
        let action = Action::ToolLength { offset, second: None, length_mm: length_mm(selected) };
        match &mut self.state {
            WalkState::Active(active) => active.push_item(source, ItemKind::Action(action)),
            WalkState::Off | WalkState::Selected(_) => self.out.action(action, source),
        }
        true
    }

    fn with_length(&mut self, action: Action, source: Source) -> Action {
        let Action::ToolLength { offset: Some(number), second, length_mm: added_mm } = action
        else {
            return action;
        };
        let lengths = [Some(number), second].into_iter().flatten().filter(|number| *number != 0);
        let length_mm: f64 = lengths.map(|number| self.length_in_table(number, source)).sum();
        Action::ToolLength { offset: Some(number), second, length_mm: length_mm + added_mm }
    }

    fn length_in_table(&mut self, number: u32, source: Source) -> f64 {
        match self.tools.tools.get(&number) {
            Some(tool) => tool.length_mm,
            None => {
                let mut finding = radius::unknown(format!("H{number}"), self.tools, source);
                if self.tools.tools.is_empty() {
                    finding.severity = Severity::Warning;
                    finding.message += "; a length of 0 is used";
                }
                self.report.findings.push(finding);
                0.0
            }
        }
    }
}
