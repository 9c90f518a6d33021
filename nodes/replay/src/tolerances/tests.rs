//! The table of tolerances, and its coverage.

use super::*;
use rosidl::field_path::PathStep;
use rosidl::schema::FieldType;
use rosidl::types::{Arity, Primitive};

/// The types that are compared.
const TYPES: [&str; 5] = [
    wire::ProgrammedContour::TYPE_NAME,
    wire::ContourChunk::TYPE_NAME,
    wire::CompensationReport::TYPE_NAME,
    wire::CompensatedPath::TYPE_NAME,
    wire::PathChunk::TYPE_NAME,
];

/// Every scalar field of a type, with its primitive type.
fn leaves(
    schema: &MessageSchema,
    path: &mut Vec<PathStep>,
    found: &mut Vec<(FieldPath, Primitive)>,
) {
    for field in &schema.fields {
        let depth = path.len();
        path.push(PathStep::Field(field.name.clone()));
        if field.arity != Arity::One {
            path.push(PathStep::Index(0));
        }
        match &field.field_type {
            FieldType::Message(inner) => leaves(inner, path, found),
            FieldType::Primitive(kind) => found.push((FieldPath(path.clone()), *kind)),
        }
        path.truncate(depth);
    }
}

fn leaves_of(type_name: &'static str) -> Vec<(FieldPath, Primitive)> {
    let mut found = Vec::new();
    leaves(&TypeRules::new(type_name).schema, &mut Vec::new(), &mut found);
    found
}

/// The row that decides about a field: its index in the table.
fn row_of(type_name: &str, path: &FieldPath) -> usize {
    let fits = |row: &ToleranceRow| row.is_of(type_name) && row.pattern().matches(path);
    ROWS.iter().position(fits).expect("the last row fits everything")
}

#[test]
fn every_number_with_a_fraction_has_a_row_of_its_own() {
    for type_name in TYPES {
        for (path, kind) in leaves_of(type_name) {
            let is_float = matches!(kind, Primitive::F32 | Primitive::F64);
            let row = row_of(type_name, &path);
            assert!(
                !is_float || row + 1 < ROWS.len(),
                "{type_name} {path} is a fraction: how near is the same?"
            );
        }
    }
}

#[test]
fn no_row_is_dead_and_each_has_a_reason() {
    let mut used = vec![false; ROWS.len()];
    for type_name in TYPES {
        for (path, _) in leaves_of(type_name) {
            used[row_of(type_name, &path)] = true;
        }
    }
    for (row, used) in ROWS.iter().zip(used) {
        assert!(used, "{} {} fits no field", row.type_name, row.fields);
        assert!(row.reason.len() > 10, "{} {} has no reason", row.type_name, row.fields);
    }
}

#[test]
fn the_comparison_uses_the_rules_of_the_table() {
    for type_name in TYPES {
        let ready = TypeRules::new(type_name);
        for (path, _) in leaves_of(type_name) {
            let row = &ROWS[row_of(type_name, &path)];
            assert_eq!(ready.rule(&path), row.rule, "{type_name} {path}");
            let is_left_out = ready.rules.ignored.iter().any(|pattern| pattern.matches(&path));
            let is_to_be = matches!(row.rule, Rule::Given | Rule::Ignored);
            assert_eq!(is_left_out, is_to_be, "{type_name} {path}");
            let mut last_first = ready.rules.fields.iter().rev();
            let (_, tolerance) = last_first.find(|(it, _)| it.matches(&path)).expect("a rule");
            let Rule::Within(by, _) = row.rule else {
                assert_eq!(*tolerance, Tolerance::EXACT, "{type_name} {path}");
                continue;
            };
            assert_eq!(*tolerance, Tolerance::absolute(by), "{type_name} {path}");
        }
    }
}

#[test]
fn the_page_shows_the_table() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/replay.md");
    let page = std::fs::read_to_string(&root).expect("docs/replay.md");
    let (before, after_begin) = page.split_once("<!-- tolerances -->\n").expect("where it begins");
    let (_, after) = after_begin.split_once("<!-- end -->").expect("where it ends");
    let expected = [before, "<!-- tolerances -->\n", &table(), "<!-- end -->", after].concat();
    expect_test::expect_file![root].assert_eq(&expected);
}
