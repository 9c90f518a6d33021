//! Keep-out boxes: the room that clamps, vices and fixtures take.
//!
//! The YAML form is in millimetres, by name. A table that was read has only boxes with a size
//! in every axis. Which path touches one is not known here.

use crate::contour::work_system;
use crate::geometry::{AXIS_LETTERS, Position};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The largest coordinate of a box, either sign, mm.
const COORDINATE_MM_MAX: f64 = 100_000.0;
/// The most boxes of a table: each is compared with every block.
const BOXES_MAX: usize = 200;

/// All boxes, by name.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeepOut {
    #[serde(default, deserialize_with = "crate::unique::map")]
    pub keep_out: BTreeMap<String, KeepOutBox>,
}

/// A box whose sides are parallel to the axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeepOutBox {
    pub frame: Frame,
    pub min_mm: Position,
    pub max_mm: Position,
}

/// The coordinates that a box is written in: `machine`, or `G54` to `G59.3`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Frame {
    Machine,
    /// 1 to 9.
    Work(u8),
}

impl Frame {
    /// `machine`, `G54`.
    pub fn name(self) -> String {
        match self {
            Self::Machine => "machine".into(),
            Self::Work(system) => work_system(system),
        }
    }
}

impl From<Frame> for String {
    fn from(frame: Frame) -> Self {
        frame.name()
    }
}

impl TryFrom<String> for Frame {
    type Error = String;

    fn try_from(word: String) -> Result<Self, String> {
        let frames = (1..=9).map(Self::Work).chain([Self::Machine]);
        let found = frames.into_iter().find(|frame| frame.name().eq_ignore_ascii_case(&word));
        found.ok_or_else(|| format!("frame {word:?} is not machine, nor G54 to G59.3"))
    }
}

/// A box that nothing can have.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum KeepOutError {
    #[error("{letter} of {key} of {name:?} is {value:?}; it must be within {COORDINATE_MM_MAX} mm")]
    Coordinate { name: String, key: &'static str, letter: char, value: f64 },
    #[error(
        "{name:?} has no size in {letter}: min_mm is {min}, max_mm is {max}; min_mm must be less \
         than max_mm"
    )]
    NoSize { name: String, letter: char, min: f64, max: f64 },
    #[error("a box has no name, or a name with a control character: {name:?}")]
    Name { name: String },
    #[error("keep_out has no boxes: write at least one, or leave the file out")]
    NoBoxes,
    #[error("there are {count} boxes; at most {BOXES_MAX} are accepted")]
    TooMany { count: usize },
}

impl KeepOutError {
    /// The name of the box that is wrong.
    pub fn name(&self) -> Option<&str> {
        match self {
            Self::Coordinate { name, .. } | Self::NoSize { name, .. } | Self::Name { name } => {
                Some(name)
            }
            Self::NoBoxes | Self::TooMany { .. } => None,
        }
    }
}

impl KeepOut {
    /// Whether there are boxes, and every one is one.
    ///
    /// # Errors
    /// There are none: who names a file means to have some. Or the first one that is not.
    pub fn check(&self) -> Result<(), KeepOutError> {
        if self.keep_out.is_empty() {
            return Err(KeepOutError::NoBoxes);
        }
        if self.keep_out.len() > BOXES_MAX {
            return Err(KeepOutError::TooMany { count: self.keep_out.len() });
        }
        for (name, it) in &self.keep_out {
            if name.trim().is_empty() || name.chars().any(char::is_control) {
                return Err(KeepOutError::Name { name: name.clone() });
            }
            for (axis, letter) in AXIS_LETTERS.into_iter().enumerate() {
                for (key, value) in [("min_mm", it.min_mm[axis]), ("max_mm", it.max_mm[axis])] {
                    if value.is_nan() || value.abs() > COORDINATE_MM_MAX {
                        let name = name.clone();
                        return Err(KeepOutError::Coordinate { name, key, letter, value });
                    }
                }
                let (min, max) = (it.min_mm[axis], it.max_mm[axis]);
                if min >= max {
                    return Err(KeepOutError::NoSize { name: name.clone(), letter, min, max });
                }
            }
        }
        Ok(())
    }
}
