//! Bags that wait for a store: copies in a folder, with what only their folder said.
//!
//! A bag leaves the spool when it is in the store and in the index.

use crate::FleetError;
use crate::core::key::{is_key, key_of};
use bytes::Bytes;
use intake::replace::replace;
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};

/// A bag in the spool.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Waiting {
    pub file: PathBuf,
    pub machine: Option<String>,
    pub kept: Option<String>,
}

/// Puts a bag into the spool, unless it is there whole.
pub fn add(
    folder: &Path,
    content: &Bytes,
    machine: Option<&str>,
    kept: Option<&str>,
) -> Result<(), FleetError> {
    fs::create_dir_all(folder).map_err(|why| FleetError::file(folder, why))?;
    let file = folder.join(format!("{}.mcap", key_of(content)));
    // A copy of another size was cut short, and one with other bytes is damaged: it is written again.
    let is_whole = fs::metadata(&file).is_ok_and(|it| it.len() == content.len() as u64)
        && fs::read(&file).is_ok_and(|it| it == *content);
    if is_whole {
        return Ok(());
    }
    let said = json!({ "machine": machine, "kept": kept }).to_string();
    // The bag is last: what is in the folder with its name is whole.
    write(&file.with_extension("json"), said.as_bytes())?;
    write(&file, content)
}

/// The bags in the spool, by name; none when there is no such folder.
pub fn waiting(folder: &Path) -> Result<Vec<Waiting>, FleetError> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(why) if why.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(why) => return Err(FleetError::file(folder, why)),
    };
    let mut waiting = Vec::new();
    for entry in entries {
        let file = entry.map_err(|why| FleetError::file(folder, why))?.path();
        let is_bag = file.extension().is_some_and(|it| it == "mcap")
            && file.file_stem().and_then(|it| it.to_str()).is_some_and(is_key);
        if is_bag {
            let said = fs::read(file.with_extension("json")).unwrap_or_default();
            let said: serde_json::Value = serde_json::from_slice(&said).unwrap_or_default();
            let text = |key| said.get(key).and_then(|it| it.as_str()).map(str::to_owned);
            waiting.push(Waiting { machine: text("machine"), kept: text("kept"), file });
        }
    }
    waiting.sort_by(|one, other| one.file.cmp(&other.file));
    Ok(waiting)
}

/// Removes a bag that is in the store.
pub fn remove(file: &Path) -> Result<(), FleetError> {
    match fs::remove_file(file) {
        // Another push with this spool has sent it, too.
        Err(why) if why.kind() == std::io::ErrorKind::NotFound => {}
        removed => removed.map_err(|why| FleetError::file(file, why))?,
    }
    // It may be of a spool without one.
    let _ = fs::remove_file(file.with_extension("json"));
    Ok(())
}

/// Writes a file that is there whole or not at all, after a power cut too.
fn write(file: &Path, content: &[u8]) -> Result<(), FleetError> {
    replace(file, content).map_err(|why| FleetError::file(file, why))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bag_waits_with_what_its_folder_said() {
        let folder = tempfile::tempdir().expect("a folder");
        let spool = folder.path().join("spool");
        assert_eq!(waiting(&spool).expect("no spool"), []);
        let content = Bytes::from_static(b"a bag");
        for _ in 0..2 {
            add(&spool, &content, Some("mill 1"), Some("alarm")).expect("added");
        }
        fs::write(spool.join("other.mcap"), b"x").expect("written");
        let found = waiting(&spool).expect("a spool");
        let [bag] = &found[..] else { panic!("{found:?}") };
        assert_eq!((bag.machine.as_deref(), bag.kept.as_deref()), (Some("mill 1"), Some("alarm")));
        assert_eq!(fs::read(&bag.file).expect("a file"), b"a bag");
        remove(&bag.file).expect("removed");
        assert_eq!(waiting(&spool).expect("a spool"), []);
        assert_eq!(fs::read_dir(&spool).expect("a folder").count(), 1);
    }

    #[test]
    fn pushes_that_share_a_spool_leave_whole_bags_and_mend_what_is_cut() {
        let folder = tempfile::tempdir().expect("a folder");
        let spool = folder.path();
        let content = Bytes::from(vec![7; 1 << 20]);
        let file = spool.join(format!("{}.mcap", key_of(&content)));
        for cut in [b"cut".to_vec(), vec![8; 1 << 20]] {
            fs::write(&file, cut).expect("written");
            std::thread::scope(|scope| {
                for _ in 0..8 {
                    scope.spawn(|| add(spool, &content, Some("mill"), None).expect("added"));
                }
            });
            assert!(fs::read(&file).expect("a file") == content);
            let said = fs::read(file.with_extension("json")).expect("a file");
            assert_eq!(said, br#"{"kept":null,"machine":"mill"}"#);
            assert_eq!(fs::read_dir(spool).expect("a folder").count(), 2, "no temporary file");
        }
        // Each of two pushes sent it.
        remove(&file).expect("removed");
        remove(&file).expect("gone already");
    }
}
