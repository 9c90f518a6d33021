//! The node as a program of its own.

fn main() -> std::process::ExitCode {
    axis_driver::node::main(&[], std::env::args().skip(1).collect())
}
