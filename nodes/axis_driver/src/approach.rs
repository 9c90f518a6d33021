//! How the tool comes to where a run begins in the middle, as text and read back from it.
//!
//! The driver writes it into the answer to a check; who draws a picture of the start reads it.

use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes};
use cnc_msgs::geometry::{AXIS_LETTERS, Position};
use std::fmt;
use std::str::FromStr;

/// The text begins with this.
const HEAD: &str = "the approach";

/// The moves, one after the other; a place is of the work frame in which the run begins, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ApproachText {
    /// Where the tool is, and the height to which it goes up, as far as the work frame is known.
    pub from: Option<(Position, f64)>,
    /// The same height in the machine frame.
    pub height_in_machine: f64,
    /// Where A to W go at that height.
    pub further: FurtherAxes,
    /// Where X and Y go at that height, and Z after them; `None`: it stays.
    pub to: [Option<f64>; 3],
    /// `None` for a rapid.
    pub feed_mm_per_min: Option<f64>,
}

impl fmt::Display for ApproachText {
    /// `the approach from X50.000 Y50.000 Z40.000, up to Z48.000 (Z-2.000 in the machine frame), there to
    /// A180.000, over X30.000 Y20.000, down to Z-1.000 at F600`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(HEAD)?;
        match self.from {
            Some((from, height)) => {
                f.write_str(" from")?;
                for (letter, place) in AXIS_LETTERS.iter().zip(from) {
                    write!(f, " {letter}{place:.3}")?;
                }
                let in_machine = self.height_in_machine;
                write!(f, ", up to Z{height:.3} (Z{in_machine:.3} in the machine frame)")?;
            }
            None => write!(f, ", up to Z{:.3} in the machine frame", self.height_in_machine)?,
        }
        if !self.further.is_empty() {
            f.write_str(", there to")?;
            for (axis, place) in self.further.iter() {
                write!(f, " {}{place:.3}", FURTHER_LETTERS[axis])?;
            }
        }
        let [x, y, z] = self.to;
        if x.or(y).is_some() {
            f.write_str(", over")?;
            for (letter, place) in AXIS_LETTERS.iter().zip([x, y]) {
                place.map_or(Ok(()), |place| write!(f, " {letter}{place:.3}"))?;
            }
        }
        let Some(z) = z else { return f.write_str(", and it stays up") };
        write!(f, ", down to Z{z:.3}")?;
        match self.feed_mm_per_min {
            Some(feed) => write!(f, " at F{feed}"),
            None => f.write_str(" at rapid"),
        }
    }
}

impl FromStr for ApproachText {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let mut parts = text.strip_prefix(HEAD).ok_or(())?.split(", ");
        let from = words(parts.next().ok_or(())?.strip_prefix(" from").unwrap_or_default())?;
        let up = parts.next().and_then(|up| up.strip_prefix("up to ")).ok_or(())?;
        let (height, rest) = up.split_once(' ').ok_or(())?;
        let height = height.strip_prefix('Z').and_then(|height| height.parse().ok()).ok_or(())?;
        let in_machine = rest.strip_prefix("(Z").and_then(|rest| rest.split(' ').next());
        let in_machine = in_machine.map_or(Ok(height), |it| it.parse().map_err(drop))?;
        let mut read = Self {
            from: None,
            height_in_machine: in_machine,
            further: FurtherAxes::NONE,
            to: [None; 3],
            feed_mm_per_min: None,
        };
        if let [(_, x), (_, y), (_, z)] = from.as_slice() {
            read.from = Some(([*x, *y, *z], height));
        }
        for part in parts {
            let (word, rest) = part.split_once(' ').ok_or(())?;
            match word {
                "there" => {
                    let turned = words(rest.strip_prefix("to").ok_or(())?)?;
                    let axis =
                        |(letter, at): (char, f64)| Some((FurtherAxes::index_of(letter)?, at));
                    read.further = turned.into_iter().filter_map(axis).collect();
                }
                "over" | "down" => {
                    let rest = rest.strip_prefix("to ").unwrap_or(rest);
                    let (places, feed) = rest.split_once(" at ").unwrap_or((rest, ""));
                    for (letter, place) in words(places)? {
                        let axis = AXIS_LETTERS.iter().position(|known| *known == letter);
                        read.to[axis.ok_or(())?] = Some(place);
                    }
                    read.feed_mm_per_min = feed.strip_prefix('F').and_then(|it| it.parse().ok());
                }
                _ => {}
            }
        }
        Ok(read)
    }
}

/// Letters and numbers: `X50.000 Y-1.000`.
fn words(text: &str) -> Result<Vec<(char, f64)>, ()> {
    let word = |word: &str| {
        let letter = word.chars().next().ok_or(())?;
        let value = word[letter.len_utf8()..].parse().map_err(drop)?;
        Ok((letter, value))
    };
    text.split_whitespace().map(word).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_moves_of_an_approach_are_said_and_read_back() {
        let whole = ApproachText {
            from: Some(([50.0, -50.5, 40.0], 48.0)),
            height_in_machine: -2.0,
            further: FurtherAxes::NONE.with(0, 180.0).with(1, -20.0),
            to: [Some(30.0), Some(20.0), Some(-1.0)],
            feed_mm_per_min: Some(600.0),
        };
        let (none, up) = (FurtherAxes::NONE, [Some(30.0), None, None]);
        for (approach, text) in [
            (
                whole,
                "the approach from X50.000 Y-50.500 Z40.000, up to Z48.000 (Z-2.000 in the machine frame), \
                 there to A180.000 B-20.000, over X30.000 Y20.000, down to Z-1.000 at F600",
            ),
            (
                ApproachText { from: None, further: none, feed_mm_per_min: None, ..whole },
                "the approach, up to Z-2.000 in the machine frame, over X30.000 Y20.000, down to Z-1.000 at rapid",
            ),
            (
                ApproachText { from: None, further: none, to: up, feed_mm_per_min: None, ..whole },
                "the approach, up to Z-2.000 in the machine frame, over X30.000, and it stays up",
            ),
        ] {
            assert_eq!(approach.to_string(), text);
            assert_eq!(text.parse(), Ok(approach), "{text}");
        }
        for junk in ["", "the approach", "the approach, up", "the approach from X, up to Z1 a", "x"]
        {
            assert_eq!(junk.parse::<ApproachText>(), Err(()), "{junk}");
        }
    }
}
