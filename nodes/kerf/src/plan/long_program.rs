//! The file of a long program, of which no more than a piece is held.

use crate::exit::{CommandResult, Failure, Status};
use crate::files;
use crate::terminal::show_findings;
use cnc_msgs::finding::Finding;
use compensation_planner::node::disagreement::FILE_BYTES_MAX;
use intake::file::ReadError;
use intake::line_pieces::{LinePieces, count_lines};
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
    /// Why a piece could not be read.
    failure: Option<ReadError>,
}

impl<'p> LongProgram<'p> {
    /// `None` for a program that can be held, or cannot be read.
    pub(super) fn open(path: &'p Path) -> Option<Self> {
        Self::of(path, ProgramSize::HELD_MAX)
    }

    /// The same where no more than this is held.
    pub(super) fn of(path: &'p Path, held_max: ProgramSize) -> Option<Self> {
        let file = LinePieces::open(path).ok()?;
        let is_long = file.bytes() > held_max.bytes
            || file.bytes() > held_max.lines.into()
                && count_lines(path).is_ok_and(|lines| lines > held_max.lines.into());
        is_long.then_some(Self { path, file, held_max, failure: None })
    }

    pub(super) fn name(&self) -> String {
        files::file_name(self.path)
    }

    /// Whether no piece has failed.
    pub(super) fn is_read(&self) -> bool {
        self.failure.is_none()
    }

    /// What is said where a piece has failed.
    pub(super) fn failure(&self) -> Option<Failure> {
        let path = self.path.display();
        self.failure
            .as_ref()
            .map(|error| Failure::usage(format_args!("cannot read {path}: {error}")))
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
        let places = findings.iter().flat_map(|it| [Some(it.source), it.other]).flatten();
        let last = places.map(|place| place.line).max().unwrap_or_default();
        while before < last
            && let Some((piece, _)) = file.next_piece()?
        {
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
        match piece {
            Ok(piece) => piece.map(|(text, left)| Piece { text, left }),
            Err(error) => {
                self.failure.get_or_insert(error);
                None
            }
        }
    }
}
