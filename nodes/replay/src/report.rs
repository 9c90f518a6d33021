//! The report of a replay: counts first, then a row for each field, then the differences.
//!
//! As text for people, and as JSON for scripts.

use super::compare::{Comparison, Difference, kind};
use super::recording::Recording;
use super::{Level, ReplayResult};
use cnc_msgs::count::counted;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Differences of a core that are printed, unless all are requested.
const SHOWN_MAX: usize = 20;

impl ReplayResult {
    /// Whether every core makes what was recorded; remarks do not count.
    pub fn is_reproduced(&self) -> bool {
        self.comparisons.iter().all(|(_, comparison)| comparison.differences.is_empty())
    }

    /// Whether there is a difference or a remark.
    pub(crate) fn has_rows(&self) -> bool {
        let rows =
            |comparison: &Comparison| comparison.differences.len() + comparison.remarks.len();
        self.comparisons.iter().any(|(_, comparison)| rows(comparison) > 0)
    }

    /// Whether there is a difference, or a remark that the other comparison lacks.
    pub(crate) fn has_rows_beyond(&self, other: &Self) -> bool {
        let remarks = |result: &Self| -> Vec<String> {
            let rows = result.comparisons.iter().flat_map(|(_, comparison)| &comparison.remarks);
            rows.map(|row| format!("{}: {}", row.message, row.text)).collect()
        };
        let known = remarks(other);
        !self.is_reproduced() || remarks(self).iter().any(|row| !known.contains(row))
    }

    /// Whether a published state is not reached now.
    pub(crate) fn has_other_states(&self) -> bool {
        let rows = self.comparisons.iter().flat_map(|(_, comparison)| &comparison.differences);
        rows.into_iter().any(|row| row.field == "state")
    }

    /// `reproduced` or `DIFFERENT`.
    pub fn word(&self) -> &'static str {
        if self.is_reproduced() { "reproduced" } else { "DIFFERENT" }
    }

    /// The report for people.
    pub fn report(&self, bag: &str, is_all: bool) -> String {
        let mut report = format!("{bag}: {}\n", self.word());
        for (level, comparison) in &self.comparisons {
            let row = counts(comparison);
            report += &format!("  {}: {row}\n", level.name());
            report += &differences(comparison, if is_all { usize::MAX } else { SHOWN_MAX });
        }
        report
    }

    /// The report for scripts.
    pub fn to_json(&self, bag: &str) -> Value {
        let row = |row: &Difference| {
            json!({
                "message": row.message,
                "field": row.field,
                "text": row.text,
                "line": (row.place.line > 0).then_some(row.place.line),
                "position_mm": row.place.position,
                "distance_mm": row.place.distance_mm.filter(|it| it.is_finite()),
            })
        };
        let levels = self.comparisons.iter().map(|(level, comparison)| {
            json!({
                "level": level.name(),
                "compared": comparison.compared,
                "difference_count": comparison.differences.len(),
                "differences": comparison.differences.iter().map(row).collect::<Vec<_>>(),
                "remarks": comparison.remarks.iter().map(row).collect::<Vec<_>>(),
            })
        });
        json!({
            "bag": bag,
            "reproduced": self.is_reproduced(),
            "levels": levels.collect::<Vec<_>>(),
        })
    }

    /// What was compared at each level, in the order of the levels.
    pub fn comparisons(&self) -> &[(Level, Comparison)] {
        &self.comparisons
    }

    /// The recording that was replayed.
    pub fn recording(&self) -> &Recording {
        &self.inputs.recording
    }

    /// One line for each level: number of differences, what was compared.
    pub fn summary(&self) -> String {
        let rows = self.comparisons.iter();
        let rows = rows.map(|(level, it)| format!("{}: {}", level.name(), counts(it)));
        rows.collect::<Vec<_>>().join("\n")
    }

    /// The first `shown_max` differences of each level, with their texts.
    pub fn differences(&self, shown_max: usize) -> Vec<[String; 2]> {
        let of_level = |(level, comparison): &(Level, Comparison)| {
            let rest = comparison.differences.len().saturating_sub(shown_max);
            let rest = (rest > 0).then(|| {
                [level.name().to_owned(), format!("and {rest} more; `kerf replay --all` has them")]
            });
            let name = level.name();
            let shown = comparison.differences.iter().take(shown_max);
            let shown = shown.map(|it| [format!("{name}: {}", it.message), it.text.clone()]);
            shown.chain(rest).collect::<Vec<_>>()
        };
        self.comparisons.iter().flat_map(of_level).collect()
    }
}

fn counts(comparison: &Comparison) -> String {
    let counts: Vec<String> =
        comparison.compared.iter().map(|(what, count)| compared(*count, what)).collect();
    format!(
        "{}; compared {}",
        counted(comparison.differences.len(), "difference"),
        if counts.is_empty() { "nothing".to_owned() } else { counts.join(", ") }
    )
}

/// The first difference, the count for each field, and the differences themselves.
fn differences(comparison: &Comparison, shown_max: usize) -> String {
    let rows = &comparison.differences;
    let text = |row: &Difference| format!("{}: {}{}", row.message, row.text, row.place.text());
    let mut report = String::new();
    if let Some(first) = rows.first() {
        report += &format!("    first: {}\n", text(first));
    }
    let mut fields: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    for row in rows {
        *fields.entry((kind(&row.message), &row.field)).or_default() += 1;
    }
    for ((kind, field), count) in fields {
        report += &format!("    {count} x {kind} {field}\n");
    }
    for row in rows.iter().take(shown_max).skip(1) {
        report += &format!("    {}\n", text(row));
    }
    if rows.len() > shown_max {
        report += &format!("    and {} more; --all shows them\n", rows.len() - shown_max);
    }
    for remark in comparison.remarks.iter().take(shown_max) {
        report += &format!("    remark: {}\n", text(remark));
    }
    if comparison.remarks.len() > shown_max {
        let more = comparison.remarks.len() - shown_max;
        report += &format!("    and {more} more remarks; --all shows them\n");
    }
    report
}

/// `2 paths as curves`, `1 path as curve`; the name of a topic stays as it is.
fn compared(count: usize, what: &str) -> String {
    if count != 1 || what.contains('_') {
        return format!("{count} {what}");
    }
    let singular = |word: &str| match word {
        "as" => "as".to_owned(),
        word => word.strip_suffix('s').unwrap_or(word).to_owned(),
    };
    let words: Vec<String> = what.split(' ').map(singular).collect();
    format!("1 {}", words.join(" "))
}

#[cfg(test)]
mod tests {
    use super::compared;

    #[test]
    fn one_thing_that_was_compared_is_singular_and_a_topic_keeps_its_name() {
        for (count, what, expected) in [
            (1, "paths as curves", "1 path as curve"),
            (2, "paths as curves", "2 paths as curves"),
            (1, "lines of G-code", "1 line of G-code"),
            (1, "compensated_path/chunks", "1 compensated_path/chunks"),
            (0, "states", "0 states"),
        ] {
            assert_eq!(compared(count, what), expected);
        }
    }
}
