//! Paths that name the parts of a message, and patterns of such paths.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

/// One step of a path.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum PathStep {
    /// `.name`
    Field(Arc<str>),
    /// `[3]`
    Index(usize),
    /// `*`: any one field. Only in patterns.
    AnyField,
    /// `[*]`: any one element. Only in patterns.
    AnyIndex,
    /// `**`: any number of steps, also none. Only in patterns.
    AnySteps,
}

/// Names a part of a message: `elements[3].end.x`; empty for the whole.
///
/// As a pattern it may hold `*` for any field, `[*]` for any element and `**`
/// for any steps: `**.stamp`, `elements[*].end.*`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct FieldPath(pub Vec<PathStep>);

/// Text that is not a path.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "\"{path}\" is not a field path: {why} at character {at}; it should look like elements[3].end.x"
)]
pub struct PathError {
    pub path: String,
    /// 1-based.
    pub at: usize,
    pub why: &'static str,
}

impl FieldPath {
    /// Whether this pattern names the part at `path`.
    pub fn matches(&self, path: &FieldPath) -> bool {
        matches(&self.0, &path.0)
    }
}

fn matches(pattern: &[PathStep], path: &[PathStep]) -> bool {
    // Where to retry when a later step does not fit: after the last `**`, one step further.
    let (mut p, mut s) = (0, 0);
    let mut again = None;
    while s < path.len() {
        let fits = match (pattern.get(p), &path[s]) {
            (Some(PathStep::AnySteps), _) => {
                again = Some((p + 1, s));
                p += 1;
                continue;
            }
            (Some(PathStep::AnyField), PathStep::Field(_))
            | (Some(PathStep::AnyIndex), PathStep::Index(_)) => true,
            (Some(step), at) => step == at,
            (None, _) => false,
        };
        if fits {
            (p, s) = (p + 1, s + 1);
        } else if let Some((after, from)) = again {
            again = Some((after, from + 1));
            (p, s) = (after, from + 1);
        } else {
            return false;
        }
    }
    pattern[p..].iter().all(|step| *step == PathStep::AnySteps)
}

impl FromStr for FieldPath {
    type Err = PathError;

    fn from_str(text: &str) -> Result<Self, PathError> {
        let mut steps = Vec::new();
        let mut at = 0;
        let error = |at: usize, why| PathError {
            path: text.to_owned(),
            at: text[..at].chars().count() + 1,
            why,
        };
        while at < text.len() {
            let rest = &text[at..];
            if let Some(inside) = rest.strip_prefix('[') {
                let end =
                    inside.find(']').ok_or_else(|| error(at, "the bracket does not close"))?;
                steps.push(match &inside[..end] {
                    "*" => PathStep::AnyIndex,
                    number => {
                        PathStep::Index(number.parse().map_err(|_| error(at + 1, "no number"))?)
                    }
                });
                at += end + 2;
                continue;
            }
            let name = match rest.strip_prefix('.') {
                Some(name) if !steps.is_empty() => {
                    at += 1;
                    name
                }
                None if steps.is_empty() => rest,
                _ => return Err(error(at, "write one point before each field except the first")),
            };
            let end = name.find(['.', '[']).unwrap_or(name.len());
            steps.push(match &name[..end] {
                "*" => PathStep::AnyField,
                "**" => PathStep::AnySteps,
                word if is_field_name(word) => PathStep::Field(word.into()),
                _ => return Err(error(at, "no field name")),
            });
            at += end;
        }
        Ok(Self(steps))
    }
}

fn is_field_name(word: &str) -> bool {
    !word.is_empty() && word.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
}

impl fmt::Display for FieldPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, step) in self.0.iter().enumerate() {
            let point = if index > 0 { "." } else { "" };
            match step {
                PathStep::Field(name) => write!(f, "{point}{name}")?,
                PathStep::Index(index) => write!(f, "[{index}]")?,
                PathStep::AnyField => write!(f, "{point}*")?,
                PathStep::AnyIndex => f.write_str("[*]")?,
                PathStep::AnySteps => write!(f, "{point}**")?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(text: &str) -> FieldPath {
        text.parse().unwrap()
    }

    #[test]
    fn paths_are_written_as_they_are_read() {
        for text in ["", "a", "elements[3].end.x", "a[0][1].b_2", "**.stamp", "a[*].*"] {
            assert_eq!(path(text).to_string(), text);
        }
    }

    #[test]
    fn a_bad_path_says_where() {
        let cases = [(".a", 1), ("a..b", 3), ("a[", 2), ("a[x]", 3), ("a b", 1), ("a[1]b", 5)];
        for (text, at) in cases {
            let error = text.parse::<FieldPath>().unwrap_err();
            assert_eq!(error.at, at, "{error}");
        }
    }

    #[test]
    fn patterns_name_one_step_or_any_number_of_them() {
        let cases = [
            ("**.stamp", "stamp", true),
            ("**.stamp", "header.stamp", true),
            ("**.stamp", "list[2].header.stamp", true),
            ("**.stamp", "header.stamp.sec", false),
            ("**.stamp.**", "header.stamp.sec", true),
            ("**.a.**.b", "a.x.a.y.b", true),
            ("elements[*].end.*", "elements[7].end.x", true),
            ("elements[*].end.*", "elements[7].end", false),
            ("elements[1].end", "elements[2].end", false),
            ("*", "a", true),
            ("*", "a.b", false),
            ("**", "", true),
        ];
        for (pattern, name, expected) in cases {
            assert_eq!(path(pattern).matches(&path(name)), expected, "{pattern} {name}");
        }
    }
}
