//! Prints measured times as tables.

use std::fmt::Write;
use std::time::Duration;

/// Upper ends of the classes of a histogram, ms.
const CLASSES_MS: [f64; 15] =
    [0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0, f64::INFINITY];
/// The longest bar of a histogram, characters.
const BAR_CHARACTERS: usize = 24;

/// Times of one kind.
#[derive(Debug, Default)]
pub(crate) struct Times(Vec<Duration>);

impl FromIterator<Duration> for Times {
    fn from_iter<T: IntoIterator<Item = Duration>>(times: T) -> Self {
        Self(times.into_iter().collect())
    }
}

impl Times {
    pub(crate) fn push(&mut self, time: Duration) {
        self.0.push(time);
    }

    /// The smallest time that this share of all does not exceed, in milliseconds.
    pub(crate) fn quantile_ms(&self, part: f64) -> f64 {
        let mut sorted = self.0.clone();
        sorted.sort_unstable();
        let rank = (part * sorted.len() as f64).ceil() as usize;
        sorted.get(rank.saturating_sub(1)).map_or(f64::NAN, |time| time.as_secs_f64() * 1e3)
    }

    fn per_class(&self) -> Vec<usize> {
        let mut counts = vec![0; CLASSES_MS.len()];
        for time in &self.0 {
            let ms = time.as_secs_f64() * 1e3;
            let class = CLASSES_MS.iter().position(|end| ms <= *end);
            counts[class.unwrap_or(CLASSES_MS.len() - 1)] += 1;
        }
        counts
    }
}

/// One line for each kind: quantiles.
pub(crate) fn quantiles(series: &[(&str, &Times)]) -> String {
    let mut text =
        format!("{:<28} {:>6} {:>8} {:>8} {:>8} {:>8}\n", "ms", "n", "p50", "p90", "p99", "max");
    for (name, times) in series {
        let _ = write!(text, "{name:<28} {:>6}", times.0.len());
        for part in [0.5, 0.9, 0.99, 1.0] {
            let _ = write!(text, " {:>8.3}", times.quantile_ms(part));
        }
        text.push('\n');
    }
    text
}

/// One column for each kind: how many times are in each class.
pub(crate) fn histogram(series: &[(&str, &Times)]) -> String {
    let mut text = format!("{:>8}", "up to ms");
    for (name, _) in series {
        let _ = write!(text, "  {name:<width$}", width = BAR_CHARACTERS + 5);
    }
    text.push('\n');
    let columns: Vec<Vec<usize>> = series.iter().map(|(_, times)| times.per_class()).collect();
    for (class, end) in CLASSES_MS.iter().enumerate() {
        if columns.iter().all(|column| column[class] == 0) {
            continue;
        }
        let _ = match end.is_finite() {
            true => write!(text, "{end:>8.1}"),
            false => write!(text, "{:>8}", "more"),
        };
        for column in &columns {
            let all: usize = column.iter().sum();
            let bar = "#".repeat((column[class] * BAR_CHARACTERS).div_ceil(all.max(1)));
            let _ = write!(text, "  {:>4} {bar:<BAR_CHARACTERS$}", column[class]);
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
    }
    text
}
