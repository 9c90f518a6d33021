//! Generates Rust code from the interface files; see `generator/mod.rs`.
#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    reason = "a build script reads and writes files; what it makes is pure"
)]

use std::path::Path;
use std::process::ExitCode;
use std::{env, fs};

#[path = "generator/mod.rs"]
#[allow(dead_code, reason = "some of it only tests use")]
mod generator;

use generator::{files, rust};
use rosidl::InterfaceError;

#[allow(clippy::print_stdout, reason = "a build script speaks to cargo by printing")]
fn main() -> ExitCode {
    for path in ["build.rs", "generator", "msg", "srv", "action", "share"] {
        println!("cargo::rerun-if-changed={path}");
    }
    match generate() {
        Ok(()) => ExitCode::SUCCESS,
        Err(refusals) => {
            for refusal in refusals {
                println!("cargo::error={refusal}");
            }
            ExitCode::FAILURE
        }
    }
}

fn generate() -> Result<(), Vec<InterfaceError>> {
    let files = files::read_all(Path::new("."), "cnc_msgs")?;
    let registry = generator::read(&files)?;
    write("wire.rs", &rust::wire(&registry)?)?;
    write("schemas.rs", &rust::schemas(&registry))?;
    write("every_message.rs", &rust::every_message(&registry))
}

fn write(name: &str, text: &str) -> Result<(), Vec<InterfaceError>> {
    let folder = env::var_os("OUT_DIR").unwrap_or_default();
    let path = Path::new(&folder).join(name);
    fs::write(&path, text).map_err(|error| {
        vec![InterfaceError {
            file: path.display().to_string(),
            line: 0,
            message: error.to_string(),
        }]
    })
}
