//! The node as its own program.

#[cfg(feature = "node")]
fn main() -> std::process::ExitCode {
    runtime::main_with("run_recorder", run_recorder::node::main)
}

/// The core alone, as benches build it, is no node.
#[cfg(not(feature = "node"))]
fn main() -> std::process::ExitCode {
    std::process::ExitCode::FAILURE
}
