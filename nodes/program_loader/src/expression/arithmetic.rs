//! The operators and functions of expressions.

use super::Trouble;

/// Values that differ by less are equal for EQ, NE, GE and LE (LinuxCNC).
const EQUAL_TOLERANCE: f64 = 1e-6;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Operator {
    Power,
    Times,
    Over,
    Modulo,
    Plus,
    Minus,
    Equal,
    NotEqual,
    Greater,
    GreaterOrEqual,
    Less,
    LessOrEqual,
    And,
    Or,
    ExclusiveOr,
}

impl Operator {
    pub(super) const ALL: [(&'static str, Self); 15] = [
        ("**", Self::Power),
        ("*", Self::Times),
        ("/", Self::Over),
        ("+", Self::Plus),
        ("-", Self::Minus),
        ("MOD", Self::Modulo),
        ("EQ", Self::Equal),
        ("NE", Self::NotEqual),
        ("GT", Self::Greater),
        ("GE", Self::GreaterOrEqual),
        ("LT", Self::Less),
        ("LE", Self::LessOrEqual),
        ("AND", Self::And),
        ("OR", Self::Or),
        ("XOR", Self::ExclusiveOr),
    ];

    /// The operator that the text begins with, and the bytes that it takes.
    #[inline]
    pub(super) fn read(text: &[u8]) -> Option<(Self, usize)> {
        match text {
            // Most values end with it.
            [b']', ..] => None,
            _ => spelled_of(&Self::ALL, text),
        }
    }

    /// Higher ones are applied first; equal ones from left to right.
    pub(super) const fn precedence(self) -> u8 {
        match self {
            Self::And | Self::Or | Self::ExclusiveOr => 0,
            Self::Equal
            | Self::NotEqual
            | Self::Greater
            | Self::GreaterOrEqual
            | Self::Less
            | Self::LessOrEqual => 1,
            Self::Plus | Self::Minus => 2,
            Self::Times | Self::Over | Self::Modulo => 3,
            Self::Power => 4,
        }
    }

    pub(super) fn apply(self, left: f64, right: f64) -> Result<f64, Trouble> {
        if left.is_nan() || right.is_nan() {
            return Ok(f64::NAN);
        }
        let truth = |is_true: bool| f64::from(u8::from(is_true));
        let is_equal = (left - right).abs() < EQUAL_TOLERANCE;
        let value = match self {
            Self::Plus => left + right,
            Self::Minus => left - right,
            Self::Times => left * right,
            Self::Over | Self::Modulo if right == 0.0 => return Err(Trouble::DivisionByZero),
            Self::Over => left / right,
            Self::Modulo => {
                let rest = left % right;
                if rest < 0.0 { rest + right.abs() } else { rest }
            }
            Self::Power if left < 0.0 && right.fract() != 0.0 => {
                return Err(Trouble::NegativePower { base: left, exponent: right });
            }
            Self::Power => left.powf(right),
            Self::Equal => truth(is_equal),
            Self::NotEqual => truth(!is_equal),
            Self::Greater => truth(left > right),
            Self::GreaterOrEqual => truth(left > right || is_equal),
            Self::Less => truth(left < right),
            Self::LessOrEqual => truth(left < right || is_equal),
            Self::And => truth(left != 0.0 && right != 0.0),
            Self::Or => truth(left != 0.0 || right != 0.0),
            Self::ExclusiveOr => truth((left != 0.0) != (right != 0.0)),
        };
        finite(value)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Function {
    Abs,
    Acos,
    Asin,
    Atan,
    Cos,
    Exists,
    Exp,
    Fix,
    Fup,
    Ln,
    Round,
    Sin,
    Sqrt,
    Tan,
}

impl Function {
    pub(super) const ALL: [(&'static str, Self); 14] = [
        ("ABS", Self::Abs),
        ("ACOS", Self::Acos),
        ("ASIN", Self::Asin),
        ("ATAN", Self::Atan),
        ("COS", Self::Cos),
        ("EXISTS", Self::Exists),
        ("EXP", Self::Exp),
        ("FIX", Self::Fix),
        ("FUP", Self::Fup),
        ("LN", Self::Ln),
        ("ROUND", Self::Round),
        ("SIN", Self::Sin),
        ("SQRT", Self::Sqrt),
        ("TAN", Self::Tan),
    ];

    /// The function that the text begins with, and the bytes that it takes.
    pub(super) fn read(text: &[u8]) -> Option<(Self, usize)> {
        spelled_of(&Self::ALL, text)
    }

    pub(super) fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, function)| *function == self).map_or("", |(name, _)| name)
    }

    /// `second` is the denominator of ATAN.
    pub(super) fn apply(self, argument: f64, second: Option<f64>) -> Result<f64, Trouble> {
        if argument.is_nan() || second.is_some_and(f64::is_nan) {
            return Ok(f64::NAN);
        }
        let outside =
            |allowed| Err(Trouble::OutOfDomain { function: self.name(), value: argument, allowed });
        let is_ratio = (-1.0..=1.0).contains(&argument);
        let value = match self {
            Self::Abs => argument.abs(),
            Self::Acos | Self::Asin if !is_ratio => return outside("from -1 to 1"),
            Self::Acos => argument.acos().to_degrees(),
            Self::Asin => argument.asin().to_degrees(),
            Self::Atan => argument.atan2(second.unwrap_or(1.0)).to_degrees(),
            Self::Cos => cosine(argument),
            // It is asked of a parameter, not of a value.
            Self::Exists => 1.0,
            Self::Exp => argument.exp(),
            Self::Fix => argument.floor(),
            Self::Fup => argument.ceil(),
            Self::Ln if argument <= 0.0 => return outside("above 0"),
            Self::Ln => argument.ln(),
            Self::Round => (argument + 0.5_f64.copysign(argument)).trunc(),
            Self::Sin => sine(argument),
            Self::Sqrt if argument < 0.0 => return outside("from 0 on"),
            Self::Sqrt => argument.sqrt(),
            Self::Tan => tangent(argument),
        };
        finite(value)
    }
}

/// The sine of an angle in degrees. The angle in radians has twice the digits of a double, so that
/// `SIN[150]` is 0.5 and not a digit less (LinuxCNC computes with more digits, too).
fn sine(degrees: f64) -> f64 {
    let (high, low) = radians(degrees);
    high.sin() + low * high.cos()
}

/// The cosine of an angle in degrees, like [`sine`].
fn cosine(degrees: f64) -> f64 {
    let (high, low) = radians(degrees);
    high.cos() - low * high.sin()
}

/// The tangent of an angle in degrees, like [`sine`].
fn tangent(degrees: f64) -> f64 {
    let (high, low) = radians(degrees);
    let tangent = high.tan();
    tangent + low * (1.0 + tangent * tangent)
}

/// An angle in radians as the sum of two doubles.
fn radians(degrees: f64) -> (f64, f64) {
    /// Pi is this much more than the double nearest to it.
    const PI_LOW: f64 = 1.224_646_799_147_353_2e-16;
    use std::f64::consts::PI;
    let product = degrees * PI;
    let rest = degrees.mul_add(PI, -product) + degrees * PI_LOW;
    let high = product / 180.0;
    let low = ((-high).mul_add(180.0, product) + rest) / 180.0;
    (high, low)
}

fn finite(value: f64) -> Result<f64, Trouble> {
    if value.is_finite() { Ok(value) } else { Err(Trouble::NotFinite) }
}

/// What the first of these names means that the text begins with, and the bytes that it takes.
pub(crate) fn spelled_of<T: Copy>(names: &[(&str, T)], text: &[u8]) -> Option<(T, usize)> {
    let first = text.first()?.to_ascii_uppercase();
    let mut likely = names.iter().filter(|(name, _)| name.as_bytes()[0] == first);
    likely.find_map(|&(name, meaning)| Some((meaning, spelled(text, name)?)))
}

/// The bytes that a name takes at the beginning of the text, in any case and with blanks inside.
fn spelled(text: &[u8], name: &str) -> Option<usize> {
    let mut at = 0;
    for (index, letter) in name.bytes().enumerate() {
        if index > 0 {
            at = super::skip_blanks(text, at);
        }
        if !text.get(at)?.eq_ignore_ascii_case(&letter) {
            return None;
        }
        at += 1;
    }
    Some(at)
}
