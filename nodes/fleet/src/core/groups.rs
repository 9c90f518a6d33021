//! What a report says of index and verdicts.

use super::schema::{INDEX, Row, VERDICTS, Value, place};
use std::collections::{BTreeMap, BTreeSet};

/// The columns of the index that a report needs, in the order of [`Known`].
pub const INDEX_COLUMNS: [&str; 5] = ["bag", "program", "control", "firmware", "start"];

/// What the index says of a bag: program, control, firmware, start.
#[derive(Debug, Clone, Default)]
pub struct Known {
    pub program: Value,
    pub control: Value,
    pub firmware: Value,
    /// Microseconds since the epoch; bags that do not say come last.
    pub start_us: i64,
}

impl Known {
    /// From a row of the whole index.
    pub fn of(row: &Row) -> Self {
        let value = |name| row[place(INDEX, name)].clone();
        Self {
            program: value("program"),
            control: value("control"),
            firmware: value("firmware"),
            start_us: value("start").as_integer().unwrap_or(i64::MAX),
        }
    }
}

/// How many bags have which verdict.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    pub reproduced: usize,
    pub different: usize,
    pub error: usize,
}

impl Counts {
    /// Of all verdicts of a build, one for each bag.
    pub fn of<'a>(verdicts: impl IntoIterator<Item = &'a Row>) -> Self {
        let mut counts = Self::default();
        for row in verdicts {
            match row[place(VERDICTS, "verdict")].as_text() {
                "reproduced" => counts.reproduced += 1,
                "different" => counts.different += 1,
                _ => counts.error += 1,
            }
        }
        counts
    }

    pub fn total(&self) -> usize {
        self.reproduced + self.different + self.error
    }
}

/// Bags that have something in common.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// What they have in common.
    pub value: String,
    pub bags: usize,
    /// The earliest run of them, and what its verdict says.
    pub first_bag: String,
    pub first_text: String,
}

/// Groups by one column, the largest first.
#[derive(Debug, Clone, PartialEq)]
pub struct Grouping {
    pub by: &'static str,
    pub groups: Vec<Group>,
}

/// Groups of one column on a page.
pub const GROUPS_MAX: usize = 50;

impl Grouping {
    /// The groups that a page has room for.
    pub fn shown(&self) -> impl Iterator<Item = &Group> {
        self.groups.iter().take(GROUPS_MAX)
    }
}

/// By bag: the index, and the verdicts of one build.
pub type Index = BTreeMap<String, Known>;
/// By bag: whole rows of the verdicts.
pub type Verdicts = BTreeMap<String, Row>;

/// The bags whose recording is not what this build makes of it.
pub fn not_reproduced(verdicts: &Verdicts) -> BTreeSet<&str> {
    let rows = verdicts.iter();
    let rows = rows.filter(|(_, row)| row[place(VERDICTS, "verdict")].as_text() != "reproduced");
    rows.map(|(bag, _)| bag.as_str()).collect()
}

/// The bags for which two builds do not say the same; those with one verdict are not compared.
pub fn changed<'a>(now: &'a Verdicts, before: &Verdicts) -> BTreeSet<&'a str> {
    // Time, memory and number of the machine are not of the build.
    const SAID: [&str; 6] = ["verdict", "level", "message", "field", "text", "differences"];
    let places = SAID.map(|name| place(VERDICTS, name));
    let differs = |(now, before): (&Row, &Row)| places.iter().any(|it| now[*it] != before[*it]);
    let both = now.iter().filter_map(|(bag, row)| Some((bag, (row, before.get(bag)?))));
    both.filter(|(_, rows)| differs(*rows)).map(|(bag, _)| bag.as_str()).collect()
}

/// Groups these bags by program, control, firmware and field.
pub fn group(bags: &BTreeSet<&str>, index: &Index, verdicts: &Verdicts) -> Vec<Grouping> {
    let unknown = Known { start_us: i64::MAX, ..Known::default() };
    let known = |bag: &str| index.get(bag).unwrap_or(&unknown);
    let mut in_time: Vec<&str> = bags.iter().copied().collect();
    in_time.sort_by_key(|bag| known(bag).start_us);
    let by = |by: &'static str, value: &dyn Fn(&str) -> String| {
        let mut groups: BTreeMap<String, Group> = BTreeMap::new();
        for bag in &in_time {
            let value = value(bag);
            let group = groups.entry(value.clone()).or_insert_with(|| Group {
                value,
                bags: 0,
                first_bag: (*bag).to_owned(),
                first_text: text_of(verdicts.get(*bag)),
            });
            group.bags += 1;
        }
        let mut groups: Vec<Group> = groups.into_values().collect();
        groups.sort_by_key(|group| std::cmp::Reverse(group.bags));
        Grouping { by, groups }
    };
    vec![
        by("program", &|bag| known(bag).program.to_string()),
        by("control", &|bag| known(bag).control.to_string()),
        by("firmware", &|bag| known(bag).firmware.to_string()),
        by("field", &|bag| field_of(verdicts.get(bag))),
    ]
}

/// `planner: compensated_path/chunks elements[].end.x`; for what cannot be compared `error`.
fn field_of(row: Option<&Row>) -> String {
    let Some(row) = row else { return "-".to_owned() };
    let text = |name| row[place(VERDICTS, name)].as_text();
    match text("verdict") {
        "different" => format!("{}: {} {}", text("level"), text("message"), text("field")),
        verdict => verdict.to_owned(),
    }
}

/// The first difference or the error of a verdict, with its place.
fn text_of(row: Option<&Row>) -> String {
    let Some(row) = row else { return String::new() };
    let text = row[place(VERDICTS, "text")].as_text();
    match row[place(VERDICTS, "line")].as_integer() {
        Some(line) if line > 0 => format!("{text} (line {line})"),
        _ => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verdict(bag: &str, verdict: &str, field: &str, text: &str, seconds: f64) -> (String, Row) {
        let mut row = vec![Value::Null; VERDICTS.len()];
        let mut set = |name, value| row[place(VERDICTS, name)] = value;
        set("bag", Value::text(bag));
        set("verdict", Value::text(verdict));
        set("level", Value::text("planner"));
        set("message", Value::text("path"));
        set("field", Value::text(field));
        set("text", Value::text(text));
        set("seconds", Value::Real(seconds));
        (bag.to_owned(), row)
    }

    fn known(program: &str, start_us: i64) -> Known {
        Known { program: Value::text(program), start_us, ..Known::default() }
    }

    #[test]
    fn bags_that_differ_are_grouped_and_the_earliest_is_named() {
        let verdicts: Verdicts = [
            verdict("a", "different", "x", "of a", 0.1),
            verdict("b", "different", "x", "of b", 0.1),
            verdict("c", "reproduced", "", "", 0.1),
            verdict("d", "error", "", "not a bag", 0.1),
        ]
        .into();
        assert_eq!(Counts::of(verdicts.values()), Counts { reproduced: 1, different: 2, error: 1 });
        let index: Index = [
            ("a".to_owned(), known("p", 20)),
            ("b".to_owned(), known("p", 10)),
            ("c".to_owned(), known("q", 5)),
        ]
        .into();
        let bags = not_reproduced(&verdicts);
        assert_eq!(bags, ["a", "b", "d"].into());
        let groupings = group(&bags, &index, &verdicts);
        let shown = |by: usize| -> Vec<String> {
            let groups = groupings[by].groups.iter();
            groups
                .map(|it| format!("{} {} {} {}", it.bags, it.value, it.first_bag, it.first_text))
                .collect()
        };
        assert_eq!(shown(0), ["2 p b of b", "1 - d not a bag"]);
        assert_eq!(shown(3), ["2 planner: path x b of b", "1 error d not a bag"]);
    }

    #[test]
    fn two_builds_differ_in_what_they_say_and_not_in_their_time() {
        let now: Verdicts = [
            verdict("a", "reproduced", "", "", 0.1),
            verdict("b", "different", "x", "1 became 2", 0.1),
            verdict("c", "different", "x", "1 became 2", 0.1),
            verdict("d", "reproduced", "", "", 0.1),
        ]
        .into();
        let before: Verdicts = [
            verdict("a", "reproduced", "", "", 0.9),
            verdict("b", "reproduced", "", "", 0.1),
            verdict("c", "different", "x", "1 became 3", 0.1),
        ]
        .into();
        assert_eq!(changed(&now, &before), ["b", "c"].into());
        assert_eq!(changed(&now, &now), BTreeSet::new());
    }
}
