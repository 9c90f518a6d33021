//! A program that is planned in parts while it is being read is accepted if the whole is accepted.

use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::node::parts::PartsVerdict;
use compensation_planner::{Alone, Planning, judge};
use kerf_tests::{files, root};
use program_loader::{LoadOptions, load, load_in_parts};
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
        let mut parts = PartsVerdict::new(scope, profile, tools, &Alone);
        let loaded =
            load_in_parts(text, profile, &LoadOptions::default(), part_events, &mut |contour| {
                parts.take(contour);
                taken += usize::from(contour.events.is_empty());
            });
        loaded.is_accepted() && parts.accepts(loaded.contour)
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
