//! Where A, B, C, U, V and W arrive: marks with their words, since a picture is of X, Y and Z.

use super::view::{Point, View};
use cnc_msgs::contour::{Action, ContourEventKind, ProgrammedContour};
use cnc_msgs::further::FurtherMode;
use cnc_msgs::geometry::Position;
use std::collections::BTreeMap;

/// So many places are marked; of more, the first.
const MARKS_MAX: usize = 1_000;
/// So many arrivals at one place are written out.
const WORDS_MAX: usize = 4;

/// A place on the paper, and where the other axes arrive there, in order.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Mark {
    pub(crate) at: Point,
    /// `A0, A90 C-15`
    pub(crate) words: String,
    /// The line of the first.
    pub(crate) line: u32,
}

/// The marks of a program. Of several moves while X, Y and Z stand, the last arrives.
pub(crate) fn marks(contour: &ProgrammedContour, view: View) -> Vec<Mark> {
    let mut marks: Vec<Mark> = Vec::new();
    // The index of a mark, and how many have arrived there.
    let mut by_place: BTreeMap<[i64; 2], (usize, usize)> = BTreeMap::new();
    for (at, words, line) in arrivals(contour) {
        let at = view.project(at);
        let place = at.map(|value| (value * 1e3).round() as i64);
        match by_place.get_mut(&place) {
            Some((index, count)) => {
                *count += 1;
                match *count {
                    ..=WORDS_MAX => marks[*index].words += &format!(", {words}"),
                    count if count == WORDS_MAX + 1 => marks[*index].words += ", ...",
                    _ => {}
                }
            }
            None if marks.len() < MARKS_MAX => {
                by_place.insert(place, (marks.len(), 1));
                marks.push(Mark { at, words, line });
            }
            None => {}
        }
    }
    marks
}

/// Where X, Y and Z are when other axes arrive, with the words and the line.
fn arrivals(contour: &ProgrammedContour) -> Vec<(Position, String, u32)> {
    let mut arrivals: Vec<(Position, String, u32)> = Vec::new();
    let (mut at, mut along) = (contour.start, None);
    // Nothing has moved X, Y and Z since the last arrival.
    let mut stands = false;
    for event in &contour.events {
        let arrived = match event.kind {
            ContourEventKind::Action(Action::Further(it)) => {
                let goes_along = it.mode == FurtherMode::Along;
                // Those of a block with motion arrive where that ends.
                along = goes_along.then_some(it.axes);
                (!goes_along).then_some(it.axes)
            }
            ContourEventKind::Motion(motion) => {
                stands &= at == motion.end;
                at = motion.end;
                along.take()
            }
            ContourEventKind::Action(_) => along.take(),
            _ => None,
        };
        let Some(axes) = arrived else { continue };
        if std::mem::replace(&mut stands, true) {
            arrivals.pop();
        }
        arrivals.push((at, axes.words().trim().to_owned(), event.source.line));
    }
    arrivals
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::geometry::Plane;
    use program_loader::{LoadOptions, load};

    #[test]
    fn axes_are_marked_where_they_arrive_and_places_have_one_mark() {
        let profile = settings::load_profile("rs274").expect("the shipped profile");
        let program = "G90 G94 F100\nG0 X10 A90\nG1 X20\nG1 A0 F360\nA45\nX5 Y5 A-30.5 C10\nX10 Y0 A1\n\
                       X20\nX10 A2\nX9\nX10 A3\nX9\nX10 A4\nX9\nX10 A5\nM2\n";
        let loaded = load(program.as_bytes(), &profile, &LoadOptions::default());
        let view = View { plane: Plane::Xy, is_mirrored: false };
        let found: Vec<_> =
            marks(&loaded.contour, view).into_iter().map(|it| (it.at, it.words, it.line)).collect();
        let wanted = [
            ([10.0, 0.0], "A90, A1, A2, A3, ...", 2),
            ([20.0, 0.0], "A45", 5),
            ([5.0, -5.0], "A-30.5 C10", 6),
        ];
        assert_eq!(found, wanted.map(|(at, words, line)| (at, words.to_owned(), line)));
    }
}
