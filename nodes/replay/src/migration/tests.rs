//! Old definitions, derived from today's by removing lines.

use super::*;
use crate::compare::Comparison;
use cnc_msgs::wire::cnc_msgs::msg::{CompensationReport, ContourChunk, ContourEvent, MachineState};
use run_recorder::bag_reader::BagSchema;

/// A channel whose definition is today's with some lines removed or replaced.
fn channel<M: Message>(hash: &str, edit: impl Fn(&str) -> String) -> BagChannel {
    let text: String =
        TypeInfo::of::<M>().schema_text.lines().map(|line| edit(line) + "\n").collect();
    BagChannel {
        topic: "/a".into(),
        schema: Some(Arc::new(BagSchema {
            name: M::TYPE_NAME.into(),
            encoding: "ros2msg".into(),
            text: text.into_bytes(),
        })),
        message_encoding: "cdr".into(),
        qos: Vec::new(),
        type_hash: hash.into(),
        metadata: BTreeMap::new(),
        message_count: 1,
    }
}

fn message(channel: BagChannel, data: Vec<u8>) -> BagMessage {
    BagMessage {
        channel_index: 0,
        channel: Arc::new(channel),
        sequence: 0,
        log_time_ns: 0,
        publish_time_ns: 0,
        data,
    }
}

const FIRST_CONTOUR_CHUNK: &str =
    "RIHS01_d103fdd8073408a5a27158f6882af36e841ade951dd3a7ce677accfbb506cb04";

fn without_direction(line: &str) -> String {
    if line == "float64[3] direction" { String::new() } else { line.into() }
}

fn chunk() -> ContourChunk {
    let event = |line| ContourEvent {
        kind: ContourEvent::KIND_MOTION,
        direction: [1.0, 2.0, 3.0],
        line,
        ..ContourEvent::default()
    };
    ContourChunk { events: vec![event(1), event(2)], ..ContourChunk::default() }
}

/// The bytes that a recorder of that time wrote.
fn old_bytes(channel: &BagChannel, message: &ContourChunk) -> Vec<u8> {
    let schema_today = TypeInfo::of::<ContourChunk>().schema_text;
    let today = MessageSchema::parse(ContourChunk::TYPE_NAME, schema_today).unwrap();
    let value = decode::decode(&today, &cdr::encapsulated(message)).unwrap();
    encode(&channel.schema.as_ref().unwrap().parse().unwrap(), &value).unwrap()
}

#[test]
fn fields_that_were_added_later_are_zero_and_are_not_compared() {
    for hash in [FIRST_CONTOUR_CHUNK, ""] {
        let channel = channel::<ContourChunk>(hash, without_direction);
        let bytes = old_bytes(&channel, &chunk());
        let mut definitions = Definitions::default();
        let read: ContourChunk = definitions.decode(&message(channel, bytes), 1).expect("migrated");
        let mut expected = chunk();
        expected.events.iter_mut().for_each(|event| event.direction = [0.0; 3]);
        assert_eq!(read, expected, "{hash}");
        assert_eq!(definitions.forget(chunk()), expected);
        // Of an unchanged type, no field is removed.
        let state = MachineState { tool_wanted: 7, ..MachineState::default() };
        assert_eq!(definitions.forget(state.clone()), state);
    }
}

#[test]
fn without_a_hash_only_what_the_definition_lacks_is_not_compared() {
    let lacking = |line: &str| match line.contains(" further_") {
        true => String::new(),
        false => line.to_owned(),
    };
    let channel = channel::<MachineState>("", lacking);
    let schema = channel.schema.as_ref().unwrap().parse().unwrap();
    let today = TypeInfo::of::<MachineState>().schema_text;
    let today = MessageSchema::parse(MachineState::TYPE_NAME, today).unwrap();
    // Rows of older definitions name the tool and the watch, too.
    let state = MachineState { tool_wanted: 7, link_watch: 2, ..MachineState::default() };
    let value = decode::decode(&today, &cdr::encapsulated(&state)).unwrap();
    let bytes = encode(&schema, &value).unwrap();
    let mut definitions = Definitions::default();
    assert_eq!(definitions.decode::<MachineState>(&message(channel, bytes), 1).unwrap(), state);
    let known = MachineState { further_machine_position: vec![1.0], ..state.clone() };
    assert_eq!(definitions.forget(known), state);
}

#[test]
fn added_fields_are_left_out_of_every_message_that_is_compared() {
    let before = |added: &[&str]| {
        let today = TypeInfo::of::<CompensationReport>().schema_text;
        let today = MessageSchema::parse(CompensationReport::TYPE_NAME, today).unwrap();
        let added = added.iter().map(|path| path.parse().unwrap()).collect();
        let decoding = Decoding::Migrated { old: Arc::clone(&today), today, added };
        let ways = BTreeMap::from([((CompensationReport::TYPE_NAME, 0), decoding)]);
        Arc::new(Definitions { ways })
    };
    let recorded = CompensationReport::default();
    let now = CompensationReport { warning_count: 2, error_count: 1, ..recorded.clone() };
    for (added, fields) in [
        (&["warning_count", "error_count"][..], &[][..]),
        (&["warning_count"], &["error_count"]),
        (&[], &["error_count", "warning_count"]),
    ] {
        let mut comparison = Comparison::new(before(added));
        // A second comparison of the same bag leaves out the same fields.
        let mut besides = comparison.another();
        for comparison in [&mut comparison, &mut besides] {
            comparison.message("compensation_report 1", &recorded, &now);
            let mut found: Vec<&str> =
                comparison.differences.iter().map(|row| row.field.as_str()).collect();
            found.sort_unstable();
            assert_eq!(found, fields, "{added:?}");
        }
    }
}

#[test]
fn each_channel_of_a_type_is_read_by_its_own_definition() {
    let old = channel::<ContourChunk>(FIRST_CONTOUR_CHUNK, without_direction);
    let bytes = old_bytes(&old, &chunk());
    let new = channel::<ContourChunk>("", str::to_owned);
    let new = BagMessage { channel_index: 1, ..message(new, cdr::encapsulated(&chunk())) };
    let old = message(old, bytes);
    let mut forgotten = chunk();
    forgotten.events.iter_mut().for_each(|event| event.direction = [0.0; 3]);
    for order in [[&old, &new], [&new, &old]] {
        let mut definitions = Definitions::default();
        for message in order {
            let read: ContourChunk = definitions.decode(message, 1).expect("it is read");
            assert_eq!(read, if message.channel_index == 0 { forgotten.clone() } else { chunk() });
        }
        // A field that one channel lacked is not compared.
        assert_eq!(definitions.forget(chunk()), forgotten);
    }
}

#[test]
fn other_encodings_and_definition_languages_are_rejected_by_name() {
    let of = |edit: &dyn Fn(&mut BagChannel)| {
        let mut channel = channel::<ContourChunk>("", str::to_owned);
        edit(&mut channel);
        let message = message(channel, cdr::encapsulated(&chunk()));
        Definitions::default().decode::<ContourChunk>(&message, 1).unwrap_err().to_string()
    };
    let json = of(&|channel| channel.message_encoding = "json".into());
    assert_eq!(json, "/a: its messages are written as \"json\", not cdr");
    let idl = of(&|channel| {
        let known = channel.schema.as_deref().cloned().expect("a definition");
        channel.schema = Some(Arc::new(BagSchema { encoding: "ros2idl".into(), ..known }));
    });
    assert_eq!(idl, "/a: it is defined in \"ros2idl\", not in ros2msg");
}

#[test]
fn the_definition_of_today_is_read_without_a_hash_and_with_any() {
    for hash in ["", TypeInfo::of::<ContourChunk>().rihs01, "RIHS01_00"] {
        let channel = channel::<ContourChunk>(hash, str::to_owned);
        let message = message(channel, cdr::encapsulated(&chunk()));
        assert_eq!(Definitions::default().decode::<ContourChunk>(&message, 1).unwrap(), chunk());
    }
}

#[test]
fn a_definition_that_cannot_be_converted_is_named_with_its_fields() {
    let today = TypeInfo::of::<ContourChunk>().rihs01;
    let dropped = |line: &str| {
        format!("{line}{}", if line == "float64[3] direction" { "\nfloat64 old" } else { "" })
    };
    let changed = |line: &str| line.replace("float64[3] direction", "float32[3] direction");
    let said = |channel: BagChannel| {
        let message = message(channel, cdr::encapsulated(&chunk()));
        Definitions::default().decode::<ContourChunk>(&message, 1).unwrap_err().to_string()
    };
    let of = |hash: &str, edit: &dyn Fn(&str) -> String| said(channel::<ContourChunk>(hash, edit));
    for (said, expected) in [
        (
            of("RIHS01_00", &without_direction),
            ["definition RIHS01_00", "events[*].direction was added"],
        ),
        (of(FIRST_CONTOUR_CHUNK, &dropped), [FIRST_CONTOUR_CHUNK, "events[*].old was removed"]),
        (
            of("", &changed),
            ["a definition without hash", "events[*].direction has a different type or place"],
        ),
        (of(today, &without_direction), ["than its hash", "events[*].direction was added"]),
    ] {
        for words in expected {
            assert!(said.contains(words), "{said}");
        }
    }
}

#[test]
fn fields_in_another_order_are_another_definition() {
    let old = MessageSchema::parse("a_msgs/msg/A", "int32 a\nint32 b\nint32 c\n").unwrap();
    let today =
        MessageSchema::parse("a_msgs/msg/A", "int32 b\nint32 d\nint32 a\nint32 c\n").unwrap();
    let mut gaps = Vec::new();
    compare(&old, &today, &mut Vec::new(), &mut gaps);
    let said: Vec<String> = gaps.iter().map(ToString::to_string).collect();
    assert_eq!(said, ["d was added", "b has a different type or place"]);
}

/// Whether a pattern such as `events[*].direction` names a field.
fn names_a_field(schema: &MessageSchema, steps: &[PathStep]) -> bool {
    let [PathStep::Field(name), rest @ ..] = steps else { return false };
    let rest = rest.strip_prefix(&[PathStep::AnyIndex]).unwrap_or(rest);
    let field = schema.fields.iter().find(|field| field.name == *name);
    field.is_some_and(|field| match &field.field_type {
        _ if rest.is_empty() => true,
        FieldType::Message(inner) => names_a_field(inner, rest),
        FieldType::Primitive(_) => false,
    })
}

#[test]
fn every_row_leads_to_fields_of_today() {
    for row in MIGRATIONS {
        let today = cnc_msgs::schema::lookup(row.type_name).expect("a type of ours");
        assert_ne!(today.rihs01, row.from, "{} is today's definition", row.from);
        let schema = MessageSchema::parse(row.type_name, today.schema_text).unwrap();
        for path in row.added {
            let FieldPath(steps) = path.parse().unwrap();
            assert!(names_a_field(&schema, &steps), "{}: {path}", row.type_name);
        }
    }
}
