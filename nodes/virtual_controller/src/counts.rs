//! Counts what a controller has done since it was first switched on.
//!
//! For tests that account for every byte and every line.

use std::time::Duration;

/// A stop counts as an underrun when the next block comes within this time.
pub(crate) const UNDERRUN_S: f64 = 1.0;

/// Counts since the supply was first switched on; power cycles do not reset them.
///
/// Unless motion is dropped, `blocks_planned` is `blocks_executed` plus the blocks in the
/// planner. Every line that was read is answered once, except those that a reset or a flush
/// dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Bytes that arrived, real-time bytes included.
    pub bytes_received: u64,
    /// Bytes of these that were lost to a full receive buffer.
    pub bytes_lost: u64,
    /// The most bytes the receive buffer ever held.
    pub receive_buffer_bytes_max: usize,
    /// Lines taken from the receive buffer, empty ones included.
    pub lines_read: u64,
    /// Lines answered `ok`.
    pub oks: u64,
    /// Lines answered `error:N`.
    pub errors: u64,
    /// Straight blocks that went into the planner; an arc is many blocks.
    pub blocks_planned: u64,
    /// Blocks that were executed to their end.
    pub blocks_executed: u64,
    /// Blocks that a reset, an alarm, a cancel or a probe contact dropped.
    pub blocks_discarded: u64,
    /// Lines, arcs, jogs and probes that were executed to their end, those of length zero included.
    pub motions_finished: u64,
    /// How often the planner ran empty, so that the axes stopped where the path has no stop.
    ///
    /// That is: the last block ended, no block followed and nothing waited for the stop (a dwell,
    /// a spindle command, the end of the program). The next block came within one second of machine
    /// time, and the corner between the two could have been taken at a speed above zero.
    pub underruns: u64,
    /// Alarms raised.
    pub alarms: u64,
    /// Status reports sent.
    pub reports: u64,
    /// Those that were torn on purpose.
    pub torn_reports: u64,
    /// The controller's own time.
    pub machine_time: Duration,
}

impl Counts {
    /// The counts as a JSON object of numbers, one a line.
    pub fn to_json(&self) -> String {
        let rows = [
            ("bytes_received", self.bytes_received.to_string()),
            ("bytes_lost", self.bytes_lost.to_string()),
            ("receive_buffer_bytes_max", self.receive_buffer_bytes_max.to_string()),
            ("lines_read", self.lines_read.to_string()),
            ("oks", self.oks.to_string()),
            ("errors", self.errors.to_string()),
            ("blocks_planned", self.blocks_planned.to_string()),
            ("blocks_executed", self.blocks_executed.to_string()),
            ("blocks_discarded", self.blocks_discarded.to_string()),
            ("motions_finished", self.motions_finished.to_string()),
            ("underruns", self.underruns.to_string()),
            ("alarms", self.alarms.to_string()),
            ("reports", self.reports.to_string()),
            ("machine_seconds", format!("{:.9}", self.machine_time.as_secs_f64())),
        ];
        let rows: Vec<String> =
            rows.iter().map(|(name, value)| format!("  \"{name}\": {value}")).collect();
        format!("{{\n{}\n}}\n", rows.join(",\n"))
    }
}
