//! The node as a program of its own.

fn main() -> std::process::ExitCode {
    runtime::main_with("axis_driver", |words| axis_driver::node::main(&[], words))
}
