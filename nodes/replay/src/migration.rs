//! Converts messages from the definitions of a bag to those of today.
//!
//! A bag carries the definition of every type in it. Where today's definition has more fields,
//! [`MIGRATIONS`] lists them by the hash of the old one. New fields get the zero of their type,
//! which every definition reads as "not known". Replay does not compare them: see
//! [`Definitions::forget`]. The meaning of a field must not change under its name; a field with a
//! new meaning gets a new name.

use super::ReplayError;
use cnc_msgs::cdr;
use cnc_msgs::chunk::{Chunk, Collector};
use cnc_msgs::interface::Message;
use cnc_msgs::profile::Profile;
use cnc_msgs::schema::TypeInfo;
use cnc_msgs::wire::cnc_msgs::msg::NodeParameters;
use rosidl::decode;
use rosidl::encode::encode;
use rosidl::field_path::{FieldPath, PathStep};
use rosidl::schema::{FieldType, MessageSchema};
use rosidl::types::{Arity, Primitive};
use rosidl::value::{MessageValue, Value};
use run_recorder::bag_reader::{BagChannel, BagMessage};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fmt;
use std::sync::Arc;

/// The fields that were added to a definition since.
struct Migration {
    type_name: &'static str,
    /// Hash of the old definition.
    from: &'static str,
    /// Fields of today that the old definition lacks, as patterns.
    added: &'static [&'static str],
}

/// The calls of everything in a report.
const CALLS_OF_REPORT: &[&str] = &[
    "findings[*].calls",
    "findings[*].other_calls",
    "certificates[*].limited_by[*].calls",
    "certificates[*].calls",
    "uncut[*].calls",
];

/// One row for each definition that bags in the field may have.
const MIGRATIONS: &[Migration] = &[
    Migration {
        type_name: "cnc_msgs/msg/ContourChunk",
        from: "RIHS01_d103fdd8073408a5a27158f6882af36e841ade951dd3a7ce677accfbb506cb04",
        added: &[
            "events[*].direction",
            "event_calls",
            "calls",
            "events[*].function[*].further_axes",
            "events[*].function[*].further_target",
        ],
    },
    Migration {
        type_name: "cnc_msgs/msg/ContourChunk",
        from: "RIHS01_bcf1c04eb4de8c45cf1c2fcb93f6b78b84648494c7e1e7d84845a1900b510b01",
        added: &[
            "event_calls",
            "calls",
            "events[*].function[*].further_axes",
            "events[*].function[*].further_target",
        ],
    },
    Migration {
        type_name: "cnc_msgs/msg/PathChunk",
        from: "RIHS01_bb3dbb3aa55d7a2813c2f3dab890b0ada004871a3f323bea6742cfb6355346da",
        added: &[
            "element_calls",
            "event_calls",
            "calls",
            "events[*].function.further_axes",
            "events[*].function.further_target",
        ],
    },
    Migration {
        type_name: "cnc_msgs/msg/ProgrammedContour",
        from: "RIHS01_a4e3e2c78258a2ae8ee564d9bba79bc75159e164035b308f9b652ef9fd990d06",
        added: &["call_count"],
    },
    Migration {
        type_name: "cnc_msgs/msg/ProgrammedContour",
        from: "RIHS01_e76881234d03f2d1a24e364187edb9ee9442fb145e58d879ed6b18229f82a309",
        added: &["call_count"],
    },
    Migration {
        type_name: "cnc_msgs/msg/CompensatedPath",
        from: "RIHS01_962c69237c705e49eb33562553cc3c6a2d7fe3b7fac3e7742249367a97c923d5",
        added: &["call_count"],
    },
    Migration {
        type_name: "cnc_msgs/msg/CompensatedPath",
        from: "RIHS01_40bad5cec12ff1975f5ad23922f5760e29b944fd9b9704c06bb550aeb7defe3a",
        added: &["call_count"],
    },
    Migration {
        type_name: "cnc_msgs/msg/CompensationReport",
        from: "RIHS01_e1cc32bb2c7236f4cdebccf77b35cc08570ab681a6b8b3aa0bc8126d8df1f3d5",
        added: CALLS_OF_REPORT,
    },
    Migration {
        type_name: "cnc_msgs/msg/CompensationReport",
        from: "RIHS01_734251729a5eebd04165fcd3e58b195a8dfaa7b47c130ae58fcd54b37d80aa0b",
        added: CALLS_OF_REPORT,
    },
    Migration {
        type_name: "cnc_msgs/msg/MachineState",
        from: "RIHS01_d8961b5863f3218ef7419e5dacc54f4c97305cd6947a9ac75f0b5b6291b347f2",
        added: &[
            "motion_possible",
            "needs_reset",
            "spindle",
            "flood",
            "mist",
            "work_system",
            "tool_wanted",
            "link_watch",
            "further_axes",
            "further_machine_position",
            "further_work_position",
        ],
    },
    Migration {
        type_name: "cnc_msgs/msg/ControllerSettings",
        from: "RIHS01_e764618d25924d7acc696dc260a09e79bc7c4e7953e53974c6c5933894bf7461",
        added: &["axes", "offsets[*].further_axes", "offsets[*].further_position"],
    },
    Migration {
        type_name: "cnc_msgs/msg/RunResult",
        from: "RIHS01_d397c422512a1dc2455bf1b9236b8d111aa1902d97b745e1a42328072d2f5daa",
        added: &["last_occurrence", "start_line", "start_occurrence"],
    },
    Migration {
        type_name: "cnc_msgs/msg/MachineState",
        from: "RIHS01_86e6ac950541fb4a7fce264c9d93bccf60a25ad0010a09bba5a0df2419896034",
        added: &["link_watch", "further_axes", "further_machine_position", "further_work_position"],
    },
    Migration {
        type_name: "cnc_msgs/msg/MachineState",
        from: "RIHS01_e9a5e8f60d232a5df145204a84689280385865712f3afa1b7698470d9a46c644",
        added: &["further_axes", "further_machine_position", "further_work_position"],
    },
];

/// Fields that have a new name today: type, old name, new name. Their bytes are the same.
const RENAMED: &[(&str, &str, &str)] = &[
    ("cnc_msgs/msg/Program", "controller", "control"),
    ("cnc_msgs/msg/ProgrammedContour", "controller", "control"),
    ("cnc_msgs/msg/CompensatedPath", "controller", "control"),
    ("cnc_msgs/msg/CompensationReport", "diagnostics", "findings"),
];

/// Parameters that have a new name today: node, old name, new name.
const RENAMED_PARAMETERS: &[(&str, &str, &str)] = &[("program_loader", "controller", "control")];

/// Renames recorded parameters to the names that today's nodes know.
pub(crate) fn rename_parameters(recorded: &mut NodeParameters) {
    for (node, then, today) in RENAMED_PARAMETERS {
        if recorded.node.rsplit('/').next() == Some(node) {
            for row in recorded.parameters.iter_mut().filter(|row| row.name == *then) {
                row.name = (*today).to_owned();
            }
        }
    }
}

/// Texts of old profiles, and the equivalent text of today.
const PROFILE_CHANGES: &[(&str, &str)] = &[("contour: error", "react: alarm")];

/// The profile that was recorded with a contour, with old keys renamed.
pub(crate) fn profile_of_then(text: &str) -> Result<Profile, String> {
    let read = |text: &str| settings::profile_from_yaml(text).map_err(|error| error.to_string());
    read(text).or_else(|problem| {
        let renamed = |line: &str| {
            let (indent, words) = line.split_at(line.len() - line.trim_start().len());
            let change = PROFILE_CHANGES.iter().find(|(was, _)| *was == words.trim_end());
            format!("{indent}{}\n", change.map_or(words, |(_, is)| is))
        };
        let text_now: String = text.lines().map(renamed).collect();
        // Other errors are reported for the text as it is in the bag.
        read(&text_now).map_err(|_| problem)
    })
}

/// How messages of one type are decoded.
#[derive(Debug, Clone)]
enum Decoding {
    /// Directly: the definition is today's.
    AsToday,
    /// By the old definition, with zeros for the added fields.
    Migrated { old: Arc<MessageSchema>, today: Arc<MessageSchema>, added: Vec<FieldPath> },
}

/// The definitions of a bag, and how to convert them to those of today.
#[derive(Debug, Clone, Default)]
pub(crate) struct Definitions {
    /// By type and channel: two channels of a type may have different definitions.
    ways: BTreeMap<(&'static str, usize), Decoding>,
}

impl Definitions {
    /// Decodes a message with the definition that it was recorded with.
    ///
    /// `number` counts the messages of its topic from 1.
    pub(crate) fn decode<M: Message>(
        &mut self,
        message: &BagMessage,
        number: u64,
    ) -> Result<M, ReplayError> {
        let way = match self.ways.entry((M::TYPE_NAME, message.channel_index)) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(new) => new.insert(decoding::<M>(&message.channel)?),
        };
        let content = |error: &dyn fmt::Display| ReplayError::content(message, number, error);
        match way {
            Decoding::AsToday => cdr::decode(&message.data).map_err(|error| content(&error)),
            Decoding::Migrated { old, today, .. } => {
                let was = decode::decode(old, &message.data).map_err(|error| content(&error))?;
                from_value(&completed(today, &was), today).map_err(|error| content(&error))
            }
        }
    }

    /// The collector; it skips checksums that were made over bytes of an older definition.
    pub(crate) fn sealed<C: Chunk + Message>(&self, collector: Collector<C>) -> Collector<C> {
        if self.is_migrated(C::TYPE_NAME) { collector.without_checksums() } else { collector }
    }

    /// Whether any channel had an older definition of this type.
    pub(crate) fn is_migrated(&self, type_name: &str) -> bool {
        self.of(type_name).any(|way| matches!(way, Decoding::Migrated { .. }))
    }

    /// Whether any channel had an older definition of one of these types.
    pub(crate) fn is_older(&self, type_names: &[&str]) -> bool {
        type_names.iter().any(|type_name| self.is_migrated(type_name))
    }

    /// How messages of one type are decoded, by channel.
    fn of(&self, type_name: &str) -> impl Iterator<Item = &Decoding> {
        self.ways.iter().filter(move |((known, _), _)| *known == type_name).map(|(_, way)| way)
    }

    /// The message without the fields that the bag's definition of its type lacks.
    pub(crate) fn forget<M: Message>(&self, message: M) -> M {
        self.of(M::TYPE_NAME).fold(message, |message, way| {
            let Decoding::Migrated { today, added, .. } = way else { return message };
            let value = decode::decode(today, &cdr::encapsulated(&message))
                .expect("a message fits the definition that its struct was made of");
            let known = without(&value, &mut Vec::new(), added);
            from_value(&completed(today, &known), today)
                .expect("a message with zeros in it is a message still")
        })
    }
}

fn decoding<M: Message>(channel: &BagChannel) -> Result<Decoding, ReplayError> {
    let today = TypeInfo::of::<M>();
    let content = |error: &dyn fmt::Display| ReplayError::Content {
        place: channel.topic.clone(),
        error: error.to_string(),
    };
    let Some(recorded) = &channel.schema else {
        return Err(content(&"it has no definition in the bag"));
    };
    let (written, defined) = (channel.message_encoding.as_str(), recorded.encoding.as_str());
    if written != "cdr" {
        return Err(content(&format_args!("its messages are written as \"{written}\", not cdr")));
    }
    if defined != "ros2msg" {
        return Err(content(&format_args!("it is defined in \"{defined}\", not in ros2msg")));
    }
    let old = recorded.parse().map_err(|error| content(&error))?;
    let old = with_names_of_today(M::TYPE_NAME, old);
    let new = MessageSchema::parse(M::TYPE_NAME, today.schema_text)
        .expect("our own definitions are valid; a test in cnc_msgs reads them all");
    let mut gaps = Vec::new();
    compare(&old, &new, &mut Vec::new(), &mut gaps);
    if gaps.is_empty() {
        return Ok(Decoding::AsToday);
    }
    let refused = || ReplayError::Definition {
        type_name: M::TYPE_NAME,
        recorded: match channel.type_hash.as_str() {
            "" => "a definition without hash".to_owned(),
            hash if hash == today.rihs01 => format!("another definition than its hash {hash} says"),
            hash => format!("definition {hash}"),
        },
        gaps: gaps.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "),
    };
    // Recorders that know no hashes leave it empty; then the fields decide.
    let rows = MIGRATIONS.iter().filter(|row| {
        row.type_name == M::TYPE_NAME
            && (channel.type_hash.is_empty() || channel.type_hash == row.from)
    });
    for row in rows {
        let patterns: Vec<FieldPath> = row
            .added
            .iter()
            .map(|path| path.parse().expect("the table holds valid paths"))
            .collect();
        // Without a hash a row may name more than this definition lacks.
        let added = |gap: &Gap| match gap {
            Gap::Added(path) if patterns.contains(path) => Some(path.clone()),
            _ => None,
        };
        if let Some(added) = gaps.iter().map(added).collect() {
            return Ok(Decoding::Migrated { old, today: new, added });
        }
    }
    Err(refused())
}

/// The old definition, with fields under the names of today.
pub fn with_names_of_today(of: &str, mut old: Arc<MessageSchema>) -> Arc<MessageSchema> {
    for (type_name, then, today) in RENAMED {
        if *type_name == of
            && let Some(index) = old.fields.iter().position(|field| *field.name == **then)
        {
            Arc::make_mut(&mut old).fields[index].name = (*today).into();
        }
    }
    old
}

/// One point in which two definitions differ.
#[derive(Debug, PartialEq)]
enum Gap {
    /// Today's definition has an additional field.
    Added(FieldPath),
    /// Today's definition lacks the field.
    Dropped(FieldPath),
    /// Another type, number of elements, or position.
    Changed(FieldPath),
}

impl fmt::Display for Gap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Added(path) => write!(f, "{path} was added"),
            Self::Dropped(path) => write!(f, "{path} was removed"),
            Self::Changed(path) => write!(f, "{path} has a different type or place"),
        }
    }
}

/// Lists the gaps, with `[*]` for the elements of lists.
fn compare(
    old: &MessageSchema,
    today: &MessageSchema,
    path: &mut Vec<PathStep>,
    gaps: &mut Vec<Gap>,
) {
    for field in &today.fields {
        path.push(PathStep::Field(field.name.clone()));
        match old.fields.iter().find(|known| known.name == field.name) {
            None => gaps.push(Gap::Added(FieldPath(path.clone()))),
            Some(known) if known.arity != field.arity => {
                gaps.push(Gap::Changed(FieldPath(path.clone())));
            }
            Some(known) => match (&known.field_type, &field.field_type) {
                (FieldType::Message(known), FieldType::Message(now)) => {
                    let is_list = field.arity != Arity::One;
                    if is_list {
                        path.push(PathStep::AnyIndex);
                    }
                    compare(known, now, path, gaps);
                    if is_list {
                        path.pop();
                    }
                }
                (known, now) if known == now => {}
                _ => gaps.push(Gap::Changed(FieldPath(path.clone()))),
            },
        }
        path.pop();
    }
    let is_of_today = |name: &str| today.fields.iter().any(|field| *field.name == *name);
    let common: Vec<_> = old.fields.iter().filter(|field| is_of_today(&field.name)).collect();
    for field in old.fields.iter().filter(|field| !is_of_today(&field.name)) {
        path.push(PathStep::Field(field.name.clone()));
        gaps.push(Gap::Dropped(FieldPath(path.clone())));
        path.pop();
    }
    // The same fields in another order are other bytes.
    let is_common = |name: &str| common.iter().any(|field| *field.name == *name);
    let now = today.fields.iter().filter(|field| is_common(&field.name));
    if let Some((_, moved)) = common.iter().zip(now).find(|(was, is)| was.name != is.name) {
        path.push(PathStep::Field(moved.name.clone()));
        gaps.push(Gap::Changed(FieldPath(path.clone())));
        path.pop();
    }
}

/// The message with every field of the definition; missing ones are zero.
pub fn completed(schema: &MessageSchema, message: &MessageValue) -> MessageValue {
    let fields = schema.fields.iter().map(|field| {
        let value = match (message.get(&field.name), &field.field_type) {
            (Some(Value::Message(inner)), FieldType::Message(schema)) => {
                Value::Message(completed(schema, inner))
            }
            (Some(Value::List(list)), FieldType::Message(schema)) => Value::List(
                list.iter()
                    .map(|element| match element {
                        Value::Message(inner) => Value::Message(completed(schema, inner)),
                        other => other.clone(),
                    })
                    .collect(),
            ),
            (Some(value), _) => value.clone(),
            (None, field_type) => zero(field_type, field.arity),
        };
        (field.name.clone(), value)
    });
    MessageValue { type_name: schema.type_name.clone(), fields: fields.collect() }
}

fn zero(field_type: &FieldType, arity: Arity) -> Value {
    let one = || match field_type {
        FieldType::Message(schema) => {
            let nothing = MessageValue { type_name: schema.type_name.clone(), fields: Vec::new() };
            Value::Message(completed(schema, &nothing))
        }
        FieldType::Primitive(primitive) => match primitive {
            Primitive::Bool => Value::Bool(false),
            Primitive::F32 | Primitive::F64 => Value::Float(0.0),
            Primitive::String | Primitive::WideString => Value::Text(String::new()),
            _ => Value::Unsigned(0),
        },
    };
    match arity {
        Arity::One => one(),
        Arity::Sequence => Value::List(Vec::new()),
        Arity::Array(count) => Value::List(vec![one(); count]),
    }
}

/// The message without the fields that match a pattern.
fn without(
    message: &MessageValue,
    path: &mut Vec<PathStep>,
    patterns: &[FieldPath],
) -> MessageValue {
    let mut fields = Vec::with_capacity(message.fields.len());
    for (name, value) in &message.fields {
        path.push(PathStep::Field(name.clone()));
        let here = FieldPath(path.clone());
        if !patterns.iter().any(|pattern| pattern.matches(&here)) {
            let value = match value {
                Value::Message(inner) => Value::Message(without(inner, path, patterns)),
                Value::List(list) => Value::List(
                    list.iter()
                        .enumerate()
                        .map(|(index, element)| match element {
                            Value::Message(inner) => {
                                path.push(PathStep::Index(index));
                                let inner = without(inner, path, patterns);
                                path.pop();
                                Value::Message(inner)
                            }
                            other => other.clone(),
                        })
                        .collect(),
                ),
                other => other.clone(),
            };
            fields.push((name.clone(), value));
        }
        path.pop();
    }
    MessageValue { type_name: message.type_name.clone(), fields }
}

fn from_value<M: Message>(value: &MessageValue, schema: &MessageSchema) -> Result<M, String> {
    let bytes = encode(schema, value).map_err(|error| error.to_string())?;
    cdr::decode(&bytes).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests;
