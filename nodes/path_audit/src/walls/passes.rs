//! Finds what bounds the tool: the passes of a contour, without their tails.
//!
//! A pass ends where the contour returns to a point that it has already passed. A tail is the piece
//! from a free end of a pass to the first place where the pass meets itself.

use crate::geometry::distance_bounds;
use crate::geometry::pieces::Pieces;
use crate::geometry::planar::{Piece, Point, cross, crossings, left, unit};
use crate::geometry::strip_tree::{self, StripTree};
use crate::walls::retraced_legs::RetracedLegs;
use std::ops::Range;

/// Places so near each other count as one, mm.
const MEET_MM: f64 = 1.5e-6;
/// Legs that stay so close to one line count as one, mm; a contour does not meet itself within.
const MERGE_MM: f64 = 1e-4;
/// One arc continues another if its circle passes so near to the end of the other, mm.
const ENDS_MM: f64 = 1e-7;
/// A loop of a smaller mean width has no inside, mm.
const LOOP_MM: f64 = 2e-3;
/// Meetings kept for each leg, plus a constant; and the same before looking for retraced legs.
const MEETINGS_MAX: (usize, usize) = (4, 200_000);
const FEW: (usize, usize) = (4, 100);

/// A place on a leg, mm from its start.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
struct PlaceOnLeg {
    leg: usize,
    along: f64,
}

#[derive(Debug, Clone, Copy)]
struct Meeting {
    early: PlaceOnLeg,
    late: PlaceOnLeg,
    is_return: bool,
}

#[derive(Debug)]
struct Pass {
    legs: Range<usize>,
    begin: Option<PlaceOnLeg>,
    end: Option<PlaceOnLeg>,
}

#[derive(Debug)]
pub(crate) struct Passes {
    passes: Vec<Pass>,
}

impl Passes {
    /// The passes of a span; `None` when its legs meet too often to check.
    pub(crate) fn of(tree: &StripTree<'_>) -> Option<Self> {
        let meetings = meetings(tree, FEW, |_| true, true)?;
        Some(Self::between(tree.pieces, meetings))
    }

    /// The passes of a span that retraces itself.
    pub(crate) fn of_copies(tree: StripTree<'_>, copies: &RetracedLegs) -> Option<Self> {
        let is_first = |leg: usize| copies.is_first(leg);
        let tree = tree.holding(is_first);
        let meetings = meetings(&tree, MEETINGS_MAX, is_first, false)?;
        Some(Self::between(tree.pieces, of_all(tree.pieces, copies, &meetings)))
    }

    fn between(legs: &Pieces, mut meetings: Vec<Meeting>) -> Self {
        if !meetings.is_empty() {
            let sums = Sums::of(legs);
            meetings.retain(|meeting| sums.is_wide(legs, meeting));
            of_whole_rings(legs, &mut meetings);
        }
        meetings.sort_by(|a, b| a.late.partial_cmp(&b.late).unwrap_or(std::cmp::Ordering::Equal));
        let mut passes: Vec<Pass> = Vec::new();
        // Where the first loop closes, and where the last loop ends.
        let mut loops: Option<(PlaceOnLeg, PlaceOnLeg)> = None;
        let mut start = 0;
        for meeting in meetings.iter().filter(|meeting| meeting.is_return) {
            if meeting.early.leg >= start && meeting.late.leg >= start {
                passes.push(Pass { legs: start..meeting.late.leg + 1, begin: None, end: None });
                start = meeting.late.leg + 1;
                let (first, _) = loops.unwrap_or((meeting.early, meeting.late));
                loops = Some((first, meeting.late));
            }
        }
        if start < legs.count() {
            passes.push(Pass { legs: start..legs.count(), begin: None, end: None });
        }
        let mut next = 0;
        for pass in &mut passes {
            while let Some(meeting) = meetings.get(next).filter(|m| m.late.leg < pass.legs.end) {
                next += 1;
                if meeting.early.leg < pass.legs.start {
                    continue;
                }
                if pass.begin.is_none_or(|begin| meeting.early < begin) {
                    pass.begin = Some(meeting.early);
                }
                if pass.end.is_none_or(|end| meeting.late > end) {
                    pass.end = Some(meeting.late);
                }
            }
        }
        if let Some((first, last)) = loops.filter(|_| passes.len() > 1) {
            free_ends(&mut passes, &meetings, first, last);
        }
        Self { passes }
    }

    /// The number of the pass that a leg belongs to.
    pub(crate) fn pass(&self, leg: usize) -> usize {
        if self.passes.len() == 1 {
            return 0;
        }
        self.passes.partition_point(|pass| pass.legs.end <= leg)
    }

    /// Whether all of a leg is a wall for every other leg.
    pub(crate) fn is_whole(&self, leg: usize) -> bool {
        self.passes.get(self.pass(leg)).is_some_and(|pass| {
            pass.begin.is_none_or(|begin| leg > begin.leg)
                && pass.end.is_none_or(|end| leg < end.leg)
        })
    }

    /// The part of a leg that is a wall for the tool at a place of another leg (index, mm along
    /// it), or for any tool. `None` when all of it is a tail. A tail bounds only what runs along
    /// it.
    pub(crate) fn wall(
        &self,
        on: Option<(usize, f64)>,
        leg: usize,
        piece: &Piece,
    ) -> Option<Piece> {
        let number = self.pass(leg);
        let pass = self.passes.get(number)?;
        let on = on.map(|(leg, along)| PlaceOnLeg { leg, along });
        let on = on.filter(|on| self.pass(on.leg) == number);
        let (mut from, mut to) = (0.0, piece.length());
        if let Some(end) = pass.end
            && on.is_none_or(|on| on <= end)
        {
            if leg > end.leg {
                return None;
            }
            if leg == end.leg {
                to = end.along;
            }
        }
        if let Some(begin) = pass.begin
            && on.is_none_or(|on| on >= begin)
        {
            if leg < begin.leg {
                return None;
            }
            if leg == begin.leg {
                from = begin.along;
            }
        }
        if from <= 0.0 && to >= piece.length() {
            return Some(*piece);
        }
        (from < to).then(|| piece.part(from, to))
    }

    /// The first and the last wall of the pass that a leg belongs to.
    pub(crate) fn ends(&self, leg: usize) -> Option<(usize, usize)> {
        let pass = self.passes.get(self.pass(leg))?;
        let first = pass.begin.map_or(pass.legs.start, |begin| begin.leg);
        let last = pass.end.map_or(pass.legs.end.saturating_sub(1), |end| end.leg);
        Some((first, last))
    }

    /// The legs of a pass.
    pub(crate) fn legs(&self, pass: usize) -> Range<usize> {
        self.passes[pass].legs.clone()
    }
}

/// The tails before the first loop and after the last. They may cross each other; they end only
/// where they meet a loop.
fn free_ends(passes: &mut [Pass], meetings: &[Meeting], first: PlaceOnLeg, last: PlaceOnLeg) {
    let least = |a: PlaceOnLeg, b: PlaceOnLeg| if b < a { b } else { a };
    let most = |a: PlaceOnLeg, b: PlaceOnLeg| if b > a { b } else { a };
    let leads_on = meetings.iter().filter(|meeting| meeting.late <= last);
    passes[0].begin = leads_on.map(|meeting| meeting.early).reduce(least);
    let Some(last_pass) = passes.last_mut().filter(|pass| pass.legs.start > last.leg) else {
        return;
    };
    let leads_off = meetings.iter().filter(|meeting| meeting.early >= first);
    let start = PlaceOnLeg { leg: last_pass.legs.start, along: 0.0 };
    last_pass.end = leads_off.map(|meeting| meeting.late).chain([start]).reduce(most);
}

/// Finds the meetings that count. A leg begins where the one before it ends; that counts only if it
/// may be another copy that ends there.
fn meetings(
    tree: &StripTree<'_>,
    most: (usize, usize),
    counts: impl Fn(usize) -> bool,
    skips_joints: bool,
) -> Option<Vec<Meeting>> {
    let legs = tree.pieces;
    let mut found: Vec<Meeting> = Vec::new();
    for leg in (0..legs.count()).filter(|leg| counts(*leg)) {
        if (legs.end(leg) - legs.begin(leg)).norm_squared() > MEET_MM * MEET_MM {
            continue;
        }
        let piece = legs.piece(leg);
        if piece.length() > MERGE_MM {
            let late = PlaceOnLeg { leg, along: piece.length() };
            found.push(Meeting { early: PlaceOnLeg { leg, along: 0.0 }, late, is_return: true });
        }
    }
    let most = most.0 * legs.count() + most.1;
    // Within one range of directions two places are at least half the path between them apart. So
    // legs that meet there are at one place of the contour, which is no meeting.
    let is_complete = strip_tree::near_itself(tree, MEET_MM, |early, late| {
        for late in late.filter(|late| counts(*late)) {
            for early in (early.start..early.end.min(late)).filter(|early| counts(*early)) {
                meet(legs, (early, late), skips_joints && early + 1 == late, &mut found);
            }
        }
        found.len() < most
    });
    is_complete.then_some(found)
}

/// The meetings of all copies: of each leg with those before it, the first and the last of them.
fn of_all(legs: &Pieces, copies: &RetracedLegs, of_firsts: &[Meeting]) -> Vec<Meeting> {
    let mut meetings: Vec<Vec<(PlaceOnLeg, PlaceOnLeg)>> = vec![Vec::new(); legs.count()];
    for leg in (0..legs.count()).filter(|leg| copies.is_first(*leg)) {
        let place = |along: f64| PlaceOnLeg { leg, along };
        let length = legs.piece(leg).length();
        meetings[leg].extend([0.0, length].map(|along| (place(along), place(along))));
    }
    for &Meeting { early, late, .. } in of_firsts {
        meetings[late.leg].push((late, early));
        if early.leg != late.leg {
            meetings[early.leg].push((early, late));
        }
    }
    let mut found = Vec::new();
    for leg in 0..legs.count() {
        let length = legs.piece(leg).length();
        for &(own, other) in &meetings[copies.of_leg(leg)[0]] {
            let is_own_loop = own.leg == other.leg && own.along > other.along;
            let itself = is_own_loop.then_some(leg);
            for before in copies.before(other.leg, leg).chain(itself) {
                let is_joint = before + 1 == leg
                    && own.along <= MEET_MM
                    && other.along >= legs.piece(before).length() - MEET_MM;
                if !is_joint {
                    let is_return = own.along >= length - MEET_MM && !runs_on(legs, leg);
                    let early = PlaceOnLeg { leg: before, ..other };
                    found.push(Meeting { early, late: PlaceOnLeg { leg, ..own }, is_return });
                }
            }
        }
    }
    found
}

/// The rounding of long sums hides loops of so few legs.
const SHORT: usize = 50;

/// Running sums over the legs: twice the area swept about the start of the first leg, mm², and the
/// length.
struct Sums(Vec<[f64; 2]>);

impl Sums {
    fn of(legs: &Pieces) -> Self {
        if legs.count() <= SHORT {
            return Self(Vec::new());
        }
        let start = legs.begin(0);
        let mut sum = [0.0; 2];
        let mut before = vec![sum];
        for leg in 0..legs.count() {
            let [area, length] = swept(&legs.piece(leg), start);
            sum = [sum[0] + area, sum[1] + length];
            before.push(sum);
        }
        Self(before)
    }

    /// Whether the legs between two passings of a place enclose more than noise. A contour that
    /// only goes back over itself has not returned.
    fn is_wide(&self, legs: &Pieces, meeting: &Meeting) -> bool {
        let (PlaceOnLeg { leg: early, along: begin }, PlaceOnLeg { leg: late, along: end }) =
            (meeting.early, meeting.late);
        if early == late {
            return true;
        }
        let (first, last) = (legs.piece(early), legs.piece(late));
        let parts = [first.part(begin, first.length()), last.part(0.0, end)];
        let is_short = late - early <= SHORT;
        let from = if is_short { parts[0].from } else { legs.begin(0) };
        let mut sum = [0.0; 2];
        let mut add = |[area, length]: [f64; 2]| sum = [sum[0] + area, sum[1] + length];
        if is_short {
            (early + 1..late).for_each(|leg| add(swept(&legs.piece(leg), from)));
        } else {
            let (begin, end) = (self.0[early + 1], self.0[late]);
            add([end[0] - begin[0], end[1] - begin[1]]);
        }
        parts.iter().for_each(|part| add(swept(part, from)));
        sum[0].abs() > LOOP_MM * sum[1]
    }
}

/// Twice the area between a piece and a point, mm², and the length of the piece.
fn swept(piece: &Piece, from: Point) -> [f64; 2] {
    let bend = piece
        .round
        .map_or(0.0, |round| round.radius * round.radius * (round.sweep - round.sweep.sin()));
    [cross(piece.from - from, piece.to - from) + bend, piece.length()]
}

/// Blocks that retrace a ring belong to it, however many they are: the contour returns where it
/// leaves the circle.
fn of_whole_rings(legs: &Pieces, meetings: &mut [Meeting]) {
    // The first leg of the same circle without a break.
    let mut firsts: Vec<usize> = (0..legs.count()).collect();
    for leg in 1..legs.count() {
        if goes_around(&legs.piece(leg - 1), &legs.piece(leg)) {
            firsts[leg] = firsts[leg - 1];
        }
    }
    for Meeting { early, late, is_return } in meetings {
        let goes_on = firsts.get(late.leg + 1).is_some_and(|first| *first <= late.leg);
        let is_at_end = early.along >= legs.piece(early.leg).length() - MEET_MM;
        *is_return &= !(goes_on && firsts[late.leg] <= early.leg + usize::from(is_at_end));
    }
}

/// Whether one arc continues another on the same circle.
fn goes_around(a: &Piece, b: &Piece) -> bool {
    let (Some(before), Some(after)) = (&a.round, &b.round) else { return false };
    let (off, longer) = (before.center - after.center, before.radius - after.radius);
    let ends_there = (off + unit(b.to - after.center) * longer).norm() <= ENDS_MM;
    let is_same = off.norm() + longer.abs() <= MERGE_MM && ends_there;
    before.sweep * after.sweep > 0.0 && is_same
}

/// How many legs may lead to a closed contour, plus one.
const LEADING_LEGS: usize = 4;

/// Whether a line continues in the next leg, so that its end is no end of a wall. A contour that
/// returns to its beginning, or to the end of what leads to it, is still one line there.
fn runs_on(legs: &Pieces, leg: usize) -> bool {
    if leg + 1 >= legs.count() {
        return false;
    }
    let (a, b) = (legs.piece(leg), legs.piece(leg + 1));
    let comes_back = |first: usize| (legs.begin(first) - a.to).norm() <= MEET_MM;
    if !(a.is_line() && b.is_line()) || (0..LEADING_LEGS.min(leg)).any(comes_back) {
        return false;
    }
    let (da, db) = (a.to - a.from, b.to - b.from);
    let longer = da.norm().max(db.norm());
    da.dot(&db) > 0.0 && cross(unit(da), unit(db)).abs() * da.norm().min(db.norm()) <= MERGE_MM
        || longer <= MERGE_MM
}

/// Whether a line and an arc of less than half a turn part at their tangent joint: neither ends on
/// the other.
fn parts_from(legs: &Pieces, early: usize, late: usize) -> bool {
    let (bow, line, is_line_first) = match (legs.bow(early), legs.bow(late)) {
        (None, Some(bow)) => (bow, legs.chord(early), true),
        (Some(bow), None) => (bow, legs.chord(late), false),
        _ => return false,
    };
    let (end_of_line, end_of_arc) = match is_line_first {
        true => (legs.begin(early), legs.end(late)),
        false => (legs.end(late), legs.begin(early)),
    };
    let along = unit(line.1 - line.0);
    let (center, radius) = (bow.round.center, bow.round.radius);
    let off_line = |point: Point| cross(along, point - line.0).abs();
    let off_circle = ((end_of_line - center).norm() - radius).abs();
    let tangent = left(legs.end(early) - center) * bow.round.sweep.signum();
    tangent.dot(&along) > 0.0
        && bow.round.sweep.abs() < 3.0
        && bow.uneven < MEET_MM
        && (off_line(center) - radius).abs() < 1e-3 * radius
        && off_line(end_of_arc).min(off_circle) > 4.0 * MEET_MM
}

fn meet(legs: &Pieces, (early, late): (usize, usize), is_joined: bool, found: &mut Vec<Meeting>) {
    let ((a0, a1), (b0, b1)) = (legs.chord(early), legs.chord(late));
    let (of_a, of_b) = (legs.bow(early), legs.bow(late));
    if of_a.is_none() && of_b.is_none() {
        // Boxes first. Neighbours meet elsewhere only if one comes back onto the other.
        let apart = |a0: f64, a1: f64, b0: f64, b1: f64| {
            a0.max(a1) + MEET_MM < b0.min(b1) || b0.max(b1) + MEET_MM < a0.min(a1)
        };
        if apart(a0.x, a1.x, b0.x, b1.x) || apart(a0.y, a1.y, b0.y, b1.y) {
            return;
        }
        if is_joined {
            let (back, ahead) = (a0 - a1, b1 - a1);
            let shorter = back.norm().min(ahead.norm());
            if back.dot(&ahead) <= 0.0 || cross(unit(back), unit(ahead)).abs() * shorter > MEET_MM {
                return;
            }
        }
    }
    if is_joined && parts_from(legs, early, late) {
        return;
    }
    // A little more than the limit, for pieces exactly at the limit.
    if distance_bounds::are_pieces_apart((a0, a1), of_a, (b0, b1), of_b, 1.01 * MEET_MM) {
        return;
    }
    let (a, b) = (legs.piece(early), legs.piece(late));
    let mut add = |point: Point, is_end_of_late: bool| {
        let near = |piece: &Piece| (piece.nearest(point) - point).norm() <= MEET_MM;
        if (is_joined && (point - a1).norm() <= 2.0 * MEET_MM) || !near(&a) || !near(&b) {
            return;
        }
        let place = |leg: usize, piece: &Piece| PlaceOnLeg {
            leg,
            along: piece.along(point).clamp(0.0, piece.length()),
        };
        let (from, mut to) = (place(early, &a), place(late, &b));
        if is_end_of_late {
            to.along = b.length();
        }
        let is_return = is_end_of_late && !runs_on(legs, late);
        found.push(Meeting { early: from, late: to, is_return });
    };
    add(b1, true);
    add(b0, false);
    add(a0, false);
    add(a1, false);
    for point in crossings(&a, &b).into_iter().flatten() {
        add(point, false);
    }
}
