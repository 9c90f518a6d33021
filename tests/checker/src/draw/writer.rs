//! Programs in the language of each control, and the geometry of what was written.

use super::language::Language;
use crate::piece::{Piece, Point, point};
use crate::random::Random;
use std::f64::consts::TAU;

/// Writes blocks and says what they mean.
#[derive(Debug)]
pub(super) struct Writer {
    language: Language,
    decimals: usize,
    /// Of a position: first and second axis of the plane, and the height.
    pub axes: [usize; 3],
    pub text: String,
    /// Lines written so far.
    pub line: u32,
    /// Where the tool is, as it was written.
    pub at: Point,
    words: &'static str,
}

impl Writer {
    pub(super) fn new(language: Language, decimals: usize, axes: [usize; 3]) -> Self {
        let (text, at) = (String::new(), point(0.0, 0.0));
        Self { language, decimals, axes, text, line: 0, at, words: "" }
    }

    pub(super) fn block(&mut self, words: &str) {
        self.line += 1;
        self.text += words;
        self.text.push('\n');
    }

    /// To a height, where there is one.
    pub(super) fn height(&mut self, mode: &str, height_mm: f64) {
        if !self.language.is_lathe {
            let letter = ["X", "Y", "Z"][self.axes[2]];
            self.block(&format!("{mode} {letter}{height_mm}"));
        }
    }

    /// What the next motion is written with.
    pub(super) fn with(&mut self, words: &'static str) {
        self.words = words;
    }

    fn round(&self, value: f64) -> f64 {
        let unit = 10_f64.powi(self.decimals as i32);
        // Not on a tie: what is one point on the drawing is one in the program.
        (value * unit + 1e-4).round() / unit + 0.0
    }

    /// The point that is written for another.
    pub(super) fn rounded(&self, at: Point) -> Point {
        point(self.round(at.u), self.round(at.v))
    }

    fn number(&self, letter: &str, value: f64) -> String {
        format!(" {letter}{:.*}", self.decimals, value + 0.0)
    }

    fn place(&self, at: Point) -> String {
        let letters = self.axes.map(|axis| ["X", "Y", "Z"][axis]);
        // On a lathe X is a diameter.
        let second = if self.language.is_lathe { 2.0 * at.v } else { at.v };
        self.number(letters[0], at.u) + &self.number(letters[1], second)
    }

    /// A straight move.
    pub(super) fn go(&mut self, mode: &str, to: Point) -> Piece {
        let (from, to) = (self.at, self.rounded(to));
        let words = std::mem::take(&mut self.words);
        self.block(&format!("{mode}{}{words}", self.place(to)));
        self.at = to;
        Piece::line(from, to)
    }

    /// An element of a contour, from where the tool is.
    pub(super) fn piece(&mut self, mode: &str, piece: &Piece, random: &mut Random) -> Piece {
        let Piece::Arc { center, sweep, .. } = *piece else {
            return self.go(&format!("{mode}G1"), piece.end());
        };
        let is_ccw = sweep > 0.0;
        let word = if is_ccw { "G3" } else { "G2" };
        let (from, to) = (self.at, self.rounded(piece.end()));
        let words = std::mem::take(&mut self.words);
        let letter = self.language.radius_letter.filter(|_| (0.2..2.6).contains(&sweep.abs()));
        if let Some(letter) = letter.filter(|_| random.once_in(4)) {
            let radius = self.round(center.to(piece.start()));
            let half = (to - from) * 0.5;
            let far = (radius * radius - half.dot(half)).max(0.0).sqrt();
            let center = from + half + half.unit().left() * if is_ccw { far } else { -far };
            let radius = self.number(letter, radius);
            self.block(&format!("{mode}{word}{}{radius}{words}", self.place(to)));
            self.at = to;
            return Piece::arc(from, to, center, is_ccw);
        }
        let off = self.rounded(center - from);
        let letters = self.axes.map(|axis| ["I", "J", "K"][axis]);
        let off_words = self.number(letters[0], off.u) + &self.number(letters[1], off.v);
        self.block(&format!("{mode}{word}{}{off_words}{words}", self.place(to)));
        self.at = to;
        debug_assert!(sweep.abs() <= TAU + 1e-9);
        Piece::arc(from, to, from + off, is_ccw)
    }
}
