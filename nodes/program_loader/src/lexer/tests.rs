//! Words, and texts that are not words, in tables.

use super::*;
use crate::dialect;
use crate::expression::Parameter;
use cnc_msgs::profile::Dialect;

/// The words as `LETTERvalue@start..end`, the N number, and the codes of the findings.
fn lex(text: &str, dialect: Dialect) -> (String, Option<u32>, Vec<String>) {
    let mut block = Block::default();
    let mut findings = Findings::default();
    let line = Line { number: 1, text: text.as_bytes(), call: 0 };
    let values = crate::parameters::Parameters::default();
    read(line, &dialect::of(dialect).lexer, &mut block, &mut findings, &values);
    let words: Vec<String> = block
        .words
        .iter()
        .map(|word| {
            format!("{}{}@{}..{}", char::from(word.letter), word.value, word.start, word.end)
        })
        .collect();
    let found = findings.finish();
    let found = found
        .iter()
        .map(|found| {
            format!("{} {}+{}", found.code.name(), found.source.column, found.source.length)
        })
        .collect();
    (words.join(" "), block.number, found)
}

#[track_caller]
fn check(text: &str, words: &str) {
    let (seen, _, found) = lex(text, Dialect::Rs274);
    assert_eq!((seen.as_str(), found), (words, vec![]), "{text:?}");
}

#[track_caller]
fn check_bad(text: &str, words: &str, found: &[&str]) {
    let (seen, _, seen_found) = lex(text, Dialect::Rs274);
    assert_eq!(
        (seen.as_str(), seen_found),
        (words, found.iter().map(ToString::to_string).collect()),
        "{text:?}"
    );
}

#[test]
fn words_are_letters_and_numbers_however_they_are_spaced() {
    for (text, words) in [
        ("", ""),
        ("   \t", ""),
        ("G1X10.5Y-3", "G1@0..2 X10.5@2..7 Y-3@7..10"),
        ("g01 x 10.5 y - 3", "G1@0..3 X10.5@4..10 Y-3@11..16"),
        ("G41.1D8", "G41.1@0..5 D8@5..7"),
        ("X+.5Y5.", "X0.5@0..4 Y5@4..7"),
        ("\tG 0", "G0@1..4"),
    ] {
        check(text, words);
    }
}

#[test]
fn comments_are_not_words() {
    for (text, words) in [
        ("(a b) G1 (c) X1 ; d (e", "G1@6..8 X1@13..15"),
        ("; G1", ""),
        ("()G1", "G1@2..4"),
        ("G1(\u{fc})X1", "G1@0..2 X1@6..8"),
    ] {
        check(text, words);
    }
}

#[test]
fn the_block_number_is_first_even_after_block_delete() {
    for (text, number) in [
        ("N10 G1", Some(10)),
        ("n010", Some(10)),
        ("/N7 G1", Some(7)),
        ("(x) N7", Some(7)),
        ("G1", None),
    ] {
        let (_, seen, found) = lex(text, Dialect::Rs274);
        assert_eq!((seen, found.len()), (number, 0), "{text:?}");
    }
    check_bad("G1 N10", "G1@0..2", &["syntax 4+3"]);
    check_bad("N1 N2", "", &["syntax 4+2"]);
    // RS-274 has lines between two lines.
    assert_eq!(lex("N1.5 G1", Dialect::Rs274).1, Some(1));
    assert_eq!(lex("N1.5 G1", Dialect::Nct).2, ["bad_number 1+4"]);
    check_bad("N-1", "", &["bad_number 1+3"]);
    check_bad("N999999999", "", &["bad_number 1+10"]);
}

#[test]
fn a_word_without_a_good_number_is_reported_once_and_stays_present() {
    for (text, words, found) in [
        ("X", "XNaN@0..1", vec!["bad_number 1+1"]),
        ("XY5", "XNaN@0..1 Y5@1..3", vec!["bad_number 1+1"]),
        ("Xnan Y1", "XNaN@0..4 Y1@5..7", vec!["bad_number 1+4"]),
        ("X--5 Y1", "XNaN@0..4 Y1@5..7", vec!["bad_number 1+4"]),
        ("X1.2.3", "XNaN@0..6", vec!["bad_number 1+6"]),
        ("X. Y1", "XNaN@0..2 Y1@3..5", vec!["bad_number 1+2"]),
        ("X1e5Y2", "XNaN@0..4 Y2@4..6", vec!["bad_number 1+4"]),
        ("X[1/0] Y2", "XNaN@0..7 Y2@7..9", vec!["bad_number 4+2"]),
        ("X#<depth> Y2", "XNaN@0..10 Y2@10..12", vec!["bad_number 2+8"]),
        ("X-#<_a>", "XNaN@0..7", vec!["bad_number 3+5"]),
        ("X[1+2 Y2", "XNaN@0..8", vec!["bad_number 7+1"]),
    ] {
        let (seen, _, seen_found) = lex(text, Dialect::Rs274);
        assert_eq!(
            (seen.as_str(), seen_found),
            (words, found.iter().map(ToString::to_string).collect()),
            "{text:?}"
        );
    }
}

#[test]
fn text_that_is_not_a_word_is_rejected_at_its_place() {
    for (text, words, found) in [
        ("G1 5", "G15@0..4", "suspicious_value 1+4"),
        ("5 G1", "G1@2..4", "syntax 1+1"),
        ("G1 ! X1", "G1@0..2 X1@5..7", "syntax 4+1"),
        ("G1 \u{20ac}\u{20ac} X1", "G1@0..2 X1@10..12", "syntax 4+2"),
        ("G1 (open", "G1@0..2", "syntax 4+5"),
        ("G1 a)", "G1@0..2 ANaN@3..4", "bad_number 4+1"),
        ("(a (b) c) G1", "G1@10..12", "syntax 4+1"),
        ("G1 / X1", "G1@0..2 X1@5..7", "syntax 4+1"),
        ("#1", "", "syntax 1+2"),
        ("#<a=5", "", "bad_number 1+1"),
        ("#1=", "", "bad_number 3+1"),
        ("X1 [2]", "X1@0..2", "syntax 4+1"),
        ("X1 o100", "X1@0..2", "syntax 4+4"),
        ("$H", "", "unsupported 1+2"),
        ("G1\rX1", "G1@0..2", "syntax 3+1"),
        ("G1\0X1", "G1@0..2", "syntax 3+1"),
        ("G1 @x", "G1@0..2 @NaN@3..4 XNaN@4..5", "bad_number 4+1"),
    ] {
        let (seen, _, seen_found) = lex(text, Dialect::Rs274);
        assert_eq!((seen.as_str(), seen_found[0].as_str()), (words, found), "{text:?}");
    }
}

#[test]
fn a_value_may_be_an_expression() {
    check("X[1+2] Y2", "X3@0..6 Y2@7..9");
    check("X-[2*3]Y#5Z+SIN[90]", "X-6@0..7 Y0@7..10 Z1@10..19");
    check("G [10*9] x[ 1 ]", "G90@0..8 X1@9..15");
    check("O1001 (NAME) G90", "G90@13..16");
    for dialect in [Dialect::Masso, Dialect::Nct, Dialect::Sinumerik840c, Dialect::OspLathe] {
        let (_, _, found) = lex("X[1+2] Y2", dialect);
        assert_eq!(found[0], "unsupported 1+6", "{dialect:?}");
    }
}

#[test]
fn a_block_sets_parameters_with_the_values_before_it() {
    let mut block = Block::default();
    let mut findings = Findings::default();
    let line = Line { number: 1, text: b"#1=5 G1 X#1 #<De pth>=[#1+2.5]", call: 0 };
    let mut values = crate::parameters::Parameters::default();
    values.set(&Parameter::Numbered(1), 15.0).expect("a parameter");
    read(line, &dialect::of(Dialect::Rs274).lexer, &mut block, &mut findings, &values);
    let set: Vec<_> = block.assignments.iter().map(|it| (it.parameter.clone(), it.value)).collect();
    let name = Parameter::Named("depth".into());
    assert_eq!(set, [(Parameter::Numbered(1), 5.0), (name, 17.5)]);
    assert_eq!(block.words[1].value, 15.0);
    assert_eq!(findings.count(), 0);
}

#[test]
fn the_840c_writes_line_feeds_at_words_and_delete_levels() {
    for (text, words) in
        [("N30 M08 H1 LF", "M8@4..7 H1@8..10"), ("@714", "@714@0..4"), ("/2 N5 G1", "G1@6..8")]
    {
        let (seen, _, found) = lex(text, Dialect::Sinumerik840c);
        assert_eq!((seen.as_str(), found), (words, vec![]), "{text:?}");
    }
    let (_, _, found) = lex("X1 0", Dialect::Sinumerik840c);
    assert_eq!(found, ["syntax 4+1"]);
}

#[test]
fn a_block_has_at_most_sixty_four_words() {
    let (_, _, found) = lex(&"M8 ".repeat(65), Dialect::Rs274);
    assert_eq!(found.len(), 1);
    assert!(found[0].starts_with("limit"), "{found:?}");
}
