//! Words of LinuxCNC beyond moves and cycles: what they become, and what is wrong with them.

#[path = "../common/mod.rs"]
mod common;
mod curves;
mod outside;
mod rotated;

use common::profile;
use program_loader::{LoadOptions, Loaded, canonical, load};

fn read(text: &str) -> Loaded {
    load(text.as_bytes(), &profile("rs274"), &LoadOptions::default())
}

/// The events of programs without places, one a line, and the warnings of each.
#[track_caller]
fn check(cases: &[(&str, &str, &[&str])]) {
    for &(text, wanted, warnings) in cases {
        let loaded = read(text);
        assert!(loaded.is_accepted(), "{text}: {:?}", loaded.findings);
        let events: Vec<String> = loaded.contour.events.iter().map(canonical::event_text).collect();
        assert_eq!(events.join("; "), wanted, "{text}");
        let found: Vec<&str> = loaded.findings.iter().map(|it| it.message.as_str()).collect();
        assert_eq!(found, warnings, "{text}");
    }
}

/// The errors of programs with the bytes that each is about.
#[track_caller]
fn check_bad(cases: &[(&str, &[(&str, &str)])]) {
    for &(text, wanted) in cases {
        let loaded = read(text);
        let lines: Vec<&str> = text.lines().collect();
        let errors = loaded.findings.iter().filter(|it| it.is_error());
        let found: Vec<(&str, &str)> = errors
            .map(|it| {
                let start = usize::from(it.source.column) - 1;
                let end = start + usize::from(it.source.length);
                (&lines[it.source.line as usize - 1][start..end], it.message.as_str())
            })
            .collect();
        assert_eq!(found, wanted, "{text}");
    }
}

#[test]
fn messages_are_events_in_their_place() {
    check(&[
        (
            "(MSG, hello #1)\n#1=5 (DEBUG, is %d#1)\nG0 X1 (print, x #<_x>)\nM2",
            "(MSG, hello #1); (MSG, is 5); (MSG, x 0.000000); \
             rapid X1 Y0 Z0 named X; M2",
            &[],
        ),
        ("(MSG,)\n(MSG)\n(message)\nM0 (MSG, turn it)\nM2", "(MSG, turn it); M0; M2", &[]),
        (
            "(DEBUG, #5021 and #<no>)\nM2",
            "(MSG, ###### and ######); M2",
            &[
                "#5021 is a position in machine coordinates, which is known only while the machine \
                 runs: the message shows ######",
                "nothing has set the parameter #<no>: the message shows ######",
            ],
        ),
        (
            "(LOGOPEN, ../x)\n(LOG, #1)\n(LOGCLOSE)\nM2",
            "(MSG, 0.000000); M2",
            &[
                "no file is written: (LOG, ...) is a message to the operator, and the bag has what probes find",
            ],
        ),
        (
            "#1=2\no1 while [#1 GT 0]\n(DEBUG, %d#1)\n#1=[#1-1]\no1 endwhile\nM2",
            "(MSG, 2); (MSG, 1); M2",
            &[],
        ),
        // More than one event holds.
        (
            "(MSG, the quick brown fox jumps over the lazy dog and over all of its sleepy friends)\nM2",
            "(MSG, the quick brown fox jumps over the lazy dog and over all of); \
             (MSG, its sleepy friends); M2",
            &[],
        ),
        (
            "(DEBUG, %d#5599)\n#5599=0\n(DEBUG, no)\n(PRINT, yes)\n#5599=1\n(DEBUG, on)\nM2",
            "(MSG, 1); (MSG, yes); (MSG, on); M2",
            &[],
        ),
        ("; MSG, no\n(MSG , no)\nM2", "M2", &[]),
        // Of several comments in a line the last one counts.
        ("(ABORT, no)(foo)\nM2", "M2", &[]),
        ("(MSG, a)G0 X2 (MSG, b)\n(MSG, c)()\nM2", "(MSG, b); rapid X2 Y0 Z0 named X; M2", &[]),
        ("(MSG, a) ; of a\nM2", "(MSG, a); M2", &[]),
    ]);
}

#[test]
fn a_program_that_aborts_is_refused_with_its_text() {
    for text in ["(ABORT, no tool)\nM2", "o1 if [1]\nG0 X1 (abort, no tool)\no1 endif\nM2"] {
        let loaded = read(text);
        let first = loaded.findings.first().expect("a finding");
        assert!(first.is_error() && first.message == "the program ends itself here: no tool");
    }
    // Other languages have comments only.
    let text = b"N10 (MSG, hello)\nN20 M30";
    let loaded = load(text, &profile("nct"), &LoadOptions::default());
    assert_eq!((loaded.contour.events.len(), loaded.findings.len()), (1, 0));
}

#[test]
fn the_tool_in_the_spindle_is_read_as_the_program_has_set_it() {
    let message = "(DEBUG, %.2f#5403 #5410 #5401 #5411)";
    check(&[(
        &format!(
            "T1 M6\nG10 L1 P1 Z7 R3\n{message}\nG10 L1 P1 Z8\nG43\n{message}\nT0 M6\n{message}\nM2"
        ),
        "T1; M6 T1; (MSG, 7.00 6.00 0.00 0.00); G43.1 Z8; (MSG, 8.00 6.00 0.00 0.00); T0; M6 T0; \
             (MSG, 0.00 0.00 0.00 0.00); M2",
        &[],
    )]);
    check_bad(&[
        (
            "#1=#5410\nM2",
            &[(
                "#5410",
                "#5410 is a value of the tool in the spindle, which is known only after M6",
            )],
        ),
        (
            "T1 M6\n#1=#5413\nM2",
            &[("#5413", "#5413 is a value of the tool table, which is not here")],
        ),
    ]);
}

#[test]
fn where_z_is_after_a_change_of_the_tool_length_follows_from_both_lengths() {
    let z = "(DEBUG, %.2f#<_z> #5422)";
    check(&[
        (
            &format!(
                "G0 Z20\nT1 M6\nG10 L1 P1 Z7 R3\nG43\n{z}\nG92 X0\nG43.1 Z2\n{z}\nG52 Z1\nG49\n{z}\nG20\n{z}\nM2"
            ),
            "rapid X0 Y0 Z20 named Z; T1; M6 T1; G43.1 Z7; (MSG, 13.00 13.00); G43.1 Z2; (MSG, 18.00 18.00); G49; \
             (MSG, 19.00 19.00); (MSG, 0.75 0.75); M2",
            &[],
        ),
        (
            "G0 Z20\nG43.1 Z5\nG91 G0 Z-1\n#1=#<_z>\nG90 G0 Z#1\nM2",
            "rapid X0 Y0 Z20 named Z; G43.1 Z5; G91 Z; rapid X0 Y0 Z19 named Z; rapid X0 Y0 Z14 named Z; M2",
            &[],
        ),
    ]);
    let unknown = "#<_z> is the position of Z, which is not known here";
    for before in [
        "G43.1 Z5",
        "G0 Z1\nG43.1 Z5\nG53 G0 Z0",
        "G0 Z1\nG53 G0 Z0\nG43.1 Z5",
        "G0 Z1\nG43.1 Z5\nG55",
    ] {
        check_bad(&[(&format!("{before}\n#1=#<_z>\nM2"), &[("#<_z>", unknown)])]);
    }
    // The table comes with the text of a program that reads it.
    let missing = "#<_z> is a value of the tool table, which is not here";
    check_bad(&[("G0 Z1\nT1 M6\nG43\n#1=#<_z>\nM2", &[("#<_z>", missing)])]);
}

#[test]
fn two_words_for_the_machine_of_one_group_exclude_each_other() {
    check_bad(&[
        ("M3 M19 R5\nM2", &[("M19", "M3 and M19 exclude each other in one block")]),
        ("M62 P1 M65\nM2", &[("M65", "M62 and M65 exclude each other in one block")]),
        ("M101 M102\nM2", &[("M102", "M101 and M102 exclude each other in one block")]),
        ("M19 R5 Q0\nM2", &[("Q0", "M19 does not take Q0")]),
    ]);
}

#[test]
fn words_for_the_machine_are_passed_on_with_their_values() {
    check(&[
        ("M62 P1 G0 X1\nM2", "M62 P1; rapid X1 Y0 Z0 named X; M2", &[]),
        ("M66 P0 L3 Q2.5\nM67 E1 Q-0.5\nM2", "M66 L3 P0 Q2.5; M67 E1 Q-0.5; M2", &[]),
        (
            "M19 R45 Q1\nM50 P0\nM51\nM53 P0\nM101 P1 Q2.5\nM49\nM2",
            "M19 Q1 R45; M50 P0; M53 P0; M101 P1 Q2.5; M51 P0; M2",
            &[],
        ),
        (
            "M50 P0\nM52\n(DEBUG, %d#<_feed_override>#<_speed_override>#<_adaptive_feed>)\nM2",
            "M50 P0; M52 P1; (MSG, 011); M2",
            &[],
        ),
        ("M70\nM49\nM72\nM2", "M50 P0; M51 P0; M50 P1; M51 P1; M2", &[]),
        ("M61 Q7\n(DEBUG, %d#5400 #<_current_tool>)\nG43\nM2", "(MSG, 7 7); G43 H7; M2", &[]),
        (
            "F100 G0 X0 Y20\nM61 Q3\nG41 G1 Y0\nX9\nG40 Y9\nM2",
            "rapid X0 Y20 Z0 named XY; radius of tool 3; select left; line X0 Y0 Z0 F100 named Y; \
          line X9 Y0 Z0 F100 named X; cancel; line X9 Y9 Z0 F100 named Y; M2",
            &[],
        ),
    ]);
}

#[test]
fn wrong_words_for_the_machine_are_errors_at_their_places() {
    check_bad(&[
        ("M62\nM2", &[("M62", "M62 without P")]),
        ("M64 P1.5\nM2", &[("P1.5", "M64 does not take P1.5")]),
        ("M65 P-1\nM2", &[("P-1", "M65 does not take P-1")]),
        ("M66\nM2", &[("M66", "M66 reads one input")]),
        ("M66 P1 E1\nM2", &[("M66", "M66 reads one input")]),
        ("M66 E1 L3 Q1\nM2", &[("L3", "an analog input is read at once")]),
        ("M66 P1 L3\nM2", &[("M66", "M66 waits without a time")]),
        ("M66 P1 L5 Q1\nM2", &[("L5", "M66 does not take L5")]),
        ("M67 Q1\nM2", &[("M67", "M67 without E")]),
        ("M19 R400\nM2", &[("R400", "M19 does not take R400")]),
        ("M61\nM2", &[("M61", "M61 without Q")]),
        ("M61 Q1.5\nM2", &[("Q1.5", "Q1.5 is not a whole number of at most eight digits")]),
        ("T1 M6 M61 Q1\nM2", &[("M61", "M6 and M61 exclude each other in one block")]),
        ("M62 P[0/0]\nM2", &[("/0", "a division by zero")]),
        (
            "G0 X#5399\nM66 P1 L0\nM2",
            &[("#5399", "#5399 is what M66 has read, and none comes before it")],
        ),
        (
            "F100 G0 X0 Y20\nT1 M6\nG41 G1 Y0\nX5\nM61 Q2\nX9\nG40 Y9\nM2",
            &[("M61", "M61 changes the tool under cutter radius compensation")],
        ),
        ("M48 P1\nM2", &[("P1", "nothing in this block uses P1")]),
    ]);
    let mut loaded = read("M61 Q5\nM2");
    loaded.allow_tools(&[1]);
    assert!(!loaded.is_accepted() && loaded.findings[0].source.line == 1);
}

#[test]
fn tool_lengths_and_radii_may_come_from_the_program() {
    let compensated = "G0 X0 Y20\nG41 {D} G1 Y0\nX9\nG40 Y9\nM2";
    let radius_of = |text: &str| {
        let loaded = read(text);
        assert!(loaded.is_accepted(), "{text}: {:?}", loaded.findings);
        let events: Vec<String> = loaded.contour.events.iter().map(canonical::event_text).collect();
        events.into_iter().find(|it| it.starts_with("radius")).expect("a radius")
    };
    for (text, word, wanted) in [
        ("G10 L1 P3 R2.5", "D3", "radius diameter 5"),
        ("G10 L1 P3 R2.5", "D4", "radius of tool 4"),
        ("G10 L1 P3 R2.5\nT3 M6", "", "radius diameter 5"),
        ("T4 M6\nG10 L1 P3 R2.5", "", "radius of the tool in the spindle"),
        ("M61 Q3\nG10 L1 P3 R2.5 Z1", "D0", "radius diameter 5"),
    ] {
        let text = format!("F100\n{text}\n{}", compensated.replace("{D}", word));
        assert_eq!(radius_of(&text), wanted, "{text}");
    }
    check(&[
        ("G43.1 Z5\nM2", "G43.1 Z5; M2", &[]),
        ("G20 G43.1 Z1\nM2", "G43.1 Z25.4; M2", &[]),
        (
            "T2 M6 G43 H0\nG43.2 H0\nM2",
            "T2; M6 T2; G43 H2; G43 H2 G43.2 H2; M2",
            &["G43 H0 takes the tool in the spindle", "G43.2 H0 takes the tool in the spindle"],
        ),
        ("G43 H2\nG43.2 Z1.5\nM2", "G43 H2; G43 H2 and 1.5; M2", &[]),
        ("G43.1 Z5\nG43.2 H2\nG49\nM2", "G43.1 Z5; G43 H2 and 5; G49; M2", &[]),
        ("G10 L1 P2 Z7\nG43 H2\nG43 H3\nM2", "G43.1 Z7; G43 H3; M2", &[]),
        // The tool of 7 mm reads Z10; to read Z2 it has to be 8 mm longer.
        (
            "G43.1 Z7\nG0 Z10\nG10 L10 P2 Z2\nG43 H2\nM2",
            "G43.1 Z7; rapid X0 Y0 Z10 named Z; G43.1 Z15; M2",
            &[],
        ),
        (
            "G43 H1\nG0 Z10\nG10 L10 P2 Z2\nG43 H2\nM2",
            "G43 H1; rapid X0 Y0 Z10 named Z; G43 H1 and 8; M2",
            &[],
        ),
        (
            "G10 L2 P1 Z-10\nG10 L2 P9 Z-50\nG43.1 Z7\nG0 Z10\nG92 Z1\nG10 L11 P2 Z2\nG43 H2\nM2",
            "G10 L2 P1 Z-10; G10 L2 P9 Z-50; G43.1 Z7; rapid X0 Y0 Z10 named Z; G43.1 Z55; M2",
            &[],
        ),
        (
            "G59.3 G43.1 Z7\nG0 Z10\nG10 L11 P2 Z2\nG43 H2\nM2",
            "G43.1 Z7; G59.3; rapid X0 Y0 Z10 named Z; G43.1 Z15; M2",
            &[],
        ),
        (
            "G43 H1\nG43.2 Z1\nG43.2 H2\nG43 H3\nM2",
            "G43 H1; G43 H1 and 1; G43 H1 G43.2 H2 and 1; G43 H3; M2",
            &[],
        ),
        (
            "G96 S120 D2500 M3\nG0 X20\nG95 G1 X10 F.2\nX30 S60\nG97 S500\nX0\nM2",
            "G96 S120 D2500; M3; rapid X20 Y0 Z0 named X; line X10 Y0 Z0 F190.985932 named X; G96 S60 D2500; \
             line X30 Y0 Z0 F63.661977 named X; G97; S500; line X0 Y0 Z0 F100 named X; M2",
            &[],
        ),
        // In a cycle, a curve and a move of another axis alone; the unit of F is that of its block.
        (
            "G96 S100 D3000 M3\nG95 F.2 G0 X50 Z5\nG81 X25 Z-2 R2\nG80 G20\nG1 U1\nM2",
            "G96 S100 D3000; M3; rapid X50 Y0 Z5 named XZ; rapid X25 Y0 Z5 named X; rapid X25 Y0 Z2 named Z; \
             line X25 Y0 Z-2 F127.323954 named Z; rapid X25 Y0 Z5 named Z; axes line F127.323954 U25.4; M2",
            &[],
        ),
        (
            "G96 S100 D3000 M3\nG95 F.2 G0 X0\nG5 X80 Y0 I1 J0 P-1 Q0\nM2",
            "G96 S100 D3000; M3; rapid X0 Y0 Z0 named X; line X80 Y0 Z0 F39.788736 named XY; M2",
            &[],
        ),
        (
            "G96 S100 D3000 M3\nG97\nM2",
            "G96 S100 D3000; M3; G97; M2",
            &["G97 without S: no spindle speed is in force after G96"],
        ),
        // What changes nothing is no event.
        ("M48\nM51\nM50 P0\nM48\nM2", "M50 P0; M50 P1; M2", &[]),
        // Feet a minute. Of an arc the part that is cut counts.
        (
            "G20 G96 S100 D1000\nG21 M3\nG0 X10 Z0\nG18 G95 G3 X10 Z-10 R1000 F.2\nM2",
            "G96 S30.48 D1000; M3; rapid X10 Y0 Z0 named XZ; plane zx; \
             arc ccw zx X10 Y0 Z-10 center X-989.9875 Z-5 F96.899728 named XZ; M2",
            &[],
        ),
        ("G59.1\nG0 X1\nG59.3\nM2", "G59.1; rapid X1 Y0 Z0 named X; G59.3; M2", &[]),
    ]);
    check_bad(&[
        ("G43.1\nM2", &[("G43.1", "G43.1 without Z")]),
        ("G43.1 X1 Z1\nM2", &[("X1", "a tool length along X or Y is not supported")]),
        ("G43.2\nM2", &[("G43.2", "G43.2 without H and without Z")]),
        ("G96 D1000\nM2", &[("G96", "G96 without S")]),
        ("G96 S-1 D1000\nM2", &[("S-1", "S-1 is negative")]),
        ("G96 S1 D0\nM2", &[("D0", "D0 is not above 0")]),
        (
            "G96 S100 D1000 M3\nG95 F1 G28 X0\nG1 X9\nM2",
            &[(
                "G1 X9",
                "this block starts from where X is, which is not known since G28 in line 2",
            )],
        ),
        (
            "G96 S100 D1000 M3\nG95 F1 G0 X9\nG53 G1 X3\nM2",
            &[(
                "G53",
                "how fast X moves by G53 with G1 depends on how far it is from X0 (G95 under G96)",
            )],
        ),
        (
            "G96 S100 D1000 M3\nG0 X9 Z1\nG33 Z0 K1\nM2",
            &[("G33 Z0 K1", "G33 needs a spindle that turns: G96 changes its speed along X")],
        ),
        (
            "G96 S100 D1000 M3\nG97 G95\nG1 X9 F.1\nM2",
            &[(
                "G1 X9 F.1",
                "this move has a feed per revolution (G95), and no spindle speed is in force",
            )],
        ),
        (
            "G43 H1\nG43.2 H2\nG43.2 H3\nM2",
            &[("G43.2", "no more than two lengths of the tool table are added")],
        ),
        ("G10 L1 Z1\nM2", &[("G10", "G10 without P")]),
        ("G10 L1 P0 Z1\nM2", &[("P0", "P0 is not the number of a tool")]),
        ("G10 L10 P0 Z1\nM2", &[("P0", "P0 is not the number of a tool")]),
        ("G10 L11 P0 Z1\nM2", &[("P0", "P0 is not the number of a tool")]),
        ("G10 L1 P1 R-1\nM2", &[("R-1", "R-1 is negative")]),
        (
            "G10 L1 P1 Q3\nM2",
            &[("Q3", "the angles and the orientation of a turning tool are in the tool table")],
        ),
        (
            "G10 L11 P1 Z3\nM2",
            &[(
                "L11",
                "G10 L11 measures in the work system G59.3: its zero, or that of the one in force, is \
                 known only by the machine",
            )],
        ),
        ("G10 L1 P1 Z[1/0]\nM2", &[("/0", "a division by zero")]),
        (
            "G43 H1\nG43 H2\nG92 Z1\nM2",
            &[(
                "G92 Z1",
                "this block starts from where Z is, which is not known since G43 in line 2",
            )],
        ),
        (
            "F100\nG10 L1 P3 R1\nG0 X0 Y20\nG41 G1 Y0\nX9\nG40 Y9\nM2",
            &[("G41", "the program has set radii, and which tool is in the spindle is not known")],
        ),
    ]);
}

#[test]
fn a_cycle_goes_to_its_hole_where_the_tool_was_before_the_machine_moved() {
    let drill = "rapid X10 Y10 Z2 named Z; line X10 Y10 Z-5 F100 named Z";
    for (between, acts) in [("G91 G28 X0 Y0\nG90", "G28 XY"), ("G55", "G55")] {
        let hole = "X10 Y10 Z-5 R2";
        let text = format!("F100 G0 X10 Y10 Z5\nG81 {hole}\nG80\n{between} G0 Z5\nG81 {hole}\nM2");
        let wanted = format!(
            "rapid X10 Y10 Z5 named XYZ; {drill}; rapid X10 Y10 Z5 named Z; {acts}; \
             rapid X10 Y10 Z5 named Z; rapid X10 Y10 Z5 named XY; {drill}; \
             rapid X10 Y10 Z5 named Z; M2"
        );
        check(&[(&text, &wanted, &[])]);
    }
    // Where the program has not named an axis yet.
    check(&[(
        "F100 G0 Z5\nG81 X0 Y0 Z-1 R2\nM2",
        "rapid X0 Y0 Z5 named Z; rapid X0 Y0 Z5 named XY; rapid X0 Y0 Z2 named Z; \
         line X0 Y0 Z-1 F100 named Z; rapid X0 Y0 Z5 named Z; M2",
        &[],
    )]);
}

#[test]
fn a_centre_that_fits_the_other_way_is_said_to() {
    let arc = "G2 X-26.513 Y4.495 I-24.273 J0.025\nM2";
    for (before, word) in [("", "G90.1"), ("G90.1 ", "G91.1")] {
        let arc = match word {
            "G90.1" => arc.to_owned(),
            _ => arc.replace("I-24.273 J0.025", "I-2.138 J4.52"),
        };
        let approach = "F100 G0 X-22.135 Y-4.495 Z2";
        let loaded = read(&format!("{before}{approach}\n{arc}"));
        let [error] = &loaded.findings[..] else { panic!("{:?}", loaded.findings) };
        assert!(error.help.contains(&format!("write {word}")), "{error:?}");
        assert!(read(&format!("{before}{approach}\n{word}\n{arc}")).is_accepted());
    }
}

#[test]
fn a_straight_motion_word_next_to_a_reference_is_in_force_after_it() {
    check(&[
        (
            "G0 X1 Y1 Z1\nG0 G91 G28 Z0\nG90 X5\nM2",
            "rapid X1 Y1 Z1 named XYZ; G28 Z; rapid X5 Y1 Z1 named X; M2",
            &[],
        ),
        (
            "F100 G0 X1 Y1 Z1\nG28 G91 G1 X0 Y0\nG90 Z5\nM2",
            "rapid X1 Y1 Z1 named XYZ; G28 XY; line X1 Y1 Z5 F100 named Z; M2",
            &[],
        ),
    ]);
    check_bad(&[(
        "F100 G0 X1 Y1 Z1\nG2 G28 X5\nM2",
        &[("G2", "G28 and G2 both use the axis words of this block")],
    )]);
}

#[test]
fn a_block_by_hand_sets_nothing_for_the_next_one() {
    let options = LoadOptions { is_single_block: true, ..LoadOptions::default() };
    for (text, is_accepted) in [
        ("G10 L2 P1 R5", false),
        ("G10 L1 P1 Z5", false),
        ("G10 L2 P1 X5 R90", false),
        ("G10 L2 P1 X5", true),
        ("M61 Q1", false),
        ("G5.2 X1 Y1 P1", false),
        ("G43.1 Z5", true),
        ("G0 X1 (MSG, hello)", true),
    ] {
        let loaded = load(text.as_bytes(), &profile("rs274"), &options);
        assert_eq!(loaded.is_accepted(), is_accepted, "{text}: {:?}", loaded.findings);
    }
}

#[test]
fn parameters_begin_with_the_values_of_a_parameter_file() {
    let with = |text: &str, file: &str| {
        let profile = profile("rs274");
        let text = program_loader::parameter_file::with_parameters(
            text.as_bytes().to_vec(),
            &profile,
            "linuxcnc.var",
            file.as_bytes(),
        );
        String::from_utf8(text.expect("a good file")).expect("text")
    };
    let program =
        "(DEBUG, %d#31 #32 #5222 #5161)\n#31=[#31+1]\nG10 L2 P1 Y4\n(PRINT, %d#31 #5222)\nM2";
    let file = "31 7\n5161 3\n5210 0\n5220 1\n5222 2.0\n";
    check(&[
        (&with(program, file), "(MSG, 7 0 2 3); G10 L2 P1 Y4; (MSG, 8 4); M2", &[]),
        (
            &with("M2", "5210 1\n5220 2"),
            "M2",
            &[
                "the parameter file linuxcnc.var has G92 in force, and programs begin without",
                "the parameter file linuxcnc.var selects work system 2; programs begin in G54",
            ],
        ),
        // What the machine has stored since is not known any more.
        (
            &with(
                "G0 X1\nG28.1\n(DEBUG, #5161)\nG10 L20 P1 X0\n(DEBUG, #5221)\nM2",
                "5161 3\n5221 4",
            ),
            "rapid X1 Y0 Z0 named X; G28.1; (MSG, ######); G10 L20 P1 X0; rapid X0 Y0 Z0 named X; (MSG, ######); M2",
            &[
                "#5161 is a stored position of the machine, which is known only there or from a \
                 parameter file: the message shows ######",
                "#5221 is a work offset of the machine, which is known only there or from a \
                 parameter file: the message shows ######",
            ],
        ),
    ]);
    let no_end = "the program has no end";
    check(&[
        // The line that separates them is not the end of the program.
        (&with("G0 X1", "31 1"), "rapid X1 Y0 Z0 named X", &[no_end]),
        (&with("%\nG0 X1\n%", "31 1"), "rapid X1 Y0 Z0 named X", &[]),
        (
            &with("(parameter file of mine)\n(#100=50)\n(DEBUG, %d#100)\nM2", ""),
            "(MSG, 0); M2",
            &[],
        ),
        (
            &with("M2", "7 1\n5100 2\n5400 3"),
            "M2",
            &[
                "the parameter file linuxcnc.var sets #7 and 2 more, which LinuxCNC does not keep: no effect",
            ],
        ),
    ]);
    let loaded = read(&with("G0 X1\n", "31 1"));
    assert_eq!(loaded.findings[0].source.line, 1);
    // What a run keeps of rotations, also in an empty file. The first depends on what was there before.
    let loaded = read(&with("G0 X1 Y0\nG10 L2 P1 R30\nG10 L2 P2 R5\nM2", ""));
    assert_eq!(loaded.findings, []);
    let left: Vec<_> =
        loaded.left.iter().map(|it| (it.number, it.began, it.value, it.is_read)).collect();
    assert_eq!(left, [(5230, 0.0, 30.0, true), (5250, 0.0, 5.0, false)]);
    let rotated = "the parameter file linuxcnc.var rotates work system 1 by 90 degrees";
    check(&[(&with("G0 X1 Y0\nM2", "5230 90"), "rapid X0 Y1 Z0 named XY; M2", &[rotated])]);
}

#[test]
fn polar_words_stand_for_x_and_y() {
    check(&[
        (
            "G0 X0 Y5\nG0 @10 ^90\nG0 ^0\nG0 @4\nG91 G0 @1 ^90\nG90 G0 @-5 ^180 Z1\nM2",
            "rapid X0 Y5 Z0 named XY; rapid X0 Y10 Z0 named XY; rapid X10 Y0 Z0 named XY; \
             rapid X4 Y0 Z0 named XY; rapid X0 Y5 Z0 named XY; rapid X5 Y0 Z1 named XYZ; M2",
            &[],
        ),
        // Holes on a circle, a row of holes, and one that is drilled twice.
        (
            "F100 G0 X5 Y0 Z5\nG91 G81 ^90 R-4 Z-3 L2\nG80 G90 G0 X3 Y4\nG91 G81 @5 R-4 Z-3 L2\nM2",
            "rapid X5 Y0 Z5 named XYZ; \
             rapid X0 Y5 Z5 named XY; rapid X0 Y5 Z1 named Z; line X0 Y5 Z-2 F100 named Z; rapid X0 Y5 Z5 named Z; \
             rapid X-5 Y0 Z5 named XY; rapid X-5 Y0 Z1 named Z; line X-5 Y0 Z-2 F100 named Z; rapid X-5 Y0 Z5 named Z; \
             rapid X3 Y4 Z5 named XY; \
             rapid X6 Y8 Z5 named XY; rapid X6 Y8 Z1 named Z; line X6 Y8 Z-2 F100 named Z; rapid X6 Y8 Z5 named Z; \
             rapid X9 Y12 Z5 named XY; rapid X9 Y12 Z1 named Z; line X9 Y12 Z-2 F100 named Z; rapid X9 Y12 Z5 named Z; M2",
            &[],
        ),
        (
            "F100 G0 X5 Y0 Z5\nG81 ^90 R1 Z-3 L2\nM2",
            "rapid X5 Y0 Z5 named XYZ; \
             rapid X0 Y5 Z5 named XY; rapid X0 Y5 Z1 named Z; line X0 Y5 Z-3 F100 named Z; rapid X0 Y5 Z5 named Z; \
             rapid X0 Y5 Z1 named Z; line X0 Y5 Z-3 F100 named Z; rapid X0 Y5 Z5 named Z; M2",
            &[],
        ),
        (
            "G52 X1 Y2\n#1=5\nG20 G0 @#1 ^[45*2]\nG7 G0 @1 ^0\nM2",
            "rapid X1 Y129 Z0 named XY; rapid X26.4 Y2 Z0 named XY; M2",
            &[],
        ),
    ]);
    check_bad(&[
        ("G0 @5 X1\nM2", &[("@5", "@5 and X in one block")]),
        ("G0 @\nM2", &[("@", "`@` has no number")]),
        ("G0 @1 ^3 @2\nM2", &[("@2", "@ twice in one block")]),
        ("G53 G0 @5 ^10\nM2", &[("@5", "@5 in a block that is no move")]),
        ("G92 ^10\nM2", &[("^10", "^10 in a block that is no move")]),
        ("G0 X0 Y0\nG91 G0 @5\nM2", &[("@5", "@5 at the zero, where there is no angle")]),
        (
            "G28\nG0 ^5\nM2",
            &[(
                "G0 ^5",
                "this block starts from where X and Y are, which is not known since G28 in line 1",
            )],
        ),
        ("G0 X0 Y0\nG0 @5\nM2", &[("@5", "@5 at the zero, where there is no angle")]),
        (
            "F100 G0 X10 Y0 Z5\nG91 G81 @-5 R-1 Z-3 L3\nM2",
            &[("G91 G81 @-5 R-1 Z-3 L3", "the cycle comes to the zero, where there is no angle")],
        ),
        ("G18\nG0 @10 ^30\nM2", &[("@10", "@10 outside the plane XY")]),
        ("G19 G0 ^30\nG91 G0 X1\nM2", &[("^30", "^30 outside the plane XY")]),
        ("G0 @[1/0] ^5\nM2", &[("/0", "a division by zero")]),
        ("G0 @9999999 ^5\nM2", &[("@9999999", "@9999999 is beyond 1000000 mm")]),
        (
            "F100 T1 M6\nG0 X0 Y20\nG41 G1 Y0\nG1 ^5\nG40 Y9\nM2",
            &[("^5", "^5 counts from where the tool is, under cutter radius compensation")],
        ),
    ]);
}
