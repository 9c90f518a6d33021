//! The parameters of the node, and the options that follow from them.

use crate::LoadOptions;
use crate::limits::{FlowLimits, TimeLimit};
use runtime::{Declared, Handle};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// Some ten times what the other limits take on a small computer.
const EXECUTED_SECONDS_MAX: f64 = 20.0;

/// The node's parameters.
pub fn parameters() -> Vec<Declared> {
    vec![
        Declared::new(
            "control",
            "rs274",
            "control profile of programs that do not name one: a built-in name, or a YAML file",
        )
        .read_only()
        .formerly("controller"),
        Declared::new(
            "frame_id",
            "work",
            "frame of the programmed contour; work stands after the namespace of the node \
             (cell/mill/work), /work does not",
        )
        .read_only(),
        Declared::new("block_delete", false, "whether blocks that begin with / are skipped")
            .read_only(),
        Declared::new(
            "program_directories",
            Vec::<String>::new(),
            "folders in which `path` of load_program is looked up; empty: none, programs come as \
             text or upload",
        )
        .read_only(),
        Declared::new(
            "subroutine_directories",
            Vec::<String>::new(),
            "folders with the files of subroutines that a program calls and does not define: \
             o<pocket> call reads pocket.ngc, M98 P10 on MASSO 10.nc",
        )
        .read_only(),
        Declared::new(
            "parameter_file",
            "",
            "file with the values of numbered parameters that every program begins with, as \
             LinuxCNC writes it (a number and a value in each line); a run that is finished writes \
             what its program has set; its folder must be writable; empty: none",
        )
        .read_only(),
        Declared::new(
            "executed_blocks_max",
            FlowLimits::default().blocks_max as i64,
            "blocks that a program with loops and subroutines may execute, above the lines of the \
             program",
        )
        .integer_within(1, i64::from(u32::MAX))
        .read_only(),
        Declared::new(
            "executed_bytes_max",
            FlowLimits::default().bytes_max as i64,
            "bytes of the blocks that a program with loops and subroutines may execute, each as \
             often as it is executed, above the bytes of the program: a bound on the time, as long \
             blocks take longer",
        )
        .integer_within(1, i64::from(u32::MAX))
        .read_only(),
        Declared::new(
            "executed_seconds_max",
            EXECUTED_SECONDS_MAX,
            "seconds that a program with loops and subroutines may take to be read, on this computer",
        )
        .within(0.01, 3600.0)
        .read_only(),
        Declared::new(
            "subroutine_depth_max",
            FlowLimits::default().depth_max as i64,
            "subroutines that may be inside each other",
        )
        .integer_within(1, 10_000)
        .read_only(),
        Declared::new(
            "control_directories",
            Vec::<String>::new(),
            "folders in which a YAML file that a request names as its `control` is looked up",
        )
        .read_only(),
    ]
}

/// How programs are loaded.
pub(super) fn options(node: &Handle) -> LoadOptions {
    let depth_max = usize::try_from(node.parameter::<i64>("subroutine_depth_max"));
    let flow = FlowLimits {
        blocks_max: node.parameter::<i64>("executed_blocks_max").unsigned_abs(),
        bytes_max: node.parameter::<i64>("executed_bytes_max").unsigned_abs(),
        depth_max: depth_max.unwrap_or(1),
        time: Some(TimeLimit {
            most: Duration::try_from_secs_f64(node.parameter("executed_seconds_max"))
                .unwrap_or(Duration::MAX),
            clock: since_start,
        }),
    };
    LoadOptions { block_delete: node.parameter("block_delete"), flow, ..LoadOptions::default() }
}

/// The time since it was asked for first.
fn since_start() -> Duration {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed()
}
