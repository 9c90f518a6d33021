//! The node as a program of its own.

fn main() -> std::process::ExitCode {
    runtime::main_with("compensation_planner", compensation_planner::node::main)
}
