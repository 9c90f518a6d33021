//! The node as a program of its own.

fn main() -> std::process::ExitCode {
    run_recorder::node::main(std::env::args().skip(1).collect())
}
