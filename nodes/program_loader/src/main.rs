//! The program loader as a program of its own.

fn main() -> std::process::ExitCode {
    runtime::main_with("program_loader", program_loader::node::main)
}
