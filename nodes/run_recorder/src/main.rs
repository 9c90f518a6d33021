//! The node as its own program.

fn main() -> std::process::ExitCode {
    runtime::main_with("run_recorder", run_recorder::node::main)
}
