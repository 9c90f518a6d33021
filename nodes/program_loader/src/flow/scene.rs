//! One O word while it is executed: its values, and what is wrong with it.
//!
//! Knows nothing of loops and subroutines.

use super::statement::{self, Keyword, Name, Statement};
use crate::expression::{self, ExpressionError};
use crate::findings::Findings;
use crate::interpreter::Interpreter;
use crate::line::Line;
use crate::parameters::Parameters;
use crate::values::Values;
use cnc_msgs::finding::{Code, Finding};

/// What a statement may ask and change.
pub(crate) struct World<'w, 'r> {
    pub(crate) parameters: &'w mut Parameters,
    pub(crate) interpreter: &'w Interpreter<'r>,
    pub(crate) findings: &'w mut Findings,
}

/// An error has been reported, after which nothing can be executed.
pub(super) struct Stopped;

/// One statement during its execution.
pub(super) struct Scene<'s, 'w, 'r> {
    pub(super) line: Line<'s>,
    pub(super) statement: Statement<'s>,
    pub(super) world: &'s mut World<'w, 'r>,
}

impl Scene<'_, '_, '_> {
    /// The value at a byte of the line, and the first byte after it.
    fn value_at(&mut self, at: usize) -> Result<(f64, usize), Stopped> {
        let values = Values {
            parameters: self.world.parameters,
            interpreter: self.world.interpreter,
            line: self.line.number,
            is_single_block: false,
        };
        match expression::value(self.line.text, at, &values) {
            // It has been reported why.
            Ok((value, _)) if value.is_nan() => Err(Stopped),
            Ok(read) => Ok(read),
            Err(error) => Err(self.wrong(&error)),
        }
    }

    /// The one value of a statement.
    pub(super) fn value(&mut self) -> Result<f64, Stopped> {
        let at = statement::skip_remarks(self.line.text, self.statement.arguments);
        if at >= self.statement.end {
            let word = self.statement.keyword.word();
            let message = format!("{word} has no value");
            return Err(self.refuse(Code::MissingWord, message, &format!("write {word} [ ... ]")));
        }
        let (value, end) = self.value_at(at)?;
        self.nothing_from(end)?;
        Ok(value)
    }

    pub(super) fn truth(&mut self) -> Result<bool, Stopped> {
        Ok(self.value()? != 0.0)
    }

    /// The value of `return` or `endsub`, if it has one.
    pub(super) fn optional_value(&mut self) -> Result<Option<f64>, Stopped> {
        let at = statement::skip_remarks(self.line.text, self.statement.arguments);
        if at < self.statement.end { self.value().map(Some) } else { Ok(None) }
    }

    /// The name of the subroutine that is called, as `flow` knows it.
    pub(super) fn name(&mut self) -> Result<Box<str>, Stopped> {
        match &self.statement.name {
            Name::Known(name) => Ok(name.clone().into()),
            &Name::Computed(at) => Ok(self.value_at(at)?.0.round().to_string().into()),
        }
    }

    /// The arguments of a call.
    pub(super) fn arguments(&mut self) -> Result<Vec<f64>, Stopped> {
        let mut arguments = Vec::new();
        let mut next = statement::skip_remarks(self.line.text, self.statement.arguments);
        while next < self.statement.end && self.line.text[next] == b'[' {
            let (value, end) = self.value_at(next)?;
            arguments.push(value);
            next = statement::skip_remarks(self.line.text, end);
        }
        self.nothing_from(next)?;
        Ok(arguments)
    }

    /// Checks that a statement without a value has none.
    pub(super) fn nothing_follows(&mut self) -> Result<(), Stopped> {
        match self.statement.keyword {
            Keyword::While | Keyword::Repeat => Ok(()),
            _ => self.nothing_from(self.statement.arguments),
        }
    }

    fn nothing_from(&mut self, at: usize) -> Result<(), Stopped> {
        let at = statement::skip_remarks(self.line.text, at);
        if at >= self.statement.end {
            return Ok(());
        }
        let quote = self.line.quote(at, self.statement.end);
        let message = format!("`{quote}` after {}", self.statement.keyword.word());
        let source = self.line.source(self.statement.block, at, self.statement.end);
        let finding = Finding::error(Code::Syntax, source, message);
        let help = match self.statement.keyword {
            Keyword::Call | Keyword::Return | Keyword::EndSub => {
                "write each value in brackets, as in o1 call [5]"
            }
            _ => "write it into a line of its own",
        };
        self.world.findings.push(finding.help(help));
        Err(Stopped)
    }

    fn wrong(&mut self, error: &ExpressionError) -> Stopped {
        self.world.findings.push(error.finding(self.line, self.statement.block));
        Stopped
    }

    /// Reports an error of the whole statement.
    pub(super) fn refuse(&mut self, code: Code, message: String, help: &str) -> Stopped {
        let Statement { block, start, end, .. } = self.statement;
        let source = self.line.source(block, start, end);
        self.world.findings.push(Finding::error(code, source, message).help(help));
        Stopped
    }
}
