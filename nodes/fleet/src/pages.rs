//! A page of the first bag of each group, as `kerf replay --html` draws it.

use crate::FleetError;
use crate::core::key::{bag_object, is_key};
use crate::report::Report;
use crate::store::{Missing, Store};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

/// Draws the pages of a report into a folder next to its own page, and notes them in it. `say` gets a sentence
/// for each bag that cannot be drawn.
///
/// # Errors
/// There is no `kerf`, or the folder cannot be written.
pub fn draw(
    store: &Store,
    report: &mut Report,
    page: &Path,
    say: &dyn Fn(&str),
) -> Result<(), FleetError> {
    let folder = page.with_extension("pages");
    fs::create_dir_all(&folder).map_err(|why| FleetError::file(&folder, why))?;
    let kerf = runtime::program_beside("kerf");
    let against = report.against.iter().flat_map(|it| &it.groups);
    let groups = report.groups.iter().chain(against).flat_map(|it| it.shown());
    let bags: BTreeSet<String> = groups.map(|group| group.first_bag.clone()).collect();
    for bag in bags.into_iter().filter(|bag| is_key(bag)) {
        let object = bag_object(&bag);
        let content = match store.get(&object) {
            Ok(content) => content,
            Err(Missing::Absent) => {
                say(&format!("{object}: it is not in the store, so there is no page of it"));
                continue;
            }
            Err(Missing::Failed(error)) => {
                say(&error.to_string());
                continue;
            }
        };
        let file = folder.join(&bag[..12.min(bag.len())]).with_extension("html");
        let copy = file.with_extension("mcap");
        // A page of before is not one of today.
        let _ = fs::remove_file(&file);
        fs::write(&copy, &content).map_err(|why| FleetError::file(&copy, why))?;
        let mut replay = Command::new(&kerf);
        replay.arg("replay").arg(&copy).arg("--html").arg(&file);
        let said = replay.stdin(Stdio::null()).output();
        let _ = fs::remove_file(&copy);
        let said = said.map_err(|why| {
            FleetError::NotDone(format!(
                "{}: {why}; --pages needs `kerf` next to kerf-fleet or on PATH",
                kerf.display()
            ))
        })?;
        // 1 is the answer to a bag that differs.
        if matches!(said.status.code(), Some(0 | 1)) && file.exists() {
            let place = [folder.file_name(), file.file_name()];
            let place = place.map(|it| it.unwrap_or_default().to_string_lossy().into_owned());
            report.pages.insert(bag, place.join("/"));
        } else {
            let why = String::from_utf8_lossy(&said.stderr);
            say(&format!("{object}: there is no page of it: {}", why.trim()));
        }
    }
    Ok(())
}
