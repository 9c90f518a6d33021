//! The G-code of grbl and its descendants: words, modal state, checks, arcs.
//!
//! Knows what a line means and whether it is valid; moves nothing. The whole line is checked
//! before any part of it takes effect.

pub(crate) mod arc;
mod check;
mod modal;
mod port;
pub(crate) mod single;
mod sort;
mod words;

pub(crate) use arc::ArcPrecision;
pub(crate) use check::{Checked, CommandKind, Effect, Flow, NonModal, check};
pub(crate) use modal::{
    Coolant, CoordinateSystems, Distance, FeedMode, Modal, Motion, ParserState, Plane, Spindle,
    Units, system_name,
};
pub(crate) use port::{InputWait, Output, PortCommand, PortCounts};
pub(crate) use words::{Digits, read_number};
