//! The parameters that a node has besides its own.

use super::declared::Declared;

/// Declared by every node: whether time comes from `/clock`.
pub const USE_SIM_TIME: &str = "use_sim_time";
/// Declared by every managed node: whether it makes itself active.
pub const AUTOSTART: &str = "autostart";
/// Declared by every node: the memory at which it ends.
pub(crate) const MEMORY_MB_MAX: &str = "memory_mb_max";
/// Declared by every node: requests that may wait at a service.
pub(crate) const SERVICE_DEPTH: &str = "service_depth";
pub(crate) const SERVICE_DEPTH_USUAL: i64 = 100;
/// Of nodes and commands; a program of a million lines takes up to 800 MB.
pub(crate) const MEMORY_MB_USUAL: i64 = 2_048;
/// Below this a node does not start.
pub(crate) const MEMORY_MB_LEAST: i64 = 64;

/// Of every node.
pub(crate) fn use_sim_time() -> Declared {
    Declared::new(USE_SIM_TIME, false, "whether time comes from the topic /clock")
}

/// Of every managed node.
pub(crate) fn autostart() -> Declared {
    let description = "whether the node configures and activates itself when it starts";
    Declared::new(AUTOSTART, true, description).read_only()
}

/// Of every node that is started as a process.
pub(crate) fn of_process() -> [Declared; 2] {
    [memory_mb_max(), service_depth()]
}

fn service_depth() -> Declared {
    let description = "requests that may wait at each service; of more, some are lost";
    Declared::new(SERVICE_DEPTH, SERVICE_DEPTH_USUAL, description)
        .integer_within(1, 10_000)
        .read_only()
}

fn memory_mb_max() -> Declared {
    Declared::new(
        MEMORY_MB_MAX,
        MEMORY_MB_USUAL,
        "the node ends, and is restarted by its supervisor, when it takes more memory than this, \
         in MB, or more than three quarters of the computer's",
    )
    .within(MEMORY_MB_LEAST as f64, f64::from(i32::MAX))
    .read_only()
}
