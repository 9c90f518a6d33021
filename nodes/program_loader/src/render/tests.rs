//! Findings as they are drawn.

use super::*;
use cnc_msgs::finding::Code;
use expect_test::{Expect, expect};

fn at(line: u32, column: u16, length: u16) -> Source {
    Source { line, column, length, ..Source::default() }
}

#[track_caller]
fn check(text: &str, findings: &[Finding], expected: Expect) {
    expected.assert_eq(&render("bracket.mpf", text, findings, false));
}

#[test]
fn a_planner_finding_shows_its_place_its_numbers_and_its_help() {
    let text = "N10\nN20\nN30\nN40 G1 X95\nN50\nN60\n";
    let mut gouge = Finding::error(
        Code::Gouge,
        at(4, 1, 10),
        "the tool of T4 (radius 5.050 mm) cuts 0.100 mm into block N60 while it follows N40",
    )
    .help("this contour takes tools up to radius 5.000 mm");
    gouge.position = Some([100.0, 55.0, 0.0]);
    gouge.needed_mm = Some(10.1);
    gouge.available_mm = Some(10.0);
    gouge.other = Some(Source { block: Some(60), ..at(6, 1, 3) });
    check(
        text,
        &[gouge],
        expect![[r#"
            error[gouge]: the tool of T4 (radius 5.050 mm) cuts 0.100 mm into block N60 while it follows N40
             --> bracket.mpf:4:1
              |
            4 | N40 G1 X95
              | ^^^^^^^^^^ closest at X100.000 Y55.000 Z0.000; 10.100 mm needed, 10.000 mm there; see N60 in line 6
              |
              = help: this contour takes tools up to radius 5.000 mm
        "#]],
    );
}

#[test]
fn places_outside_the_text_are_shown_without_a_line() {
    let whole = Finding::warning(Code::MissingWord, at(0, 0, 0), "the program has no blocks");
    let beyond = Finding::error(Code::Syntax, at(99, 7, 1), "beyond the end").help("look again");
    check(
        "G0\n",
        &[whole, beyond],
        expect![[r#"
        warning[missing_word]: the program has no blocks
        --> bracket.mpf

        error[syntax]: beyond the end
        --> bracket.mpf:99:7
         = help: look again
    "#]],
    );
}

#[test]
fn tabs_umlauts_and_columns_after_the_end_keep_the_carets_in_place() {
    let text = "\tG1\t(\u{fc}ber \u{6f22}) X--5\n";
    check(
        text,
        &[
            Finding::error(Code::BadNumber, at(1, 14, 4), "`X--5` is not a number"),
            Finding::error(Code::Syntax, at(1, 900, 3), "far after the end"),
            Finding::error(Code::Syntax, at(1, 17, 900), "longer than the line"),
        ],
        expect![[r#"
            error[bad_number]: `X--5` is not a number
             --> bracket.mpf:1:14
              |
            1 |  G1 (über 漢) X--5
              |               ^^^^

            error[syntax]: far after the end
             --> bracket.mpf:1:900
              |
            1 |  G1 (über 漢) X--5
              |                   ^

            error[syntax]: longer than the line
             --> bracket.mpf:1:17
              |
            1 |  G1 (über 漢) X--5
              |                  ^
        "#]],
    );
}

#[test]
fn long_lines_are_cut_around_the_finding() {
    let text = format!("{}X--5{}", "G1 ".repeat(300), " M8".repeat(300));
    check(
        &text,
        &[Finding::error(Code::BadNumber, at(1, 901, 4), "`X--5` is not a number")],
        expect![[r#"
            error[bad_number]: `X--5` is not a number
             --> bracket.mpf:1:901
              |
            1 | ... G1 G1 G1 G1 G1 G1 G1 G1 G1 G1 G1 G1 G1 X--5 M8 M8 M8 M8 M8 M8 M8 M8 M8 M8 M8 M8 M8 M8 M8 M8 M8 M8 M8 M8 M8 M8 M8 M8 M8 ...
              |                                            ^^^^
        "#]],
    );
}

#[test]
fn color_is_only_there_when_asked_for() {
    let found = [Finding::error(Code::Syntax, at(1, 1, 1), "no")];
    assert!(!render("a", "G1", &found, false).contains('\u{1b}'));
    assert!(render("a", "G1", &found, true).contains('\u{1b}'));
    assert_eq!(render("a", "G1", &[], true), "");
}
