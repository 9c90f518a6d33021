//! A program that is planned in parts while it is being read is accepted if the whole is accepted.

use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::finding::Code;
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::node::parts::PartsVerdict;
use compensation_planner::{Alone, Planning, judge};
use kerf_tests::{files, root};
use program_loader::pieces::{Piece, Pieces, load_pieces};
use program_loader::{LoadOptions, Loaded, load, load_in_parts};
use settings::Control;
use std::fmt::Write;
use std::path::PathBuf;

fn accepts_whole(text: &[u8], profile: &Profile, tools: &ToolTable) -> bool {
    let loaded = load(text, profile, &LoadOptions::default());
    loaded.is_accepted()
        && judge(&loaded.contour, profile, tools, Planning::default()).plan.accepted()
}

/// Whether all parts are accepted, and how many times events were offered and taken. A part has at
/// least so many events.
fn accepts_in_parts(
    text: &[u8],
    profile: &Profile,
    tools: &ToolTable,
    part_events: usize,
) -> (bool, usize) {
    let mut taken = 0;
    let is_accepted = std::thread::scope(|scope| {
        let mut parts = PartsVerdict::new(scope, profile, tools, &Alone, u64::MAX);
        let loaded =
            load_in_parts(text, profile, &LoadOptions::default(), part_events, &mut |contour| {
                parts.take(contour);
                taken += usize::from(contour.events.is_empty());
            });
        loaded.is_accepted() && parts.judge(loaded.contour).is_ok()
    });
    (is_accepted, taken)
}

#[test]
fn the_verdict_on_each_program_of_this_project_is_the_same_in_parts() {
    let text = std::fs::read(root().join("tests/golden_runs/tools.yaml")).expect("a file");
    let tools: ToolTable = serde_yaml::from_slice(&text).expect("a table of tools");
    let (mut accepted, mut refused, mut all_taken) = (0, 0, 0);
    for ending in [".ngc", ".nc", ".mpf", ".nct", ".min", ".ascript"] {
        // Bad ones are refused while they are read; some of them without an end.
        let is_good = |path: &PathBuf| !path.components().any(|part| part.as_os_str() == "bad");
        for path in files(ending).into_iter().filter(is_good) {
            let text = std::fs::read(&path).expect("a program");
            for control in Control::ALL {
                let profile = settings::load_profile(control.name()).expect("a shipped profile");
                let whole = accepts_whole(&text, &profile, &tools);
                let (parts, taken) = accepts_in_parts(&text, &profile, &tools, 1);
                assert_eq!(parts, whole, "{} {}", path.display(), control.name());
                *(if whole { &mut accepted } else { &mut refused }) += 1;
                all_taken += taken;
            }
        }
    }
    assert!(accepted > 20 && refused > 50 && all_taken > 200, "{accepted} {refused} {all_taken}");
}

/// A text in pieces of so many lines.
struct InPieces<'t> {
    left: &'t [u8],
    lines: usize,
}

impl Pieces for InPieces<'_> {
    fn next(&mut self) -> Option<Piece<'_>> {
        let end = self
            .left
            .split_inclusive(|byte| *byte == b'\n')
            .take(self.lines)
            .map(<[u8]>::len)
            .sum();
        let (text, left) = self.left.split_at(end);
        self.left = left;
        (end > 0).then_some(Piece { text, left: left.len() as u64 })
    }
}

fn load_by_lines(text: &[u8], profile: &Profile, lines: usize) -> Option<Loaded> {
    let mut pieces = InPieces { left: text, lines };
    let events = 10_000..=usize::MAX;
    load_pieces(&mut pieces, profile, &LoadOptions::default(), events, &mut |_| {})
}

/// The bad ones, too. Those that are not loaded in pieces are read whole.
#[test]
fn each_program_of_this_project_is_loaded_in_pieces_as_whole() {
    let (mut in_pieces, mut whole) = (0, 0);
    for ending in [".ngc", ".nc", ".mpf", ".nct", ".min", ".ascript"] {
        for path in files(ending) {
            let text = std::fs::read(&path).expect("a program");
            for control in Control::ALL {
                let profile = settings::load_profile(control.name()).expect("a shipped profile");
                let expected = load(&text, &profile, &LoadOptions::default());
                for lines in [1, 3, 1000] {
                    let Some(loaded) = load_by_lines(&text, &profile, lines) else {
                        whole += 1;
                        continue;
                    };
                    in_pieces += 1;
                    assert_eq!(loaded, expected, "{} {} {lines}", path.display(), control.name());
                }
            }
        }
    }
    assert!(in_pieces > 500 && whole > 100, "{in_pieces} {whole}");
}

#[test]
fn a_text_in_pieces_is_read_to_its_end_as_whole() {
    let profile = settings::load_profile("rs274").expect("a shipped profile");
    let line = "G1 X1 F100\n";
    for (text, is_plain) in [
        ("\u{feff}G21\nG1 X1 F100\nM2\n", true),
        ("G21\nG1 X1 F100\nM2", true),
        ("G21\r\nG1 X1 F100\r\n\x1a", true),
        ("G21\nM2\n\0\0\0", true),
        ("G21\nM2\n\0\0\x1a\0", true),
        ("G21\nM2\n\n\nG1 X2\n", true),
        ("%\nG21\n%\n", true),
        ("G1 X\n(x", true),
        ("\n\n", true),
        ("G21\no1 call\nM2\n", false),
        ("G21\nM98 P10\nM2\n", false),
        ("G21\nN5 O1 if [1]\nM2\n", false),
        ("M2\n% (what follows is appended by Kerf)\n", false),
        ("M2\n(tool table, appended by Kerf: 0)\n", false),
        ("\u{0}\u{0}\n", true),
    ] {
        let text = text.replace("G1 X1 F100\n", &line.repeat(7));
        let expected = load(text.as_bytes(), &profile, &LoadOptions::default());
        for lines in 1..9 {
            let loaded = load_by_lines(text.as_bytes(), &profile, lines);
            assert_eq!(loaded, is_plain.then(|| expected.clone()), "{text:?} {lines}");
        }
    }
}

/// What is held stays below a limit, however the program goes on. A part that ends in time begins anew.
#[test]
fn a_contour_that_does_not_end_is_refused_where_too_much_of_it_waits() {
    let profile = settings::load_profile("rs274").expect("a shipped profile");
    let options = LoadOptions::default();
    let lines = |count: usize| (0..count).map(|y| format!("Y{y}\n")).collect::<String>();
    let begin = "G21 F100\nG41.1 D4 G1 X10\n";
    let help = "end the compensation with G40 between contours, or split the program";
    // The line of the error.
    for (text, line) in [
        (format!("{begin}{}G40 G1 X50\nM2\n", lines(10)), None),
        (format!("{begin}{}G40 G1 X50\n{}M2\n", lines(10), lines(1000)), None),
        (format!("{begin}{}M2\n", lines(1000)), Some(19)),
        (format!("G0 X0\n{}{begin}{}G40 G1 X50\nM2\n", lines(100), lines(1000)), Some(119)),
    ] {
        let (mut pieces, mut most) = (InPieces { left: text.as_bytes(), lines: 10 }, 0);
        let take = &mut |contour: &mut ProgrammedContour| {
            most = most.max(contour.events.len());
            contour.events.clear();
        };
        let loaded = load_pieces(&mut pieces, &profile, &options, 5..=20, take).expect("plain");
        let limit = loaded.findings.iter().find(|found| found.is_error());
        assert_eq!(limit.map(|it| (it.code, it.source.line)), line.map(|line| (Code::Limit, line)));
        if let Some(limit) = limit {
            let wanted =
                "20 events here since nothing was compensated; at most 20 are planned at once";
            assert!(limit.message.contains(wanted) && limit.help == help, "{limit:?}");
        }
        assert!(most <= 20, "{most}");
    }
}

/// The limit on events before a cycle or a curve protects those who hold them all.
#[test]
fn a_cycle_is_not_refused_for_what_was_planned_before_it() {
    let profile = settings::load_profile("rs274").expect("a shipped profile");
    let options = LoadOptions::default();
    let cycle = "G0 X0 Y0 Z5\nG81 X1 Y1 Z-1 R1 L20\nG80\n".repeat(20);
    let text = format!("G21 F100\n{cycle}M2\n");
    let (mut pieces, mut taken) = (InPieces { left: text.as_bytes(), lines: 10 }, 0);
    let take = &mut |contour: &mut ProgrammedContour| taken += contour.events.drain(..).count();
    let loaded = load_pieces(&mut pieces, &profile, &options, 5..=100, take).expect("plain");
    assert!(loaded.is_accepted() && taken > 1000, "{taken} {:?}", loaded.findings);
}

/// Numbers of programs may stand before all lines of a text, and are looked for in each piece.
#[test]
fn a_text_with_programs_that_are_called_comes_whole() {
    for (control, text, is_plain) in [
        ("nct", "%O1000\nG0 X1\nM30\n", true),
        ("nct", "%O1000\nG0 X1\nM30\nO2\nM99\n", false),
        ("nct", "%O1000\nG0 X1\n\n\nO2\nM99\n", false),
        ("sinumerik_840c", "%MPF1\nN10 G0 X1\nN20 M30\n", true),
        ("sinumerik_840c", "%MPF1\nN10 L10\nN20 M30\n", false),
        ("masso", "G0 X1\nM98 P10\nM30\n", false),
    ] {
        let profile = settings::load_profile(control).expect("a shipped profile");
        for lines in 1..5 {
            let loaded = load_by_lines(text.as_bytes(), &profile, lines);
            assert_eq!(loaded.is_some(), is_plain, "{control} {text:?} {lines}");
        }
    }
}

/// Numbers that look random, the same in each run.
struct Draw(u64);

impl Draw {
    /// A number below `end`.
    fn below(&mut self, end: u64) -> u64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % end
    }

    fn is_one_in(&mut self, count: u64) -> bool {
        self.below(count) == 0
    }
}

/// Squares in two rows with all that may stand between contours, and some faults: a square that is
/// too narrow, one that cuts into its neighbour, no lead-off, a plane that is no plane of it.
fn squares(draw: &mut Draw) -> String {
    let mut text = String::from("G21 G17 G90 G40 F1000\nT1 M6\n");
    let faults = draw.below(3) * draw.below(12);
    for place in 0..3 + draw.below(9) {
        let is_faulty = faults > 0 && draw.is_one_in(faults);
        let fault = if is_faulty { draw.below(4) } else { 9 };
        let (x, y) = (40.0 * (place % 4) as f64, 40.0 * (place / 4) as f64);
        // Of the places between them the tool of 4 mm needs 4.
        let x = if fault == 0 { x - 8.5 } else { x };
        let side = if fault == 1 { 3.5 } else { 30.0 };
        let word = ["G41.1", "G42.1"][draw.below(2) as usize];
        // On the right of a square that is cut counter-clockwise is its outside.
        let (from, by) = if word == "G42.1" { (-10.0, "") } else { (side / 2.0, "") };
        if draw.is_one_in(3) {
            let _ = writeln!(
                text,
                "{}",
                ["M8", "G54", "G4 P0.1", "S900 M3", "G0 Z5", "M9"][draw.below(6) as usize]
            );
        }
        let _ = writeln!(text, "G0 X{} Y{}{by}", x + side / 2.0, y + from);
        if draw.is_one_in(4) {
            let _ = writeln!(text, "G1 Z-{}", draw.below(3));
        }
        let _ = writeln!(text, "{word} D4 G1 X{} Y{y}", x + side / 2.0);
        for [u, v] in [[1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0], [0.5, 0.0]] {
            let _ = writeln!(text, "X{} Y{}", x + u * side, y + v * side);
            if draw.is_one_in(15) {
                let _ = writeln!(text, "{}", ["M8", "G4 P1", "G1 Z-2"][draw.below(3) as usize]);
            }
        }
        match fault {
            2 => continue,
            3 => text.push_str("G18\n"),
            _ => {}
        }
        let end = [x + side / 2.0, y + from];
        let _ = match draw.below(3) {
            0 => writeln!(text, "G40\nG0 Z5\nG1 X{} Y{}", end[0], end[1]),
            1 => writeln!(text, "G40\nG1 X{} Y{}", end[0], end[1]),
            _ => writeln!(text, "G40 G1 X{} Y{}", end[0], end[1]),
        };
        if draw.is_one_in(5) {
            text.push_str("G40\n");
        }
    }
    text.push_str("M2\n");
    text
}

#[test]
fn the_verdict_on_programs_of_many_contours_is_the_same_in_parts_of_any_size() {
    let profile = settings::load_profile("rs274").expect("a shipped profile");
    let tools = ToolTable::default();
    let (mut draw, mut accepted, mut refused, mut most) = (Draw(7), 0, 0, 0);
    for _ in 0..600 {
        let text = squares(&mut draw);
        let whole = accepts_whole(text.as_bytes(), &profile, &tools);
        for part_events in [1, 2 + draw.below(40) as usize] {
            let (parts, taken) = accepts_in_parts(text.as_bytes(), &profile, &tools, part_events);
            assert_eq!(parts, whole, "parts of {part_events} events:\n{text}");
            most = most.max(taken);
        }
        *(if whole { &mut accepted } else { &mut refused }) += 1;
    }
    assert!(accepted > 100 && refused > 100 && most > 20, "{accepted} {refused} {most}");
}

#[test]
fn the_verdict_on_loops_and_subroutines_is_the_same_in_parts() {
    // The side of a pocket, which a tool of 4 mm cuts, where it goes up to before each, and whether that is accepted.
    let table = [
        ("30", "5", true),
        ("3.5", "5", false),
        ("[30-26.5*[#100 EQ 10]]", "5", false),
        ("30", "1/[10-#100]", false),
    ];
    let profile = settings::load_profile("rs274").expect("a shipped profile");
    let tools = ToolTable::default();
    for (side, lift, wanted) in table {
        let text = format!(
            "G21 G17 G90 G40 F1000\no1 sub\nG0 X[#1+#2/2] Y[#2/2]\nG0 Z0\nG41.1 D4 G1 Y0\nX[#1+#2]\nY#2\nX#1\nY0\n\
             X[#1+#2/2]\nG40 G1 Y[#2/2]\nM8\no1 endsub\n#100=0\no2 while [#100 LT 12]\nG0 Z[{lift}]\n\
             o1 call [40*#100] [{side}]\n#100=[#100+1]\no2 endwhile\nM2\n"
        );
        assert_eq!(accepts_whole(text.as_bytes(), &profile, &tools), wanted, "{text}");
        for part_events in [1, 2, 7, 30] {
            let (parts, taken) = accepts_in_parts(text.as_bytes(), &profile, &tools, part_events);
            assert_eq!(parts, wanted, "parts of {part_events} events:\n{text}");
            assert!(taken > 1, "{taken} parts of {part_events} events:\n{text}");
        }
    }
}
