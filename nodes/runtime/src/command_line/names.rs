//! ROS names: validity, resolution and remapping.
//!
//! Follows the ROS 2 design articles on topic and service names and on static
//! remapping. Pure: returns a name, or why it is not valid.

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
    /// What it is for.
    pub scope: Scope,
    /// The name as the node's source writes it, or as it is expanded.
    pub from: String,
    /// What it becomes.
    pub to: String,
}

impl Remap {
    /// A rule for every node and everything.
    pub fn new(from: &str, to: &str) -> Self {
        Self { node: None, scope: Scope::Any, from: from.to_owned(), to: to.to_owned() }
    }
}

/// What a rule is for: `rostopic://` and `rosservice://` before it narrow it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    Any,
    Topic,
    Service,
}

/// The name and namespace of a node, and its remapping rules.
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
        let is_for = |rule: &&Remap, name: &str| rule.node.as_ref().is_none_or(|node| node == name);
        // As in rcl the first rule counts, for the node as for topics.
        let renamed =
            remaps.iter().find(|rule| rule.from == "__node" && is_for(rule, default_node));
        let node = renamed.map_or(default_node, |rule| &rule.to).to_owned();
        check_node(&node)?;
        // A rule may mean the node by the name that it has now, as in rcl, or by its own.
        let is_ours = |rule: &&Remap| is_for(rule, &node) || is_for(rule, default_node);
        let rules = remaps.iter().filter(is_ours);
        let moved = rules.clone().find(|rule| rule.from == "__ns");
        let namespace = namespace_of(moved.map_or("/", |rule| &rule.to))?;
        let mut names = Self { namespace, node: node.clone(), remaps: Vec::new() };
        for rule in rules.filter(|rule| rule.from != "__node" && rule.from != "__ns") {
            let (from, to) = (names.expand(&rule.from)?, names.expand(&rule.to)?);
            names.remaps.push(Remap { node: None, scope: rule.scope, from, to });
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

    /// What stands before the names of the machine's frames, so that two machines have frames
    /// of their own in one `/tf`: `wanted`, or the namespace (`cell/mill/`) if that is empty.
    /// `/` is no prefix.
    pub fn frame_prefix(&self, wanted: &str) -> String {
        match (wanted, &self.namespace[1..]) {
            ("/", _) | ("", "") => String::new(),
            ("", namespace) => format!("{namespace}/"),
            (wanted, _) => wanted.to_owned(),
        }
    }

    /// The absolute name that `name` stands for: relative to the namespace,
    /// `~/` to the node; then the first rule for it is applied, once. Rules for
    /// topics or for services alone do not count.
    ///
    /// # Errors
    /// The name is not valid.
    pub fn resolve(&self, name: &str) -> Result<String, NameError> {
        self.resolve_as(name, Scope::Any)
    }

    /// The same for a topic or a service, with the rules for these.
    ///
    /// # Errors
    /// The name is not valid.
    pub fn resolve_as(&self, name: &str, scope: Scope) -> Result<String, NameError> {
        let expanded = self.expand(name)?;
        let counts = |rule: &&Remap| rule.scope == Scope::Any || rule.scope == scope;
        let rule = self.remaps.iter().filter(counts).find(|rule| rule.from == expanded);
        Ok(rule.map_or(expanded, |rule| rule.to.clone()))
    }

    fn expand(&self, given: &str) -> Result<String, NameError> {
        let name = &given
            .replace("{node}", &self.node)
            .replace("{ns}", &self.namespace)
            .replace("{namespace}", &self.namespace);
        let name = name.as_str();
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
            _ if name.is_empty() => Err(invalid(given, "it is empty")),
            Some(reason) => Err(invalid(given, &reason)),
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
                '{' | '}' => "the substitutions are {node}, {ns} and {namespace}".to_owned(),
                '~' => "~ may only be at the beginning, before a slash".to_owned(),
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
        Remap::new(from, to)
    }

    #[test]
    fn a_namespace_is_prefix_enough_for_the_frames_of_a_machine() {
        // The namespace, the parameter, the prefix.
        let table = [
            ("/", "", ""),
            ("/", "left_", "left_"),
            ("/mill", "", "mill/"),
            ("/cell/mill", "", "cell/mill/"),
            ("/cell/mill", "left_", "left_"),
            ("/cell/mill", "/", ""),
            ("/", "/", ""),
        ];
        for (namespace, wanted, expected) in table {
            let names = Names::new("axis_driver", &[Remap::new("__ns", namespace)]);
            let prefix = names.expect("valid").frame_prefix(wanted);
            assert_eq!(prefix, expected, "{namespace} {wanted:?}");
        }
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
    fn of_rules_for_the_node_itself_the_first_counts_too() {
        let for_node =
            |node: &str, from: &str, to: &str| Remap { node: Some(node.into()), ..rule(from, to) };
        let table: Vec<(Vec<Remap>, &str, &str)> = vec![
            (vec![rule("__node", "a"), rule("__node", "b")], "/a", "/x"),
            (vec![rule("__ns", "/a"), rule("__ns", "/b")], "/a/driver", "/a/x"),
            (vec![for_node("planner", "__ns", "/a"), rule("__ns", "/b")], "/b/driver", "/b/x"),
            (vec![for_node("driver", "__node", "left")], "/left", "/x"),
            // By the name that it has now, or by its own.
            (vec![rule("__node", "left"), for_node("left", "x", "y")], "/left", "/y"),
            (vec![rule("__node", "left"), for_node("driver", "x", "y")], "/left", "/y"),
            (vec![rule("__node", "left"), for_node("left", "__ns", "/a")], "/a/left", "/a/x"),
        ];
        for (rules, full, resolved) in table {
            let names = Names::new("driver", &rules).expect("valid");
            assert_eq!(names.fully_qualified(), full, "{rules:?}");
            assert_eq!(names.resolve("x").expect("valid"), resolved, "{rules:?}");
        }
    }

    #[test]
    fn a_rule_may_be_for_topics_or_services_alone() {
        let only = |scope, from: &str, to: &str| Remap { scope, ..rule(from, to) };
        let rules = [
            only(Scope::Service, "feed_hold", "hold_service"),
            only(Scope::Topic, "feed_hold", "hold_topic"),
            rule("resume", "go"),
        ];
        let names = Names::new("driver", &rules).expect("valid");
        let resolve = |name, scope| names.resolve_as(name, scope).expect("valid");
        assert_eq!(resolve("feed_hold", Scope::Service), "/hold_service");
        assert_eq!(resolve("feed_hold", Scope::Topic), "/hold_topic");
        assert_eq!(resolve("feed_hold", Scope::Any), "/feed_hold");
        for scope in [Scope::Any, Scope::Topic, Scope::Service] {
            assert_eq!(resolve("resume", scope), "/go");
        }
    }

    #[test]
    fn names_may_hold_the_node_and_its_namespace() {
        let rules = [rule("__ns", "/cell"), rule("state", "{ns}/states/{node}")];
        let names = Names::new("driver", &rules).expect("valid");
        assert_eq!(names.resolve("state").expect("valid"), "/cell/states/driver");
        assert_eq!(names.resolve("{node}/x").expect("valid"), "/cell/driver/x");
        assert_eq!(names.resolve("{namespace}/x").expect("valid"), "/cell/x");
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
            ("~a", "~ may only be"),
            ("a/~", "~ may only be"),
            ("a__b", "underscores"),
            ("a{b}", "{node}, {ns}"),
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
