//! The node as a program of its own.

fn main() -> std::process::ExitCode {
    runtime::main_with("run_recorder", run_recorder::node::main)
}
