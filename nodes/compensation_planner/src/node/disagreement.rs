//! Keeps programs on which the planner and its audit disagree, as files for a report.
//!
//! `kerf plan`, `kerf check`, `kerf replay` and the node write the same files. Writing has a
//! deadline, and the files are few and small: a folder of reports must not stop a machine.

use super::Planner;
use crate::tools::verdict::Disagreement;
use cnc_msgs::calls::chain_after;
use cnc_msgs::wire::cnc_msgs::srv::GetProgramChunksRequest;
use serde_yaml::{Mapping, Value};
use std::fs;
use std::io::{Error, ErrorKind, Result, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::{Duration, SystemTime};
use tokio::sync::mpsc as queue;

/// The folder, unless a parameter names another one.
pub const FOLDER: &str = "kerf-reports";

/// The most files kept; the oldest is removed.
pub const FILES_MAX: usize = 20;
/// The largest file, bytes; of a longer program it has only the beginning.
pub const FILE_BYTES_MAX: usize = 8 << 20;
/// How long writing a file may take.
pub const WITHIN: Duration = Duration::from_secs(5);

/// The most programs that wait to be kept; for others there is only a line in the log.
pub(super) const WAITING_MAX: usize = 4;
/// How long the loader may take to hand over the text.
const ASK_WITHIN: Duration = Duration::from_secs(5);
/// The most events listed. For single blocks and replans, which have no text, they are all there
/// is.
const EVENTS_MAX: usize = 1000;
const PREFIX: &str = "disagreement_";
/// The name of a file while it is written, or after a power failure.
const UNFINISHED: &str = ".part";

/// Whether a file is being written: a disk that hangs must not collect threads.
static IS_WRITING: AtomicBool = AtomicBool::new(false);

/// Keeps a program in a folder, which it creates; a program that is kept already stays as it is.
///
/// # Errors
/// The file cannot be written, or not within [`WITHIN`].
pub fn keep(
    folder: &Path,
    name: &str,
    text: &[u8],
    disagreement: &Disagreement,
) -> Result<PathBuf> {
    let (folder, file_name) = (folder.to_owned(), disagreement.file_name.clone());
    let document = document(name, text, disagreement);
    within(WITHIN, move || write(&folder, &file_name, document.as_bytes()))
}

/// Does a piece of work in a thread, and waits for it for a limited time.
fn within<T: Send + 'static>(
    limit: Duration,
    work: impl FnOnce() -> Result<T> + Send + 'static,
) -> Result<T> {
    if IS_WRITING.swap(true, Ordering::AcqRel) {
        return Err(Error::new(ErrorKind::WouldBlock, "another report is being written"));
    }
    let (done, is_done) = mpsc::sync_channel(1);
    let thread = std::thread::Builder::new().name("report".into()).spawn(move || {
        let result = work();
        IS_WRITING.store(false, Ordering::Release);
        // The receiver may have given up.
        let _ = done.send(result);
    });
    if let Err(error) = thread {
        IS_WRITING.store(false, Ordering::Release);
        return Err(error);
    }
    let late = || Error::new(ErrorKind::TimedOut, format!("not written within {limit:?}"));
    is_done.recv_timeout(limit).unwrap_or_else(|_| Err(late()))
}

/// Writes a file so that it is complete or does not exist.
fn write(folder: &Path, file_name: &str, bytes: &[u8]) -> Result<PathBuf> {
    fs::create_dir_all(folder)?;
    let path = folder.join(file_name);
    if path.try_exists()? {
        return Ok(path);
    }
    let unfinished = folder.join(format!("{file_name}.{}{UNFINISHED}", std::process::id()));
    let written = fs::File::create(&unfinished).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()
    });
    let moved = written.and_then(|()| {
        make_room(folder)?;
        fs::rename(&unfinished, &path)
    });
    if let Err(error) = moved {
        // Only the first error matters: a failed removal has the same cause.
        let _ = fs::remove_file(&unfinished);
        return Err(error);
    }
    Ok(path)
}

/// Removes unfinished files, and the oldest files to make room for one more.
fn make_room(folder: &Path) -> Result<()> {
    let mut kept: Vec<(SystemTime, PathBuf)> = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if !name.starts_with(PREFIX) {
            continue;
        }
        // Another process may have removed it.
        let Ok(modified) = entry.metadata().and_then(|file| file.modified()) else { continue };
        if !name.ends_with(UNFINISHED) {
            kept.push((modified, entry.path()));
        } else if modified.elapsed().is_ok_and(|age| age > 10 * WITHIN) {
            let _ = fs::remove_file(entry.path());
        }
    }
    kept.sort();
    let surplus = (kept.len() + 1).saturating_sub(FILES_MAX);
    for (_, oldest) in kept.into_iter().take(surplus) {
        match fs::remove_file(oldest) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
            _ => {}
        }
    }
    Ok(())
}

/// The content of the file; a text that is too long is cut off.
fn document(name: &str, text: &[u8], disagreement: &Disagreement) -> String {
    let mut length = text.len().min(FILE_BYTES_MAX / 2);
    loop {
        let document = document_of(name, text, length, disagreement);
        if document.len() <= FILE_BYTES_MAX || length == 0 {
            return document;
        }
        // Control characters take several bytes.
        length /= 4;
    }
}

fn document_of(name: &str, text: &[u8], length: usize, disagreement: &Disagreement) -> String {
    let Disagreement { contour, profile, tools, findings, .. } = disagreement;
    let yaml = |value: std::result::Result<Value, serde_yaml::Error>| value.unwrap_or(Value::Null);
    let findings: Vec<String> = findings
        .iter()
        .map(|it| {
            let calls = chain_after(&it.calls);
            format!("line {}{calls} {}: {}", it.source.line, it.code.name(), it.message)
        })
        .collect();
    let events = contour.events.iter().take(EVENTS_MAX);
    let events: Vec<String> = events.map(|event| format!("{event:?}")).collect();
    let fields = [
        ("build", Value::from(concat!("kerf ", env!("CARGO_PKG_VERSION")))),
        ("program", Value::from(name)),
        ("start_mm", yaml(serde_yaml::to_value(contour.start))),
        ("findings", yaml(serde_yaml::to_value(findings))),
        ("tools", yaml(serde_yaml::to_value(tools))),
        ("control", yaml(serde_yaml::to_value(profile))),
        ("events", yaml(serde_yaml::to_value(events))),
        ("text_bytes", Value::from(text.len())),
        ("text", Value::from(String::from_utf8_lossy(&text[..length]).into_owned())),
    ];
    let fields = fields.into_iter().map(|(key, value)| (Value::from(key), value));
    serde_yaml::to_string(&fields.collect::<Mapping>()).unwrap_or_default()
}

/// A program of the node that waits to be kept.
#[derive(Debug)]
pub(super) struct Waiting {
    name: String,
    /// The program whose text the loader has; `None` if there is none.
    program_id: Option<String>,
    disagreement: Disagreement,
}

impl Planner {
    /// Queues a program to be kept, without waiting; the log says where it is.
    pub(super) fn keep(&self, name: &str, program_id: Option<&str>, disagreement: Disagreement) {
        tracing::error!(
            "the planner and the audit of its path disagree on {name}: a defect of Kerf"
        );
        let program_id = program_id.map(str::to_owned);
        let waiting = Waiting { name: name.to_owned(), program_id, disagreement };
        if self.reports.try_send(waiting).is_err() {
            tracing::error!(
                "{name} is not kept for a report: too many others are waiting to be written"
            );
        }
    }

    /// Keeps the queued programs, one after another.
    pub(super) async fn keep_reports(&self, mut reports: queue::Receiver<Waiting>) {
        while let Some(Waiting { name, program_id, disagreement }) = reports.recv().await {
            let mut text = Vec::new();
            if let Some(program_id) = program_id {
                // As much as has arrived by then.
                let asking = self.text(&program_id, &mut text);
                let _ = tokio::time::timeout(ASK_WITHIN, asking).await;
            }
            let folder = self.report_directory.clone();
            let file = folder.join(&disagreement.file_name);
            let kept = tokio::task::spawn_blocking({
                let name = name.clone();
                move || keep(&folder, &name, &text, &disagreement)
            });
            match kept.await.unwrap_or_else(|error| Err(Error::other(error))) {
                Ok(path) => tracing::error!("{name} is kept: please report {}", path.display()),
                Err(error) => {
                    tracing::error!("{name} is not kept: cannot write {}: {error}", file.display());
                }
            }
        }
    }

    /// The text of a program, as far as the loader has it and a report takes it.
    async fn text(&self, program_id: &str, text: &mut Vec<u8>) {
        let mut first = 0;
        while text.len() <= FILE_BYTES_MAX {
            let request = GetProgramChunksRequest { program_id: program_id.to_owned(), first };
            let Ok(answer) = self.programs.call_within(request, ASK_WITHIN).await else { return };
            let Some(last) = answer.chunks.last() else { return };
            let next = last.index + 1;
            let is_complete = next >= last.chunk_count;
            text.extend(answer.chunks.iter().flat_map(|chunk| &chunk.data));
            if is_complete || next <= first {
                return;
            }
            first = next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tools::verdict::tests::{offset, sinumerik, square};
    use std::fs::FileTimes;

    fn disagreement(number: usize) -> Disagreement {
        Disagreement {
            file_name: format!("{PREFIX}{number:016x}.yaml"),
            contour: square(),
            profile: sinumerik(),
            tools: offset(5.0),
            findings: Vec::new(),
        }
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).expect("a folder");
        let name = |entry: Result<fs::DirEntry>| entry.expect("a file").file_name();
        let mut names: Vec<_> =
            entries.map(|entry| name(entry).to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// Makes a file look so many seconds old.
    fn age(path: &Path, seconds: u64) {
        let then = SystemTime::now() - Duration::from_secs(seconds);
        let file = fs::File::options().write(true).open(path).expect("a file");
        file.set_times(FileTimes::new().set_modified(then)).expect("a time");
    }

    #[test]
    fn the_oldest_files_go_and_files_of_others_stay() {
        let folder = tempfile::tempdir().expect("a folder");
        let folder = folder.path();
        fs::write(folder.join("notes.txt"), "mine").expect("written");
        for number in 0..FILES_MAX + 3 {
            let Disagreement { file_name, .. } = disagreement(number);
            let path = write(folder, &file_name, b"whole").expect("kept");
            age(&path, 1000 - number as u64);
        }
        let names = names(folder);
        assert_eq!(names.len(), FILES_MAX + 1);
        assert_eq!(names[0], disagreement(3).file_name);
        assert_eq!(names[FILES_MAX], "notes.txt");
    }

    #[test]
    fn a_file_is_whole_or_not_there_and_stays_as_it_is() {
        let folder = tempfile::tempdir().expect("a folder");
        let folder = folder.path();
        // As a process left it that was killed.
        let left = folder.join(format!("{}.1{UNFINISHED}", disagreement(1).file_name));
        fs::write(&left, "ha").expect("written");
        age(&left, 3600);
        let path = write(folder, &disagreement(1).file_name, b"whole").expect("kept");
        assert_eq!(names(folder), [disagreement(1).file_name]);
        write(folder, &disagreement(1).file_name, b"other").expect("kept");
        assert_eq!(fs::read(&path).expect("a file"), b"whole");
        // A folder in its place: nothing is left of what was begun.
        let occupied = folder.join("occupied");
        fs::write(&occupied, "a file").expect("written");
        write(&occupied, "x.yaml", b"whole").expect_err("no folder");
    }

    #[test]
    fn a_file_has_the_program_and_is_not_too_large() {
        let short = document("a.mpf", b"N10 G1 X1\n", &disagreement(1));
        let read: Mapping = serde_yaml::from_str(&short).expect("YAML");
        assert_eq!(read["text"], Value::from("N10 G1 X1\n"));
        let events = read["events"].as_sequence().map(Vec::len);
        assert_eq!(events, Some(square().events.len()));
        for byte in [b'X', 1, 0xff] {
            let text = vec![byte; FILE_BYTES_MAX + 1];
            let long = document("long.mpf", &text, &disagreement(1));
            assert!(long.len() <= FILE_BYTES_MAX && long.contains("text_bytes: 8388609"));
        }
    }

    #[test]
    fn a_disk_that_hangs_is_waited_for_only_so_long() {
        let (go_on, hangs) = mpsc::channel::<()>();
        let late = within(Duration::from_millis(20), move || {
            let _ = hangs.recv();
            Ok(())
        });
        assert_eq!(late.expect_err("it hangs").kind(), ErrorKind::TimedOut);
        let next = within(WITHIN, || Ok(()));
        assert_eq!(next.expect_err("it still hangs").kind(), ErrorKind::WouldBlock);
        drop(go_on);
        while IS_WRITING.load(Ordering::Acquire) {
            std::thread::sleep(Duration::from_millis(1));
        }
        within(WITHIN, || Ok(())).expect("the disk is there again");
    }
}
