//! From the encoder to the link, as fast as there is room.

use super::block::BlockOfLine;
use super::run::{Next, Stage, Then};
use super::{Driver, Origin, Phase, RunOutcome};
use crate::codes::error_code;
use crate::encoder::{EncodedLine, SYNC, Step};
use crate::link::LineKind;
use crate::report::ControllerState;

impl Driver {
    /// Sends as many lines as there is room for.
    pub(super) fn feed_run(&mut self) {
        let is_machine_held = self.machine.is_state(&ControllerState::Hold)
            || self.machine.is_state(&ControllerState::Door);
        let Phase::Running(run) = &mut self.phase else { return };
        let is_single_block = self.is_single_block && !run.is_check();
        // What is sent while another rest is proven would be sent again.
        let is_waiting = run.rest.is_some() || run.is_stopping();
        if is_waiting || run.is_held || is_machine_held || run.is_alone {
            return;
        }
        loop {
            if run.has_sent && !run.is_check() && matches!(run.stage, Stage::Streaming) {
                self.link.check_lines(self.now);
            }
            if run.next.is_none() && matches!(run.stage, Stage::Streaming) {
                let resumed = run.next_block.take();
                let step = match resumed {
                    Some(line) => Some(Ok(Step::Line(line))),
                    None => run.encoder.next_step(),
                };
                let then = match step {
                    Some(Ok(Step::Line(line))) => {
                        let block = BlockOfLine::of(&line);
                        let last = run.block.replace(block);
                        match last {
                            Some(last) if is_single_block && last.ends_before(&block) => {
                                // It is looked at again after the resume, as if it were the first.
                                run.block = None;
                                run.next_block = Some(line);
                                Then::BlockEnd(last)
                            }
                            _ => {
                                run.next = Some(Next::Line(line));
                                continue;
                            }
                        }
                    }
                    // Nothing moves in check mode, and nobody changes a tool.
                    Some(Ok(
                        Step::Home { .. }
                        | Step::ToolChange { .. }
                        | Step::ControllerChange { .. }
                        | Step::CheckStart,
                    )) if run.is_check() => {
                        continue;
                    }
                    Some(Ok(Step::Home { text, axes, source_line })) => {
                        Then::Home { text, axes, source_line }
                    }
                    Some(Ok(Step::ToolChange { tool, source_line })) => {
                        // Whoever confirms it has seen the machine stand.
                        run.block = None;
                        Then::ToolChange { tool, source_line }
                    }
                    Some(Ok(Step::ControllerChange { tool, source_line })) => {
                        run.block = None;
                        Then::ControllerChange { tool, source_line }
                    }
                    Some(Ok(Step::CheckStart)) => Then::CheckStart,
                    Some(Ok(Step::CheckReturn { stood })) => Then::CheckReturn { stood },
                    None => Then::End,
                    Some(Err(problem)) => {
                        let (code, text) = (error_code::NOT_ENCODABLE, problem.to_string());
                        return self.stop_run(RunOutcome::Aborted, code, text);
                    }
                };
                run.stage = Stage::Draining(then);
                run.next = Some(Next::Sync);
            }
            match run.next.take() {
                Some(Next::Sync) if self.link.has_room(SYNC.len()) => {
                    // It dwells for no longer than a motion line waits: silence is a lost answer.
                    self.link.send_line(SYNC, LineKind::Motion, Origin::Sync);
                }
                Some(Next::Line(line))
                    if self.link.has_room(line.text.len())
                        && (!line.is_alone || self.link.unanswered() == 0) =>
                {
                    run.has_sent = true;
                    run.is_alone = line.is_alone;
                    let EncodedLine { text, kind, element, source_line, .. } = line;
                    self.link.send_line(
                        &text.clone(),
                        kind,
                        Origin::Program { text, source_line, element },
                    );
                    if run.is_alone {
                        return;
                    }
                }
                waiting => {
                    run.next = waiting;
                    return;
                }
            }
        }
    }
}
