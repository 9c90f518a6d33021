//! The node as a program of its own.

#[cfg(feature = "node")]
fn main() -> std::process::ExitCode {
    runtime::main_with("compensation_planner", compensation_planner::node::main)
}

/// The core alone, as benches build it, is no node.
#[cfg(not(feature = "node"))]
fn main() -> std::process::ExitCode {
    std::process::ExitCode::FAILURE
}
