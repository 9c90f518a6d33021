//! The virtual controller as a program of its own.

fn main() -> std::process::ExitCode {
    virtual_controller::cli(std::env::args_os())
}
