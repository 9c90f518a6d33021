//! What a run is asked to do.

use cnc_msgs::path::{CompensatedPath, StartInSpan};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The program name that the state shows for a single block of manual data input.
pub const MDI: &str = "mdi";

/// What to run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunRequest {
    pub program_id: String,
    /// The revision of the path of that program.
    pub revision: u64,
    pub path: Arc<CompensatedPath>,
    /// The source line to begin at; 0 and 1 are the whole program.
    pub start_line: u32,
    /// Which time that line is run, from 1; 0: the only one.
    pub occurrence: u32,
    /// What the control of the program says of a start under cutter compensation.
    pub in_span: StartInSpan,
    /// Nothing moves: the path is encoded from end to end for this controller, and
    /// read by its own check mode where the configuration says so.
    pub check_only: bool,
    /// By T number, mm, for keep-out boxes; empty where there are none.
    pub tool_diameters_mm: BTreeMap<u32, f64>,
}

impl RunRequest {
    /// The path of a single block, and the tools of the table that is in force.
    pub(in crate::driver) fn mdi(
        path: Arc<CompensatedPath>,
        tool_diameters_mm: BTreeMap<u32, f64>,
    ) -> Self {
        let program_id = MDI.to_owned();
        let in_span = StartInSpan::Refused;
        Self {
            program_id,
            revision: 0,
            path,
            start_line: 0,
            occurrence: 0,
            in_span,
            check_only: false,
            tool_diameters_mm,
        }
    }

    /// Whether it has a bag: a single block has none.
    pub(in crate::driver) fn is_recorded(&self) -> bool {
        self.program_id != MDI
    }

    /// Whether it is a single block of manual data input.
    pub(in crate::driver) fn is_mdi(&self) -> bool {
        !self.is_recorded()
    }
}
