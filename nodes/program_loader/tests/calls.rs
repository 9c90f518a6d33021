//! The calls and loop passes that lead to a line, and the bounds on what a program executes.

mod common;

use cnc_msgs::contour::{ContourEvent, ContourEventKind};
use cnc_msgs::finding::Code;
use common::profile;
use program_loader::limits::{FlowLimits, TimeLimit};
use program_loader::subroutines::with_subroutines;
use program_loader::{LoadOptions, Loaded, load, render};
use std::cell::Cell;
use std::time::Duration;

fn loaded(text: &str) -> Loaded {
    load(text.as_bytes(), &profile("rs274"), &LoadOptions::default())
}

/// For each move its line, and the calls and passes that led to it.
fn moves(text: &str) -> Vec<String> {
    let loaded = loaded(text);
    assert!(loaded.is_accepted(), "{:#?}", loaded.findings);
    let is_move = |event: &&ContourEvent| matches!(event.kind, ContourEventKind::Motion(_));
    let moves = loaded.contour.events.iter().filter(is_move).map(|event| event.source);
    moves.map(|at| format!("{}{}", at.line, loaded.contour.calls.after(at))).collect()
}

#[test]
fn each_move_names_the_calls_and_passes_that_led_to_it() {
    for (name, text, expected) in [
        ("a program without O words", "G0 X1\nG0 X2\nM2\n", &["1", "2"][..]),
        (
            "a subroutine in a loop in a subroutine",
            "o<hole> sub\nG0 X#1\no<hole> endsub\n\
             o<row> sub\no1 repeat [2]\no<hole> call [#1]\no1 endrepeat\no<row> endsub\n\
             G0 Y0\no<row> call [5]\nG0 Y1\nM2\n",
            &[
                "9",
                "2, in o<hole>, called from line 6, pass 1 of the loop in line 5, in o<row>, called \
                 from line 10",
                "2, in o<hole>, called from line 6, pass 2 of the loop in line 5, in o<row>, called \
                 from line 10",
                "11",
            ],
        ),
        (
            "while and do, and a loop that is left in the middle",
            "#1=0\no1 while [#1 LT 2]\nG0 X#1\n#1=[#1+1]\no1 endwhile\n\
             o2 do\nG0 Y#1\no2 while [0]\n\
             o3 repeat [5]\nG0 Z1\no3 break\no3 endrepeat\nG0 Z2\nM2\n",
            &[
                "3, pass 1 of the loop in line 2",
                "3, pass 2 of the loop in line 2",
                "7, pass 1 of the loop in line 6",
                "10, pass 1 of the loop in line 9",
                "13",
            ],
        ),
        (
            "continue, and a loop inside a loop",
            "o1 repeat [2]\no2 repeat [2]\nG0 X1\no2 continue\no2 endrepeat\nG0 X2\no1 endrepeat\nM2\n",
            &[
                "3, pass 1 of the loop in line 2, pass 1 of the loop in line 1",
                "3, pass 2 of the loop in line 2, pass 1 of the loop in line 1",
                "6, pass 1 of the loop in line 1",
                "3, pass 1 of the loop in line 2, pass 2 of the loop in line 1",
                "3, pass 2 of the loop in line 2, pass 2 of the loop in line 1",
                "6, pass 2 of the loop in line 1",
            ],
        ),
        (
            "a computed name, and a return from within a loop",
            "o101 sub\no1 repeat [3]\nG0 X1\no101 return\no1 endrepeat\no101 endsub\n\
             #2=101\no[#2] call\no[#2] call\nG0 X2\nM2\n",
            &[
                "3, pass 1 of the loop in line 2, in o101, called from line 8",
                "3, pass 1 of the loop in line 2, in o101, called from line 9",
                "10",
            ],
        ),
        (
            "programs that M98 calls",
            "M98 P100 L2\nG0 X9\nM2\nO100\nG0 X1\nM98 P200\nM99\nO200\nG0 X2\nM99\n",
            &[
                "5, in O100, called from line 1",
                "9, in O200, called from line 6, in O100, called from line 1",
                "5, in O100, called from line 1, pass 2",
                "9, in O200, called from line 6, in O100, called from line 1, pass 2",
                "2",
            ],
        ),
    ] {
        assert_eq!(moves(text), expected, "{name}");
    }
}

#[test]
fn a_recursion_names_both_ends_of_its_calls() {
    let text = "o<down> sub\no1 if [#1 GT 0]\no<down> call [#1-1]\no1 else\nG0 X1\no1 endif\n\
                o<down> endsub\no<down> call [20]\nM2\n";
    let deepest = "5, in o<down>, called from line 3";
    let found = moves(text);
    assert!(found.len() == 1 && found[0].starts_with(deepest), "{found:?}");
    assert!(
        found[0].ends_with(
            "13 more, in o<down>, called from line 3, in o<down>, called from \
         line 3, in o<down>, called from line 3, in o<down>, called from line 8"
        ),
        "{found:?}"
    );
}

#[test]
fn a_program_without_calls_has_no_table_and_unused_passes_are_not_in_it() {
    assert!(loaded("G0 X1\nM2\n").contour.calls.is_empty());
    // A thousand passes without a move, and one with two moves.
    let text = "o1 repeat [1000]\n#1=[#1+1]\no2 if [#1 EQ 500]\nG0 X1\nG0 X2\no2 endif\n\
                o1 endrepeat\nM2\n";
    let loaded = loaded(text);
    assert_eq!(loaded.contour.calls.rows().len(), 1);
    assert_eq!(loaded.contour.calls.text(1), "pass 500 of the loop in line 1");
}

#[test]
fn a_million_moves_of_one_call_share_its_row() {
    let text = "o1 sub\nG91\nG81 X1 Z-1 R1 F100 L1000\no1 endsub\nG0 Z5\no1 call\nM2\n";
    let loaded = loaded(text);
    assert!(loaded.contour.events.len() > 1000, "{}", loaded.contour.events.len());
    assert_eq!(loaded.contour.calls.rows().len(), 1);
}

#[test]
fn an_error_is_drawn_with_its_calls_and_the_file_it_is_in() {
    let pocket = "; made by hand\no<pocket> sub\no1 repeat [2]\nG1 X[1/#1] F100\no1 endrepeat\n\
                  o<pocket> endsub\n";
    let main = "G0 X0\no<pocket> call [0]\nM2\n";
    let profile = profile("rs274");
    let text = with_subroutines(main.as_bytes().to_vec(), &profile, |name| {
        (name == "pocket.ngc").then(|| pocket.as_bytes().to_vec()).ok_or(None)
    });
    let loaded = load(&text, &profile, &LoadOptions::default());
    let text = String::from_utf8_lossy(&text);
    expect_test::expect![[r#"
        error[bad_number]: a division by zero
         --> part.ngc:9:7
          |
        9 | G1 X[1/#1] F100
          |       ^^^
          |
          = note: line 9 is line 4 of pocket.ngc
          = note: pass 1 of the loop in line 8 (line 3 of pocket.ngc), in o<pocket>, called from line 2
          = help: test the divisor with IF before this block
    "#]]
    .assert_eq(&render::render("part.ngc", &text, &loaded.findings, false));
}

#[test]
fn a_long_program_with_a_number_is_no_loop_without_an_end() {
    let text = format!("O1001\n{}M2\n", "G0 X1\n".repeat(50));
    let flow = FlowLimits { blocks_max: 10, bytes_max: 10, ..FlowLimits::default() };
    let options = LoadOptions { flow, ..LoadOptions::default() };
    let loaded = load(text.as_bytes(), &profile("rs274"), &options);
    assert!(loaded.is_accepted(), "{:?}", loaded.findings);
}

/// The one error of a program that executes too much, with its calls.
fn refused(text: &str, flow: FlowLimits) -> (String, String) {
    let options = LoadOptions { flow, ..LoadOptions::default() };
    let loaded = load(text.as_bytes(), &profile("rs274"), &options);
    assert!(loaded.contour.events.is_empty() && loaded.contour.calls.is_empty());
    let [finding] = loaded.findings.as_slice() else { panic!("{:#?}", loaded.findings) };
    assert_eq!(finding.code, Code::Limit);
    let calls = cnc_msgs::calls::chain_after(&finding.calls);
    (finding.message.clone(), format!("{}{calls}", finding.source.line))
}

#[test]
fn what_a_program_executes_is_bounded_in_blocks_bytes_and_depth() {
    let standard = FlowLimits::default();
    let endless = "o<a> sub\no1 while [1]\nG0 X1\no1 endwhile\no<a> endsub\no<a> call\nM2\n";
    let flow = FlowLimits { blocks_max: 3_000, ..standard };
    assert_eq!(
        refused(endless, flow),
        (
            "more than 3007 blocks have been executed".into(),
            "4, pass 1002 of the loop in line 2, in o<a>, called from line 6".into()
        )
    );
    // The program itself is not counted.
    let flow = FlowLimits { bytes_max: 26_000 - endless.len() as u64, ..standard };
    assert_eq!(
        refused(endless, flow),
        (
            "more than 26000 bytes of blocks have been executed".into(),
            "4, pass 928 of the loop in line 2, in o<a>, called from line 6".into()
        )
    );
    let recursion = "o<a> sub\no<a> call\no<a> endsub\no<a> call\nM2\n";
    let (message, place) = refused(recursion, FlowLimits { depth_max: 3, ..standard });
    assert_eq!(message, "more than 3 subroutines inside each other");
    assert_eq!(
        place,
        "2, in o<a>, called from line 2, in o<a>, called from line 2, in o<a>, called from line 4"
    );
}

#[test]
fn what_a_program_executes_is_bounded_in_time() {
    thread_local!(static CLOCK_MS: Cell<u64> = const { Cell::new(0) });
    // A millisecond for each look at it.
    let clock = || Duration::from_millis(CLOCK_MS.replace(CLOCK_MS.get() + 1));
    let refused_after = |text: &str, most_ms| {
        let time = TimeLimit { most: Duration::from_millis(most_ms), clock };
        refused(text, FlowLimits { time: Some(time), ..FlowLimits::default() })
    };
    let endless = "o1 while [1]\nG0 X1\no1 endwhile\nM2\n";
    let (message, place) = refused_after(endless, 9);
    assert_eq!(
        message,
        "its loops and subroutines have been executed for more than 0.009 s, and 640 blocks"
    );
    assert_eq!(place, "1, pass 213 of the loop in line 1");
    // Lines that are executed once take their time.
    let lines: String = (0..10_000).map(|x| format!("G1 X{x} F600\n")).collect();
    let long = format!("o1 repeat [1]\n{lines}o1 endrepeat\nM2\n");
    let profile = settings::load_profile("rs274").expect("a shipped profile");
    let time = Some(TimeLimit { most: Duration::ZERO, clock });
    let flow = FlowLimits { time, ..FlowLimits::default() };
    assert_eq!(
        load(long.as_bytes(), &profile, &LoadOptions { flow, ..LoadOptions::default() }).findings,
        []
    );
}

#[test]
fn a_long_program_that_ends_is_not_bounded_by_its_own_bytes() {
    let lines: String = (0..100).map(|x| format!("G1 X{x} F600 (a long comment)\n")).collect();
    let text = |passes| format!("o1 repeat [{passes}]\n{lines}o1 endrepeat\nM2\n");
    let load = |passes| {
        let profile = settings::load_profile("rs274").expect("a shipped profile");
        let flow = FlowLimits { bytes_max: 100, ..FlowLimits::default() };
        let options = LoadOptions { flow, ..LoadOptions::default() };
        load(text(passes).as_bytes(), &profile, &options).findings
    };
    assert_eq!(load(1), []);
    let twice = load(2);
    assert!(twice[0].message.contains("bytes of blocks have been executed"), "{twice:?}");
}

#[test]
fn a_chain_of_branches_counts_as_well() {
    // One line of the loop reads a thousand branches.
    let branches: String = (0..1000).map(|_| "o2 elseif [0]\n").collect();
    let text = format!("o1 while [1]\no2 if [0]\n{branches}o2 endif\no1 endwhile\nM2\n");
    let flow = FlowLimits { blocks_max: 10_000, ..FlowLimits::default() };
    let (message, place) = refused(&text, flow);
    assert_eq!(message, "more than 11005 blocks have been executed");
    assert!(place.ends_with(", pass 11 of the loop in line 1"), "{place}");
}

#[test]
fn an_o_word_in_the_last_line_needs_no_line_end_after_it() {
    for text in [
        "G91 G21\nG0 X5\no1 if [#5420 GT 5]\nG0 Z-1\no1 endif",
        "G91 G21\n#1=0\no1 while [#1 LT 3]\nG0 X5\n#1=[#1+1]\no1 endwhile",
        "o<a> sub\nG91 G0 X1\no<a> endsub\no1 repeat [2]\no<a> call\no1 endrepeat",
        "o<a> call\nM2\no<a> sub\nG91 G0 X1\no<a> endsub",
    ] {
        let (with, without) = (loaded(&format!("{text}\n")), loaded(text));
        assert_eq!(with.contour, without.contour, "{text}");
        assert_eq!(with.findings, without.findings, "{text}");
    }
}

#[test]
fn the_texts_of_messages_count_as_well() {
    let endless = "#1=[10**300]\no1 while [1]\n(DEBUG, %.9f #1 #1 #1)\no1 endwhile\nM2\n";
    let flow = FlowLimits { bytes_max: 1 << 20, ..FlowLimits::default() };
    let (message, place) = refused(endless, flow);
    assert!(message.contains("bytes of blocks have been executed"), "{message}");
    // Some thousand bytes each, which count three times; the lines alone would be enough for 18 000 passes.
    let pass = place.split("pass ").nth(1).and_then(|rest| rest.split(' ').next());
    let pass: u32 = pass.and_then(|pass| pass.parse().ok()).expect("a pass");
    assert!((300..500).contains(&pass), "{place}");
}

#[test]
fn an_error_of_a_lathe_cycle_in_a_loop_is_reported_once() {
    let text = "o100 sub\nG0 X10 Z0\nG1 Z-20\nX5\nZ-40\nX50\no100 endsub\nG18 F100 S100 M3\n\
                o1 repeat [4]\nG0 X60 Z5\nG71 Q100 X8 Z2 D0 I1 R1\no1 endrepeat\nM2\n";
    let errors = loaded(text).findings;
    let errors: Vec<_> = errors.iter().filter(|it| it.is_error()).collect();
    assert_eq!(errors.len(), 1, "{errors:#?}");
}

#[test]
fn carriage_returns_before_a_line_end_are_a_part_of_it() {
    let text = "G21 G90\r\r\no1 repeat [2]\r\r\nG0 X5\r\r\no1 endrepeat\r\r\nM2\r\r\n";
    let plain = loaded(&text.replace('\r', ""));
    assert_eq!(loaded(text).contour, plain.contour);
}
