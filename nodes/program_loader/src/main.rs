//! The node as a program of its own.

fn main() -> std::process::ExitCode {
    program_loader::node::main(std::env::args().skip(1).collect())
}
