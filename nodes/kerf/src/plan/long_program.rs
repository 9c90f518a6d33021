//! The file of a long program, of which no more than a piece is held.

use crate::exit::{CommandResult, Failure, Status};
use crate::files;
use crate::terminal::show_findings;
use cnc_msgs::finding::Finding;
use compensation_planner::node::disagreement::FILE_BYTES_MAX;
use intake::file::ReadError;
use intake::line_pieces::{LinePieces, PIECE_BYTES};
use program_loader::limits::ProgramSize;
use program_loader::pieces::{Piece, Pieces};
use program_loader::render::{render_lines, shown_lines};
use std::io::IsTerminal;
use std::path::Path;

#[derive(Debug)]
pub(super) struct LongProgram<'p> {
    path: &'p Path,
    file: LinePieces,
    /// The largest program that is held.
    held_max: ProgramSize,
    is_read: bool,
}

impl<'p> LongProgram<'p> {
    /// `None` for a file that is no longer than a piece, or cannot be read.
    pub(super) fn open(path: &'p Path) -> Option<Self> {
        Self::of(path, PIECE_BYTES as u64, ProgramSize::HELD_MAX)
    }

    /// `None` for a file of no more than so many bytes.
    pub(super) fn of(path: &'p Path, short_bytes: u64, held_max: ProgramSize) -> Option<Self> {
        let file = LinePieces::open(path).ok()?;
        (file.bytes() > short_bytes).then_some(Self { path, file, held_max, is_read: true })
    }

    pub(super) fn name(&self) -> String {
        files::file_name(self.path)
    }

    /// Whether no piece has failed.
    pub(super) fn is_read(&self) -> bool {
        self.is_read
    }

    /// Why it cannot be read and planned whole, if it cannot.
    pub(super) fn too_long(&self, lines: u32) -> Option<Finding> {
        let size = ProgramSize { bytes: self.file.bytes(), lines };
        program_loader::too_long(size, self.held_max)
    }

    /// Shows what was found in it, and ends with the verdict.
    pub(super) fn conclude(&self, is_accepted: bool, findings: &[Finding]) -> CommandResult {
        if !findings.is_empty() {
            let lines = self.lines(findings).map_err(|error| {
                Failure::usage(format_args!("cannot read {}: {error}", self.path.display()))
            })?;
            let color = std::io::stderr().is_terminal();
            show_findings(&render_lines(&self.name(), &lines, findings, color));
        }
        if is_accepted { Ok(()) } else { Err(Failure::said(Status::Refused)) }
    }

    /// The lines that are shown with findings, read again.
    pub(super) fn lines(&self, findings: &[Finding]) -> Result<Vec<(u32, String)>, ReadError> {
        let mut file = LinePieces::open(self.path)?;
        let mut before = 0;
        let mut lines = Vec::new();
        while let Some((piece, _)) = file.next_piece()? {
            let text = String::from_utf8_lossy(piece);
            let count = text.bytes().filter(|byte| *byte == b'\n').count() as u32;
            let found = shown_lines(&text, before, findings);
            lines.extend(found.into_iter().map(|(number, line)| (number, line.to_owned())));
            before += count;
        }
        Ok(lines)
    }

    /// What a report keeps of it.
    pub(super) fn beginning(&self) -> Vec<u8> {
        let mut text = Vec::new();
        if let Ok(mut file) = LinePieces::open(self.path) {
            while text.len() <= FILE_BYTES_MAX
                && let Ok(Some((piece, _))) = file.next_piece()
            {
                text.extend_from_slice(piece);
            }
        }
        text
    }
}

impl Pieces for LongProgram<'_> {
    fn next(&mut self) -> Option<Piece<'_>> {
        let piece = self.file.next_piece();
        self.is_read &= piece.is_ok();
        let (text, left) = piece.ok()??;
        Some(Piece { text, left })
    }
}
