//! What A, B, C, U, V and W do along the path: a picture of X, Y and Z cannot show it.

use super::view::Point;
use axis_driver::vectors::length_mm;
use cnc_msgs::contour::{Action, ContourEventKind, ProgrammedContour};
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes, FurtherMode, FurtherMove, further_distance};
use serde::Serialize;
use std::io::{self, Write};

/// So many points are drawn of an axis at most, in pieces of a strip that a picture shows as one.
const POINTS_MAX: usize = 4_000;

/// How far along the path, value and line.
type Place = (f64, f64, u32);
/// The way of an axis between two places where the program loses it.
type Piece = Vec<Place>;

/// One axis over the length of the path, in mm. Where A to W move alone it has the way of these: mm, or degrees.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Strip {
    pub(crate) letter: char,
    /// `degrees`, `mm`
    pub(crate) unit: &'static str,
    /// Least and greatest value.
    pub(crate) range: [f64; 2],
    /// The whole path.
    pub(crate) length: f64,
    /// Where it stands from one block to the next: length, value, line. A gap is where the program does not say it.
    pub(crate) pieces: Vec<Piece>,
}

/// A strip for each further axis that the program moves.
pub(crate) fn strips(contour: &ProgrammedContour) -> Vec<Strip> {
    let mut pieces: [Vec<Piece>; 6] = Default::default();
    let mut at = FurtherAxes::NONE;
    let mut along = FurtherAxes::NONE;
    let (mut length, mut position) = (0.0, contour.start);
    for event in &contour.events {
        let line = event.source.line;
        let mut go = |axes: FurtherAxes, at: &mut FurtherAxes, way: f64| {
            let way = if way > 0.0 { way } else { further_distance(*at, axes) };
            let (from, to) = (length, length + way);
            for (axis, value) in axes.iter() {
                match (at.get(axis), pieces[axis].last_mut()) {
                    (Some(before), Some(piece)) => {
                        piece.extend([(from, before, line), (to, value, line)]);
                    }
                    _ => pieces[axis].push(vec![(to, value, line)]),
                }
                *at = at.with(axis, value);
            }
            length = to;
        };
        match event.kind {
            ContourEventKind::Action(Action::Further(FurtherMove { axes, mode })) => match mode {
                FurtherMode::Along => along = axes,
                FurtherMode::Rapid | FurtherMode::Feed(_) => go(axes, &mut at, 0.0),
            },
            ContourEventKind::Motion(motion) => {
                let start = std::mem::replace(&mut position, motion.end);
                let way = length_mm(&motion.shape, start, motion.end);
                go(std::mem::take(&mut along), &mut at, way);
            }
            ContourEventKind::Action(action) => {
                let lost = match () {
                    () if action.takes_further() => std::mem::take(&mut along),
                    () if action.loses_further() => at,
                    () => FurtherAxes::NONE,
                };
                at = close(&mut pieces, at, lost, length, line);
            }
            _ => {}
        }
    }
    let last = contour.events.last().map_or(0, |event| event.source.line);
    close(&mut pieces, at, at, length, last);
    let strip = |(axis, pieces): (usize, Vec<Piece>)| {
        let values = || pieces.iter().flatten().map(|(_, value, _)| *value);
        let range = [values().fold(f64::MAX, f64::min), values().fold(f64::MIN, f64::max)];
        let points: usize = pieces.iter().map(Vec::len).sum();
        let bucket = (length / (POINTS_MAX / 4) as f64).max(f64::MIN_POSITIVE);
        let pieces = match points > POINTS_MAX {
            true => pieces.iter().map(|piece| thinned(piece, bucket)).collect(),
            false => pieces,
        };
        let unit = if FurtherAxes::is_rotary(axis) { "degrees" } else { "mm" };
        Strip { letter: FURTHER_LETTERS[axis], unit, range, length, pieces }
    };
    let moved = pieces.into_iter().enumerate().filter(|(_, pieces)| !pieces.is_empty());
    moved.map(strip).collect()
}

/// Ends the piece of each axis that is lost; gives the places of the others.
fn close(
    pieces: &mut [Vec<Piece>; 6],
    at: FurtherAxes,
    lost: FurtherAxes,
    length: f64,
    line: u32,
) -> FurtherAxes {
    for (axis, _) in lost.iter() {
        if let (Some(value), Some(piece)) = (at.get(axis), pieces[axis].last_mut()) {
            piece.push((length, value, line));
        }
    }
    at.without_all(lost)
}

/// Of the points in each piece of this length the first, the least, the greatest and the last.
fn thinned(points: &[Place], bucket: f64) -> Piece {
    let mut kept = Vec::new();
    let of = |point: &Place| (point.0 / bucket).floor() as u64;
    for group in points.chunk_by(|one, other| of(one) == of(other)) {
        let by_value = |one: &&Place, other: &&Place| one.1.total_cmp(&other.1);
        let (least, most) = (group.iter().min_by(by_value), group.iter().max_by(by_value));
        let mut few: Vec<&Place> =
            [group.first(), least, most, group.last()].into_iter().flatten().collect();
        few.sort_by(|one, other| one.0.total_cmp(&other.0));
        few.dedup();
        kept.extend(few);
    }
    kept
}

/// The height of a strip with its words and its gap, in heights of text.
const HEIGHT: f64 = 8.0;
/// The same of the drawn part.
const DRAWN: f64 = 5.5;

/// The height of so many strips, where a line of text has this height.
pub(super) fn height(strips: &[Strip], text: f64) -> f64 {
    strips.len() as f64 * HEIGHT * text
}

/// Draws strips below each other, from a corner on, as wide as this.
pub(super) fn write(
    svg: &mut impl Write,
    strips: &[Strip],
    [left, top]: Point,
    width: f64,
    text: f64,
) -> io::Result<()> {
    // Room for the numbers.
    let (begin, end) = (left + 5.0 * text, left + width - text);
    for (number, strip) in strips.iter().enumerate() {
        let Strip { letter, unit, range: [least, most], length, .. } = *strip;
        let top = top + (number as f64 * HEIGHT + 2.0) * text;
        let bottom = top + DRAWN * text;
        let whole = if length > 0.0 { length } else { 1.0 };
        let x = |along: f64| begin + along / whole * (end - begin);
        // An axis that stays is drawn in the middle.
        let (low, span) = if most > least { (least, most - least) } else { (least - 0.5, 1.0) };
        let y = |value: f64| bottom - (value - low) / span * (bottom - top);
        writeln!(
            svg,
            "<text x=\"{left:.6}\" y=\"{:.6}\" dx=\"{text:.6}\">{letter} in {unit} along {length:.1} mm of \
             path; a turn alone counts 1 mm a degree</text>",
            top - 0.9 * text
        )?;
        for value in [least, most] {
            let line = y(value);
            writeln!(
                svg,
                "<path class=\"grid\" d=\"M{begin:.6} {line:.6}H{end:.6}\"/><text class=\"tick\" \
                 x=\"{:.6}\" y=\"{:.6}\" text-anchor=\"end\">{value}</text>",
                begin - 0.4 * text,
                line + 0.25 * text
            )?;
            if most <= least {
                break;
            }
        }
        for piece in &strip.pieces {
            for (index, (along, value, _)) in piece.iter().enumerate() {
                let word = if index == 0 { "<path class=\"strip\" d=\"M" } else { "L" };
                write!(svg, "{word}{:.6} {:.6}", x(*along), y(*value))?;
            }
            svg.write_all(b"\"/>\n")?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use program_loader::{LoadOptions, load};

    fn of(program: &str) -> Vec<Strip> {
        let profile = settings::load_profile("rs274").expect("the shipped profile");
        let loaded = load(program.as_bytes(), &profile, &LoadOptions::default());
        assert!(loaded.findings.iter().all(|it| !it.is_error()), "{:?}", loaded.findings);
        strips(&loaded.contour)
    }

    #[test]
    fn each_axis_has_its_way_along_the_path_with_gaps_where_it_is_lost() {
        let found = of(
            "G90 G94 F100\nG0 X10 A90\nG1 X20\nG1 A0 F360\nX30 A-30 U5 F100\nG55\nG0 A7\nX1\nM2\n",
        );
        let [a, u] = found.as_slice() else { panic!("{found:?}") };
        assert_eq!((a.letter, a.unit, a.range, a.length), ('A', "degrees", [-30.0, 90.0], 149.0));
        let first = vec![
            (10.0, 90.0, 2),
            (20.0, 90.0, 4),
            (110.0, 0.0, 4),
            (110.0, 0.0, 5),
            (120.0, -30.0, 5),
            (120.0, -30.0, 6),
        ];
        assert_eq!(a.pieces, [first, vec![(120.0, 7.0, 7), (149.0, 7.0, 9)]]);
        assert_eq!((u.letter, u.unit, u.pieces.len()), ('U', "mm", 1));
        assert_eq!(of("G0 X1\nM2\n"), []);
    }

    #[test]
    fn a_long_program_is_thinned_and_keeps_its_ends() {
        let lines =
            (0..20_000).map(|line| format!("A{}\n", if line == 777 { 500 } else { line % 90 }));
        let found = of(&format!("G90 G0\n{}M2\n", lines.collect::<String>()));
        let points = &found[0].pieces[0];
        assert!(points.len() <= POINTS_MAX + 4, "{}", points.len());
        assert_eq!(found[0].range, [0.0, 500.0]);
        assert!(points.iter().any(|point| point.1 == 500.0), "the one that stands out is kept");
        assert_eq!(points.last().map(|point| point.0), Some(found[0].length));
    }
}
