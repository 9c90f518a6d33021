//! Reads a long file in pieces of whole lines, so that it is never held whole.

use crate::file::{ReadError, open};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Bytes of a piece, at most.
pub const PIECE_BYTES: usize = 1 << 20;

/// A file that is read from its beginning to the end that it had when it was opened.
#[derive(Debug)]
pub struct LinePieces {
    file: File,
    /// Bytes of the file, and those that have not been read yet.
    bytes: u64,
    left: u64,
    /// What was read; that before `given` has been given.
    read: Vec<u8>,
    given: usize,
}

impl LinePieces {
    /// Opens a regular file.
    ///
    /// # Errors
    /// As [`open`].
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let file = open(path)?;
        let bytes = file.metadata()?.len();
        Ok(Self { file, bytes, left: bytes, read: Vec::new(), given: 0 })
    }

    /// Bytes of the file.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The next lines, with their ends, and how many bytes follow them; nothing at the end.
    ///
    /// # Errors
    /// The file cannot be read, has become shorter or longer, or has a line of more than [`PIECE_BYTES`].
    pub fn next_piece(&mut self) -> Result<Option<(&[u8], u64)>, ReadError> {
        self.read.drain(..std::mem::take(&mut self.given));
        let room = (PIECE_BYTES - self.read.len()) as u64;
        let wanted = room.min(self.left);
        if (&self.file).take(wanted).read_to_end(&mut self.read)? as u64 != wanted {
            return Err(ReadError::Shrank { bytes: self.bytes });
        }
        self.left -= wanted;
        if self.read.is_empty() {
            return Ok(None);
        }
        self.given = match self.left {
            0 if self.file.metadata()?.len() > self.bytes => {
                return Err(ReadError::Grew { most: self.bytes });
            }
            0 => self.read.len(),
            _ => {
                let end = self.read.iter().rposition(|byte| *byte == b'\n');
                end.ok_or(ReadError::LongLine { most: PIECE_BYTES })? + 1
            }
        };
        let after = self.left + (self.read.len() - self.given) as u64;
        Ok(Some((&self.read[..self.given], after)))
    }
}

/// The lines of a file.
///
/// # Errors
/// As [`LinePieces::next_piece`].
pub fn count_lines(path: &Path) -> Result<u64, ReadError> {
    let mut pieces = LinePieces::open(path)?;
    let mut lines = 0;
    while let Some((piece, _)) = pieces.next_piece()? {
        lines += piece.iter().filter(|byte| **byte == b'\n').count() as u64;
        lines += u64::from(!piece.ends_with(b"\n"));
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pieces of a file, each with what follows it.
    fn pieces(path: &Path) -> Result<Vec<(Vec<u8>, u64)>, ReadError> {
        let mut pieces = LinePieces::open(path)?;
        let mut all = Vec::new();
        while let Some((text, left)) = pieces.next_piece()? {
            all.push((text.to_vec(), left));
        }
        Ok(all)
    }

    #[test]
    fn the_pieces_are_whole_lines_and_all_of_the_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("long.ngc");
        let line = b"G1 X10.5 Y-3.25 (a line)\n";
        for (lines, end) in [(0, ""), (0, "M2"), (3, ""), (200_000, ""), (200_000, "M2")] {
            let mut text = line.repeat(lines);
            text.extend_from_slice(end.as_bytes());
            std::fs::write(&path, &text).expect("written");
            let found = pieces(&path).expect("read");
            let mut left = text.len() as u64;
            for (piece, after) in &found {
                left -= piece.len() as u64;
                assert_eq!(*after, left);
                assert!(*after == 0 || piece.ends_with(b"\n") && piece.len() <= PIECE_BYTES);
            }
            assert_eq!(found.into_iter().flat_map(|it| it.0).collect::<Vec<_>>(), text);
            assert_eq!(count_lines(&path).expect("read"), (lines + end.lines().count()) as u64);
        }
    }

    #[test]
    fn a_line_that_is_longer_than_a_piece_and_a_file_that_changes_are_errors() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("long.ngc");
        std::fs::write(&path, vec![b'x'; PIECE_BYTES + 1]).expect("written");
        assert!(matches!(pieces(&path), Err(ReadError::LongLine { .. })));
        std::fs::write(&path, b"G1 X1\n".repeat(PIECE_BYTES / 3)).expect("written");
        let mut open = LinePieces::open(&path).expect("opened");
        assert!(open.next_piece().is_ok_and(|it| it.is_some()));
        std::fs::write(&path, "M2").expect("written");
        assert!(matches!(open.next_piece(), Err(ReadError::Shrank { .. })));
        let mut open = LinePieces::open(&path).expect("opened");
        std::fs::write(&path, "M2\nG1 X").expect("written");
        assert!(matches!(open.next_piece(), Err(ReadError::Grew { most: 2 })));
    }
}
