//! Schema text and type hash of every type in [`crate::wire`].
//!
//! Also of services and actions as a whole, and of the messages that ROS derives
//! from them.

use crate::interface::Message;

/// What a bag or a peer needs to know about a type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TypeInfo {
    /// Full name: `cnc_msgs/msg/Program`.
    pub name: &'static str,
    /// The definition and all that it needs, in the encoding `ros2msg`, as
    /// rosbag2 writes it. For a service or an action as a whole: its file, and
    /// the types that the file names.
    pub schema_text: &'static str,
    /// Type hash: `RIHS01_` and 64 hex digits.
    pub rihs01: &'static str,
    /// The JSON that is hashed: the fields of the type and of the types that it needs.
    pub description: &'static str,
}

impl TypeInfo {
    /// The row of a message that is known at compile time.
    pub fn of<M: Message>() -> &'static Self {
        lookup(M::TYPE_NAME).expect("structs and schemas are made of the same definitions")
    }
}

static ALL: &[TypeInfo] = include!(concat!(env!("OUT_DIR"), "/schemas.rs"));

/// All types, sorted by name.
pub fn all() -> &'static [TypeInfo] {
    ALL
}

/// The row of a type, by its full name.
pub fn lookup(type_name: &str) -> Option<&'static TypeInfo> {
    let at = ALL.binary_search_by(|info| info.name.cmp(type_name)).ok()?;
    Some(&ALL[at])
}
