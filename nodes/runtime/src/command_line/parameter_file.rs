//! ROS 2 parameter files and `-p`.
//!
//! Pure: text in, values for one node out, each with its line.
//! Knows sections (`/**:`, `/ns/node:`, `*`), `ros__parameters`, and how
//! groups become dotted names. `parameters` validates the values.

use crate::command_line::arguments::ParameterArgument;
use crate::command_line::names::Names;
use crate::parameters::{Origin, Override, ParameterValue};
use intake::nearest::nearest;
use serde_yaml::Value;
use settings::yaml::{FileError, from_yaml_str, line_of};

/// The content of a parameter file for one node.
#[derive(Debug, Default)]
pub(crate) struct Found {
    /// In order.
    pub(crate) overrides: Vec<Override>,
    /// Where sections of other nodes are, with their names.
    pub(crate) others: Vec<(Origin, String)>,
}

/// The values that a parameter file has for the node of `names`, which is a `default_node`.
///
/// # Errors
/// Not a parameter file, a value that no parameter can have, or a section of a node whose
/// name is almost that of this one.
pub(crate) fn read(
    text: &str,
    file: &str,
    names: &Names,
    default_node: &str,
) -> Result<Found, FileError> {
    let root: Value = from_yaml_str(text, file)?;
    let mut reader = Reader { text, file, names, default_node, found: Found::default() };
    match &root {
        Value::Null => {}
        Value::Mapping(_) => reader.sections(&root, &mut Vec::new())?,
        _ => return Err(reader.error(&[], "nodes with their ros__parameters are needed")),
    }
    Ok(reader.found)
}

/// The values that `-p` has for the node of `names`.
///
/// # Errors
/// A value that is not YAML, or that no parameter can have.
pub(crate) fn from_arguments(
    arguments: &[ParameterArgument],
    names: &Names,
    default_node: &str,
) -> Result<Vec<Override>, FileError> {
    let is_ours = |argument: &&ParameterArgument| {
        argument.node.as_ref().is_none_or(|node| node == names.node() || node == default_node)
    };
    arguments
        .iter()
        .filter(is_ours)
        .map(|argument| {
            let origin = format!("-p {}:={}", argument.name, argument.yaml);
            let value: Value = from_yaml_str(&argument.yaml, &origin)?;
            let value = match value {
                // An empty word is an empty string.
                Value::Null if argument.yaml.is_empty() => Some(ParameterValue::from("")),
                other => value_of(&other).map_err(|why| FileError::new(&origin, None, why))?,
            };
            let name = argument.name.clone();
            Ok(Override { name, value, origin: Origin(origin), is_shared: false })
        })
        .collect()
}

struct Reader<'a> {
    text: &'a str,
    file: &'a str,
    names: &'a Names,
    default_node: &'a str,
    found: Found,
}

impl Reader<'_> {
    /// Walks nodes and namespaces, which may be nested.
    fn sections(&mut self, map: &Value, path: &mut Vec<String>) -> Result<(), FileError> {
        let Value::Mapping(map) = map else {
            return Err(self.error(path, "ros__parameters is missing below it"));
        };
        for (key, value) in map {
            let Value::String(key) = key else {
                return Err(self.error(path, "the name of a node or namespace is needed"));
            };
            path.push(key.clone());
            if key == "ros__parameters" {
                let section = &path[..path.len() - 1];
                let name = section.last().and_then(|key| key.rsplit('/').next());
                if !matches(section, &self.names.fully_qualified()) {
                    self.other(section, name.unwrap_or_default())?;
                } else {
                    // `/**/driver` says where the node may be, but not which one it is.
                    let is_shared = name.is_some_and(|name| name.contains('*'));
                    match value {
                        Value::Null => {}
                        Value::Mapping(_) => self.group(value, path, String::new(), is_shared)?,
                        _ => return Err(self.error(path, "parameters with values are needed")),
                    }
                }
            } else {
                self.sections(value, path)?;
            }
            path.pop();
        }
        Ok(())
    }

    /// Skips the section of another node, if it is one.
    fn other(&mut self, section: &[String], name: &str) -> Result<(), FileError> {
        let (node, default_node) = (self.names.node(), self.default_node);
        // `axis_driver_left` is another name, and so is the present name of the node.
        let is_own = name.starts_with(default_node) || name == node || name.contains('*');
        if !is_own && nearest(name, [default_node]).is_some() {
            let why = format!("there is no node \"{name}\"; did you mean \"{default_node}\"?");
            return Err(self.error(section, &why));
        }
        self.found.others.push((self.origin(section), section.join("/")));
        Ok(())
    }

    fn origin(&self, path: &[String]) -> Origin {
        match line_of(self.text, path) {
            Some(line) => Origin(format!("{}:{line}", self.file)),
            None => Origin(self.file.to_owned()),
        }
    }

    /// Takes parameters; groups become a prefix with a dot.
    fn group(
        &mut self,
        map: &Value,
        path: &mut Vec<String>,
        prefix: String,
        is_shared: bool,
    ) -> Result<(), FileError> {
        let Value::Mapping(map) = map else { return Ok(()) };
        for (key, value) in map {
            let Value::String(key) = key else {
                return Err(self.error(path, "the name of a parameter is needed"));
            };
            path.push(key.clone());
            let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
            if matches!(value, Value::Mapping(_)) {
                self.group(value, path, name, is_shared)?;
            } else {
                let value = value_of(value)
                    .map_err(|why| self.error(path, &format!("parameter \"{name}\": {why}")))?;
                let origin = self.origin(path);
                self.found.overrides.push(Override { name, value, origin, is_shared });
            }
            path.pop();
        }
        Ok(())
    }

    fn error(&self, path: &[String], reason: &str) -> FileError {
        FileError::new(self.file, line_of(self.text, path), reason)
    }
}

/// A scalar or an array of one type; `None` for an empty array.
fn value_of(value: &Value) -> Result<Option<ParameterValue>, String> {
    let scalar = |value: &Value| match value {
        Value::Bool(value) => Ok(ParameterValue::Bool(*value)),
        Value::String(value) => Ok(ParameterValue::String(value.clone())),
        Value::Number(number) => match (number.as_i64(), number.as_f64()) {
            (Some(whole), _) => Ok(ParameterValue::Integer(whole)),
            (None, Some(real)) if number.is_f64() => Ok(ParameterValue::Double(real)),
            _ => Err(format!("{number} is beyond 64-bit integers")),
        },
        Value::Null => Err("it has no value".to_owned()),
        _ => Err("a bool, a number, a string or a list of these is needed".to_owned()),
    };
    let Value::Sequence(items) = value else { return scalar(value).map(Some) };
    let items = items.iter().map(scalar).collect::<Result<Vec<_>, _>>()?;
    let mixed =
        || "the values of a list must be of one type (1.0 is a double, 1 an integer)".into();
    macro_rules! array {
        ($variant:ident, $array:ident) => {
            items
                .into_iter()
                .map(|item| match item {
                    ParameterValue::$variant(value) => Ok(value),
                    _ => Err(mixed()),
                })
                .collect::<Result<Vec<_>, String>>()
                .map(|values| Some(ParameterValue::$array(values)))
        };
    }
    match items.first() {
        None => Ok(None),
        Some(ParameterValue::Bool(_)) => array!(Bool, BoolArray),
        Some(ParameterValue::Integer(_)) => array!(Integer, IntegerArray),
        Some(ParameterValue::Double(_)) => array!(Double, DoubleArray),
        _ => array!(String, StringArray),
    }
}

/// Whether a section's keys mean the node: `*` is one part of its name, `**`
/// any number of them.
fn matches(section: &[String], node: &str) -> bool {
    let joined = section.join("/");
    let pattern: Vec<&str> = joined.split('/').filter(|part| !part.is_empty()).collect();
    let name: Vec<&str> = node.split('/').filter(|part| !part.is_empty()).collect();
    parts_match(&pattern, &name)
}

fn parts_match(pattern: &[&str], name: &[&str]) -> bool {
    match (pattern, name) {
        ([], []) => true,
        (["**", rest @ ..], _) => (0..=name.len()).any(|skip| parts_match(rest, &name[skip..])),
        (["*", rest @ ..], [_, others @ ..]) => parts_match(rest, others),
        ([first, rest @ ..], [part, others @ ..]) => first == part && parts_match(rest, others),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command_line::names::Remap;

    fn names() -> Names {
        let ns = Remap::new("__ns", "/cell/mill");
        Names::new("driver", &[ns]).expect("valid")
    }

    fn found(text: &str) -> Vec<(String, Option<ParameterValue>, String)> {
        let found = read(text, "f.yaml", &names(), "driver").expect("valid");
        found.overrides.into_iter().map(|one| (one.name, one.value, one.origin.0)).collect()
    }

    #[test]
    fn sections_are_taken_in_order_and_groups_become_dotted_names() {
        let text = "\
/**:
  ros__parameters:
    use_sim_time: true
/cell/mill/driver:
  ros__parameters:
    port: /dev/ttyUSB0
    limits:
      feed_mm_per_min: 5000.0
      axes: [1, 2]
other:
  ros__parameters: {port: x}
cell:
  mill:
    driver:
      ros__parameters: {port: last, empty: []}
";
        let expected = [
            ("use_sim_time", Some(ParameterValue::Bool(true)), "f.yaml:3"),
            ("port", Some("/dev/ttyUSB0".into()), "f.yaml:6"),
            ("limits.feed_mm_per_min", Some(5000.0.into()), "f.yaml:8"),
            ("limits.axes", Some(vec![1, 2].into()), "f.yaml:9"),
            ("port", Some("last".into()), "f.yaml:15"),
            ("empty", None, "f.yaml:15"),
        ];
        let expected: Vec<_> = expected
            .into_iter()
            .map(|(name, value, origin)| (name.to_owned(), value, origin.to_owned()))
            .collect();
        assert_eq!(found(text), expected);
    }

    #[test]
    fn wildcards_stand_for_parts_of_a_node_s_name() {
        let table = [
            ("/**", true),
            ("**", true),
            ("/*", false),
            ("/*/*/driver", true),
            ("/**/driver", true),
            ("/cell/**", true),
            ("/cell/*/driver", true),
            ("/cell/mill/*", true),
            ("/cell/*", false),
            ("/*/mill/*", true),
            ("**/driver", true),
            ("/cell/mill/driver/**", true),
            ("/cell/mill", false),
            ("driver", false),
            ("/cell/lathe/driver", false),
        ];
        for (section, expected) in table {
            let text = format!("\"{section}\":\n  ros__parameters:\n    a: 1\n");
            assert_eq!(!found(&text).is_empty(), expected, "{section}");
        }
    }

    #[test]
    fn what_is_no_parameter_file_is_refused_with_the_line() {
        let table = [
            ("- 1\n", "f.yaml: "),
            ("5\n", "f.yaml: "),
            ("/**:\n  port: 1\n", "f.yaml:2: ros__parameters is missing"),
            ("/**:\n  ros__parameters: 5\n", "f.yaml:2: parameters with values"),
            ("/**:\n  ros__parameters:\n    a:\n", "f.yaml:3: parameter \"a\": it has no value"),
            ("/**:\n  ros__parameters:\n    a: [1, x]\n", "f.yaml:3: parameter \"a\": the values"),
            ("/**:\n  ros__parameters:\n    a: [[1]]\n", "f.yaml:3: parameter \"a\": a bool"),
            ("/**:\n  ros__parameters:\n    5: x\n", "f.yaml:2: the name of a parameter"),
            ("/**:\n  ros__parameters:\n    a: 1\n    a: 2\n", "f.yaml:"),
            ("/**:\n  ros__parameters:\n    a: 18446744073709551615\n", "f.yaml:3: "),
            ("a: [\n", "f.yaml:"),
            ("/cell/mill/diver:\n  ros__parameters:\n    a: 1\n", "f.yaml:1: there is no node"),
        ];
        for (text, start) in table {
            let error = read(text, "f.yaml", &names(), "driver").expect_err(text).to_string();
            assert!(error.starts_with(start), "{text}: {error}");
        }
        assert_eq!(found(""), []);
        assert_eq!(found("/**:\n  ros__parameters:\n"), []);
    }

    #[test]
    fn an_argument_may_be_for_another_node() {
        let argument = |node: Option<&str>, name: &str, yaml: &str| ParameterArgument {
            node: node.map(str::to_owned),
            name: name.into(),
            yaml: yaml.into(),
        };
        let arguments = [
            argument(None, "a", "1.5"),
            argument(Some("planner"), "b", "2"),
            argument(Some("driver"), "c", "[x, y]"),
            argument(None, "d", ""),
            argument(None, "e", "\"5\""),
        ];
        let found = from_arguments(&arguments, &names(), "driver").expect("valid");
        let values: Vec<_> = found.into_iter().map(|one| (one.name, one.value)).collect();
        let strings = vec!["x".to_owned(), "y".to_owned()];
        assert_eq!(
            values,
            [
                ("a".to_owned(), Some(1.5.into())),
                ("c".to_owned(), Some(strings.into())),
                ("d".to_owned(), Some("".into())),
                ("e".to_owned(), Some("5".into())),
            ]
        );
        for yaml in ["{a: 1}", "[1, [2]]", "~", "{"] {
            assert!(from_arguments(&[argument(None, "a", yaml)], &names(), "driver").is_err());
        }
    }
}
