//! Programs as bytes: through loader and planner, under the profile of a control.
//!
//! Whatever comes in: no panic, nothing that is not a number, a path whose elements
//! hang together, findings at places that the text has, and no path with an error.

use crate::mutate::{Random, mutate};
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::finding::Finding;
use cnc_msgs::geometry::Shape;
use cnc_msgs::path::{CompensatedPath, PathElement};
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::{Offset, Tool, ToolTable};
use compensation_planner::{Plan, plan, plan_certified};
use kerf_tests::root;
use kerf_tests::rows::IN_ORDER;
use kerf_tests::samples::{Sample, samples};
use program_loader::LoadOptions;
use program_loader::limits::FlowLimits;
use program_loader::subroutines::with_subroutines;
use program_loader::tool_rows::load_with_tools;

/// Programs to begin with, each with the profile of its control.
pub(crate) fn corpus() -> Vec<(Profile, Vec<u8>)> {
    let mut corpus = Vec::new();
    for control in IN_ORDER {
        let folder = root().join("nodes/program_loader/tests/programs").join(control.name());
        let files = std::fs::read_dir(folder).expect("golden programs of each control");
        let mut paths: Vec<_> = files.map(|file| file.expect("a file").path()).collect();
        paths.retain(|path| path.extension().is_some_and(|ending| ending != "txt"));
        paths.sort();
        assert!(!paths.is_empty(), "no golden program of {control}");
        for path in paths {
            corpus.push((profile(control.name()), std::fs::read(path).expect("a golden program")));
        }
    }
    corpus
}

pub(crate) fn profile(control: &str) -> Profile {
    settings::load_profile(control).expect("a shipped profile")
}

pub(crate) fn controls() -> Vec<Profile> {
    IN_ORDER.iter().map(|control| profile(control.name())).collect()
}

/// T1 to T7 and D1 to D7, of sizes between nothing and too much.
pub(crate) fn tools(random: &mut Random) -> ToolTable {
    let mut tools = ToolTable::default();
    for number in 1..8 {
        let radius_mm = *random.of(&[0.0, 0.001, 0.4, 1.0, 3.0, 5.0, 8.0, 40.0]);
        let tip_direction = random.below(10) as u8;
        let (diameter_mm, nose_radius_mm) = (2.0 * radius_mm, radius_mm);
        let tool = Tool { diameter_mm, nose_radius_mm, tip_direction, ..Tool::default() };
        tools.tools.insert(number, tool);
        let radius_mm = if random.once_in(6) { -radius_mm } else { radius_mm };
        tools.offsets.insert(number, Offset { radius_mm, tip_direction, ..Offset::default() });
    }
    tools
}

/// One mutated program; whether it was accepted.
pub(crate) fn check(corpus: &[(Profile, Vec<u8>)], random: &mut Random) -> bool {
    let (profile, text) = random.of(corpus).clone();
    let (_, other) = random.of(corpus);
    // Now and then under the rules of another control.
    let profile = if random.once_in(8) { random.of(corpus).0.clone() } else { profile };
    let text = mutate(&text, other, random);
    loaded_and_planned(&text, &profile, random)
}

/// Bytes that are like a program in nothing but their alphabet, or not even in that.
pub(crate) fn check_bytes(profiles: &[Profile], random: &mut Random) {
    const ALPHABET: &[u8] = b"GMXYZIJKDFTN0123456789.- \n\r()%;/#[]=\"\0\xff\xc3\xbc";
    let is_any = random.once_in(4);
    let bytes: Vec<u8> = (0..random.below(400))
        .map(|_| if is_any { random.next() as u8 } else { *random.of(ALPHABET) })
        .collect();
    loaded_and_planned(&bytes, random.of(profiles), random);
}

/// The pieces of programs in the rs274 language: lines of the program that each row of its page has, whole programs of
/// that kind, and words that are wrong in most places.
pub(crate) fn language() -> Vec<String> {
    let samples: Vec<String> = samples().iter().map(Sample::whole).collect();
    let lines = samples.iter().flat_map(|text| text.lines().map(|line| format!("{line}\n")));
    let whole = samples.iter().map(|text| text.replace("M2\n", ""));
    lines.chain(whole).chain(PIECES.iter().map(|piece| (*piece).to_owned())).collect()
}

/// Words of the rs274 language that seldom are where they belong.
const PIECES: &[&str] = &[
    "o1 ",
    "o2 ",
    "o<a> ",
    "O100\n",
    "o[#1] ",
    "sub\n",
    "endsub\n",
    "endsub [#1]\n",
    "call\n",
    "call [1] (x) [#2]\n",
    "return\n",
    "if [#1 LT 2]\n",
    "elseif [1]\n",
    "else\n",
    "endif\n",
    "while [#1 LT 3]\n",
    "endwhile\n",
    "do\n",
    "repeat [2]\n",
    "endrepeat\n",
    "break\n",
    "continue\n",
    "#1=[#1+1]\n",
    "#2=#1 ",
    "#<a>=[1/#1]\n",
    "#<_b>=ATAN[1]/[#1]\n",
    "M98 P100 L2\n",
    "M99\n",
    "M2\n",
    "M70\n",
    "M71\n",
    "M72\n",
    "M73\n",
    "G0 X#1 Y#2\n",
    "G1 X[#1*10] Z-1 F100\n",
    "G2 X10 Y0 I5 J#2\n",
    "G98 ",
    "G99 ",
    "G81 X1 Y#1 Z-5 R1 L2\n",
    "G83 X2 Z-3 R1 Q1\n",
    "G73 Z-2 R1 Q0.5\n",
    "G84 X1 Z-1 R1\n",
    "G80\n",
    "G18 G71.2 Q1 X9 Z#1 D#2 I2 R1\n",
    "G18 G70 Q1 X9 Z9 D1 E#2 P2\n",
    "G72 Q2 I#1\n",
    "G1 X#1 W-3 A0.1\n",
    "U2 Z-#2 C0.2\n",
    "G91 ",
    "G90 ",
    "G17 ",
    "G18 ",
    "G19 ",
    "G20 ",
    "G21 ",
    "G92 X#1 Z0\n",
    "G92.1\n",
    "G92.2\n",
    "G92.3\n",
    "G52 X5 Y#2\n",
    "G10 L2 P1 X#1\n",
    "G10 L20 P0 Z0\n",
    "G38.2 Z#1 F50\n",
    "G38.5 X-9 Y#2\n",
    "#1=#5063\n",
    "G54 ",
    "G55 ",
    "G93 G1 X#2 F5\n",
    "G94 F100\n",
    "G95 F0.1 S500\n",
    "G7 ",
    "G8 ",
    "M3 S100\n",
    "M5\n",
    "T1 M6\n",
    "G41 D1 ",
    "G40 ",
    "G28\n",
    "G53 G0 Z0\n",
    "G10 L2 P1 R[#2*15]\n",
    "G10 L1 P1 Z5 R2\n",
    "G10 L10 P2 Z#1\n",
    "G43\n",
    "G43 H2\n",
    "G43.1 Z#1\n",
    "G43.2 H1\n",
    "G43.2 Z1\n",
    "G49\n",
    "G59.1 ",
    "M61 Q#1\n",
    "M62 P#1 ",
    "M66 P0 L3 Q1\n",
    "M50 P0\n",
    "M101 P#1 Q2\n",
    "(MSG, hello #1)\n",
    "(DEBUG, %d#1 #<a> #5221 ##)\n",
    "(LOG, #<_x>)",
    "(ABORT, #1)\n",
    "G5 I0 J3 P0 Q-3 X#1 Y1\n",
    "G5 P#1 Q1 X9 Y9\n",
    "G5.1 X#1 Y2 I1 J0\n",
    "G5.2 P#1 L3\n",
    "G5.2 X1 Y1 P2\n",
    "X#1 Y5 P1\n",
    "G5.3\n",
    "@5 ",
    "^#1 ",
    "G1 @10 ^[#1*30]\n",
    "(parameter file x)\n(#31=5)\n",
    "#31=#5399\n",
    "%\n",
    "/",
    "N10.1 ",
    "(x)",
    "G0 X0 Y0 Z5\n",
];

/// A text of such pieces, in any order; whether it was accepted.
pub(crate) fn check_language(rs274: &Profile, pieces: &[String], random: &mut Random) -> bool {
    let count = if random.once_in(4) { random.below(4) } else { random.below(60) };
    let text: String = (0..count).map(|_| random.of(pieces).as_str()).collect();
    loaded_and_planned(text.as_bytes(), rs274, random)
}

/// A text of the words of controls that call programs by their number, in any order, with files.
pub(crate) fn check_calls(profiles: &[Profile], random: &mut Random) -> bool {
    const PIECES: &[&str] = &[
        "O1\n",
        "O2 (SUB)\n",
        "O02 G0 X1\n",
        "%O1\n",
        "%O3 (NAME)\n",
        "%SPF1\n",
        "%spf 2 LF\n",
        "%MPF7\n",
        "%\n",
        "M98 P1\n",
        "M98 P2 L3\n",
        "M98 P9 L0\n",
        "G1 X5 F100 M98 P2\n",
        "M99\n",
        "M99 P10\n",
        "L1\n",
        "N10 L2 P3 LF\n",
        "L1 X3\n",
        "G0 X1 M17\n",
        "R1=5\n",
        "R2=R1*2-R3\n",
        "R1=R1+1 L2\n",
        "G1 X=R1 Y=-R2 F100\n",
        "M17\n",
        "M30\n",
        "M2\n",
        "G41 D1 G1 X10 Y0 F100\n",
        "G41 P2\n",
        "G1 X20 Y0 F100\n",
        "X30 Y10\n",
        "G40 X40 Y20\n",
        "G2 X10 Y0 I5 J0\n",
        "G91\n",
        "G90 ",
        "/",
        "N10 ",
        "(x)\n",
        "T1 M6\n",
        "G0 X0 Y0 Z5\n",
    ];
    let mut piece = || (0..random.below(12)).map(|_| *random.of(PIECES)).collect::<String>();
    let (mut text, file) = (piece(), piece());
    if random.once_in(2) {
        // One that runs.
        text = format!("M98 P1\nL1\nM30\n{text}");
    }
    let profile = random.of(profiles).clone();
    let text = with_subroutines(text.into_bytes(), &profile, |name| {
        name.starts_with('1').then(|| file.clone().into_bytes()).ok_or(None)
    });
    loaded_and_planned(&text, &profile, random)
}

fn loaded_and_planned(text: &[u8], profile: &Profile, random: &mut Random) -> bool {
    let shown = || format!("{}\n{}", profile.name, String::from_utf8_lossy(text));
    let options = LoadOptions {
        start: [0.0, 0.0, random.between(-10.0, 10.0)],
        block_delete: random.once_in(2),
        is_single_block: random.once_in(10),
        // Loops without an end are found sooner.
        flow: FlowLimits { blocks_max: 2000, depth_max: 10, ..FlowLimits::default() },
        probes_touch_at: text.len().is_multiple_of(2).then_some(0.4),
    };
    let tools = tools(random);
    let (_, loaded) = load_with_tools(text, profile, &options, &tools);
    check_places(&loaded.findings, loaded.line_count, &shown());
    for event in &loaded.contour.events {
        assert!(event.source.line <= loaded.line_count, "{event:?}\n{}", shown());
    }
    if !loaded.is_accepted() {
        assert!(loaded.contour.events.is_empty(), "{}", shown());
        return false;
    }
    planned(&loaded.contour, profile, &tools, loaded.line_count, true, shown).accepted()
}

/// Plans with and without certificates and checks what comes out.
pub(crate) fn planned(
    contour: &ProgrammedContour,
    profile: &Profile,
    tools: &ToolTable,
    line_count: u32,
    are_arcs: bool,
    shown: impl Fn() -> String,
) -> Plan {
    let plan = plan(contour, profile, tools);
    let certified = plan_certified(contour, profile, tools);
    assert_eq!(plan.path, certified.path, "a certificate changes the path\n{}", shown());
    assert_eq!(plan.findings, certified.findings, "{}", shown());
    for certificate in &certified.certificates {
        let radii = [certificate.radius_mm, certificate.valid_to_mm, certificate.leads_valid_to_mm];
        assert!(radii.iter().all(|radius| *radius >= 0.0), "{certificate:?}\n{}", shown());
    }
    check_places(&plan.findings, line_count, &shown());
    if plan.accepted() {
        check_path(&plan.path, line_count, are_arcs, &shown);
    } else {
        assert!(plan.path.elements.is_empty() && plan.path.events.is_empty(), "{}", shown());
    }
    check_elements(contour.start, &plan.refused, are_arcs, &shown);
    plan
}

fn check_places(findings: &[Finding], line_count: u32, shown: &str) {
    for finding in findings {
        assert!(finding.source.line <= line_count.max(1), "{finding:?}\n{shown}");
        assert!(!finding.message.is_empty(), "{finding:?}");
        let numbers = [finding.depth_mm, finding.needed_mm, finding.available_mm];
        let position = finding.position.into_iter().flatten();
        let are_numbers = numbers.into_iter().flatten().chain(position).all(f64::is_finite);
        assert!(are_numbers, "{finding:?}\n{shown}");
    }
}

fn check_path(
    path: &CompensatedPath,
    line_count: u32,
    are_arcs: bool,
    shown: &impl Fn() -> String,
) {
    check_elements(path.start, &path.elements, are_arcs, shown);
    let mut before = 0;
    for event in &path.events {
        let is_in_order = before <= event.at_element && event.at_element <= path.elements.len();
        assert!(is_in_order && event.source.line <= line_count, "{event:?}\n{}", shown());
        before = event.at_element;
    }
}

/// How far the radii of an arc at its ends may differ in what a loader lets through, mm.
const ARC_MISMATCH_MM: f64 = 0.5 + 1e-3;

/// `are_arcs`: what was programmed as an arc was one.
fn check_elements(
    start: [f64; 3],
    elements: &[PathElement],
    are_arcs: bool,
    shown: &impl Fn() -> String,
) {
    let mut at = start;
    for element in elements {
        assert!(element.end.iter().all(|value| value.is_finite()), "{element:?}\n{}", shown());
        let feed = element.feed_mm_per_min.unwrap_or(1.0);
        assert!(feed.is_finite() && feed >= 0.0, "{element:?}\n{}", shown());
        if let Shape::Arc(arc) = element.shape
            && are_arcs
        {
            let [u, v, _] = arc.plane.axes();
            let out = |p: [f64; 3]| (p[u] - arc.center[u]).hypot(p[v] - arc.center[v]);
            let difference = (out(at) - out(element.end)).abs();
            assert!(difference <= ARC_MISMATCH_MM, "{difference} {at:?} {element:?}\n{}", shown());
        }
        at = element.end;
    }
}
