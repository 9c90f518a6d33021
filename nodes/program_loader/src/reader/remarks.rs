//! Messages to the operator, and what comments ask for besides.
//!
//! Knows what becomes of each; how they are written is the lexer's.

use super::Reader;
use crate::lexer::remark::{self, Remark, RemarkWord};
use crate::line::Line;
use crate::parameters::SHOWS_DEBUG;
use crate::values::Values;
use cnc_msgs::finding::{Code, Finding};

impl Reader<'_> {
    /// Does what the comment of a block asks for, with the parameters that the block has set.
    #[cold]
    pub(super) fn remark(&mut self, line: Line<'_>, remark: Remark) {
        let text = remark.text(line.text);
        match remark.word {
            RemarkWord::Message => {
                let text = String::from_utf8_lossy(text).into_owned();
                self.show(line, remark, &text);
            }
            RemarkWord::Debug if self.parameters.numbered(SHOWS_DEBUG) == Some(0.0) => {}
            RemarkWord::Values | RemarkWord::Debug | RemarkWord::Log => {
                let text = self.text_with_values(line, remark);
                if remark.word == RemarkWord::Log {
                    self.no_log(line, remark);
                }
                self.show(line, remark, &text);
            }
            RemarkWord::LogFile => self.no_log(line, remark),
            RemarkWord::Abort => {
                let source = line.source(self.block.number, remark.start, remark.end);
                let text = self.text_with_values(line, remark);
                let message = format!("the program ends itself here: {}", text.trim());
                let help = "the program has found what it cannot go on with; change its input";
                self.findings.push(Finding::error(Code::Syntax, source, message).help(help));
                self.block.is_damaged = true;
            }
        }
    }

    fn text_with_values(&mut self, line: Line<'_>, remark: Remark) -> String {
        let values = Values {
            parameters: &self.parameters,
            interpreter: &self.interpreter,
            line: line.number,
            is_single_block: self.options.is_single_block,
        };
        let (text, mut unknown) = remark::with_values(remark.text(line.text), &values);
        let source = line.source(self.block.number, remark.start, remark.end);
        // A loop may come here a million times.
        let left_out = unknown.len().saturating_sub(self.findings.room());
        unknown.truncate(unknown.len() - left_out);
        for (name, trouble) in unknown {
            let message = format!("{}: the message shows ######", trouble.message(&name));
            let found = Finding::warning(Code::BadNumber, source, message);
            self.findings.push(found.help(trouble.help()));
        }
        self.findings.leave_out(left_out);
        text
    }

    fn show(&mut self, line: Line<'_>, remark: Remark, text: &str) {
        let source = line.source(self.block.number, remark.start, remark.end);
        if let Some(flow) = &mut self.flow {
            flow.count_text(text.len());
        }
        // One line in the log of the operator.
        let text = intake::text::one_line(text);
        self.interpreter.show(source, &text);
    }

    /// A program must not write files; said once.
    fn no_log(&mut self, line: Line<'_>, remark: Remark) {
        if std::mem::replace(&mut self.has_reported_log, true) {
            return;
        }
        let source = line.source(self.block.number, remark.start, remark.end);
        let message = "no file is written: (LOG, ...) is a message to the operator, and the bag has what probes find";
        let help = "find the messages in the bag of the run, on /rosout";
        self.findings.push(Finding::warning(Code::Unsupported, source, message).help(help));
    }
}
