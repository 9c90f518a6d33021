//! G70 to G72: what a lathe cycle makes of a profile.
//!
//! Geometry in the plane ZX, in mm, without words, axes and events. [`piece`] is a line or an arc, [`corners`] rounds
//! and bevels, [`frame`] turns each case into one, [`allowance`] keeps a distance from the profile, and [`passes`] cuts
//! in layers. Each uses only those before it.
//!
//! The passes are those of LinuxCNC, as its interpreter prints them.

mod allowance;
mod corners;
mod frame;
mod passes;
mod piece;

use allowance::keep_distance;
pub(crate) use corners::{Bevel, Corner};
use frame::{Frame, beside};
pub(crate) use passes::Pockets;
use passes::{Passes, rough};
pub(crate) use piece::{Circle, Piece, Point};
use piece::{apart, cross, minus};

/// A coordinate that goes back by less still runs one way, mm: three decimals of an arc's centre, rounded.
const RUNS_BACK_MM_MAX: f64 = 0.001;
/// Places that are nearer to each other are one, mm.
const SAME_MM: f64 = 1e-9;

/// The axis that a cycle cuts along.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Along {
    /// G71: in layers of X.
    Z,
    /// G72: in layers of Z.
    X,
}

impl Along {
    /// Its place in a [`Point`].
    pub(crate) const fn axis(self) -> usize {
        match self {
            Self::Z => 0,
            Self::X => 1,
        }
    }

    pub(crate) const fn letter(self) -> char {
        match self {
            Self::Z => 'Z',
            Self::X => 'X',
        }
    }

    pub(crate) const fn other(self) -> Self {
        match self {
            Self::Z => Self::X,
            Self::X => Self::Z,
        }
    }
}

/// What a cycle is asked for; lengths in mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Cut {
    /// G70: so many passes, from one distance to the profile down to another.
    Finish { passes: u32, first_mm: f64, last_mm: f64 },
    /// G71 and G72.
    Rough { along: Along, pockets: Pockets, distance_mm: f64, step_mm: f64, retract_mm: f64 },
}

/// One move of a cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Move {
    pub(crate) to: Point,
    pub(crate) is_rapid: bool,
    pub(crate) circle: Option<Circle>,
    /// The motion of the profile that it follows, by its index; `None` between them.
    pub(crate) origin: Option<usize>,
}

impl Move {
    fn rapid(to: Point) -> Self {
        Self { to, is_rapid: true, circle: None, origin: None }
    }
}

/// Why a profile cannot be cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Trouble {
    /// It has fewer than two motions.
    Short,
    /// It does not run one way along the axis, or along none; the motion by its index.
    RunsBack { along: Option<Along>, origin: usize },
    /// A fillet or chamfer does not fit between two motions, which are so long.
    Corner { origin: usize, size_mm: f64, lengths_mm: [f64; 2] },
    /// A motion goes back over the one before it.
    Reverses { origin: usize },
    /// The profile goes away from the height where the cycle begins, along this axis.
    Falls { across: Along, start: f64, first: f64, last: f64 },
    /// Where the cycle begins does not say on which side of the profile the material is.
    Side,
    /// No tool path keeps this distance.
    Distance { mm: f64 },
    /// So many moves.
    Moves { count: f64 },
}

/// The moves of a cycle, from the place where it begins.
///
/// `profile` are the motions of the subroutine after the first one, which only leads to their start. `moves_max` bounds
/// the work. Moves of no length are left out.
pub(crate) fn moves(
    profile: &[Corner],
    start: Point,
    cut: Cut,
    moves_max: f64,
) -> Result<Vec<Move>, Trouble> {
    let pieces = corners::cut(profile)?;
    if pieces.is_empty() {
        return Err(Trouble::Short);
    }
    let moves = match cut {
        Cut::Finish { passes, first_mm, last_mm } => {
            let count = f64::from(passes) * (2.0 * pieces.len() as f64 + 3.0);
            if count > moves_max {
                return Err(Trouble::Moves { count });
            }
            finish(&pieces, start, (passes, first_mm, last_mm))?
        }
        Cut::Rough { along, pockets, distance_mm, step_mm, retract_mm } => {
            let frame = Frame::of(&pieces, start, along)?;
            let pieces = frame.within(&pieces);
            let start = frame.point_within(start);
            frame.check_rise(&pieces, start)?;
            let begin = beside(&pieces, start);
            let pieces = keep_distance(&pieces, distance_mm)?;
            let passes = Passes { pockets, step_mm, retract_mm, moves_max };
            frame.without(rough(&pieces, begin, passes)?)
        }
    };
    Ok(without_stops(start, moves))
}

/// G70.
fn finish(
    pieces: &[Piece],
    start: Point,
    (passes, first_mm, last_mm): (u32, f64, f64),
) -> Result<Vec<Move>, Trouble> {
    let frames = [Along::Z, Along::X].map(|along| Frame::of(pieces, start, along));
    let keeps_away = first_mm.max(last_mm) > 0.0;
    let frame = match frames {
        // A face may run one way along Z, too.
        [Ok(one), Ok(other)] => {
            let [tells, other_tells] = [one, other].map(|it| !it.is_level(pieces, start));
            let differs = one.is_mirrored() != other.is_mirrored();
            let is_face = one.runs_towards_plus();
            if keeps_away && differs && is_face && tells && other_tells {
                let (first, last) = (pieces[0].from, pieces[pieces.len() - 1].to);
                let side = cross(minus(last, first), minus(start, first));
                if side.abs() <= SAME_MM {
                    return Err(Trouble::Side);
                }
                if one.is_mirrored() == (side < 0.0) { one } else { other }
            } else if !tells && other_tells {
                other
            } else {
                one
            }
        }
        [Ok(one), Err(_)] | [Err(_), Ok(one)] => one,
        [Err(Trouble::RunsBack { origin, .. }), Err(_)] => {
            return Err(Trouble::RunsBack { along: None, origin });
        }
        [Err(trouble), Err(_)] => return Err(trouble),
    };
    let within = frame.within(pieces);
    if keeps_away && frame.is_level(pieces, start) && frame.is_flat(pieces) {
        return Err(Trouble::Side);
    }
    // Into the profile from beside its beginning, not across it.
    let beside = frame.beside(&within, start);
    let mut moves = Vec::new();
    for pass in (1..=passes).rev() {
        let share = f64::from(pass - 1) / f64::from(passes);
        let distance_mm = share * (first_mm - last_mm) + last_mm;
        let path = frame.without_pieces(keep_distance(&within, distance_mm)?);
        let begin = path.first().map_or(start, |piece| piece.from);
        moves.extend([start, beside, begin].map(Move::rapid));
        moves.extend(path.iter().map(Piece::feed));
    }
    Ok(moves)
}

/// Leaves out moves of no length.
fn without_stops(start: Point, moves: Vec<Move>) -> Vec<Move> {
    let mut at = start;
    let mut kept = moves;
    kept.retain(|it| {
        let moves = apart(at, it.to) > SAME_MM;
        if moves {
            at = it.to;
        }
        moves
    });
    kept
}
