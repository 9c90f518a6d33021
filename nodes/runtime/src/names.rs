//! ROS names: what is valid, and where a relative one leads.
//!
//! Follows the ROS 2 design articles on topic and service names and on static
//! remapping. Pure: names and rules in, a name or the reason against it out.

/// A name that is not valid, and why.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("invalid name \"{name}\": {reason}")]
pub struct NameError {
    /// The name as it was given.
    pub name: String,
    /// What is wrong with it.
    pub reason: String,
}

/// One `from:=to`, valid for one node when `node` is given.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Remap {
    /// The base name of the only node the rule is for.
    pub node: Option<String>,
    /// The name as the node's source writes it, or as it is expanded.
    pub from: String,
    /// What it becomes.
    pub to: String,
}

/// Where a node stands and which names are replaced.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Names {
    namespace: String,
    node: String,
    remaps: Vec<Remap>,
}

impl Names {
    /// Places the node `default_node`, after `__node` and `__ns` of the rules
    /// that are for all nodes or for this one.
    ///
    /// # Errors
    /// Any of the names is not valid.
    pub fn new(default_node: &str, remaps: &[Remap]) -> Result<Self, NameError> {
        check_node(default_node)?;
        let concerns = |rule: &&Remap| rule.node.as_ref().is_none_or(|node| node == default_node);
        let rules: Vec<&Remap> = remaps.iter().filter(concerns).collect();
        let last = |name: &str| rules.iter().rev().find(|rule| rule.from == name);
        let node = last("__node").map_or(default_node, |rule| &rule.to).to_owned();
        check_node(&node)?;
        let namespace = last("__ns").map_or("/", |rule| &rule.to);
        let namespace = namespace_of(namespace)?;
        let mut names = Self { namespace, node, remaps: Vec::new() };
        for rule in rules.into_iter().filter(|rule| rule.from != "__node" && rule.from != "__ns") {
            let rule =
                Remap { node: None, from: names.expand(&rule.from)?, to: names.expand(&rule.to)? };
            names.remaps.push(rule);
        }
        Ok(names)
    }

    /// `/` or `/cell/mill`.
    pub fn namespace(&self) -> &str {
        &self.namespace
    }

    /// The node's own name.
    pub fn node(&self) -> &str {
        &self.node
    }

    /// `/cell/mill/axis_driver`.
    pub fn fully_qualified(&self) -> String {
        join(&self.namespace, &self.node)
    }

    /// `cell.mill.axis_driver`, the name under which the node logs.
    pub fn logger(&self) -> String {
        self.fully_qualified()[1..].replace('/', ".")
    }

    /// The absolute name that `name` stands for: relative to the namespace,
    /// `~/` to the node; then the first rule for it is applied, once.
    ///
    /// # Errors
    /// The name is not valid.
    pub fn resolve(&self, name: &str) -> Result<String, NameError> {
        let expanded = self.expand(name)?;
        let rule = self.remaps.iter().find(|rule| rule.from == expanded);
        Ok(rule.map_or(expanded, |rule| rule.to.clone()))
    }

    fn expand(&self, name: &str) -> Result<String, NameError> {
        let expanded = if name == "~" {
            self.fully_qualified()
        } else if let Some(rest) = name.strip_prefix("~/") {
            join(&self.fully_qualified(), rest)
        } else if name.starts_with('/') {
            name.to_owned()
        } else {
            join(&self.namespace, name)
        };
        match fault(&expanded) {
            _ if name.is_empty() => Err(invalid(name, "it is empty")),
            Some(reason) => Err(invalid(name, &reason)),
            None => Ok(expanded),
        }
    }
}

/// Checks the name of a node: letters, digits and single underscores.
///
/// # Errors
/// The name is not valid.
pub fn check_node(name: &str) -> Result<(), NameError> {
    if name.contains('/') {
        return Err(invalid(name, "a node's name holds no slash; its namespace is set by __ns"));
    }
    match fault(&format!("/{name}")) {
        Some(reason) => Err(invalid(name, &reason)),
        None => Ok(()),
    }
}

fn namespace_of(name: &str) -> Result<String, NameError> {
    let absolute = if name.starts_with('/') { name.to_owned() } else { format!("/{name}") };
    match fault(&absolute) {
        _ if absolute == "/" => Ok(absolute),
        Some(reason) => Err(invalid(name, &reason)),
        None => Ok(absolute),
    }
}

fn join(namespace: &str, name: &str) -> String {
    match namespace {
        "/" => format!("/{name}"),
        _ => format!("{namespace}/{name}"),
    }
}

fn invalid(name: &str, reason: &str) -> NameError {
    NameError { name: name.to_owned(), reason: reason.to_owned() }
}

/// What is wrong with an absolute name.
fn fault(absolute: &str) -> Option<String> {
    if absolute.len() > 240 {
        return Some(format!("{} characters; at most 240 are allowed", absolute.len()));
    }
    for token in absolute[1..].split('/') {
        match token.chars().next() {
            None => return Some("a part of it is empty (two slashes, or one at the end)".into()),
            Some(first) if first.is_ascii_digit() => {
                return Some(format!("\"{token}\" begins with a digit"));
            }
            Some(_) => {}
        }
        if let Some(other) = token.chars().find(|c| !c.is_ascii_alphanumeric() && *c != '_') {
            return Some(match other {
                '{' | '}' => "substitutions in braces are not supported".to_owned(),
                '~' => "~ stands only at the beginning, before a slash".to_owned(),
                _ => format!("{other:?} is neither a letter, a digit, an underscore nor a slash"),
            });
        }
        if token.contains("__") {
            return Some(format!("\"{token}\" has two underscores in a row"));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rule(from: &str, to: &str) -> Remap {
        Remap { node: None, from: from.into(), to: to.into() }
    }

    #[test]
    fn a_relative_name_stands_in_the_namespace_and_a_private_one_under_the_node() {
        let names = Names::new("driver", &[rule("__ns", "/cell/mill")]).expect("valid");
        let table = [
            ("machine_state", "/cell/mill/machine_state"),
            ("compensated_path/chunks", "/cell/mill/compensated_path/chunks"),
            ("~/get_state", "/cell/mill/driver/get_state"),
            ("~", "/cell/mill/driver"),
            ("/diagnostics", "/diagnostics"),
        ];
        for (name, resolved) in table {
            assert_eq!(names.resolve(name).expect(name), resolved);
        }
        assert_eq!(names.logger(), "cell.mill.driver");
    }

    #[test]
    fn node_and_namespace_are_replaced_before_topics() {
        let rules = [
            rule("~/status", "/plant/status"),
            rule("state", "~/state"),
            rule("__node", "lathe_driver"),
            rule("__ns", "lathe"),
        ];
        let names = Names::new("driver", &rules).expect("valid");
        assert_eq!(names.fully_qualified(), "/lathe/lathe_driver");
        assert_eq!(names.resolve("state").expect("valid"), "/lathe/lathe_driver/state");
        assert_eq!(names.resolve("~/status").expect("valid"), "/plant/status");
        assert_eq!(names.resolve("/lathe/state").expect("valid"), "/lathe/lathe_driver/state");
    }

    #[test]
    fn the_first_rule_for_a_name_counts_and_rules_do_not_chain() {
        let rules = [rule("a", "b"), rule("b", "c"), rule("a", "d")];
        let names = Names::new("n", &rules).expect("valid");
        assert_eq!(names.resolve("a").expect("valid"), "/b");
        assert_eq!(names.resolve("b").expect("valid"), "/c");
    }

    #[test]
    fn a_rule_for_another_node_is_not_ours() {
        let other = Remap { node: Some("planner".into()), ..rule("a", "b") };
        let ours = Remap { node: Some("driver".into()), ..rule("a", "c") };
        let names = Names::new("driver", &[other, ours]).expect("valid");
        assert_eq!(names.resolve("a").expect("valid"), "/c");
    }

    #[test]
    fn invalid_names_are_refused_with_the_reason() {
        let names = Names::new("n", &[]).expect("valid");
        let table = [
            ("", "empty"),
            ("/", "empty"),
            ("a/", "empty"),
            ("a//b", "empty"),
            ("2a", "digit"),
            ("a/2b", "digit"),
            ("a b", "neither"),
            ("~a", "~ stands only"),
            ("a/~", "~ stands only"),
            ("a__b", "underscores"),
            ("a{b}", "braces"),
            ("gr\u{f6}\u{df}e", "neither"),
        ];
        for (name, part) in table {
            let error = names.resolve(name).expect_err(name);
            assert!(error.reason.contains(part), "{name}: {error}");
        }
        let long = "a".repeat(300);
        assert!(names.resolve(&long).is_err());
        assert!(Names::new("a/b", &[]).is_err());
        assert!(Names::new("n", &[rule("__ns", "/a/")]).is_err());
        assert!(Names::new("n", &[rule("x y", "z")]).is_err());
    }
}
