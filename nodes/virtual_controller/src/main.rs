//! The virtual controller as a program of its own.

#[cfg(feature = "node")]
fn main() -> std::process::ExitCode {
    virtual_controller::cli(std::env::args_os())
}

/// The core alone, as benches build it, is no node.
#[cfg(not(feature = "node"))]
fn main() -> std::process::ExitCode {
    std::process::ExitCode::FAILURE
}
