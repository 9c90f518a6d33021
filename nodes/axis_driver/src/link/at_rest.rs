//! A link on which nothing is under way, written down and taken up again.

use super::buffer::Buffer;
use super::check::LineCheck;
use super::framing::Framer;
use super::health::Health;
use super::{Link, LinkConfig};
use crate::report::ReportUnits;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// A link on which nothing is under way, written down.
#[derive(Debug, Serialize, Deserialize)]
pub struct LinkAtRest {
    units: ReportUnits,
    receive_bytes: u16,
    is_forgiving: bool,
    #[serde(default)]
    asks_everything: bool,
    health: Health,
    #[serde(default)]
    buffer: Buffer,
    /// Answers since the last report.
    #[serde(default)]
    answers: u32,
    /// The beginning of a line whose end has not come yet.
    unfinished: Vec<u8>,
}

impl<T> Link<T> {
    /// The link as it is; `None` when something is under way or not taken yet.
    pub fn at_rest(&self) -> Option<LinkAtRest> {
        let is_at_rest = self.in_flight.is_empty()
            && self.urgent.is_empty()
            && self.lines.is_empty()
            && self.events.is_empty();
        is_at_rest.then(|| LinkAtRest {
            units: self.units,
            receive_bytes: self.receive_bytes,
            is_forgiving: self.is_forgiving,
            asks_everything: self.asks_everything,
            health: self.health.clone(),
            buffer: self.buffer.clone(),
            answers: self.answers,
            unfinished: self.framer.unfinished().to_vec(),
        })
    }

    /// A link that goes on from there.
    pub fn from_rest(config: LinkConfig, rest: LinkAtRest) -> Self {
        let LinkAtRest {
            units,
            receive_bytes,
            is_forgiving,
            asks_everything,
            health,
            buffer,
            answers,
            unfinished,
        } = rest;
        Self {
            config,
            framer: Framer::with(unfinished),
            units,
            receive_bytes,
            in_flight: VecDeque::new(),
            in_flight_bytes: 0,
            is_forgiving,
            asks_everything,
            health,
            buffer,
            check: LineCheck::new(config.line_check_interval_ms),
            answers,
            urgent: Vec::new(),
            lines: Vec::new(),
            events: VecDeque::new(),
        }
    }
}
