//! A bag as a store keeps it: one file. The files of a split bag are joined in memory.

use bytes::Bytes;
use run_recorder::bag_reader::{Problem, RUN_RECORD};
use run_recorder::files::open_bag;
use run_recorder::recover::{CopySelection, recover};
use run_recorder::stored_bags::MARK_FILE;
use std::fs;
use std::path::{Path, PathBuf};

/// The largest bag that is read, bytes.
const BYTES_MAX: u64 = 4 << 30;

/// A bag that was read.
#[derive(Debug)]
pub struct BagFile {
    /// Where it was, for messages.
    pub name: String,
    pub content: Bytes,
    /// Why it was marked as one to keep.
    pub mark: Option<String>,
}

/// Reads the bag in a folder, or a bare file; the error says why it is refused, and what to do.
///
/// A split bag makes the same bytes each time that this build joins it, whatever its folder is called.
pub fn read(path: &Path) -> Result<BagFile, String> {
    // The mark is next to the file, whichever of file and folder is given.
    let mark = |folder: &Path| {
        fs::read_to_string(folder.join(MARK_FILE)).ok().map(|it| it.trim().to_owned())
    };
    let files = if path.is_dir() { files_of(path)? } else { vec![path.to_owned()] };
    let [file] = &files[..] else {
        return Ok(BagFile {
            name: path.display().to_string(),
            content: joined(path, &files)?,
            mark: mark(path),
        });
    };
    let content = intake::file::read(file, BYTES_MAX).map_err(|why| why.to_string())?;
    let mark = file.parent().and_then(mark);
    Ok(BagFile { name: file.display().to_string(), content: Bytes::from(content), mark })
}

/// The MCAP files of a folder; at least one.
fn files_of(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = fs::read_dir(folder).map_err(|why| why.to_string())?;
    let files = entries.flatten().map(|entry| entry.path());
    let files: Vec<PathBuf> =
        files.filter(|it| it.extension().is_some_and(|it| it == "mcap")).collect();
    if files.is_empty() {
        return Err("no .mcap file is in this folder".to_owned());
    }
    Ok(files)
}

/// One file with everything that the files of a split bag have.
fn joined(folder: &Path, files: &[PathBuf]) -> Result<Bytes, String> {
    let sizes = files.iter().map(|file| fs::metadata(file).map_or(0, |it| it.len()));
    let bytes: u64 = sizes.sum();
    if bytes > BYTES_MAX {
        return Err(format!(
            "its {} files have {} MB together, and a bag may have {}; push a part that `kerf bag trim` makes",
            files.len(),
            bytes >> 20,
            BYTES_MAX >> 20
        ));
    }
    let mut bag = open_bag(folder).map_err(|why| why.to_string())?;
    let mut runs: Vec<_> = bag.metadata().iter().filter(|it| it.name == RUN_RECORD).collect();
    // Each file of a split bag repeats the record of the run.
    runs.dedup_by(|one, other| one.values == other.values);
    if runs.len() > 1 {
        let count = files.len();
        return Err(format!("its {count} files are not of one run; push each file by itself"));
    }
    let run = runs.pop().map(|it| it.values.clone()).unwrap_or_default();
    let sink = Vec::with_capacity(usize::try_from(bytes).unwrap_or(0));
    let joined = recover(&mut bag, sink, "bag_0.mcap", &run, CopySelection::ALL);
    let (content, copied) = joined.map_err(|why| why.to_string())?;
    check(bag.problems())?;
    if let Some((topic, why)) = copied.left_out.first() {
        return Err(format!(
            "its files cannot be joined: topic {topic}: {why}; `kerf bag recover BAG NEW` leaves it out: push NEW"
        ));
    }
    Ok(Bytes::from(content))
}

/// Refuses a bag that is damaged, or that a recorder may still be writing.
pub fn check(problems: &[Problem]) -> Result<(), String> {
    let damages = problems.iter().filter(|it| it.is_damage() && !it.is_of_index());
    let damages: Vec<String> = damages.map(Problem::to_string).collect();
    if damages.is_empty() {
        return Ok(());
    }
    let is_part =
        |it: &Problem| matches!(it, Problem::PartMissing { .. } | Problem::LastPartMissing { .. });
    let advice = if problems.iter().any(is_part) {
        "if the other files of this bag are there, push their folder; else "
    } else {
        "if no recorder is writing it, "
    };
    Err(format!(
        "{}; {advice}`kerf bag recover BAG NEW` copies what can be read: push the copy",
        damages.join("; ")
    ))
}
