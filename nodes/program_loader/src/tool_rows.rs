//! The tools that a program reads (`#5403`, `#5410`), appended to its text.
//!
//! The tool table is the planner's. A program that computes with a row of it depends on that row, so the rows that there
//! are become a part of its text, as values of a parameter file do: what was loaded is one text with one hash, which is
//! recorded whole and replayed without the table. Other programs stay as they are.

use crate::appended::{Appended, append, find};
use crate::limits::PROGRAM_BYTES_MAX;
use crate::probe_results::with_results;
use crate::{LoadOptions, Loaded, load};
use cnc_msgs::probing::Measured;
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::{Tool, ToolTable};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt::Write;

/// The line before the rows begins so, and goes on with their number.
const BEGIN: &str = "(tool table, appended by Kerf: ";

/// A row, as programs read it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ToolRow {
    pub(crate) length_mm: f64,
    /// With its wear: the one that compensation takes.
    pub(crate) diameter_mm: f64,
    /// As the tool table numbers it.
    pub(crate) tip_direction: u8,
}

impl From<&Tool> for ToolRow {
    fn from(tool: &Tool) -> Self {
        // A turning tool has the circle of its nose.
        let nominal_mm = match tool.diameter_mm {
            0.0 => 2.0 * tool.nose_radius_mm,
            diameter_mm => diameter_mm,
        };
        Self {
            length_mm: tool.length_mm,
            diameter_mm: nominal_mm + tool.wear_diameter_mm,
            tip_direction: tool.tip_direction,
        }
    }
}

/// Rows by the numbers of their tools.
pub(crate) type ToolRows = BTreeMap<u32, ToolRow>;

/// [`load`] for a program that may read the tool in the spindle. Returns the text that was loaded, too: with the rows of the
/// table if the program reads any, in place of those that it had.
pub fn load_with_tools<'t>(
    text: &'t [u8],
    profile: &Profile,
    options: &LoadOptions,
    tools: &ToolTable,
) -> (Cow<'t, [u8]>, Loaded) {
    let loaded = load(text, profile, options);
    if !loaded.reads_tools {
        return (text.into(), loaded);
    }
    let text = with_tools(text, tools);
    let loaded = load(&text, profile, options);
    (text.into(), loaded)
}

/// [`load`] for a program whose run has come to a probe or an input, with the results so far. Returns the text that was
/// loaded, too. What the program reads of the table may come only after the results, so that its text has no rows yet.
pub fn load_with_results(
    program: &[u8],
    measured: &Measured,
    profile: &Profile,
    options: &LoadOptions,
    tools: Option<&ToolTable>,
) -> (Vec<u8>, Loaded) {
    let text = with_results(program, measured);
    let loaded = load(&text, profile, options);
    let Some(tools) = tools.filter(|_| loaded.reads_tools) else { return (text, loaded) };
    // The results stay at the end.
    let text = with_results(&with_tools(program, tools), measured);
    let loaded = load(&text, profile, options);
    (text, loaded)
}

/// The text with these rows. One that would be too long stays as it is.
pub(crate) fn with_tools(text: &[u8], tools: &ToolTable) -> Vec<u8> {
    let mut rows = String::new();
    for (number, tool) in &tools.tools {
        let ToolRow { length_mm, diameter_mm, tip_direction } = tool.into();
        let _ = writeln!(rows, "(T{number} {length_mm:?} {diameter_mm:?} {tip_direction})");
    }
    let all = append(split(text).0, BEGIN, tools.tools.len(), &rows);
    if all.len() > PROGRAM_BYTES_MAX { text.to_vec() } else { all }
}

/// The program, and the rows at the end of its text, if there are any. Something like them that is not whole belongs to
/// the program.
pub(crate) fn split(text: &[u8]) -> (&[u8], Option<ToolRows>) {
    section(text).map_or((text, None), |(program, rows)| (program, Some(rows)))
}

fn section(text: &[u8]) -> Option<(&[u8], ToolRows)> {
    // Without a tool there is the first line alone.
    let Appended { program, count, rows } = find(text, BEGIN, &["(T", BEGIN])?;
    let rows: ToolRows = rows.map(row).collect::<Option<_>>()?;
    (count == rows.len()).then_some((program, rows))
}

fn row(line: &str) -> Option<(u32, ToolRow)> {
    let mut words = line.strip_prefix("(T")?.strip_suffix(')')?.split(' ');
    let number = words.next()?.parse().ok()?;
    let mut length = || words.next()?.parse().ok().filter(|value: &f64| value.is_finite());
    let (length_mm, diameter_mm) = (length()?, length()?);
    let tip_direction = words.next()?.parse().ok().filter(|tip| *tip <= 9)?;
    words.next().is_none().then_some((number, ToolRow { length_mm, diameter_mm, tip_direction }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(length_mm: f64) -> ToolTable {
        let mill = Tool { diameter_mm: 6.0, wear_diameter_mm: -0.1, length_mm, ..Tool::default() };
        let lathe = Tool { nose_radius_mm: 0.4, tip_direction: 3, ..Tool::default() };
        ToolTable { tools: [(1, mill), (7, lathe)].into(), ..ToolTable::default() }
    }

    #[test]
    fn rows_follow_a_program_that_reads_them_and_are_replaced_as_a_whole() {
        let profile = settings::load_profile("rs274").expect("a shipped profile");
        let read = |text: &str, tools: &ToolTable| {
            let options = LoadOptions::default();
            let (text, loaded) = load_with_tools(text.as_bytes(), &profile, &options, tools);
            (String::from_utf8(text.into_owned()).expect("text"), loaded)
        };
        let (text, loaded) = read("T1 M6\nG0 X#5410\nM2\0", &table(20.5));
        assert!(loaded.is_accepted() && loaded.reads_tools, "{:?}", loaded.findings);
        let rows = "(T1 20.5 5.9 0)\n(T7 0.0 0.8 3)\n";
        assert_eq!(text, format!("T1 M6\nG0 X#5410\nM2\n{BEGIN}2)\n{rows}"));
        let (again, _) = read(&text, &table(1.0));
        assert_eq!(again, text.replace("20.5", "1.0"));
        for program in ["T1 M6\nG0 X1\nM2", "T1 M6\nG10 L1 P1 Z1 R2\nG0 X#5410\nM2"] {
            let (text, loaded) = read(program, &table(1.0));
            assert_eq!((text.as_str(), loaded.reads_tools), (program, false));
        }
        // A table without the tool, and none at all.
        let (_, loaded) = read("T2 M6\nG0 X#5410\nM2", &table(1.0));
        assert!(loaded.findings[0].message.contains("T2, which is not in the tool table"));
        // Without one it is not read any further: it may have no end.
        let text = b"T2 M6\n#1=#5410\no1 while [1]\nG0 X1\no1 endwhile\nM2";
        let loaded = load(text, &profile, &LoadOptions::default());
        assert!(loaded.reads_tools && loaded.findings.len() == 1, "{:?}", loaded.findings);
        assert!(loaded.findings[0].message.contains("tool table"));
    }

    #[test]
    fn what_only_looks_like_rows_belongs_to_the_program() {
        let whole = String::from_utf8(with_tools(b"M2\n", &table(2.0))).expect("text");
        assert_eq!(split(whole.as_bytes()).1.map(|rows| rows.len()), Some(2));
        for (from, to) in [
            (": 2)", ": 1)"),
            ("5.9", "inf"),
            ("(T7", "(7"),
            ("M2\n(tool", "M2 (tool"),
            ("3)\n", "3)"),
            ("0.8 3)", "0.8 10)"),
            ("0.8 3)", "0.8 3 1)"),
        ] {
            let spoiled = whole.replacen(from, to, 1);
            assert_ne!(spoiled, whole, "{from}");
            assert_eq!(split(spoiled.as_bytes()), (spoiled.as_bytes(), None), "{from}");
        }
    }
}
