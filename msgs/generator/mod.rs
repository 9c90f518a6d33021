//! Reads the interface files of this package; generates Rust code, schema texts and type hashes.
//!
//! [`files`] finds the files and `rosidl` reads them. [`strict`], with [`literal`], has the rules
//! that only our own files must follow. [`rust`] writes the code. Everything here maps text to
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
/// All faults, in the order of the files. A line that [`strict`] refuses has no other fault.
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
