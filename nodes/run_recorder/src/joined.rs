//! Walks the files of a split bag and checks that none is missing.

use std::io::{Read, Seek};

use crate::bag_problem::{BagError, Problem};
use crate::bag_reader::{BagSource, RESULT_RECORD};
use crate::scan::{Scan, scan};

/// Walks all files. Unreadable files are reported; if all are unreadable, that is an error.
pub(crate) fn scan_all<R: Read + Seek>(
    sources: &mut [BagSource<R>],
    problems: &mut Vec<Problem>,
) -> Result<Vec<(usize, Scan)>, BagError> {
    let mut found = Vec::new();
    let mut first_error = None;
    for (index, source) in sources.iter_mut().enumerate() {
        match scan(&source.name, &mut source.reader) {
            Ok(scan) => found.push((index, scan)),
            Err(error @ BagError::Io { .. }) => return Err(error),
            Err(error) => {
                problems.push(Problem::FileUnreadable { why: error.to_string() });
                first_error.get_or_insert(error);
            }
        }
    }
    match first_error {
        Some(error) if found.is_empty() => Err(error),
        _ => Ok(found),
    }
}

/// Checks that no part of a split bag is missing.
#[derive(Default)]
pub(crate) struct PartsRead {
    /// The part before this one was read to its end, so what this one repeats is known.
    pub(crate) has_earlier: bool,
    /// The last part that was read, and whether it was finished.
    before: Option<(u64, bool)>,
    next: u64,
    /// File and number of the last part, until the end of the run was read.
    open: Option<(String, u64)>,
}

impl PartsRead {
    /// Takes the next file.
    pub(crate) fn take(&mut self, file: &str, found: &Scan, problems: &mut Vec<Problem>) {
        let before = self.before.take();
        self.has_earlier = false;
        let Some(part) = found.part else { return };
        self.has_earlier = part.checked_sub(1).is_some_and(|last| before == Some((last, true)));
        self.before = Some((part, found.is_finished));
        if part != self.next {
            let (file, expected) = (file.to_owned(), self.next);
            problems.push(Problem::PartMissing { file, part, expected });
        }
        self.next = part.saturating_add(1);
        let has_end = found.metadata.iter().any(|record| record.name == RESULT_RECORD);
        // A truncated file is reported anyway.
        self.open = (found.is_finished && !has_end).then(|| (file.to_owned(), part));
    }

    /// There are no more files.
    pub(crate) fn end(self, problems: &mut Vec<Problem>) {
        if let Some((file, part)) = self.open {
            problems.push(Problem::LastPartMissing { file, part });
        }
    }
}
