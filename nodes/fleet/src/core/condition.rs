//! `--where`: a condition on the columns of the index, as SQL has it.
//!
//! Comparisons of a column with a text or a number, `in`, `between`, `like`, `is null`, `and`, `or`, `not`
//! and parentheses. As in SQL a comparison with an empty value is neither true nor false, and a bag is selected when the whole
//! is true.

use super::like::Pattern;
use super::schema::{Column, Kind, Row, Value};
use super::words::{What, Word, words};
use chrono::{DateTime, NaiveDate};
use std::cmp::Ordering;
use std::str::FromStr;

/// Parentheses and `not` inside each other.
const DEPTH_MAX: usize = 100;

/// A condition that was read; columns are checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition(Node);

#[derive(Debug, Clone, PartialEq)]
enum Node {
    Compare { column: &'static str, sign: &'static str, with: Value },
    Like { column: &'static str, pattern: Pattern },
    IsNull(&'static str),
    Not(Box<Node>),
    And(Vec<Node>),
    Or(Vec<Node>),
}

impl Condition {
    /// The columns that it asks.
    pub fn columns(&self) -> Vec<&'static str> {
        let mut columns = Vec::new();
        self.0.columns(&mut columns);
        columns.sort_unstable();
        columns.dedup();
        columns
    }

    /// Whether a row is selected; `columns` are those that the row was read with.
    pub fn selects(&self, columns: &[Column], row: &Row) -> bool {
        let value = |name: &str| {
            let place = columns.iter().position(|(it, ..)| *it == name);
            place.and_then(|place| row.get(place)).unwrap_or(&Value::Null)
        };
        self.0.is_true(&value) == Some(true)
    }
}

impl Node {
    fn columns(&self, to: &mut Vec<&'static str>) {
        match self {
            Self::Compare { column, .. } | Self::Like { column, .. } | Self::IsNull(column) => {
                to.push(column);
            }
            Self::Not(node) => node.columns(to),
            Self::And(nodes) | Self::Or(nodes) => nodes.iter().for_each(|node| node.columns(to)),
        }
    }

    /// `None` where SQL says unknown.
    fn is_true<'a>(&self, value: &impl Fn(&str) -> &'a Value) -> Option<bool> {
        match self {
            Self::Compare { column, sign, with } => {
                let order = value(column).compare(with)?;
                Some(match *sign {
                    "=" => order == Ordering::Equal,
                    "!=" => order != Ordering::Equal,
                    "<" => order == Ordering::Less,
                    "<=" => order != Ordering::Greater,
                    ">" => order == Ordering::Greater,
                    _ => order != Ordering::Less,
                })
            }
            Self::Like { column, pattern } => match value(column) {
                Value::Text(text) => Some(pattern.fits(text)),
                _ => None,
            },
            Self::IsNull(column) => Some(*value(column) == Value::Null),
            Self::Not(node) => node.is_true(value).map(|is_true| !is_true),
            Self::And(nodes) => all(nodes.iter().map(|node| node.is_true(value)), true),
            Self::Or(nodes) => all(nodes.iter().map(|node| node.is_true(value)), false),
        }
    }
}

/// The other value decides; else unknown, if there is one.
fn all(nodes: impl Iterator<Item = Option<bool>>, wanted: bool) -> Option<bool> {
    let mut result = Some(wanted);
    for node in nodes {
        match node {
            Some(is_true) if is_true != wanted => return Some(!wanted),
            None => result = None,
            Some(_) => {}
        }
    }
    result
}

impl FromStr for Condition {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = || {
            let mut parser = Parser { words: words(text)?, next: 0, depth: 0 };
            let node = parser.any_of()?;
            match parser.words.get(parser.next) {
                None => Ok(Self(node)),
                Some(word) => Err((
                    word.at,
                    "nothing follows a whole condition but `and` and `or`".to_owned(),
                )),
            }
        };
        read().map_err(|(at, why)| format!("the condition `{text}`, character {at}: {why}"))
    }
}

/// An error and its place.
type Wrong = (usize, String);

struct Parser {
    words: Vec<Word>,
    next: usize,
    depth: usize,
}

impl Parser {
    fn is_name(&mut self, name: &str) -> bool {
        let is_it =
            self.words.get(self.next).is_some_and(|word| word.what == What::Name(name.to_owned()));
        self.next += usize::from(is_it);
        is_it
    }

    fn any_of(&mut self) -> Result<Node, Wrong> {
        let mut nodes = vec![self.all_of()?];
        while self.is_name("or") {
            nodes.push(self.all_of()?);
        }
        Ok(if nodes.len() == 1 { nodes.swap_remove(0) } else { Node::Or(nodes) })
    }

    fn all_of(&mut self) -> Result<Node, Wrong> {
        let mut nodes = vec![self.single()?];
        while self.is_name("and") {
            nodes.push(self.single()?);
        }
        Ok(if nodes.len() == 1 { nodes.swap_remove(0) } else { Node::And(nodes) })
    }

    fn single(&mut self) -> Result<Node, Wrong> {
        self.depth += 1;
        if self.depth > DEPTH_MAX {
            return Err((
                self.place(),
                format!("more than {DEPTH_MAX} parentheses inside each other"),
            ));
        }
        let node = if self.is_name("not") {
            Node::Not(Box::new(self.single()?))
        } else if self.words.get(self.next).is_some_and(|word| word.what == What::Open) {
            let at = self.place();
            self.next += 1;
            let node = self.any_of()?;
            if self.words.get(self.next).is_none_or(|word| word.what != What::Close) {
                return Err((at, "this parenthesis is not closed".to_owned()));
            }
            self.next += 1;
            node
        } else {
            self.comparison()?
        };
        self.depth -= 1;
        Ok(node)
    }

    fn comparison(&mut self) -> Result<Node, Wrong> {
        let at = self.place();
        let Some(What::Name(name)) = self.take() else {
            return Err((at, "a column is missing, as in control = 'rs274'".to_owned()));
        };
        let known = || super::schema::INDEX.iter();
        let Some((column, kind, _)) = known().find(|(it, ..)| *it == name) else {
            let names: Vec<&str> = known().map(|(name, ..)| *name).collect();
            return Err((
                at,
                format!("there is no column `{name}`; the index has {}", names.join(", ")),
            ));
        };
        if self.is_name("is") {
            let is_not = self.is_name("not");
            if !self.is_name("null") {
                return Err((self.place(), "`null` is missing after `is`".to_owned()));
            }
            let node = Node::IsNull(column);
            return Ok(if is_not { Node::Not(Box::new(node)) } else { node });
        }
        let is_not = self.is_name("not");
        let at = self.place();
        let node = match self.take() {
            Some(What::Sign(sign)) if !is_not => {
                return Ok(Node::Compare { column, sign, with: self.value(column, *kind)? });
            }
            Some(What::Name(name)) if name == "in" => self.listed(column, *kind)?,
            Some(What::Name(name)) if name == "between" => {
                let with = self.value(column, *kind)?;
                let from = Node::Compare { column, sign: ">=", with };
                if !self.is_name("and") {
                    return Err((self.place(), "`and` is missing after `between`".to_owned()));
                }
                let with = self.value(column, *kind)?;
                Node::And(vec![from, Node::Compare { column, sign: "<=", with }])
            }
            Some(What::Name(name)) if name == "like" && *kind == Kind::Text => {
                let at = self.place();
                let no_end = || (at, "nothing follows the last \\ of the pattern".to_owned());
                let pattern = Pattern::read(&self.text(column)?).ok_or_else(no_end)?;
                Node::Like { column, pattern }
            }
            _ => {
                return Err((
                    at,
                    format!(
                        "a comparison is missing after {column}: = != < <= > >=, in (..), between, \
                         like of texts, or `is null`"
                    ),
                ));
            }
        };
        Ok(if is_not { Node::Not(Box::new(node)) } else { node })
    }

    /// The values of `in (1, 2)`: the column is one of them.
    fn listed(&mut self, column: &'static str, kind: Kind) -> Result<Node, Wrong> {
        let at = self.place();
        if self.take() != Some(What::Open) {
            return Err((at, "`in` is followed by values in parentheses".to_owned()));
        }
        let mut nodes = Vec::new();
        loop {
            let with = self.value(column, kind)?;
            nodes.push(Node::Compare { column, sign: "=", with });
            match self.take() {
                Some(What::Comma) => {}
                Some(What::Close) => return Ok(Node::Or(nodes)),
                _ => return Err((at, "this parenthesis is not closed".to_owned())),
            }
        }
    }

    /// A value that a column is compared with.
    fn value(&mut self, column: &str, kind: Kind) -> Result<Value, Wrong> {
        if kind == Kind::Text {
            return Ok(Value::Text(self.text(column)?.into()));
        }
        let at = self.place();
        match (kind, self.take()) {
            (Kind::Integer | Kind::Real, Some(What::Number(number))) => Ok(Value::Real(number)),
            (Kind::Time, Some(What::Text(text))) => match time_us(&text) {
                Some(time) => Ok(Value::Integer(time)),
                None => Err((
                    at,
                    format!("`{text}` is not a time; write '2026-11-24' or '2026-11-24T20:15:00Z'"),
                )),
            },
            (Kind::Time, _) => Err((at, format!("{column} is compared with a time: '2026-11-24'"))),
            _ => Err((at, format!("{column} is compared with a number"))),
        }
    }

    fn text(&mut self, column: &str) -> Result<String, Wrong> {
        let at = self.place();
        match self.take() {
            Some(What::Text(text)) => Ok(text),
            _ => Err((at, format!("{column} is compared with a text between quotes"))),
        }
    }

    fn take(&mut self) -> Option<What> {
        let word = self.words.get(self.next)?;
        self.next += 1;
        Some(word.what.clone())
    }

    /// Where the next word stands; after the end, one further than the last.
    fn place(&self) -> usize {
        let next = self.words.get(self.next).map(|word| word.at);
        next.unwrap_or_else(|| self.words.last().map_or(1, |word| word.at + 1))
    }
}

/// A date, or a time with its zone, as microseconds since the epoch.
fn time_us(text: &str) -> Option<i64> {
    if let Ok(date) = NaiveDate::parse_from_str(text, "%Y-%m-%d") {
        return Some(date.and_hms_opt(0, 0, 0)?.and_utc().timestamp_micros());
    }
    DateTime::parse_from_rfc3339(text).ok().map(|time| time.timestamp_micros())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::schema::{INDEX, place};

    fn row(values: &[(&str, Value)]) -> Row {
        let mut row = vec![Value::Null; INDEX.len()];
        for (name, value) in values {
            row[place(INDEX, name)] = value.clone();
        }
        row
    }

    #[test]
    fn a_condition_selects_as_sql_does() {
        let row = row(&[
            ("control", Value::text("rs274")),
            ("program", Value::text("it's")),
            ("duration_s", Value::Real(12.5)),
            ("holds", Value::Integer(2)),
            ("start", Value::Integer(1_790_000_000_000_000)),
        ]);
        for (condition, expected) in [
            ("control = 'rs274'", true),
            ("control != 'rs274'", false),
            ("CONTROL == \"rs274\" AND holds>=2", true),
            ("program = 'it''s'", true),
            ("duration_s > 12.5", false),
            ("duration_s >= 12.5 and duration_s <= 1.25e1", true),
            ("holds <> 3 and not holds < 2", true),
            ("holds = -2 or holds = 2 and control = 'nct'", false),
            ("(holds = 2 or holds = 3) and control = 'rs274'", true),
            // What is empty is neither.
            ("alarms = 0", false),
            ("not alarms = 0", false),
            ("alarms = 0 or control = 'rs274'", true),
            ("not (alarms = 0 and control = 'nct')", true),
            ("alarms is null and control is not null", true),
            ("start >= '2026-09-21' and start < '2026-09-22'", true),
            ("start > '2026-09-21T16:00:00+01:00'", false),
            ("control in ('nct', 'rs274') and holds IN (1,2)", true),
            ("control not in ('nct', 'rs274')", false),
            ("holds in (3)", false),
            ("alarms in (0, 1) or alarms not in (0, 1)", false),
            ("duration_s between 12.5 and 13 and holds = 2", true),
            ("duration_s not between 0 and 12", true),
            ("start between '2026-09-21' and '2026-09-22'", true),
            ("control like 'rs%' and control like '%27_' and program like '%''s'", true),
            (r"control like 'rs\_74' or control like '_\%%' or control like 'RS%'", false),
            ("control not like '%7'", true),
            ("firmware like '%' or firmware not like '%'", false),
        ] {
            let read: Condition = condition.parse().expect(condition);
            assert_eq!(read.selects(INDEX, &row), expected, "{condition}");
        }
    }

    #[test]
    fn what_cannot_be_read_is_named_with_its_place() {
        for (condition, expected) in [
            ("", "character 1: a column is missing, as in control = 'rs274'"),
            ("control = rs274", "character 11: control is compared with a text between quotes"),
            ("control = 'rs274", "character 11: the text that begins here has no closing '"),
            ("holds = 'x'", "character 9: holds is compared with a number"),
            ("holds = 1x", "character 9: `1x` is not a number; a text stands between quotes"),
            ("(holds = 1", "character 1: this parenthesis is not closed"),
            ("holds = 1)", "character 10: nothing follows a whole condition but `and` and `or`"),
            (
                "holds 1",
                "character 7: a comparison is missing after holds: = != < <= > >=, in (..), between, \
                 like of texts, or `is null`",
            ),
            (
                "holds like '1'",
                "character 7: a comparison is missing after holds: = != < <= > >=, in (..), between, \
                 like of texts, or `is null`",
            ),
            ("program like 5", "character 14: program is compared with a text between quotes"),
            (r"program like 'a\'", r"character 14: nothing follows the last \ of the pattern"),
            ("holds in 1", "character 10: `in` is followed by values in parentheses"),
            ("holds in (1 2)", "character 10: this parenthesis is not closed"),
            ("holds in ()", "character 11: holds is compared with a number"),
            ("holds in (1, 'x')", "character 14: holds is compared with a number"),
            ("holds between 1 or 2", "character 17: `and` is missing after `between`"),
            ("start > 5", "character 9: start is compared with a time: '2026-11-24'"),
            (
                "start > '5'",
                "character 9: `5` is not a time; write '2026-11-24' or '2026-11-24T20:15:00Z'",
            ),
            ("holds = 1; x", "character 10: `;` has no meaning in a condition"),
            ("holds is 1", "character 10: `null` is missing after `is`"),
        ] {
            let error = condition.parse::<Condition>().expect_err(condition);
            assert_eq!(error, format!("the condition `{condition}`, {expected}"));
        }
        let error = "feed = 1".parse::<Condition>().expect_err("no such column");
        assert!(
            error.contains(
                "character 1: there is no column `feed`; the index has bag, machine, run"
            ),
            "{error}"
        );
        let deep = format!("{}holds = 1", "(".repeat(100_000));
        assert!(
            deep.parse::<Condition>().expect_err("too deep").contains("more than 100 parentheses")
        );
    }

    #[test]
    fn only_the_columns_that_are_asked_are_read() {
        let condition: Condition =
            "holds = 1 or not (control = 'x' and holds > 2)".parse().expect("a condition");
        assert_eq!(condition.columns(), ["control", "holds"]);
    }
}
