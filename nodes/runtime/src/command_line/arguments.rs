//! The command line of a ROS 2 node.
//!
//! Knows the whole grammar between `--ros-args` and `--`; everything outside
//! is the node's own. Pure: reads a list of words, no files.

use crate::command_line::names::{Remap, Scope, check_node};

/// The parsed command line.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Arguments {
    /// `-r [node:]from:=to`, in order.
    pub remaps: Vec<Remap>,
    /// `-p [node:]name:=yaml`, in order.
    pub parameters: Vec<ParameterArgument>,
    /// `--params-file`, in order.
    pub parameter_files: Vec<String>,
    /// `--log-level [logger:=]level`, in order.
    pub log_levels: Vec<LogLevelArgument>,
    /// `--enclave`, the last one: where the keys of the node are.
    pub enclave: Option<String>,
    /// Logs do not go to `/rosout`.
    pub disable_rosout: bool,
    /// Logs do not go to the console.
    pub disable_console: bool,
    /// Arguments that are valid but have no effect here; for the log.
    pub warnings: Vec<String>,
    /// The words that are not for ROS.
    pub rest: Vec<String>,
}

/// One `-p`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ParameterArgument {
    /// The base name of the only node it is for: `-p axis_driver:port:=/dev/ttyUSB0`.
    pub node: Option<String>,
    pub name: String,
    /// The value as YAML.
    pub yaml: String,
}

/// One `--log-level`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogLevelArgument {
    /// The logger and all below it; none: all.
    pub logger: Option<String>,
    /// `None` removes a level that was given before.
    pub level: Option<LogLevel>,
}

/// How important a message is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LogLevel {
    Debug,
    Info,
    Warn,
    Error,
    Fatal,
}

/// A word that is not valid.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("argument \"{argument}\": {reason}")]
pub struct ArgumentError {
    pub argument: String,
    pub reason: String,
}

impl Arguments {
    /// Reads the words after the program's name.
    ///
    /// # Errors
    /// A word between `--ros-args` and `--` is unknown or incomplete.
    pub fn parse(words: &[String]) -> Result<Self, ArgumentError> {
        let mut found = Self::default();
        let mut words = words.iter();
        let mut is_ros = false;
        while let Some(word) = words.next() {
            match word.as_str() {
                "--ros-args" => is_ros = true,
                "--" if is_ros => is_ros = false,
                _ if is_ros => found.take(word, &mut words)?,
                _ => found.rest.push(word.clone()),
            }
        }
        Ok(found)
    }

    fn take(
        &mut self,
        word: &str,
        words: &mut std::slice::Iter<'_, String>,
    ) -> Result<(), ArgumentError> {
        let mut value = |what: &str| {
            words
                .next()
                .map(String::as_str)
                .ok_or_else(|| refuse(word, &format!("{what} is missing after it")))
        };
        match word {
            "-r" | "--remap" => self.remaps.push(remap(value("from:=to")?)?),
            "-p" | "--param" => self.parameters.push(parameter(value("name:=value")?)?),
            "--params-file" => self.parameter_files.push(value("a file name")?.to_owned()),
            "--log-level" => self.log_levels.push(log_level(value("a level")?)?),
            "--disable-rosout-logs" => self.disable_rosout = true,
            "--enable-rosout-logs" => self.disable_rosout = false,
            "--disable-stdout-logs" => self.disable_console = true,
            "--enable-stdout-logs" => self.disable_console = false,
            "-e" | "--enclave" => {
                let name = value("an enclave, as /cell/mill,")?;
                check_enclave(name)?;
                self.enclave = Some(name.to_owned());
            }
            "--log-config-file" | "--log-file-name" => {
                let value = value("a value")?;
                self.warnings.push(format!("{word} {value} is not supported and has no effect"));
            }
            "--enable-external-lib-logs" | "--disable-external-lib-logs" => {
                self.warnings.push(format!("{word} is not supported and has no effect"));
            }
            _ if word.contains(":=") => {
                return Err(refuse(word, "put -r (remap) or -p (parameter) before it"));
            }
            _ => {
                return Err(refuse(
                    word,
                    "unknown between --ros-args and --; known are -r, -p, --params-file, \
                     --log-level, --enclave, --disable-rosout-logs, --disable-stdout-logs; \
                     arguments of the node itself go before --ros-args or after --",
                ));
            }
        }
        Ok(())
    }
}

/// `[node:]from:=to`.
fn remap(rule: &str) -> Result<Remap, ArgumentError> {
    let (scope, plain) = without_scope(rule);
    let (node, from, to) = rule_parts(&plain, "from:=to")?;
    let from = match from {
        // The two names that rcl knows for it.
        "__name" | "__node" => "__node",
        other => other,
    };
    if to.is_empty() {
        return Err(refuse(rule, "there is no name after :="));
    }
    if from == "__node" {
        check_node(to).map_err(|error| refuse(rule, &error.to_string()))?;
    }
    Ok(Remap { node, scope, from: from.to_owned(), to: to.to_owned() })
}

/// Cuts `rostopic://` or `rosservice://` out of a rule, which stands before the name or
/// between the node and the name.
fn without_scope(rule: &str) -> (Scope, String) {
    let left = rule.find(":=").map_or(rule, |end| &rule[..end]);
    for (word, scope) in [("rostopic://", Scope::Topic), ("rosservice://", Scope::Service)] {
        match left.find(word) {
            Some(at) if at == 0 || left[..at].ends_with(':') => {
                return (scope, format!("{}{}", &rule[..at], &rule[at + word.len()..]));
            }
            _ => {}
        }
    }
    (Scope::Any, rule.to_owned())
}

/// `[node:]name:=yaml`.
fn parameter(rule: &str) -> Result<ParameterArgument, ArgumentError> {
    let (node, name, yaml) = rule_parts(rule, "name:=value")?;
    Ok(ParameterArgument { node, name: name.to_owned(), yaml: yaml.to_owned() })
}

fn rule_parts<'a>(
    rule: &'a str,
    form: &str,
) -> Result<(Option<String>, &'a str, &'a str), ArgumentError> {
    let Some((left, right)) = rule.split_once(":=") else {
        return Err(refuse(rule, &format!("{form} is needed, or node:{form}")));
    };
    let (node, name) = match left.split_once(':') {
        None => (None, left),
        Some((node, name)) => {
            check_node(node).map_err(|error| refuse(rule, &error.to_string()))?;
            (Some(node.to_owned()), name)
        }
    };
    if name.is_empty() {
        return Err(refuse(rule, "there is no name before :="));
    }
    if name.contains(':') {
        return Err(refuse(rule, "there are too many colons before :="));
    }
    Ok((node, name, right))
}

/// `/` or `/cell/mill`.
fn check_enclave(name: &str) -> Result<(), ArgumentError> {
    let is_token = |token: &str| {
        !token.is_empty() && token.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
    };
    match name.strip_prefix('/') {
        Some("") => Ok(()),
        Some(rest) if name.len() <= 255 && rest.split('/').all(is_token) => Ok(()),
        _ => Err(refuse(
            name,
            "an enclave begins with a slash, and its parts are letters, digits and underscores: /cell/mill",
        )),
    }
}

/// `[logger:=]level`.
fn log_level(text: &str) -> Result<LogLevelArgument, ArgumentError> {
    let (logger, level) = match text.split_once(":=") {
        Some((logger, level)) => (Some(logger.to_owned()), level),
        None => (None, text),
    };
    let level = match level.to_ascii_lowercase().as_str() {
        "unset" => None,
        "debug" => Some(LogLevel::Debug),
        "info" => Some(LogLevel::Info),
        "warn" | "warning" => Some(LogLevel::Warn),
        "error" => Some(LogLevel::Error),
        "fatal" => Some(LogLevel::Fatal),
        _ => return Err(refuse(text, "debug, info, warn, error or fatal is needed")),
    };
    Ok(LogLevelArgument { logger, level })
}

fn refuse(argument: &str, reason: &str) -> ArgumentError {
    ArgumentError { argument: argument.to_owned(), reason: reason.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &str) -> Result<Arguments, ArgumentError> {
        let words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
        Arguments::parse(&words)
    }

    fn rule(node: Option<&str>, from: &str, to: &str) -> Remap {
        Remap { node: node.map(str::to_owned), ..Remap::new(from, to) }
    }

    #[test]
    fn every_kind_of_argument_is_understood() {
        let found = parse(
            "part.mpf --ros-args -r a:=b --remap driver:c:=/d -r __ns:=/cell -r __name:=left \
             -p port:=/dev/ttyUSB0 -p axis_driver:baud:=115200 --params-file one.yaml \
             --params-file two.yaml --log-level debug --log-level cell.left:=WARN \
             --disable-rosout-logs --disable-stdout-logs -- --own flag --ros-args -r e:=f",
        )
        .expect("valid");
        let parameter = |node: Option<&str>, name: &str, yaml: &str| ParameterArgument {
            node: node.map(str::to_owned),
            name: name.into(),
            yaml: yaml.into(),
        };
        assert_eq!(
            found.remaps,
            [
                rule(None, "a", "b"),
                rule(Some("driver"), "c", "/d"),
                rule(None, "__ns", "/cell"),
                rule(None, "__node", "left"),
                rule(None, "e", "f"),
            ]
        );
        assert_eq!(
            found.parameters,
            [
                parameter(None, "port", "/dev/ttyUSB0"),
                parameter(Some("axis_driver"), "baud", "115200"),
            ]
        );
        assert_eq!(found.parameter_files, ["one.yaml", "two.yaml"]);
        assert_eq!(found.log_levels.len(), 2);
        assert_eq!(found.log_levels[1].logger.as_deref(), Some("cell.left"));
        assert_eq!(found.log_levels[1].level, Some(LogLevel::Warn));
        assert!(found.disable_rosout && found.disable_console);
        assert_eq!(found.rest, ["part.mpf", "--own", "flag"]);
        assert!(found.warnings.is_empty());
    }

    #[test]
    fn every_form_of_a_rule_is_understood() {
        let table = [
            ("a:=b", None, Scope::Any, "a", "b"),
            ("/cell/a:=/b", None, Scope::Any, "/cell/a", "/b"),
            ("~/a:={ns}/b", None, Scope::Any, "~/a", "{ns}/b"),
            ("driver:~/a:=b", Some("driver"), Scope::Any, "~/a", "b"),
            ("rostopic://a:=b", None, Scope::Topic, "a", "b"),
            ("rosservice:///a/b:=c", None, Scope::Service, "/a/b", "c"),
            ("driver:rostopic://a:=/b", Some("driver"), Scope::Topic, "a", "/b"),
            ("driver:__ns:=/cell", Some("driver"), Scope::Any, "__ns", "/cell"),
            ("driver:__name:=left", Some("driver"), Scope::Any, "__node", "left"),
        ];
        for (text, node, scope, from, to) in table {
            let found = parse(&format!("--ros-args -r {text}")).expect(text);
            assert_eq!(found.remaps, [Remap { scope, ..rule(node, from, to) }], "{text}");
        }
    }

    #[test]
    fn what_is_switched_off_can_be_switched_on_again_and_the_last_word_counts() {
        let table = [
            ("", false, false),
            ("--disable-rosout-logs", true, false),
            ("--disable-stdout-logs --enable-stdout-logs", false, false),
            ("--enable-rosout-logs --disable-rosout-logs --disable-stdout-logs", true, true),
        ];
        for (words, rosout, console) in table {
            let found = parse(&format!("--ros-args {words} --")).expect(words);
            assert_eq!((found.disable_rosout, found.disable_console), (rosout, console), "{words}");
        }
    }

    #[test]
    fn a_value_may_hold_colons_and_spaces() {
        let words = ["--ros-args", "-p", "a:='x:=y: z'"].map(str::to_owned);
        let found = Arguments::parse(&words).expect("valid");
        assert_eq!(found.parameters[0].yaml, "'x:=y: z'");
        let found = parse("--ros-args -p empty:=").expect("valid");
        assert_eq!(found.parameters[0].yaml, "");
    }

    #[test]
    fn what_is_valid_but_has_no_effect_is_a_warning() {
        let found =
            parse("--ros-args --log-file-name x -e /cell --enable-external-lib-logs -r a:=b");
        let found = found.expect("valid");
        assert_eq!(found.warnings.len(), 2);
        assert_eq!(found.remaps.len(), 1);
        assert_eq!(found.enclave.as_deref(), Some("/cell"));
    }

    #[test]
    fn what_is_wrong_is_refused_with_the_word_and_what_to_do() {
        let table = [
            ("--ros-args --wrong", "unknown between"),
            ("--ros-args part.mpf", "unknown between"),
            ("--ros-args a:=b", "put -r"),
            ("--ros-args -r", "missing after"),
            ("--ros-args -r ab", "from:=to is needed"),
            ("--ros-args -r :=b", "no name before"),
            ("--ros-args -r a:=", "no name after"),
            ("--ros-args -r a/b:c:=d", "slash"),
            ("--ros-args -r __node:=a/b", "slash"),
            ("--ros-args -p a:b:c:=d", "too many colons"),
            ("--ros-args -p :x:=1", "invalid name"),
            ("--ros-args --params-file", "missing after"),
            ("--ros-args --log-level loud", "debug, info"),
            ("--ros-args --log-level driver:=", "debug, info"),
            ("--ros-args --enclave", "missing after"),
            ("--ros-args --enclave cell", "begins with a slash"),
            ("--ros-args --enclave /cell//mill", "letters"),
            ("--ros-args --enclave /../mill", "letters"),
            ("--ros-args -r rostopic://:=b", "no name before"),
        ];
        for (line, part) in table {
            let error = parse(line).expect_err(line).to_string();
            assert!(error.contains(part), "{line}: {error}");
        }
    }

    #[test]
    fn without_ros_args_everything_is_the_node_s_own() {
        let found = parse("-r a:=b -- --ros-args").expect("valid");
        assert_eq!(found.rest, ["-r", "a:=b", "--"]);
    }
}
