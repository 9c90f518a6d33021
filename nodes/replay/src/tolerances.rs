//! What counts as equal in a replay: a rule for every field of the compared messages.
//!
//! States and bytes to the machine are not in the table: `states.rs` compares all of a state except
//! its header and `link_age`, and `driver.rs` each byte with its time, exactly. Curves are compared
//! in `path_difference.rs` by [`SAME_MM`] and [`SAME_FEED_MM_PER_MIN`]; positions of the machine in
//! `kerf/stack_replay/same.rs`.
//!
//! One table, [`ROWS`], with a unit and a reason in each row; `kerf replay --tolerances` and
//! docs/replay.md show it. The first row that matches a field counts. There is no row for numbers
//! in general: a new field with a fraction needs its own row.

use cnc_msgs::interface::Message;
use cnc_msgs::schema::lookup;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use rosidl::field_path::FieldPath;
use rosidl::schema::MessageSchema;
use run_recorder::diff::{Rules, Tolerance};
use std::collections::BTreeMap;
use std::sync::Arc;

/// How a field is compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rule {
    /// By value, bit for bit if it is a number; NaN equals nothing.
    Exact,
    /// Equal within this distance, in this unit; NaN equals nothing.
    Within(f64, &'static str),
    /// Reported when it differs, but not a difference.
    Remark,
    /// An input: it is taken from the bag, so it is not compared.
    Given,
    /// Not compared.
    Ignored,
}

/// Fields of a type, how they are compared, and why.
#[derive(Debug, Clone, Copy)]
pub struct ToleranceRow {
    /// `*` for every type.
    pub type_name: &'static str,
    /// A pattern for [`FieldPath`].
    pub fields: &'static str,
    pub rule: Rule,
    pub reason: &'static str,
}

/// Absolute, m. A micrometre is a change of the part.
const LENGTH_M: f64 = 1e-9;
/// Curves closer than this are the same, mm.
pub const SAME_MM: f64 = LENGTH_M / 1e-3;
const LENGTH: Rule = Rule::Within(LENGTH_M, "m");
const LENGTH_WHY: &str = "a nanometre is the noise of other sines and of millimetres turned into \
                          metres and back; a thousand of them are a change";

const fn row(
    type_name: &'static str,
    fields: &'static str,
    rule: Rule,
    reason: &'static str,
) -> ToleranceRow {
    ToleranceRow { type_name, fields, rule, reason }
}

const fn length(type_name: &'static str, fields: &'static str) -> ToleranceRow {
    row(type_name, fields, LENGTH, LENGTH_WHY)
}

/// The table; the first row that matches a field counts.
pub const ROWS: &[ToleranceRow] = &[
    row("*", "**.stamp.**", Rule::Ignored, "when it was published: the clock of that day"),
    row("*", "header.frame_id", Rule::Given, "a parameter of the node, not a result of its core"),
    row("*", "program_id", Rule::Given, "names the program that goes into the core"),
    row(
        "*",
        "crc32",
        Rule::Ignored,
        "of one chunk; the sha256 of the manifest is over all of them",
    ),
    row("*", "sha256", Rule::Remark, "over the last bits of numbers that are compared themselves"),
    row(wire::ProgrammedContour::TYPE_NAME, "name", Rule::Given, "the name that was loaded"),
    row(wire::ProgrammedContour::TYPE_NAME, "control", Rule::Given, "the name of the profile"),
    row(wire::ProgrammedContour::TYPE_NAME, "profile", Rule::Given, "the rules of the control"),
    row(
        wire::ProgrammedContour::TYPE_NAME,
        "start.*",
        Rule::Exact,
        "where the contour begins: an input of the loader's core, which it hands on",
    ),
    length(wire::ProgrammedContour::TYPE_NAME, "bounds_min.*"),
    length(wire::ProgrammedContour::TYPE_NAME, "bounds_max.*"),
    length(wire::ContourChunk::TYPE_NAME, "events[*].end.*"),
    length(wire::ContourChunk::TYPE_NAME, "events[*].center.*"),
    length(wire::ContourChunk::TYPE_NAME, "events[*].value"),
    row(wire::ContourChunk::TYPE_NAME, "events[*].feed_rate", FEED, FEED_WHY),
    row(
        wire::ContourChunk::TYPE_NAME,
        "events[*].direction[*]",
        Rule::Within(1e-12, "no unit"),
        "a direction of length 1 that turns by a nanometre at a kilometre",
    ),
    row(wire::ContourChunk::TYPE_NAME, "events[*].function[*].value", FUNCTION, FUNCTION_WHY),
    length(wire::ContourChunk::TYPE_NAME, "events[*].function[*].target.*"),
    row(
        wire::ContourChunk::TYPE_NAME,
        "events[*].function[*].further_target[*]",
        FUNCTION,
        FUNCTION_WHY,
    ),
    row(wire::CompensationReport::TYPE_NAME, "revision", Rule::Given, "counts plans of that day"),
    row(
        wire::CompensationReport::TYPE_NAME,
        "tool_table_revision",
        Rule::Given,
        "names the tool table that goes into the core",
    ),
    length(wire::CompensationReport::TYPE_NAME, "findings[*].position[*].*"),
    length(wire::CompensationReport::TYPE_NAME, "findings[*].depth[*]"),
    length(wire::CompensationReport::TYPE_NAME, "findings[*].needed[*]"),
    length(wire::CompensationReport::TYPE_NAME, "findings[*].available[*]"),
    length(wire::CompensationReport::TYPE_NAME, "certificates[*].radius"),
    length(wire::CompensationReport::TYPE_NAME, "certificates[*].valid_from"),
    length(wire::CompensationReport::TYPE_NAME, "certificates[*].valid_to"),
    length(wire::CompensationReport::TYPE_NAME, "certificates[*].leads_valid_to"),
    row(
        wire::CompensationReport::TYPE_NAME,
        "certificates[*].limited_by[*].position.*",
        Rule::Within(1e-7, "m"),
        "the valid radius is found to 1e-10 m, and at a tangent the place moves by the square root of that",
    ),
    length(wire::CompensationReport::TYPE_NAME, "certificates[*].limited_by[*].missing"),
    row(
        wire::CompensationReport::TYPE_NAME,
        "uncut[*].area",
        Rule::Within(1e-12, "m²"),
        "a square of a micrometre: an outline of a metre that moves by a picometre",
    ),
    length(wire::CompensationReport::TYPE_NAME, "uncut[*].outline[*].*"),
    row(wire::CompensatedPath::TYPE_NAME, "revision", Rule::Given, "counts plans of that day"),
    row(wire::CompensatedPath::TYPE_NAME, "control", Rule::Given, "the name of the profile"),
    row(
        wire::CompensatedPath::TYPE_NAME,
        "tool_table_revision",
        Rule::Given,
        "names the tool table that goes into the core",
    ),
    row(
        wire::CompensatedPath::TYPE_NAME,
        "continues_revision",
        Rule::Given,
        "names the plan that ran when the rest of it was planned",
    ),
    row(
        wire::CompensatedPath::TYPE_NAME,
        "settled_elements",
        Rule::Given,
        "what had been sent when the rest was planned",
    ),
    length(wire::CompensatedPath::TYPE_NAME, "start.*"),
    length(wire::CompensatedPath::TYPE_NAME, "bounds_min.*"),
    length(wire::CompensatedPath::TYPE_NAME, "bounds_max.*"),
    row(
        wire::CompensatedPath::TYPE_NAME,
        "feed_length",
        Rule::Within(1e-8, "m"),
        "a sum over all elements, and with it of their noise",
    ),
    row(
        wire::CompensatedPath::TYPE_NAME,
        "rapid_length",
        Rule::Within(1e-8, "m"),
        "a sum over all elements, and with it of their noise",
    ),
    row(wire::PathChunk::TYPE_NAME, "revision", Rule::Given, "counts plans of that day"),
    length(wire::PathChunk::TYPE_NAME, "elements[*].start.*"),
    length(wire::PathChunk::TYPE_NAME, "elements[*].end.*"),
    length(wire::PathChunk::TYPE_NAME, "elements[*].center.*"),
    row(wire::PathChunk::TYPE_NAME, "elements[*].feed_rate", FEED, FEED_WHY),
    row(wire::PathChunk::TYPE_NAME, "events[*].function.value", FUNCTION, FUNCTION_WHY),
    length(wire::PathChunk::TYPE_NAME, "events[*].function.target.*"),
    row(wire::PathChunk::TYPE_NAME, "events[*].function.further_target[*]", FUNCTION, FUNCTION_WHY),
    row(
        "*",
        "**",
        Rule::Exact,
        "counts, kinds, names, flags and texts: another one means another thing",
    ),
];

const FEED_M_PER_S: f64 = 1e-10;
/// Feeds closer than this are the same along a path, mm/min.
pub const SAME_FEED_MM_PER_MIN: f64 = FEED_M_PER_S * 6e4;
const FEED: Rule = Rule::Within(FEED_M_PER_S, "m/s");
const FEED_WHY: &str = "0.000006 mm/min; a controller is sent no more than three decimals";
const FUNCTION: Rule = Rule::Within(1e-9, "m, s, m/s or rad/s");
const FUNCTION_WHY: &str = "as its kind says: a nanometre, a nanosecond; a controller is sent no \
                            more than three decimals";

impl ToleranceRow {
    fn is_of(&self, type_name: &str) -> bool {
        self.type_name == "*" || self.type_name == type_name
    }

    fn pattern(&self) -> FieldPath {
        self.fields.parse().expect("the table holds valid paths; a test reads them all")
    }
}

/// The table, prepared for one type.
#[derive(Debug, Clone)]
pub struct TypeRules {
    pub schema: Arc<MessageSchema>,
    pub rules: Rules,
    rows: Vec<(FieldPath, Rule)>,
}

impl TypeRules {
    fn new(type_name: &'static str) -> Self {
        let text = lookup(type_name).expect("a type that is compared is one of ours").schema_text;
        let schema = MessageSchema::parse(type_name, text)
            .expect("our own definitions are valid; a test in cnc_msgs reads them all");
        let of_type = ROWS.iter().filter(|row| row.is_of(type_name));
        let rows: Vec<_> = of_type.map(|row| (row.pattern(), row.rule)).collect();
        // `Rules` uses the last match.
        let mut rules = Rules { floats: Tolerance::EXACT, ..Rules::default() };
        for (pattern, rule) in rows.iter().rev() {
            let tolerance = match rule {
                Rule::Within(absolute, _) => Tolerance::absolute(*absolute),
                _ => Tolerance::EXACT,
            };
            rules.fields.push((pattern.clone(), tolerance));
            if matches!(rule, Rule::Given | Rule::Ignored) {
                rules.ignored.push(pattern.clone());
            }
        }
        Self { schema, rules, rows }
    }

    /// The rule for a field.
    pub fn rule(&self, path: &FieldPath) -> Rule {
        let mut rows = self.rows.iter();
        rows.find(|(pattern, _)| pattern.matches(path)).map_or(Rule::Exact, |(_, rule)| *rule)
    }
}

/// The rules of the types used so far, each prepared once.
#[derive(Debug, Default)]
pub struct Tolerances {
    by_type: BTreeMap<&'static str, Arc<TypeRules>>,
}

impl Tolerances {
    pub fn of<M: Message>(&mut self) -> Arc<TypeRules> {
        let made = || Arc::new(TypeRules::new(M::TYPE_NAME));
        Arc::clone(self.by_type.entry(M::TYPE_NAME).or_insert_with(made))
    }
}

/// The table as Markdown.
pub fn table() -> String {
    let mut table = String::from("| type | fields | same when | why |\n|---|---|---|---|\n");
    for row in ROWS {
        let kind = match row.type_name.rsplit('/').next() {
            Some("*") | None => "every",
            Some(name) => name,
        };
        let rule = match row.rule {
            Rule::Exact => "equal".to_owned(),
            Rule::Within(by, unit) => format!("within {by:e} {unit}"),
            Rule::Remark => "a remark if not equal".to_owned(),
            Rule::Given => "an input".to_owned(),
            Rule::Ignored => "left out".to_owned(),
        };
        table += &format!("| {kind} | `{}` | {rule} | {} |\n", row.fields, row.reason);
    }
    table
}

#[cfg(test)]
mod tests;
