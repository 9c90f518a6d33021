//! Names of types, fields and constants, and the rules that rosidl has for them.

use std::fmt;

/// The folder that a definition is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum InterfaceKind {
    Action,
    Msg,
    Srv,
}

impl InterfaceKind {
    pub const ALL: [Self; 3] = [Self::Msg, Self::Srv, Self::Action];

    /// Name of the folder, which is also the extension of its files.
    pub fn folder(self) -> &'static str {
        match self {
            Self::Action => "action",
            Self::Msg => "msg",
            Self::Srv => "srv",
        }
    }
}

/// Full name of a type: `geometry_msgs/msg/Point`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TypeName {
    pub package: String,
    pub kind: InterfaceKind,
    /// `Point`, or `LoadProgram_Request` for a derived type.
    pub name: String,
}

impl TypeName {
    pub fn new(package: &str, kind: InterfaceKind, name: &str) -> Self {
        Self { package: package.into(), kind, name: name.into() }
    }

    /// The type that ROS derives from this one: `_Request`, `_Goal`.
    pub fn derived(&self, suffix: &str) -> Self {
        Self::new(&self.package, self.kind, &format!("{}{suffix}", self.name))
    }

    /// The short form that schema texts use: `geometry_msgs/Point`.
    pub fn two_part(&self) -> String {
        format!("{}/{}", self.package, self.name)
    }

    /// Reads a name in a field of `context`: `Point`, `geometry_msgs/Point` or
    /// `geometry_msgs/msg/Point`.
    ///
    /// A name with an underscore is a derived type of the kind of `context`;
    /// nothing else may have one.
    pub fn parse(text: &str, context: &Self) -> Result<Self, String> {
        let parts: Vec<&str> = text.split('/').collect();
        let (package, kind, name) = match parts[..] {
            [name] => (context.package.as_str(), None, name),
            [package, name] => (package, None, name),
            [package, folder, name] => {
                let kind = InterfaceKind::ALL.into_iter().find(|kind| kind.folder() == folder);
                (package, Some(kind.ok_or(format!("{folder} is none of msg, srv, action"))?), name)
            }
            _ => return Err(format!("{text} is not a type; write package/Type")),
        };
        check_package(package)?;
        let (stem, derived) = match name.split_once('_') {
            Some((stem, _)) => (stem, true),
            None => (name, false),
        };
        check_type(stem)?;
        let kind = kind.unwrap_or(if derived { context.kind } else { InterfaceKind::Msg });
        if derived && kind == InterfaceKind::Msg {
            return Err(format!("{name} has an underscore; types are named LikeThis"));
        }
        Ok(Self::new(package, kind, name))
    }
}

impl fmt::Display for TypeName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}/{}", self.package, self.kind.folder(), self.name)
    }
}

/// Refuses what is not `like_this`: the rule for packages.
pub fn check_package(name: &str) -> Result<(), String> {
    is_lower_snake(name).then_some(()).ok_or(format!("package {name:?} is not named like_this"))
}

/// Refuses what is not `like_this`: the rule for fields.
pub fn check_field(name: &str) -> Result<(), String> {
    is_lower_snake(name).then_some(()).ok_or(format!(
        "field {name:?} is not named like_this: a to z first, no underscore at the end, none doubled"
    ))
}

/// Refuses what is not `LikeThis`: the rule for types.
pub fn check_type(name: &str) -> Result<(), String> {
    let valid = name.starts_with(|c: char| c.is_ascii_uppercase())
        && name.chars().all(|c| c.is_ascii_alphanumeric());
    valid.then_some(()).ok_or(format!("type {name:?} is not named LikeThis"))
}

/// Refuses what is not `LIKE_THIS`: the rule for constants.
pub fn check_constant(name: &str) -> Result<(), String> {
    let valid = name.starts_with(|c: char| c.is_ascii_uppercase())
        && name.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_')
        && !name.ends_with('_')
        && !name.contains("__");
    valid.then_some(()).ok_or(format!("constant {name:?} is not named LIKE_THIS"))
}

fn is_lower_snake(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        && !name.ends_with('_')
        && !name.contains("__")
}
