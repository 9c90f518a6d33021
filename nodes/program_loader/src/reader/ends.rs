//! Where a program begins and ends: `%`, the end of the text, and what stands after the end.

use super::{Outcome, Reader, Section};
use crate::flow::{Flow, Next};
use crate::limits;
use crate::line::Line;
use cnc_msgs::contour::Source;
use cnc_msgs::finding::{Code, Finding};

impl Reader<'_> {
    /// Reports a program without blocks, or without an end.
    pub(super) fn check_end(&mut self, last_line: u32) {
        if !self.has_blocks {
            let message = "the program has no blocks";
            return self.findings.push(
                Finding::warning(Code::MissingWord, Source::default(), message)
                    .help("nothing will move; is it the right file?"),
            );
        }
        if let Some(source) = self.interpreter.open_curve() {
            let message = "the curve that G5.2 begins has no G5.3";
            let finding = Finding::error(Code::MissingWord, source, message);
            self.findings.push(finding.help("write G5.3 after the last control point"));
        }
        if let Some(line) = self.last_line_without_end {
            return self.no_end(line);
        }
        if matches!(self.section, Section::After { .. }) {
            return;
        }
        self.no_end(last_line - u32::from(self.ends_with_line_feed));
    }

    fn no_end(&mut self, line: u32) {
        let call = self.flow.as_ref().map_or(0, Flow::row);
        let source = Source { line, column: 1, call, ..Source::default() };
        self.findings.push(match self.flow.as_ref().and_then(Flow::running) {
            Some(running) => {
                let message = format!("the text ends within {running}");
                let help = match self.rules.dialect.lexer.programs {
                    Some(programs) => format!("end a program that is called with {}", programs.end),
                    None => "end what is called: a program with M99, a subroutine with endsub"
                        .to_owned(),
                };
                Finding::error(Code::Syntax, source, message).help(help)
            }
            None => Finding::warning(Code::MissingWord, source, "the program has no end")
                .help("is the file complete? programs end with M2 or M30"),
        });
    }

    /// Reads a `%` within a program or a subroutine that has been called: its text ends there, or another
    /// program begins. Tape marks before its first block have been passed over.
    #[inline]
    pub(super) fn percent_in_call(&mut self, line: Line<'_>) -> Option<Outcome> {
        let visible = line.text.trim_ascii();
        let flow = self.flow.as_ref().filter(|flow| flow.depth() > 0)?;
        if visible.first() != Some(&b'%') {
            return None;
        }
        let rest = visible[1..].trim_ascii_start();
        if line.text == limits::APPENDED.as_bytes()
            || rest.is_empty()
            || matches!(rest[0], b'(' | b';')
        {
            self.no_end(line.number);
        } else {
            let running = flow.running().unwrap_or_default();
            let message = format!("another program begins before the end of {running}");
            let source = line.source(None, 0, line.text.trim_ascii_end().len());
            let end = self.rules.dialect.lexer.programs.map_or("M99", |programs| programs.end);
            let help = format!("end a program that is called with {end}");
            self.findings.push(Finding::error(Code::Syntax, source, message).help(help));
        }
        self.section = Section::After { end_line: line.number, is_reported: true };
        Some(Outcome::Stop)
    }

    /// The end of all in a program that has been called.
    #[cold]
    pub(super) fn end_in_call(&mut self, line: Line<'_>) -> Next {
        let running = self.flow.as_ref().and_then(Flow::running).unwrap_or_default();
        let end = self.rules.dialect.lexer.programs.map_or("M99", |programs| programs.end);
        let message = format!("the end of the main program within {running}");
        let source = line.source(self.block.number, self.block.start, self.block.end);
        let help = format!("end a program that is called with {end}");
        self.findings.push(Finding::error(Code::Syntax, source, message).help(help));
        Next::Stop
    }

    /// Checks that the text is one block.
    #[cold]
    pub(super) fn refuse_unless_single(&mut self, lines: u32) {
        let source = Source { line: lines, column: 1, ..Source::default() };
        let message = match (lines, self.has_blocks) {
            (1, true) => return,
            (1, false) => "there is no block to run".to_owned(),
            (lines, _) => format!("{lines} lines are not a single block"),
        };
        let help = "give one block, without a line end; load a longer text as a program";
        self.findings.push(Finding::error(Code::Syntax, source, message).help(help));
    }

    /// Reads a line that begins with `%`: a tape mark, the name of a program, or the name of an OSP
    /// file.
    #[inline]
    pub(super) fn percent(&mut self, line: Line<'_>) -> bool {
        let visible = line.text.trim_ascii_start();
        let is_first = self.section == Section::Before;
        if is_first && self.rules.dialect.lexer.names && visible.first() == Some(&b'$') {
            return true;
        }
        if visible.first() != Some(&b'%') {
            return false;
        }
        if line.text == limits::APPENDED.as_bytes() {
            self.end_before_appended(line);
            return true;
        }
        let ends = Section::After { end_line: line.number, is_reported: false };
        if !self.rules.dialect.percent_delimits {
            // The name of the program; the name of another program ends this one.
            let is_name = visible[1..].trim_ascii().first().is_some_and(u8::is_ascii_alphabetic);
            self.section = match self.section {
                Section::Within => ends,
                section => section,
            };
            if let Section::After { end_line, is_reported: false } = self.section
                && is_name
                && self.flow.is_some()
            {
                if end_line == line.number {
                    self.last_line_without_end = Some(line.number - 1);
                }
                // Texts with programs that are called may have further main programs.
                self.section = Section::After { end_line, is_reported: true };
            }
            return true;
        }
        let rest = visible[1..].trim_ascii();
        if !rest.is_empty() && !matches!(rest[0], b'(' | b';') {
            let start = line.text.len() - visible.len();
            let source = line.source(None, start, start + visible.trim_ascii_end().len());
            let message = "% must be alone in its line";
            self.findings.push(
                Finding::error(Code::Syntax, source, message)
                    .help("delete what follows it, or put it into a comment ( )"),
            );
        }
        self.section = match self.section {
            Section::Before => Section::Within,
            Section::Within => ends,
            after @ Section::After { .. } => after,
        };
        true
    }

    /// What is appended to a program begins here.
    #[cold]
    fn end_before_appended(&mut self, line: Line<'_>) {
        if self.section == Section::Within {
            self.last_line_without_end = Some(line.number.saturating_sub(1));
        }
        let end_line = match self.section {
            Section::After { end_line, .. } => end_line,
            _ => line.number,
        };
        self.section = Section::After { end_line, is_reported: true };
    }

    /// Reports once that blocks after the end are not run; returns whether it has been reported.
    #[cold]
    pub(super) fn is_reported_after_end(&mut self, line: Line<'_>) -> bool {
        let Section::After { end_line, is_reported } = self.section else { return false };
        let visible = line.text.trim_ascii();
        let is_remark = visible.is_empty() || matches!(visible[0], b'(' | b';');
        if !is_remark && !is_reported {
            let start = line.text.len() - line.text.trim_ascii_start().len();
            let source = line.source(None, start, start + visible.len());
            let message = format!("this is after the end of the program in line {end_line}");
            self.findings.push(
                Finding::warning(Code::Syntax, source, message)
                    .help("it is not run; delete it, or delete the end before it"),
            );
            self.section = Section::After { end_line, is_reported: true };
        }
        matches!(self.section, Section::After { is_reported: true, .. })
    }

    /// Refuses a line that is longer than any block.
    #[cold]
    pub(super) fn too_long(&mut self, line: Line<'_>) {
        let message = format!(
            "the line has {} bytes; at most {} are accepted",
            line.text.len(),
            limits::LINE_BYTES_MAX
        );
        let source = line.source(None, 0, limits::LINE_BYTES_MAX);
        self.findings
            .push(Finding::error(Code::Limit, source, message).help("write one block a line"));
        self.interpreter.lose_line();
        if self.section == Section::Before {
            self.section = Section::Within;
        }
    }
}
