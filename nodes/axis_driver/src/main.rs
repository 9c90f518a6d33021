//! The node as a program of its own.

#[cfg(feature = "node")]
fn main() -> std::process::ExitCode {
    runtime::main_with("axis_driver", |words| axis_driver::node::main(&[], words))
}

/// The core alone, as benches build it, is no node.
#[cfg(not(feature = "node"))]
fn main() -> std::process::ExitCode {
    std::process::ExitCode::FAILURE
}
