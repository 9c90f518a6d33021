//! The program loader as a program of its own.

#[cfg(feature = "node")]
fn main() -> std::process::ExitCode {
    runtime::main_with("program_loader", program_loader::node::main)
}

/// The core alone, as benches build it, is no node.
#[cfg(not(feature = "node"))]
fn main() -> std::process::ExitCode {
    std::process::ExitCode::FAILURE
}
