//! The words of a line as the encoder writes it: `N12G1X10.5Y-.25F1200`.

use cnc_msgs::further::FurtherAxes;

/// The words of one line. The encoder writes each letter but G and M once.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct LineWords {
    /// Ten times the number, so that G43.1 is 431.
    g: Vec<u16>,
    m: Vec<u16>,
    pub(super) axes: [Option<f64>; 3],
    pub(super) further: FurtherAxes,
    /// I, J, K.
    pub(super) center: [Option<f64>; 3],
    pub(super) feed: Option<f64>,
    pub(super) speed: Option<f64>,
    pub(super) p: Option<f64>,
    pub(super) l: Option<f64>,
}

impl LineWords {
    /// `None` for what is not such a line.
    pub(super) fn read(text: &str) -> Option<Self> {
        let mut words = Self::default();
        let mut rest = text;
        while let Some(letter) = rest.chars().next() {
            rest = rest.get(letter.len_utf8()..)?;
            let end = rest.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(rest.len());
            let (number, after) = rest.split_at(end);
            let value: f64 = number.parse().ok()?;
            rest = after;
            match letter {
                'G' => words.g.push((value * 10.0).round() as u16),
                'M' => words.m.push(value.round() as u16),
                'X' => words.axes[0] = Some(value),
                'Y' => words.axes[1] = Some(value),
                'Z' => words.axes[2] = Some(value),
                'I' => words.center[0] = Some(value),
                'J' => words.center[1] = Some(value),
                'K' => words.center[2] = Some(value),
                'F' => words.feed = Some(value),
                'S' => words.speed = Some(value),
                'P' => words.p = Some(value),
                'L' => words.l = Some(value),
                'N' | 'T' => {}
                _ => words.further = words.further.with(FurtherAxes::index_of(letter)?, value),
            }
        }
        Some(words)
    }

    /// Whether it has this G word; `10.0 * number`.
    pub(super) fn has_g(&self, tenths: u16) -> bool {
        self.g.contains(&tenths)
    }

    /// G38.2 to G38.5.
    pub(super) fn is_probe(&self) -> bool {
        self.g.iter().any(|tenths| (382..=385).contains(tenths))
    }

    /// G33: a line at the pace of the spindle.
    pub(super) fn is_thread(&self) -> bool {
        self.has_g(330)
    }

    pub(super) fn has_m(&self, number: u16) -> bool {
        self.m.contains(&number)
    }

    /// The G word among these that comes last, by its place in the list.
    pub(super) fn last_of(&self, tenths: &[u16]) -> Option<usize> {
        self.g.iter().rev().find_map(|word| tenths.iter().position(|of| of == word))
    }

    /// G54 to G59.3 as 1 to 9.
    pub(super) fn work_system(&self) -> Option<u8> {
        let index = self.last_of(&[540, 550, 560, 570, 580, 590, 591, 592, 593])?;
        u8::try_from(index + 1).ok()
    }

    pub(super) fn has_axes(&self) -> bool {
        self.axes.iter().any(Option::is_some)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_the_encoder_are_read_word_by_word() {
        let words = LineWords::read("N12G18G2X10.5Y-.25I-5K0F1200S500").unwrap();
        assert!(words.has_g(180) && words.has_g(20) && !words.has_g(10));
        assert_eq!(words.axes, [Some(10.5), Some(-0.25), None]);
        assert_eq!(words.center, [Some(-5.0), None, Some(0.0)]);
        assert_eq!((words.feed, words.speed), (Some(1200.0), Some(500.0)));
        let words = LineWords::read("G43.1Z12.5").unwrap();
        assert!(words.has_g(431) && words.has_axes());
        let words = LineWords::read("G10L20P1X0").unwrap();
        assert_eq!((words.l, words.p), (Some(20.0), Some(1.0)));
        let words = LineWords::read("G93G1X1A-90.5F12.5").unwrap();
        assert_eq!(words.further.words(), " A-90.5");
        assert!(words.has_axes() && words.has_g(930));
        assert!(!LineWords::read("G0A90").unwrap().has_axes());
        assert!(LineWords::read("M30").unwrap().has_m(30));
        for text in ["$H", "G", "GX1", "G1X1.2.3", "X"] {
            assert_eq!(LineWords::read(text), None, "{text}");
        }
    }
}
