//! Where A, B, C, U, V and W arrive: a mark with their words, since a picture is of X, Y and Z.

use cnc_msgs::contour::{Action, ContourEventKind, ProgrammedContour};
use cnc_msgs::further::{FurtherAxes, FurtherMode};
use cnc_msgs::geometry::Position;

/// So many places are marked; of more, the first.
const TURNS_MAX: usize = 1_000;

/// A place of X, Y and Z, and where the other axes are then.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Turn {
    pub(crate) at: Position,
    /// `A90 C-15`
    pub(crate) words: String,
    pub(crate) line: u32,
}

/// The places of a program, in order. Where they move several times at one place, the last.
pub(crate) fn turns(contour: &ProgrammedContour) -> Vec<Turn> {
    let mut turns: Vec<Turn> = Vec::new();
    let (mut at, mut along) = (contour.start, None);
    for event in &contour.events {
        let arrived: Option<FurtherAxes> = match event.kind {
            ContourEventKind::Action(Action::Further(it)) => {
                let goes_along = it.mode == FurtherMode::Along;
                // Those of a block with motion arrive where that ends.
                along = goes_along.then_some(it.axes);
                (!goes_along).then_some(it.axes)
            }
            ContourEventKind::Motion(motion) => {
                at = motion.end;
                along.take()
            }
            ContourEventKind::Action(_) => along.take(),
            _ => None,
        };
        let Some(axes) = arrived else { continue };
        let turn = Turn { at, words: axes.words().trim().to_owned(), line: event.source.line };
        if turns.last().is_some_and(|last| last.at == at) {
            turns.pop();
        }
        if turns.len() >= TURNS_MAX {
            break;
        }
        turns.push(turn);
    }
    turns
}

#[cfg(test)]
mod tests {
    use super::*;
    use program_loader::{LoadOptions, load};

    #[test]
    fn axes_are_marked_where_they_arrive_and_of_several_at_one_place_the_last() {
        let profile = settings::load_profile("rs274").expect("the shipped profile");
        let program = "G90 G94 F100\nG0 X10 A90\nG1 X20\nG1 A0 F360\nA45\nX5 Y5 A-30.5 C10\nM2\n";
        let loaded = load(program.as_bytes(), &profile, &LoadOptions::default());
        let found: Vec<_> =
            turns(&loaded.contour).into_iter().map(|it| (it.at, it.words, it.line)).collect();
        let wanted = [
            ([10.0, 0.0, 0.0], "A90", 2),
            ([20.0, 0.0, 0.0], "A45", 5),
            ([5.0, 5.0, 0.0], "A-30.5 C10", 6),
        ];
        assert_eq!(found, wanted.map(|(at, words, line)| (at, words.to_owned(), line)));
    }
}
