//! From the encoder to the link, as fast as there is room.

use super::block::BlockOfLine;
use super::exit::Exit;
use super::{Pending, ProgramRun, Stage, Then};
use crate::codes::error_code;
use crate::driver::context::{Context, Origin};
use crate::encoder::{EncodedLine, EncoderStep, SYNC};
use crate::link::LineKind;
use crate::report::ControllerState;

impl ProgramRun {
    /// Sends as many lines as there is room for.
    pub(in crate::driver) fn feed(&mut self, context: &mut Context) -> Option<Exit> {
        let is_machine_held = context.machine.is_state(&ControllerState::Hold)
            || context.machine.is_state(&ControllerState::Door);
        let is_check = self.job.is_check();
        let is_single_block = context.is_single_block && !is_check;
        // What is sent while another rest is proved would be sent again.
        if self.rest.is_some() || self.is_held || is_machine_held || self.is_alone {
            return None;
        }
        loop {
            if self.job.has_sent && !is_check && matches!(self.stage, Stage::Streaming) {
                context.link.check_lines(context.now);
            }
            if self.next.is_none() && matches!(self.stage, Stage::Streaming) {
                let resumed = self.next_block.take();
                let step = match resumed {
                    Some(step) => Some(Ok(step)),
                    None => self.encoder.next_step(),
                };
                let ended = match &step {
                    Some(Ok(step)) => self.block_before(step).filter(|_| is_single_block),
                    _ => None,
                };
                let then = match (step, ended) {
                    (Some(Ok(step)), Some(last)) => {
                        // It is looked at again after the resume, as if it were the first.
                        self.block = None;
                        self.next_block = Some(step);
                        Then::BlockEnd(last)
                    }
                    (Some(Ok(EncoderStep::Line(line))), None) => {
                        self.next = Some(Pending::Line(line));
                        continue;
                    }
                    // Nothing moves in check mode, and nobody changes a tool.
                    (
                        Some(Ok(
                            EncoderStep::Home { .. }
                            | EncoderStep::ToolChange { .. }
                            | EncoderStep::ControllerChange { .. }
                            | EncoderStep::Probe { .. }
                            | EncoderStep::ReadInput { .. }
                            | EncoderStep::Stretch { .. }
                            | EncoderStep::UserFunction { .. }
                            | EncoderStep::AllowOverrides { .. }
                            | EncoderStep::CheckStart,
                        )),
                        _,
                    ) if is_check => {
                        continue;
                    }
                    (Some(Ok(EncoderStep::Home { text, axes, source })), _) => {
                        Then::Home { text, axes, source }
                    }
                    (Some(Ok(EncoderStep::ToolChange { tool, source })), _) => {
                        // Whoever confirms it has seen the machine stand.
                        self.block = None;
                        Then::ToolChange { tool, source }
                    }
                    (Some(Ok(EncoderStep::ControllerChange { tool, source })), _) => {
                        self.block = None;
                        context.machine.spindle_tool = None;
                        Then::ControllerChange { tool, source }
                    }
                    (Some(Ok(EncoderStep::Probe { line, probe })), _) => {
                        Then::Probe { line, probe }
                    }
                    (Some(Ok(EncoderStep::ReadInput { line })), _) => Then::ReadInput { line },
                    (Some(Ok(EncoderStep::Stretch { source })), _) => Then::Stretch { source },
                    (Some(Ok(EncoderStep::UserFunction { function, source })), _) => {
                        Then::UserFunction { function, source }
                    }
                    (Some(Ok(EncoderStep::AllowOverrides { allowed, source })), _) => {
                        Then::AllowOverrides { allowed, source }
                    }
                    (Some(Ok(EncoderStep::CheckStart)), _) => Then::CheckStart,
                    (Some(Ok(EncoderStep::CheckReturn { stood })), _) => {
                        Then::CheckReturn { stood }
                    }
                    (None, _) => Then::End,
                    (Some(Err(problem)), _) => {
                        let (code, text) = (error_code::NOT_ENCODABLE, problem.to_string());
                        return Some(Exit::abort(code, text));
                    }
                };
                self.stage = Stage::Draining(then);
                self.next = Some(Pending::Sync);
            }
            match self.next.take() {
                Some(Pending::Sync) if context.link.has_room(SYNC.len()) => {
                    // It dwells for no longer than a motion line waits: silence is a lost answer.
                    context.link.send_line(SYNC, LineKind::Motion, Origin::Sync);
                }
                Some(Pending::Line(line))
                    if context.link.has_room(line.text.len())
                        && (!line.is_alone || context.link.unanswered() == 0) =>
                {
                    self.send(context, line);
                    if self.is_alone {
                        return None;
                    }
                }
                waiting => {
                    self.next = waiting;
                    return None;
                }
            }
        }
    }

    /// Sends a line of the program.
    pub(super) fn send(&mut self, context: &mut Context, line: EncodedLine) {
        let EncodedLine { text, kind, is_alone, element, source, events, .. } = line;
        self.job.has_sent = true;
        self.is_alone = is_alone;
        self.watch_line(&text, source);
        context.machine.on_line(&text);
        let sent = text.clone();
        context.link.send_line(&sent, kind, Origin::Program { text, source, element, events });
    }

    /// Takes the block of what is sent next; gives the one before it, if that ends there.
    fn block_before(&mut self, step: &EncoderStep) -> Option<BlockOfLine> {
        let block = match step {
            EncoderStep::UserFunction { source, .. } => BlockOfLine::of_function(*source),
            _ => BlockOfLine::of(step.line()?),
        };
        self.block.replace(block).filter(|last| last.ends_before(&block))
    }
}
