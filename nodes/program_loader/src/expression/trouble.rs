//! What can be wrong with an expression, and what to do about it.

use crate::line::Line;
use cnc_msgs::finding::{Code, Finding};

/// An expression without a value.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ExpressionError {
    pub(crate) trouble: Trouble,
    /// Its place: bytes of the line.
    pub(crate) start: usize,
    pub(crate) end: usize,
}

impl ExpressionError {
    /// The finding of it in a line, which may have an N number.
    pub(crate) fn finding(&self, line: Line<'_>, block: Option<u32>) -> Finding {
        let source = line.source(block, self.start, self.end);
        let message = self.trouble.message(&line.quote(self.start, self.end));
        Finding::error(Code::BadNumber, source, message).help(self.trouble.help())
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Trouble {
    NoValue,
    Number {
        is_exponent: bool,
    },
    NotClosed,
    NoOperator,
    UnknownFunction,
    NoArgument {
        function: &'static str,
    },
    NoSecondArgument,
    NoParameterInExists,
    TooDeep {
        most: u32,
    },
    DivisionByZero,
    NegativePower {
        base: f64,
        exponent: f64,
    },
    OutOfDomain {
        function: &'static str,
        value: f64,
        allowed: &'static str,
    },
    NotFinite,
    NoName,
    NotWhole {
        value: f64,
    },
    NoSuchNumber {
        number: f64,
    },
    Undefined {
        name: String,
    },
    /// The position that a parameter stands for is not known here.
    UnknownPosition {
        axis: char,
    },
    /// The position that a parameter stands for depends on the radius of the tool.
    CompensatedPosition,
    /// The parameter is the result of a probe.
    Probed,
    /// The result of M66, which is not there.
    NotRead,
    /// A parameter whose value this machine does not have.
    NotHere {
        what: String,
    },
    /// The tool table lacks a tool.
    NoTool {
        tool: u32,
    },
}

impl Trouble {
    /// What is wrong, about the text at the place.
    pub(crate) fn message(&self, quote: &str) -> String {
        match self {
            Self::NoValue => format!("a value is missing at `{quote}`"),
            Self::Number { is_exponent: true } => format!("`{quote}` has an exponent"),
            Self::Number { is_exponent: false } => format!("`{quote}` is not a number"),
            Self::NotClosed => "the bracket [ is not closed".to_owned(),
            Self::NoOperator => format!("`{quote}` is not an operator"),
            Self::UnknownFunction => format!("`{quote}` is not a function"),
            Self::NoArgument { function } => format!("{function} has no argument in brackets"),
            Self::NoSecondArgument => "ATAN has no second argument".to_owned(),
            Self::NoParameterInExists => "EXISTS has no parameter as its argument".to_owned(),
            Self::TooDeep { most } => format!("more than {most} brackets inside each other"),
            Self::DivisionByZero => "a division by zero".to_owned(),
            Self::NegativePower { base, exponent } => {
                format!("{base} ** {exponent} has no value: the base is negative")
            }
            Self::OutOfDomain { function, value, .. } => {
                format!("{function}[{value}] has no value")
            }
            Self::NotFinite => "the result is too large for a number".to_owned(),
            Self::NoName => "the name of the parameter has no >".to_owned(),
            Self::NotWhole { value } => format!("{value} is not the number of a parameter"),
            Self::NoSuchNumber { number } => format!("there is no parameter #{number}"),
            Self::Undefined { name } => format!("nothing has set the parameter #<{name}>"),
            Self::UnknownPosition { axis } => {
                format!("{quote} is the position of {axis}, which is not known here")
            }
            Self::CompensatedPosition => {
                format!("{quote} cannot be read under cutter radius compensation")
            }
            Self::NotRead => format!("{quote} is what M66 has read, and none comes before it"),
            Self::Probed => format!("{quote} is the result of a probe, and none comes before it"),
            Self::NotHere { what } => format!("{quote} is {what}"),
            Self::NoTool { tool } => {
                format!("{quote} is a value of T{tool}, which is not in the tool table")
            }
        }
    }

    pub(crate) fn help(&self) -> String {
        match self {
            Self::NoValue => "write a number, a parameter, or an expression in [ ]".to_owned(),
            Self::Number { is_exponent: true } => {
                "write the number out: 100000 instead of 1e5, 0.00001 instead of 1e-5".to_owned()
            }
            Self::Number { is_exponent: false } => {
                "write it with at most one decimal point".to_owned()
            }
            Self::NotClosed => "close it with ] on the same line".to_owned(),
            Self::NoOperator => "the operators are + - * / ** MOD AND OR XOR EQ NE GT GE LT LE; \
                                 close the expression with ]"
                .to_owned(),
            Self::UnknownFunction => "the functions are ABS ACOS ASIN ATAN COS EXISTS EXP FIX \
                                      FUP LN ROUND SIN SQRT TAN"
                .to_owned(),
            Self::NoArgument { function } => format!("write {function}[ ... ]"),
            Self::NoSecondArgument => "write ATAN[y]/[x]".to_owned(),
            Self::NoParameterInExists => "write EXISTS[#<name>]".to_owned(),
            Self::TooDeep { .. } => "compute parts of it in parameters of their own".to_owned(),
            Self::DivisionByZero => "test the divisor with IF before this block".to_owned(),
            Self::NegativePower { .. } => "use a whole exponent, or ABS of the base".to_owned(),
            Self::OutOfDomain { function, allowed, .. } => {
                format!("{function} takes values {allowed}")
            }
            Self::NotFinite => "look for a wrong parameter or a missing point".to_owned(),
            Self::NoName => "write #<name>".to_owned(),
            Self::NotWhole { .. } | Self::NoSuchNumber { .. } => {
                format!("numbered parameters are #1 to #{}", crate::parameters::NUMBER_MAX)
            }
            Self::Undefined { name } if name.starts_with('_') => {
                "set it before this block; names that begin with _ are global".to_owned()
            }
            Self::Undefined { name } => format!(
                "set it before this block, in the same subroutine; name it #<_{name}> if it is \
                 shared by subroutines"
            ),
            Self::UnknownPosition { axis } => {
                format!("move {axis} with G90 and G0 or G1 before this block")
            }
            Self::CompensatedPosition => "read it before G41 or G42, or after G40".to_owned(),
            Self::NotRead => "read an input before this block (M66)".to_owned(),
            Self::Probed => "probe before this block (G38.2)".to_owned(),
            Self::NotHere { .. } => "write the value as a number".to_owned(),
            Self::NoTool { tool } => format!("add T{tool} to the tool table"),
        }
    }
}
