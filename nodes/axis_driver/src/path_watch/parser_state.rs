//! The words in force as the controller reports them, compared with those that were sent.

use super::sent::WordsInForce;
use super::tolerances::{WORD, WORD_SHARE};
use crate::report::ReportUnits;
use cnc_msgs::contour::SpindleMode;
use cnc_msgs::geometry::Plane;

/// The first word that is not what was sent: what the controller says, and what was sent.
/// `reported` is what follows `GC:`; words that no line has said are not compared, nor is
/// coolant, which a button at the machine may switch. `speeds`: the least and the most that the
/// spindle turns at (`$31`, `$30`).
pub(super) fn differs(
    sent: &WordsInForce,
    reported: &str,
    units: ReportUnits,
    speeds: [f64; 2],
) -> Option<(String, String)> {
    let words: Vec<&str> = reported.split_ascii_whitespace().collect();
    let group = |known: &[&str], wanted: Option<&str>| {
        let wanted = wanted?;
        let is = words.iter().find(|word| known.contains(word))?;
        (*is != wanted).then(|| ((*is).to_owned(), wanted.to_owned()))
    };
    let motion = sent.motion.map(|motion| ["G0", "G1", "G2", "G3"][usize::from(motion.min(3))]);
    let plane = sent.plane.map(|plane| match plane {
        Plane::Xy => "G17",
        Plane::Zx => "G18",
        Plane::Yz => "G19",
    });
    const SYSTEMS: [&str; 9] =
        ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];
    let system = sent.work_system.and_then(|system| SYSTEMS.get(usize::from(system) - 1).copied());
    let relative = sent.is_relative.map(|relative| if relative { "G91" } else { "G90" });
    let inverse = sent.is_inverse_time.map(|inverse| if inverse { "G93" } else { "G94" });
    let metric = sent.is_metric.map(|metric| if metric { "G21" } else { "G20" });
    let spindle = sent.spindle.map(|spindle| match spindle {
        SpindleMode::Clockwise => "M3",
        SpindleMode::CounterClockwise => "M4",
        SpindleMode::Off => "M5",
    });
    // Some firmwares say S0 of a spindle that is off, and clamp what they cannot turn.
    let turns = !matches!(sent.spindle, None | Some(SpindleMode::Off));
    let is_in_range = |speed: f64| (speeds[0]..=speeds[1]).contains(&speed);
    let number = |letter: char, wanted: Option<f64>, scale: f64| {
        let wanted = wanted?;
        let text = words.iter().find_map(|word| word.strip_prefix(letter))?;
        let is = text.parse::<f64>().ok()? * scale;
        let off = (is - wanted).abs();
        (off > WORD * scale + WORD_SHARE * wanted.abs())
            .then(|| (format!("{letter}{is}"), format!("{letter}{wanted}")))
    };
    group(&["G0", "G1", "G2", "G3"], motion)
        .or_else(|| group(&["G17", "G18", "G19"], plane))
        .or_else(|| group(&SYSTEMS, system))
        .or_else(|| group(&["G90", "G91"], relative))
        .or_else(|| group(&["G20", "G21"], metric))
        .or_else(|| group(&["G93", "G94"], inverse))
        .or_else(|| group(&["M3", "M4", "M5"], spindle))
        .or_else(|| number('F', sent.feed, units.millimetres()))
        .or_else(|| number('S', sent.speed.filter(|speed| turns && is_in_range(*speed)), 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPEEDS: [f64; 2] = [100.0, 24_000.0];
    const REPORTED: &str = "G1 G55 G17 G21 G90 G94 M3 M9 T0 F1200 S5000.";

    #[test]
    fn each_word_that_was_sent_is_compared_and_no_other() {
        let sent = WordsInForce {
            motion: Some(1),
            plane: Some(Plane::Xy),
            work_system: Some(2),
            is_relative: Some(false),
            is_metric: Some(true),
            is_inverse_time: Some(false),
            feed: Some(1200.4),
            speed: Some(5000.0),
            spindle: Some(SpindleMode::Clockwise),
        };
        let check = |sent: WordsInForce| differs(&sent, REPORTED, ReportUnits::Millimetres, SPEEDS);
        assert_eq!(check(sent), None);
        assert_eq!(check(WordsInForce::default()), None);
        for (sent, wanted) in [
            (WordsInForce { motion: Some(0), ..sent }, ("G1", "G0")),
            (WordsInForce { plane: Some(Plane::Zx), ..sent }, ("G17", "G18")),
            (WordsInForce { work_system: Some(1), ..sent }, ("G55", "G54")),
            (WordsInForce { is_relative: Some(true), ..sent }, ("G90", "G91")),
            (WordsInForce { is_metric: Some(false), ..sent }, ("G21", "G20")),
            (WordsInForce { is_inverse_time: Some(true), ..sent }, ("G94", "G93")),
            (WordsInForce { spindle: Some(SpindleMode::Off), ..sent }, ("M3", "M5")),
            (WordsInForce { feed: Some(1700.0), ..sent }, ("F1200", "F1700")),
            (WordsInForce { speed: Some(500.0), ..sent }, ("S5000", "S500")),
        ] {
            let (is, was_sent) = check(sent).unwrap_or_default();
            assert_eq!((is.as_str(), was_sent.as_str()), wanted);
        }
        let inches = "G1 F47.244";
        assert_eq!(differs(&sent, inches, ReportUnits::Inches, SPEEDS), None);
        for free in [
            WordsInForce { speed: Some(30_000.0), ..sent },
            WordsInForce { speed: Some(50.0), ..sent },
            WordsInForce { speed: Some(500.0), spindle: None, ..sent },
        ] {
            assert_eq!(check(free), None, "{free:?}");
        }
    }
}
