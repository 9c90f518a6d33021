//! Programs that are called by their number: M98 and M99 of NCT and MASSO, L and M17 of the 840C.

mod common;

use cnc_msgs::calls::chain_after;
use cnc_msgs::contour::{ContourEvent, ContourEventKind};
use common::profile;
use program_loader::subroutines::with_subroutines;
use program_loader::{LoadOptions, Loaded, load, render};

const NCT: &str = "nct";
const MASSO: &str = "masso";
const SIEMENS: &str = "sinumerik_840c";

/// Loads a program with the files that it calls.
fn loaded(control: &str, text: &str, files: &[(&str, &str)]) -> (Loaded, String) {
    let profile = profile(control);
    let text = with_subroutines(text.as_bytes().to_vec(), &profile, |name| {
        let file = files.iter().find(|(of, _)| *of == name).ok_or(None)?;
        Ok(file.1.as_bytes().to_vec())
    });
    let loaded = load(&text, &profile, &LoadOptions::default());
    (loaded, String::from_utf8(text).expect("text"))
}

/// For each move its line, and the calls that led to it.
fn moves(control: &str, text: &str, files: &[(&str, &str)]) -> Vec<String> {
    let (loaded, text) = loaded(control, text, files);
    assert_eq!(loaded.findings, [], "{control}\n{text}");
    let is_move = |event: &&ContourEvent| matches!(event.kind, ContourEventKind::Motion(_));
    let moves = loaded.contour.events.iter().filter(is_move).map(|event| event.source);
    moves.map(|at| format!("{}{}", at.line, loaded.contour.calls.after(at))).collect()
}

#[test]
fn each_move_names_the_call_that_led_to_it() {
    for (name, control, text, files, expected) in [
        (
            "programs with O numbers in one text, each called as often as L says",
            NCT,
            "%O1 (MAIN)\nM98 P100 L2\nG0 X9\nM98 P0200\nM30\n%\nO100 (SUB)\nG0 X1\nM98 P200\nM99\n\
             %O200\nG0 X2\nM99\n%\n",
            &[][..],
            &[
                "8, in O100, called from line 2",
                "12, in O200, called from line 9, in O100, called from line 2",
                "8, in O100, called from line 2, pass 2",
                "12, in O200, called from line 9, in O100, called from line 2, pass 2",
                "3",
                "12, in O200, called from line 4",
            ][..],
        ),
        (
            "the block of a call moves before it, and that of a return before the end",
            NCT,
            "O1\nG0 X1 M98 P2\nM30\nO2 G0 X3\nG0 X4 M99\n",
            &[],
            &["2", "4, in O2, called from line 2", "5, in O2, called from line 2"],
        ),
        (
            "a file with the number of its program, which a tape mark begins and ends",
            NCT,
            "M98 P7\nM98 P7\nM30\n",
            &[("7.nct", "%\nO0007 (SUB)\nG0 X1\nM99\n%\n")],
            &["8, in O7, called from line 1", "8, in O7, called from line 2"],
        ),
        (
            "a file that calls a file",
            MASSO,
            "N10 M98 P10 L2\nG0 X9\nM30\n",
            &[("10.nc", "%\nG0 X1\nM98 P3\nM99\n%\n"), ("3.nc", "G0 X2\nN10 M99")],
            &[
                "7, in P10, called from line 1",
                "12, in P3, called from line 8, in P10, called from line 1",
                "7, in P10, called from line 1, pass 2",
                "12, in P3, called from line 8, in P10, called from line 1, pass 2",
                "2",
            ],
        ),
        (
            "L with the passes after P, M17 in the last block with a move, a written LF",
            SIEMENS,
            "%MPF1\nN10 L123 P2 LF\nN20 L5\nM30\n%SPF123 LF\nN10 G0 X1 LF\nG1 X2 F100 M17 LF\n\
             %SPF5\nN10 L123\nG0 X3\nM17\n",
            &[],
            &[
                "6, in L123, called from line 2",
                "7, in L123, called from line 2",
                "6, in L123, called from line 2, pass 2",
                "7, in L123, called from line 2, pass 2",
                "6, in L123, called from line 9, in L5, called from line 3",
                "7, in L123, called from line 9, in L5, called from line 3",
                "10, in L5, called from line 3",
            ],
        ),
        (
            "a number that is said twice, and one after a blank",
            NCT,
            "%O1001 (PART)\nO1001\nM98 P2\nM30\n% O2\nG0 X1\nM99\n",
            &[],
            &["6, in O2, called from line 3"],
        ),
        (
            "a file with a header",
            SIEMENS,
            "L9\nM30\n",
            &[("9.spf", "%SPF9\nG0 X1\nM17\n")],
            &["6, in L9, called from line 1"],
        ),
    ] {
        assert_eq!(moves(control, text, files), expected, "{name}");
    }
}

#[test]
fn a_call_that_cannot_be_done_is_an_error_with_its_place_and_calls() {
    for (control, text, message, place, help) in [
        (
            NCT,
            "G0 X1\nM98 P100\nM30\n",
            "there is no program O100",
            "2",
            "write O100 ... M99 after the end of the main program, or put 100.nct into a folder of \
             subroutines",
        ),
        (
            NCT,
            "O1\nM98 P2\nM30\nO2\nM98 P3\nM99\n",
            "there is no program O3",
            "5, in O2, called from line 2",
            "write O3 ... M99 after the end of the main program, or put 3.nct into a folder of \
             subroutines",
        ),
        (NCT, "M98\nM30\n", "M98 without P", "1", "write P with the number of the program"),
        (
            NCT,
            "M98 P2 L0\nM30\nO2\nM99\n",
            "L0 calls the program no time",
            "1",
            "write how many times it is to run, or delete the call",
        ),
        (
            NCT,
            "M98 P2\nM30\nO2\nG0 X1\nM99 P10\n",
            "M99 P10 is not supported",
            "5, in O2, called from line 1",
            "return without P and L, to the block after the call; write what is skipped or repeated \
             as the blocks that run",
        ),
        (
            NCT,
            "M98 P2\nM30\nO2\nG0 X1\n",
            "the text ends within O2, called in line 1",
            "4, in O2, called from line 1",
            "end a program that is called with M99",
        ),
        (
            NCT,
            "M98 P2\nM30\nO2\nG0 X1\nO3\nM99\n",
            "program O3 begins before the end of O2, called in line 1",
            "5, in O2, called from line 1",
            "end the program before it: the main program with M30, others with M99",
        ),
        (
            NCT,
            "M98 P2\nM30\n%O2\nG0 X1\n%O3\nM99\n",
            "another program begins before the end of O2, called in line 1",
            "5, in O2, called from line 1",
            "end a program that is called with M99",
        ),
        (
            NCT,
            "M98 P2\nM30\nO2\nG0 X1\nM30\n",
            "the end of the main program within O2, called in line 1",
            "5, in O2, called from line 1",
            "end a program that is called with M99",
        ),
        (
            NCT,
            "G0 X1\nM99\n",
            "M99 ends a program that has been called, and none has been",
            "2",
            "end the main program with M2 or M30",
        ),
        (
            NCT,
            "G0 X1\nO2\nG0 X2\nM30\n",
            "program O2 begins before the end of the one before it",
            "2",
            "end the program before it: the main program with M30, others with M99",
        ),
        (
            NCT,
            "G0 X1\nM30\nO2\nM99\nO02\nM99\n",
            "O2 is in line 3 already",
            "5",
            "give each program a number of its own",
        ),
        (
            NCT,
            "M98 P2\nM30\nO2\nG0 X2\n%\nG0 X99\nM99\n",
            "the text ends within O2, called in line 1",
            "5, in O2, called from line 1",
            "end a program that is called with M99",
        ),
        (
            MASSO,
            "M98 P10\nM30\n",
            "there is no program P10",
            "1",
            "put 10.nc into a folder of subroutines",
        ),
        (
            MASSO,
            "O10\nM30\n",
            "O words are not supported",
            "1",
            "delete program numbers; write subroutines and loops out, or post without them",
        ),
        (
            SIEMENS,
            "L5\nM30\n",
            "there is no program L5",
            "1",
            "write %SPF5 ... M17 after the end of the main program, or put 5.spf into a folder of \
             subroutines",
        ),
        (
            SIEMENS,
            "G0 X1 L5\nM30\n%SPF5\nM17\n",
            "L5 calls a program, and its block has other words",
            "1",
            "write the call into a block of its own",
        ),
        (
            SIEMENS,
            "L5 P0\nM30\n%SPF5\nM17\n",
            "P0 calls the program no time",
            "1",
            "write how many times it is to run, or delete the call",
        ),
        (
            SIEMENS,
            "L5\nM30\n%SPF5\nG0 X1\nM02\n",
            "the end of the main program within L5, called in line 1",
            "5, in L5, called from line 1",
            "end a program that is called with M17",
        ),
    ] {
        let (loaded, _) = loaded(control, text, &[]);
        let [finding] = loaded.findings.as_slice() else {
            panic!("{text}\n{:#?}", loaded.findings)
        };
        assert_eq!(finding.message, message, "{text}");
        let found = format!("{}{}", finding.source.line, chain_after(&finding.calls));
        assert_eq!(found, place, "{text}");
        assert_eq!(finding.help, help, "{text}");
        assert!(finding.is_error() && loaded.contour.events.is_empty(), "{text}");
    }
}

#[test]
fn a_recursion_is_refused_at_the_depth_of_the_control() {
    for (control, text, files, depth) in [
        (NCT, "M98 P2\nM30\nO2\nM98 P2\nM99\n", &[][..], 100),
        (MASSO, "M98 P2\nM30\n", &[("2.nc", "M98 P2\nM99\n")][..], 5),
        (SIEMENS, "L2\nM30\n%SPF2\nL2\nM17\n", &[], 100),
    ] {
        let (loaded, text) = loaded(control, text, files);
        let [finding] = loaded.findings.as_slice() else {
            panic!("{text}\n{:#?}", loaded.findings)
        };
        assert_eq!(finding.message, format!("more than {depth} subroutines inside each other"));
        assert!(chain_after(&finding.calls).contains("called from line"), "{finding:#?}");
    }
    // Five levels are what MASSO has.
    let files: Vec<(String, String)> = (1..=5)
        .map(|it| (format!("{it}.nc"), format!("M98 P{}\nM99\n", it + 1)))
        .chain([("6.nc".to_owned(), "G0 X1\nM99\n".to_owned())])
        .collect();
    let files: Vec<(&str, &str)> = files.iter().map(|(a, b)| (a.as_str(), b.as_str())).collect();
    assert_eq!(moves(MASSO, "M98 P2\nM30\n", &files).len(), 1);
    let (sixth, _) = loaded(MASSO, "M98 P1\nM30\n", &files);
    assert_eq!(sixth.findings.len(), 1, "{:#?}", sixth.findings);
}

#[test]
fn an_error_in_a_file_of_a_program_names_the_file() {
    let (loaded, text) = loaded(
        MASSO,
        "G0 X0\nM98 P10\nM30\n",
        &[("10.nc", "(made by hand)\nG1 X1 F100 G99.9\nM99\n")],
    );
    expect_test::expect![[r#"
        error[unknown_word]: masso has no word G99.9
         --> part.nc:7:12
          |
        7 | G1 X1 F100 G99.9
          |            ^^^^^
          |
          = note: line 7 is line 2 of 10.nc
          = note: in P10, called from line 2
          = help: delete it, or choose the control that the program was written for
    "#]]
    .assert_eq(&render::render("part.nc", &text, &loaded.findings, false));
}

#[test]
fn a_plain_program_with_a_number_is_read_as_before() {
    for (control, text, warnings) in [
        (NCT, "%O1234\nG0 X1\nM30\nG0 X2\n", 1),
        (NCT, "O1234 (PART)\nG0 X1\nM30\n", 0),
        (SIEMENS, "%SPF5\nG0 X1\nM30\nG0 X2\n", 1),
    ] {
        let (loaded, _) = loaded(control, text, &[]);
        assert!(loaded.is_accepted(), "{:#?}", loaded.findings);
        assert_eq!(loaded.findings.len(), warnings, "{text}: {:#?}", loaded.findings);
        assert!(loaded.contour.calls.is_empty());
    }
}

#[test]
fn a_block_by_hand_calls_nothing() {
    let options = LoadOptions { is_single_block: true, ..LoadOptions::default() };
    for (control, text) in [(NCT, "M98 P2"), (MASSO, "M98 P2"), (SIEMENS, "L2"), (SIEMENS, "M17")] {
        let loaded = load(text.as_bytes(), &profile(control), &options);
        let messages: Vec<_> = loaded.findings.iter().map(|it| it.message.as_str()).collect();
        assert!(
            messages.iter().any(|it| it.ends_with("acts on the blocks after it only")),
            "{text}: {messages:?}"
        );
    }
}

#[test]
fn r_parameters_are_values_of_words_and_go_into_what_is_called() {
    let text = "R1=5 R02 = -2.5\nR3=R1+R2-1\nR4=R1*2/R2\nG0 X=R1 Y=-R2 Z=R3+1\nX=R4 Y=7\nR1=10 L5 P2\nM30\n\
                %SPF5\nG0 X=R1\nR1=R1+1\nM17\n";
    let (loaded, _) = loaded(SIEMENS, text, &[]);
    assert_eq!(loaded.findings, []);
    let ends: Vec<_> = loaded
        .contour
        .events
        .iter()
        .filter_map(|event| match &event.kind {
            ContourEventKind::Motion(motion) => Some(motion.end),
            _ => None,
        })
        .collect();
    let wanted = [[5.0, 2.5, 2.5], [-4.0, 7.0, 2.5], [10.0, 7.0, 2.5], [11.0, 7.0, 2.5]];
    assert_eq!(ends, wanted);
}

#[test]
fn of_two_files_with_one_program_none_is_chosen() {
    let files =
        [("11.nct", "O11\nM98 P12\nM99\nO12\nG0 X4\nM99\n"), ("12.nct", "O12\nG0 X8\nM99\n")];
    let (both, text) = loaded(NCT, "M98 P12\nM98 P11\nM30\n", &files);
    assert_eq!(both.findings.len(), 1, "{text}\n{:#?}", both.findings);
    assert!(both.findings[0].message.starts_with("O12 is in line "), "{:#?}", both.findings);
    // What one file brings along is its own.
    assert_eq!(moves(NCT, "M98 P11\nM30\n", &files[..1]).len(), 1);
}

#[test]
fn a_lost_end_of_the_main_program_is_reported_where_another_program_begins() {
    let after = |line| format!("this is after the end of the program in line {line}");
    for (control, text, message, line) in [
        (NCT, "G0 X1\n%O2\nG0 X2\nM99\n", "the program has no end".to_owned(), 1),
        (SIEMENS, "%MPF1\nG0 X1\n%SPF2\nM17\n", "the program has no end".to_owned(), 2),
        (SIEMENS, "%MPF1\nG0 X1\n%MPF2\nM30\n%SPF2\nM17\n", "the program has no end".to_owned(), 2),
        (NCT, "G0 X1\nM30\nG0 X5\nO2\nG0 X2\nM99\n", after(2), 3),
        (SIEMENS, "G0 X1\nM30\nG0 X5\n%SPF2\nG0 X2\nM17\n", after(2), 3),
        ("rs274", "G0 X1\nM2\nG0 X5\no2 sub\no2 endsub\n", after(2), 3),
    ] {
        let (loaded, _) = loaded(control, text, &[]);
        let found: Vec<_> =
            loaded.findings.iter().map(|it| (it.message.clone(), it.source.line)).collect();
        assert_eq!(found, [(message, line)], "{text}");
        assert!(loaded.is_accepted(), "{text}");
    }
    for (control, text) in [
        (NCT, "G0 X1\nM30\n%\n%O2 (SUB)\nG0 X2\nM99\n"),
        (NCT, "%O1001(PART)\nO1001\nG0 X1\nM98 P2\nM30\n% O2\nG0 X2\nM99\n"),
        (NCT, "G0 X1\nM30\n\n(SUB)\n O2\nG0 X2\nM99\n%\n"),
        (SIEMENS, "%MPF1\nG0 X1\nM30\n%MPF2\nG0 X2\nM30\n%SPF2\nG0 X2\nM17\n"),
        ("rs274", "G0 X1\nM2\no2 sub\no2 endsub\nG0 X5\n"),
    ] {
        assert_eq!(loaded(control, text, &[]).0.findings, [], "{text}");
    }
}

#[test]
fn a_percent_sign_within_what_is_called_is_an_error_in_rs274() {
    for text in [
        "O1\nG21 G0 X1\nM98 P100\nG0 X5\nM30\nO100\nG0 X2\n%\nG0 X3\nM99\n",
        "o100 sub\nG0 X1\n%\no100 endsub\no100 call\nM2\n",
    ] {
        let (loaded, _) = loaded("rs274", text, &[]);
        assert!(!loaded.is_accepted(), "{text}\n{:#?}", loaded.findings);
    }
}

#[test]
fn lines_that_are_no_blocks_count_in_a_program_without_an_end() {
    let marks = "/ G0\n".repeat(2000);
    let long = "x".repeat(5000);
    for (control, text) in [
        (NCT, format!("M98 P2 L9999999\nM30\nO2\n{marks}M99\n")),
        ("rs274", format!("o1 while [1]\n({long})\no1 endwhile\nM2\n")),
    ] {
        let options = LoadOptions { block_delete: true, ..LoadOptions::default() };
        let loaded = load(text.as_bytes(), &profile(control), &options);
        assert!(!loaded.is_accepted() && loaded.findings.len() < 3, "{:#?}", loaded.findings);
    }
}

#[test]
fn a_call_and_an_end_in_one_block_are_refused() {
    for (block, message) in [
        ("M98 P2 M30", "M98 and M30 exclude each other in one block"),
        ("M30 M98 P2", "M30 and M98 exclude each other in one block"),
        ("M2 M99", "M2 and M99 exclude each other in one block"),
        ("M98 P2 M99", "M98 and M99 exclude each other in one block"),
    ] {
        for control in [NCT, "rs274"] {
            let text = format!("O1\nG21 G0 X1\n{block}\nM30\nO2\nG0 X2\nM99\n");
            let (loaded, _) = loaded(control, &text, &[]);
            assert!(!loaded.is_accepted(), "{text}");
            let is_said = loaded.findings.iter().any(|it| it.message == message);
            assert!(is_said, "{control}: {text}\n{:#?}", loaded.findings);
        }
    }
}

#[test]
fn the_file_of_a_number_with_a_blank_in_it_is_found() {
    let file = [("8.nc", "\n%\n\nG0 X1\nM99\n")];
    for call in ["M9 8 P8", "M098 P 8", "m 98 P8"] {
        let (loaded, text) = loaded(MASSO, &format!("{call}\nM30\n"), &file);
        assert!(loaded.is_accepted(), "{text}\n{:#?}", loaded.findings);
        assert_eq!(loaded.contour.calls.rows().len(), 1, "{text}");
    }
}

#[test]
fn zeros_that_fill_the_last_block_of_a_sender_end_the_text() {
    // Files end so, too.
    assert_eq!(moves(MASSO, "M98 P8\nM30\n", &[("8.nc", "G0 X1\nM99\0\0")]).len(), 1);
    for text in ["G0 X1\nM30\0\0\0", "G0 X1\nM30\n\0\0", "G0 X1\nM30\x1A\0\0"] {
        let (loaded, _) = loaded(NCT, text, &[]);
        assert_eq!(loaded.findings, [], "{text:?}");
    }
    assert!(!loaded(NCT, "\0\0", &[]).0.is_accepted());
    assert!(!loaded(NCT, "G0 X1\n\0G0 X2\nM30\n", &[]).0.is_accepted());
}
