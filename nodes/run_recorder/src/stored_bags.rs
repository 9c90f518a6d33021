//! The bags in a directory: which are ours, which are marked, and removing expired ones.
//!
//! A bag of ours is a folder, not a link, that has only files of the recorder.
//! The `cnc_run` record of its first file has the run id that names the folder. We
//! leave everything else alone. [`crate::retention`] decides which bags are removed.

use std::collections::BTreeSet;
use std::fs::{self, File, TryLockError};
use std::io::{self, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use crate::bag_writer::PRODUCT;
use crate::files::{METADATA_FILE, METADATA_TEMPORARY, mcap_files};
use crate::retention::{Removal, RetentionLimits, Stays, StoredBag, to_remove};
use crate::scan::run_of;
use crate::split::part_file_name;

/// The file in a bag's folder that marks it as kept, with the reason.
pub const MARK_FILE: &str = "keep.txt";
/// The suffix of a folder whose bag is being removed.
const REMOVING: &str = ".removing";
/// Longest reason that is read, bytes.
const REASON_MAX: u64 = 64 * 1024;

/// The bags that were removed, and those that could not be.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RemovedBags {
    pub removed: Vec<Removal>,
    /// Path and reason.
    pub stuck: Vec<(PathBuf, String)>,
}

/// Removes expired bags. A bag that cannot be removed is skipped, and its space counts; so is one that is due
/// for a store.
///
/// # Errors
/// The directory cannot be read.
pub fn remove_old_bags(
    directory: &Path,
    keep: RetentionLimits,
    now_ns: u64,
    due: &BTreeSet<PathBuf>,
) -> io::Result<RemovedBags> {
    remove_old_bags_with(directory, keep, now_ns, due, remove)
}

fn remove_old_bags_with(
    directory: &Path,
    keep: RetentionLimits,
    now_ns: u64,
    due: &BTreeSet<PathBuf>,
    mut remove: impl FnMut(&Path) -> io::Result<()>,
) -> io::Result<RemovedBags> {
    let mut outcome = RemovedBags::default();
    if !keep.is_limited() {
        return Ok(outcome);
    }
    let mut bags = find(directory)?;
    for bag in bags.iter_mut().filter(|bag| due.contains(&bag.path)) {
        bag.stays.get_or_insert(Stays::Due);
    }
    // One at a time: a bag that cannot be removed changes which others have to be.
    while let Some(removal) = to_remove(&bags, keep, now_ns).into_iter().next() {
        match remove(&removal.path) {
            Ok(()) => {
                bags.retain(|bag| bag.path != removal.path);
                outcome.removed.push(removal);
            }
            Err(error) => {
                let bag = bags.iter_mut().find(|bag| bag.path == removal.path);
                bag.expect("what goes was found").stays = Some(Stays::Stuck);
                outcome.stuck.push((removal.path, error.to_string()));
            }
        }
    }
    Ok(outcome)
}

/// The bags of ours in a directory, not below it.
pub fn find(directory: &Path) -> io::Result<Vec<StoredBag>> {
    let mut bags = Vec::new();
    for entry in fs::read_dir(directory)? {
        // A folder that cannot be read, or disappears meanwhile, is not ours.
        let found = entry.and_then(|entry| look_at(&entry.path()));
        bags.extend(found.unwrap_or(None));
    }
    Ok(bags)
}

/// Marks a bag, also one of another recorder: it is kept beyond all limits.
pub fn mark(bag: &Path, because: &str) -> io::Result<()> {
    must_be_bag(bag)?;
    // Atomic: a reader finds the old mark or the new one.
    let temporary = bag.join(format!("{MARK_FILE}.tmp"));
    let mut file = File::create(&temporary)?;
    writeln!(file, "{because}")?;
    file.sync_all()?;
    fs::rename(temporary, bag.join(MARK_FILE))
}

/// Removes the mark of a bag; `false` if it had none.
pub fn unmark(bag: &Path) -> io::Result<bool> {
    must_be_bag(bag)?;
    match fs::remove_file(bag.join(MARK_FILE)) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

fn must_be_bag(bag: &Path) -> io::Result<()> {
    if !bag.exists() {
        return Err(io::Error::new(io::ErrorKind::NotFound, "it does not exist"));
    }
    let is_bag = bag.is_dir() && !mcap_files(bag).map_err(io::Error::other)?.is_empty();
    let text = "it is not a bag directory, which holds .mcap files";
    if is_bag { Ok(()) } else { Err(io::Error::new(io::ErrorKind::InvalidInput, text)) }
}

/// Why a bag is marked, if it is.
pub fn mark_of(bag: &Path) -> Option<String> {
    let path = bag.join(MARK_FILE);
    fs::symlink_metadata(&path).ok()?;
    // A mark that cannot be read is a mark too.
    let mut text = Vec::new();
    if let Ok(file) = crate::files::open(&path) {
        let _ = file.take(REASON_MAX).read_to_end(&mut text);
    }
    Some(String::from_utf8_lossy(&text).trim().to_owned())
}

/// The name of a bag's folder while it is removed, so that it is not marked or opened then.
fn aside_of(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    Some(path.with_file_name(format!(".{name}{REMOVING}")))
}

/// The name of the bag in a folder, also of a partly removed one.
fn bag_name(path: &Path) -> Option<&str> {
    let name = path.file_name()?.to_str()?;
    let removed = name.strip_prefix('.').and_then(|name| name.strip_suffix(REMOVING));
    Some(removed.unwrap_or(name))
}

/// The files of a folder, if it is a bag of ours.
struct BagFolder {
    name: String,
    /// Parts by number.
    parts: Vec<(usize, PathBuf)>,
    /// Other files of the recorder.
    other_files: Vec<PathBuf>,
    size: u64,
    ended_ns: u64,
}

fn look_at(path: &Path) -> io::Result<Option<StoredBag>> {
    let Some(content) = content(path)? else { return Ok(None) };
    if !is_run(&content)? {
        return Ok(None);
    }
    let stays = if content.parts.iter().any(|(_, part)| is_in_use(part)) {
        Some(Stays::InUse)
    } else if mark_of(path).is_some() {
        Some(Stays::Marked)
    } else {
        None
    };
    let BagFolder { size, ended_ns, .. } = content;
    Ok(Some(StoredBag { path: path.to_owned(), size, ended_ns, stays }))
}

/// Lists a folder; `None` if it is not a folder or has files that are not of a bag.
fn content(path: &Path) -> io::Result<Option<BagFolder>> {
    // Does not follow a link.
    if !fs::symlink_metadata(path)?.is_dir() {
        return Ok(None);
    }
    let Some(name) = bag_name(path) else { return Ok(None) };
    let mut content = BagFolder {
        name: name.to_owned(),
        parts: Vec::new(),
        other_files: Vec::new(),
        size: 0,
        ended_ns: 0,
    };
    for entry in fs::read_dir(path)? {
        let entry = entry?;
        let metadata = fs::symlink_metadata(entry.path())?;
        let file_name = entry.file_name();
        let Some(file_name) = file_name.to_str().filter(|_| metadata.is_file()) else {
            return Ok(None);
        };
        content.size += metadata.len();
        if let Some(number) = part_number(name, file_name) {
            let written = metadata.modified()?.duration_since(UNIX_EPOCH).unwrap_or_default();
            let written_ns = u64::try_from(written.as_nanos()).unwrap_or(u64::MAX);
            content.ended_ns = content.ended_ns.max(written_ns);
            content.parts.push((number, entry.path()));
        } else if [METADATA_FILE, METADATA_TEMPORARY].contains(&file_name) {
            content.other_files.push(entry.path());
        } else if file_name != MARK_FILE {
            return Ok(None);
        }
    }
    content.parts.sort();
    Ok(Some(content))
}

/// The number of a part, if the file name is that of a part of this bag.
fn part_number(bag: &str, file_name: &str) -> Option<usize> {
    let number = file_name.strip_prefix(bag)?.strip_prefix('_')?.strip_suffix(".mcap")?;
    let number = number.parse().ok()?;
    (part_file_name(bag, number) == file_name).then_some(number)
}

/// Whether the first file is of our recorder and has the run id of the folder's name.
fn is_run(content: &BagFolder) -> io::Result<bool> {
    let Some((0, first)) = content.parts.first() else { return Ok(false) };
    let mut reader = BufReader::new(crate::files::open(first)?);
    let Some((library, run)) = run_of(&mut reader)? else { return Ok(false) };
    let is_ours = library.split(' ').next() == Some(PRODUCT);
    Ok(is_ours && run.get("run_id") == Some(&content.name))
}

/// Whether a file is being written to, or that cannot be found out.
fn is_in_use(part: &Path) -> bool {
    // Shared: two who look at once do not take each other for a recorder.
    match crate::files::open(part).map(|file| file.try_lock_shared()) {
        Ok(Ok(())) => false,
        Ok(Err(TryLockError::WouldBlock | TryLockError::Error(_))) | Err(_) => true,
    }
}

/// Removes a bag, after checking it again.
fn remove(path: &Path) -> io::Result<()> {
    check_removable(path)?;
    let aside = aside_of(path).ok_or_else(changed)?;
    if bag_name(path).is_some_and(|name| path.file_name().is_some_and(|it| it != name)) {
        // An earlier removal was interrupted.
        return remove_files(path);
    }
    fs::rename(path, &aside)?;
    remove_aside(path, &aside)
}

/// Removes a bag that was renamed from `path`, or renames it back.
fn remove_aside(path: &Path, aside: &Path) -> io::Result<()> {
    // It may have been marked just before it was renamed.
    check_removable(aside).or_else(|why| {
        fs::rename(aside, path).map_err(|error| {
            let aside = aside.display();
            io::Error::new(error.kind(), format!("{why}; it is now {aside}: {error}"))
        })?;
        Err(why)
    })?;
    remove_files(aside)
}

fn changed() -> io::Error {
    io::Error::other("it changed while it was being examined")
}

fn check_removable(path: &Path) -> io::Result<()> {
    match look_at(path)? {
        Some(StoredBag { stays: None, .. }) => Ok(()),
        _ => Err(changed()),
    }
}

/// Removes the files of a bag of ours.
///
/// The first file goes last: if the power fails in between, the rest is still recognised
/// as ours. Only listed files are removed, and never a mark.
fn remove_files(path: &Path) -> io::Result<()> {
    let content = content(path)?.ok_or_else(changed)?;
    let parts = content.parts.iter().rev().map(|(_, part)| part);
    let mut files = content.other_files.iter().chain(parts);
    let removed = files.try_for_each(fs::remove_file);
    removed.and_then(|()| fs::remove_dir(path)).map_err(|error| {
        let text = format!("{error}; what is left of it is in {}", path.display());
        io::Error::new(error.kind(), text)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run_bag::{RunBag, RunBagOptions};
    use std::time::Duration;

    /// A finished bag that was written so many days after the epoch.
    fn bag(directory: &Path, name: &str, day: u64) {
        let mut options = RunBagOptions::new(directory, name);
        options.run.insert("run_id".into(), name.into());
        let bag = RunBag::create(options).unwrap();
        assert!(bag.finish(Duration::from_secs(60)).complete);
        let file =
            File::options().append(true).open(directory.join(name).join(format!("{name}_0.mcap")));
        let written = UNIX_EPOCH + Duration::from_secs(day * 86_400);
        file.unwrap().set_modified(written).unwrap();
    }

    #[test]
    fn what_cannot_be_removed_is_reported_and_others_make_room() {
        let directory = tempfile::tempdir().unwrap();
        for (day, name) in ["a", "b", "c", "d"].into_iter().enumerate() {
            bag(directory.path(), name, day as u64);
        }
        let size = find(directory.path()).unwrap()[0].size;
        let keep = RetentionLimits { days: 0, bytes: size * 5 / 2 };
        let mut asked = Vec::new();
        let removal = remove_old_bags_with(directory.path(), keep, 0, &BTreeSet::new(), |path| {
            asked.push(path.file_name().unwrap().to_str().unwrap().to_owned());
            if path.ends_with("a") {
                return Err(io::ErrorKind::PermissionDenied.into());
            }
            remove(path)
        })
        .unwrap();
        assert_eq!(asked, ["a", "b", "c"]);
        assert_eq!(removal.stuck, [(directory.path().join("a"), "permission denied".to_owned())]);
        let removed: Vec<_> = removal.removed.iter().map(|removal| &removal.path).collect();
        assert_eq!(removed, [&directory.path().join("b"), &directory.path().join("c")]);
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 2);
    }

    #[test]
    fn a_bag_that_is_due_for_a_store_stays() {
        let directory = tempfile::tempdir().unwrap();
        bag(directory.path(), "a", 0);
        bag(directory.path(), "b", 1);
        let keep = RetentionLimits { days: 1, bytes: 0 };
        let now = 9 * 86_400_000_000_000;
        let due = BTreeSet::from([directory.path().join("a")]);
        let removal = remove_old_bags(directory.path(), keep, now, &due).unwrap();
        assert_eq!((removal.removed, removal.stuck), (vec![], vec![]), "the newest stays, too");
        bag(directory.path(), "c", 2);
        let removal = remove_old_bags(directory.path(), keep, now, &due).unwrap();
        let removed: Vec<_> = removal.removed.iter().map(|removal| &removal.path).collect();
        assert_eq!(removed, [&directory.path().join("b")]);
    }

    #[test]
    fn a_bag_that_is_marked_meanwhile_stays() {
        let directory = tempfile::tempdir().unwrap();
        bag(directory.path(), "a", 0);
        bag(directory.path(), "b", 1);
        let keep = RetentionLimits { days: 1, bytes: 0 };
        let day = 86_400_000_000_000;
        let removal =
            remove_old_bags_with(directory.path(), keep, 9 * day, &BTreeSet::new(), |path| {
                mark(path, "it shows the fault").unwrap();
                remove(path)
            })
            .unwrap();
        assert_eq!(removal.stuck.len(), 1, "{removal:?}");
        assert_eq!(mark_of(&directory.path().join("a")).unwrap(), "it shows the fault");
        assert!(directory.path().join("a").join("metadata.yaml").exists());
    }

    #[test]
    fn a_mark_that_comes_between_the_look_and_the_removal_brings_the_bag_back() {
        let directory = tempfile::tempdir().unwrap();
        bag(directory.path(), "a", 0);
        let path = directory.path().join("a");
        let before = fs::read_dir(&path).unwrap().count();
        let aside = aside_of(&path).unwrap();
        check_removable(&path).unwrap();
        mark(&path, "it shows the fault").unwrap();
        fs::rename(&path, &aside).unwrap();
        remove_aside(&path, &aside).unwrap_err();
        assert_eq!(mark_of(&path).unwrap(), "it shows the fault");
        assert_eq!(fs::read_dir(&path).unwrap().count(), before + 1);
        assert!(!aside.exists());
    }

    #[test]
    fn a_removal_that_broke_off_is_gone_on_with() {
        let directory = tempfile::tempdir().unwrap();
        bag(directory.path(), "a", 0);
        bag(directory.path(), "b", 1);
        let path = directory.path().join("a");
        fs::rename(&path, aside_of(&path).unwrap()).unwrap();
        fs::remove_file(aside_of(&path).unwrap().join("metadata.yaml")).unwrap();
        let removal = remove_old_bags(
            directory.path(),
            RetentionLimits { days: 0, bytes: 1 },
            0,
            &BTreeSet::new(),
        )
        .unwrap();
        assert_eq!((removal.removed.len(), removal.stuck), (1, vec![]));
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_copy_is_no_recording_of_its_own() {
        let directory = tempfile::tempdir().unwrap();
        bag(directory.path(), "a", 0);
        let copies = directory.path().join("copies");
        let copy = copies.join("a");
        crate::files::recover_bag(&directory.path().join("a"), &copy).unwrap();
        assert_eq!(find(&copies).unwrap(), []);
        crate::files::recover_bag(&copy, &directory.path().join("again").join("a")).unwrap();
        assert_eq!(find(&directory.path().join("again")).unwrap(), []);
        assert_eq!(find(directory.path()).unwrap().len(), 1);
    }
}
