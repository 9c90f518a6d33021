//! The measuring pass counts right, and no text hides from it.

use super::*;
use proptest::prelude::*;
use serde::Deserialize;
use serde_yaml::Value;

const ANY: Limits =
    Limits { bytes: usize::MAX, depth: usize::MAX, tokens: usize::MAX, aliases: usize::MAX };

fn cost(text: &str) -> Cost {
    measure(text, &ANY).expect("no limit")
}

#[test]
fn brackets_are_counted_where_they_are_brackets() {
    let table = [
        ("a: 1\n", 1),
        ("a: [1, [2, {b: 3}]]\n", 4),
        ("a: \"[[[[\"\n", 1),
        ("a: '[[''[['\n", 1),
        ("a: b [[[[ # [[[\n", 1),
        ("# [[[[\na: 1 # [[\n", 1),
        ("a: |\n  [[[[\n  \"\nb: [1]\n", 2),
        ("a: >-\n\n   [[[[\n", 1),
        ("- |2\n   [[[\n- x\n", 1),
        ("a: b\n  \"c [[[[\nd: [1]\n", 2),
        ("- a: 1\n  b:\n  - c: [1]\n", 4),
        ("? ? ? ? a\n", 4),
        ("- - - - a\n", 4),
        ("!<a[[[> x\n", 0),
        ("\"\\\"[[\": [1]\n", 2),
        ("don't: [it's]\n", 2),
        ("{\"a\": [{\"b\": 1}]}\n", 3),
        ("%YAML 1.1\n---\n[[1]]\n...\n", 2),
    ];
    for (text, depth) in table {
        assert_eq!(cost(text).depth, depth, "{text}");
    }
}

#[test]
fn what_hides_a_bracket_from_one_reader_hides_it_from_the_other() {
    // Each has deep brackets for libyaml, and something that looks as if they were text.
    let deep = "[".repeat(200);
    let table = [
        format!("a: b\n  \"c\nd: {deep}\ne: \"\n"),
        format!("a: b 'c\nd: {deep}\ne: '\n"),
        format!("a: |\n  \"\nb: {deep}\nc: \"\n"),
        format!("- a: |\n  b: {deep}\n"),
        format!("a: x#\"\nb: {deep}\n# \"\n"),
        format!("a: x\u{85}b: {deep}\n"),
        format!("!a \"x\": {deep}\n"),
        format!("&a \"x\": {deep}\n"),
        format!("a: \"\\\\\"\nb: {deep}\n# \"\n"),
        format!("a: ''''\nb: {deep}\n# '\n"),
    ];
    for text in table {
        assert!(cost(&text).depth >= 200, "{text}");
        let error = from_str::<Value>(&text, &Limits::FILE).expect_err("too deep");
        assert!(error.reason.contains("are nested more than"), "{error}");
    }
}

/// Levels of a value: they never exceed the depth that the parser reached.
fn depth_of(value: &Value) -> usize {
    match value {
        Value::Sequence(items) => 1 + items.iter().map(depth_of).max().unwrap_or(0),
        Value::Mapping(map) => {
            let inside = map.iter().map(|(key, value)| depth_of(key).max(depth_of(value)));
            1 + inside.max().unwrap_or(0)
        }
        Value::Tagged(tagged) => depth_of(&tagged.value),
        _ => 0,
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, ..ProptestConfig::default() })]

    /// A pair in a list (`[a: 1]`) and a list without indentation are levels without a token of
    /// their own. So twice the count bounds the value.
    #[test]
    fn a_value_is_never_deeper_than_was_counted(
        pieces in proptest::collection::vec(
            proptest::sample::select(&[
                "[", "]", "{", "}", ",", ": ", ":", "- ", "-", "? ", "?", "\n", "\n  ", "\n    ", "\n ",
                " ", "a", "b: ", "\"", "'", "#", " #", "|", "|\n  ", ">-\n   ", "|2\n", "!t ", "!<x]>",
                "&a ", "*a", "\\", "\t", "---", "\n---\n", "\n...\n", "%", "\r\n", "\u{85}", "ü", "''",
                "\n- ", "\nk: ", "\n  k: ", "[[", "]]",
            ][..]),
            0..40,
        )
    ) {
        let text = pieces.concat();
        let cost = cost(&text);
        if let Ok(value) = serde_yaml::from_str::<Value>(&text) {
            prop_assert!(depth_of(&value) <= 2 * cost.depth, "{text:?} {value:?} {cost:?}");
        }
    }
}

#[test]
fn the_texts_of_the_report_are_refused_before_the_parser_sees_them() {
    let nested = "[".repeat(80_000);
    let questions = "? ".repeat(4_000_000);
    let wide = "a: 1\n".repeat(100_000);
    for limits in [Limits::FILE, Limits::MESSAGE] {
        for text in [&nested, &questions, &wide] {
            let error = from_str::<Value>(text, &limits).expect_err("too much");
            let is_bound = ["are nested more than", "tokens", "bytes"];
            assert!(is_bound.iter().any(|bound| error.reason.contains(bound)), "{error}");
        }
    }
    let bomb = "a: &a [x, x]\nb: &b [*a, *a, *a]\nc: &c [*b, *b, *b]\nd: [*c, *c, *c, *c, *c]\n";
    let error = measure(bomb, &Limits::FILE).expect_err("aliases");
    assert_eq!(
        (error.line, error.reason.as_str()),
        (Some(4), "more than 10 aliases (*) or directives (%)")
    );
    let error = measure("a: &a 1\nb: *a\n", &Limits::MESSAGE).expect_err("aliases");
    assert!(error.reason.contains("not supported here"), "{error}");
}

#[test]
fn real_texts_are_far_from_the_limits() {
    let row = "{diameter_mm: 10.0, length_mm: 80.0, wear_diameter_mm: -0.02, wear_length_mm: 0.1}";
    let table: String = (1..=4000).map(|tool| format!("  {tool}: {row}\n")).collect();
    let text = format!("tools:\n{table}");
    from_str::<Value>(&text, &Limits::FILE).expect("4000 tools");
    let json = text.replace("tools:\n", "{\"tools\": {\n").replace("}\n", "},\n") + "}}\n";
    from_str::<Value>(&json, &Limits::FILE).expect("the same as JSON");
}

#[test]
fn an_error_without_content_quotes_no_word_of_the_text() {
    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Form {
        #[expect(dead_code)]
        size: f64,
        #[expect(dead_code)]
        kind: Option<Kind>,
    }
    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "snake_case")]
    enum Kind {
        Mill,
    }
    let table = [
        (
            "root:x:0:0:secret:/root:/bin/bash\ndaemon:x:1:1::/\n",
            "invalid type, expected struct Form",
        ),
        ("secret: 1\n", "unknown field, expected `size` or `kind`"),
        ("size: secret\n", "invalid type, expected f64"),
        ("size: 1\nkind: secret\n", "unknown variant, expected `mill`"),
        ("size: 1\nsize: 2\n", "duplicate field"),
        ("{}\n", "missing field"),
        ("size: [secret\n\t", "invalid type, expected f64"),
        ("secret: [\n", "unknown field, expected `size` or `kind`"),
        ("\"secret\n", "not YAML of the expected form"),
        ("size: *secret\n", "not YAML of the expected form"),
        ("size: \"invalid type, expected secret\"\n", "invalid type, expected f64"),
    ];
    for (text, reason) in table {
        let error = from_str::<Form>(text, &Limits::FILE).expect_err(text).without_content();
        assert_eq!(error.reason, reason, "{text}");
    }
}
