//! Reads the interface files of this package and makes Rust, schema texts and type hashes of them.
//!
//! [`files`] finds the files and `rosidl` reads them; [`strict`], with [`literal`], refuses what
//! it takes from others but not from us; [`rust`] writes the code. Everything here maps text to
//! text: the build script reads and writes the files, and the tests run the same modules.
#![allow(unreachable_pub, reason = "included by the build script and by tests, which see it all")]

pub mod files;
pub mod literal;
pub mod rust;
pub mod strict;

use rosidl::InterfaceError;
use rosidl::interface_file::InterfaceFile;
use rosidl::registry::Registry;

/// All definitions of the files.
///
/// # Errors
/// Everything that is wrong, in the order of the files. Of a line that [`strict`] refuses,
/// nothing else is said.
pub fn read(files: &[InterfaceFile]) -> Result<Registry, Vec<InterfaceError>> {
    let mut refusals: Vec<InterfaceError> = files.iter().flat_map(strict::check).collect();
    match Registry::read(files) {
        Ok(registry) if refusals.is_empty() => return registry.checked(),
        Ok(_) => {}
        Err(mut more) => {
            let is_refused = |file: &str, line| {
                refusals.iter().any(|refusal| refusal.file == file && refusal.line == line)
            };
            more.retain(|refusal| !is_refused(&refusal.file, refusal.line));
            refusals.extend(more);
        }
    }
    let position =
        |refusal: &InterfaceError| files.iter().position(|file| file.path == refusal.file);
    refusals.sort_by_key(|refusal| (position(refusal), refusal.line));
    Err(refusals)
}
