//! Programs that compute with what a probe has found: a stretch of them for each reading.

mod common;

use cnc_msgs::contour::{Action, ContourEventKind, Source};
use cnc_msgs::probing::{Measured, ProbeResult};
use cnc_msgs::tool_table::{Tool, ToolTable};
use common::profile;
use program_loader::canonical::event_text;
use program_loader::probe_results::with_results;
use program_loader::tool_rows::load_with_results;
use program_loader::{LoadOptions, Loaded, load};

#[test]
fn what_is_planned_as_if_each_probe_touched_somewhere_is_what_a_run_is_planned_from_there() {
    let text = "G21 G90 F100\nG0 X0 Y0 Z5\no1 repeat [3]\nG38.2 Z-15\n#<_low>=#5063\nG91 G0 Z3\nX4\nG90\no1 endrepeat\n\
                G38.3 X20\nG0 X[#5061-1] Z[#<_low>+10]\nM2\n";
    let options = LoadOptions { probes_touch_at: Some(0.25), ..LoadOptions::default() };
    let assumed = load(text.as_bytes(), &profile("rs274"), &options);
    assert!(assumed.is_accepted() && assumed.awaits.is_none(), "{:#?}", assumed.findings);
    let [warning] = &assumed.findings[..] else { panic!("{:#?}", assumed.findings) };
    assert_eq!((warning.source.line, warning.is_error()), (5, false), "the first that reads one");
    assert!(warning.message.contains("at 25 % of its way"), "{warning:?}");
    // From 5 to -15, then from 3 above where the one before has touched; from X12 to 20.
    let touched = |contact| ProbeResult { has_touched: true, contact, stands: contact };
    let (first, second) = (0.0, 3.0 + 0.25 * (-15.0 - 3.0));
    let third = second + 3.0 + 0.25 * (-15.0 - second - 3.0);
    let results =
        [[0.0, 0.0, first], [4.0, 0.0, second], [8.0, 0.0, third], [14.0, 0.0, third + 3.0]];
    let probes = results.map(touched).to_vec();
    let text = with_results(text.as_bytes(), &Measured { probes, inputs: Vec::new() });
    let measured = load(&text, &profile("rs274"), &options);
    assert!(measured.findings.is_empty(), "{:#?}", measured.findings);
    assert_eq!(measured.contour.events.len(), assumed.contour.events.len());
    for (was, is) in measured.contour.events.iter().zip(&assumed.contour.events) {
        assert_eq!(event_text(was), event_text(is));
    }
}

#[test]
fn the_tool_table_may_be_read_for_the_first_time_after_a_probe() {
    let text = b"T1 M61 Q1\nG21 G90 F100\nG0 X0 Y0 Z5\nG38.2 Z-30\n#1=#5063\nG0 Z[#1+#5403]\nM2\n";
    let tool = Tool { length_mm: 40.0, ..Tool::default() };
    let tools = ToolTable { tools: [(1, tool)].into(), ..ToolTable::default() };
    let measured = Measured { probes: vec![TOUCH], inputs: Vec::new() };
    let (profile, options) = (profile("rs274"), LoadOptions::default());
    let (text, loaded) = load_with_results(text, &measured, &profile, &options, Some(&tools));
    assert!(loaded.is_accepted(), "{:#?}", loaded.findings);
    let last = events(&loaded);
    assert!(last.iter().any(|event| event.contains("27.5")), "{last:?}");
    // The text alone is enough for a replay.
    assert_eq!(events(&load(&text, &profile, &options)), last);
}

const BEGIN: &str = "G21 G90 F100\nG0 X0 Y0 Z5\nG38.2 Z-30\n";

/// Touched at Z-12.5, and stopped a little lower.
const TOUCH: ProbeResult =
    ProbeResult { has_touched: true, contact: [0.0, 0.0, -12.5], stands: [0.0, 0.0, -12.52] };

fn read(program: &str, results: &[ProbeResult]) -> Loaded {
    let measured = Measured { probes: results.to_vec(), inputs: Vec::new() };
    let text = with_results(program.as_bytes(), &measured);
    load(&text, &profile("rs274"), &LoadOptions::default())
}

fn events(loaded: &Loaded) -> Vec<String> {
    loaded.contour.events.iter().map(event_text).collect()
}

/// What comes after the stretch that the results have made known.
fn after(program: &str, results: &[ProbeResult]) -> Vec<String> {
    let (short, long) = (read(program, &results[..results.len() - 1]), read(program, results));
    assert!(long.is_accepted(), "{program}: {:#?}", long.findings);
    let before = &short.contour;
    assert!(short.awaits.is_some() && short.is_accepted(), "{program}: {:#?}", short.findings);
    let last = before.events.last().expect("an event");
    assert!(matches!(last.kind, ContourEventKind::Action(Action::Stretch { .. })), "{program}");
    // A run has done it: nothing in it may change.
    let (known, rest) = long.contour.events.split_at(before.events.len());
    assert_eq!(known, before.events, "{program}");
    let row = |source: &Source| before.calls.after(*source);
    for event in known {
        assert_eq!(row(&event.source), long.contour.calls.after(event.source), "{program}");
    }
    rest.iter().map(event_text).collect()
}

#[test]
fn a_program_is_planned_to_the_reading_and_on_from_the_result() {
    for (program, wanted) in [
        // Where the tool stands is known from there on.
        ("G0 Z[#5063+2]\n", vec!["rapid X0 Y0 Z-12.52 named Z", "rapid X0 Y0 Z-10.5 named Z"]),
        (
            "#1=#5063\nG91 G0 Z1\nG90 G0 Z#1\n",
            vec![
                "rapid X0 Y0 Z-12.52 named Z",
                "rapid X0 Y0 Z-11.52 named Z",
                "rapid X0 Y0 Z-12.5 named Z",
            ],
        ),
        // It has moved from there by so much.
        (
            "G91 G0 Z2\nG90\n#1=#<_z>\nG0 X#1\n",
            vec!["rapid X0 Y0 Z-10.52 named Z", "rapid X-10.52 Y0 Z-10.52 named X"],
        ),
        // Or to a place, which needs nothing.
        ("G0 Z10\nG0 X#5063\n", vec!["rapid X-12.5 Y0 Z10 named X"]),
        ("G92 X1\nG20 G0 Z10\nG0 X[#5063*2]\n", vec!["rapid X-636 Y0 Z254 named X"]),
        (
            "o1 if [#5070 EQ 1]\nG0 Z9\no1 endif\n",
            vec!["rapid X0 Y0 Z-12.52 named Z", "rapid X0 Y0 Z9 named Z"],
        ),
        (
            "o1 while [#5063 GT 0]\nG0 Z9\no1 endwhile\nG0 Z8\n",
            vec!["rapid X0 Y0 Z-12.52 named Z", "rapid X0 Y0 Z8 named Z"],
        ),
        (
            "(DEBUG, found #5063)\nG0 Z9\n",
            vec![
                "rapid X0 Y0 Z-12.52 named Z",
                "(MSG, found -12.500000)",
                "rapid X0 Y0 Z9 named Z",
            ],
        ),
        // So is what cannot be cut without knowing it.
        (
            "G91 G1 Z0.02\nG90 G92 Z0\nG0 Z3\n",
            vec!["rapid X0 Y0 Z-12.5 named Z", "rapid X0 Y0 Z-9.5 named Z"],
        ),
        (
            "G91 G18 G2 X2 Z0 I1 K0\n",
            vec![
                "rapid X0 Y0 Z-12.52 named Z",
                "plane zx",
                "arc cw zx X2 Y0 Z-12.52 center X1 Z-12.52 F100 named XZ",
            ],
        ),
        (
            "G99 G81 X4 Z-14 R-12\nG80\n",
            vec![
                "rapid X0 Y0 Z-12.52 named Z",
                "rapid X0 Y0 Z-12 named Z",
                "rapid X4 Y0 Z-12 named X",
                "line X4 Y0 Z-14 F100 named Z",
                "rapid X4 Y0 Z-12 named Z",
            ],
        ),
        (
            "G91\nG18 G41.1 D1\nG1 X2 Z3\n",
            vec![
                "rapid X0 Y0 Z-12.52 named Z",
                "plane zx",
                "radius diameter 1",
                "select left",
                "line X2 Y0 Z-9.52 F100 named XZ",
            ],
        ),
        ("G93 G1 Z0 F2\n", vec!["rapid X0 Y0 Z-12.52 named Z", "line X0 Y0 Z0 F25.04 named Z"]),
    ] {
        let rest = after(&format!("{BEGIN}{program}M2\n"), &[TOUCH]);
        let moves: Vec<_> = rest.iter().filter(|text| *text != "M2").cloned().collect();
        assert_eq!(moves, wanted, "{program}");
    }
}

#[test]
fn no_zero_is_set_where_a_probe_has_not_touched() {
    let missed = ProbeResult { has_touched: false, ..TOUCH };
    let begin = BEGIN.replace("G38.2", "G38.3");
    for (program, is_refused) in [
        ("G92 Z0\n", true),
        ("G91 G0 Z2\nG90 G92 Z0\n", true),
        ("o1 if [#5070 EQ 1]\nG92 Z0\no1 endif\n", false),
        ("G92 X0\nG0 X#5063\n", false),
        ("G0 Z[#5063+2]\nG92 Z0\n", false),
    ] {
        let text = format!("{begin}{program}M2\n");
        let loaded = read(&text, &[missed]);
        let errors: Vec<_> =
            loaded.findings.iter().filter(|it| it.is_error()).map(|it| &*it.message).collect();
        let wanted = "G92 counts Z from where the tool is, and the probe there has not touched";
        assert_eq!(errors, if is_refused { vec![wanted] } else { vec![] }, "{program}");
        assert!(read(&text, &[TOUCH]).is_accepted(), "{program}");
    }
}

#[test]
fn a_block_that_needs_a_result_keeps_its_own_findings() {
    let said = |program: &str, results: &[ProbeResult]| -> Vec<String> {
        let loaded = read(&format!("{BEGIN}{program}M2\n"), results);
        loaded.findings.iter().map(|it| it.message.clone()).collect()
    };
    let waits = "the machine waits 5000 s here";
    let dwell = "G82 X5 R-10 Z-14 P5000\nG80\n";
    assert!(said(dwell, &[]).iter().any(|it| it == waits));
    assert_eq!(said(dwell, &[TOUCH]), [waits]);
    // Once, with nothing that follows from it.
    let unused = "nothing in this block uses Q7";
    for results in [&[][..], &[TOUCH]] {
        assert_eq!(said("G91 G18 G2 X2 Z1 R5 Q7\nX2 Z1 R5\nG92 Z1\n", results), [unused]);
    }
    let no_value = "a division by zero";
    assert_eq!(said("G92 Z[1/0]\nG0 Z5 Q1\n", &[]), [no_value, "nothing in this block uses Q1"]);
}

#[test]
fn a_probe_in_a_rotated_work_system_is_read_as_the_program_counts() {
    // X of the program is Y of the machine.
    let begin = "G21 G90 F100\nG10 L2 P1 R90\nG0 X0 Y0 Z5\nG38.2 X30\n";
    let touch = ProbeResult { contact: [0.0, 12.5, 5.0], stands: [0.0, 12.75, 5.0], ..TOUCH };
    for (program, wanted) in [
        ("G0 X[#5061-2] Y#5062\n", ["rapid X0 Y12.75 Z5 named XY", "rapid X0 Y10.5 Z5 named XY"]),
        // Where Y is decides how far both axes go.
        ("G0 X5\n", ["rapid X0 Y12.75 Z5 named XY", "rapid X0 Y5 Z5 named XY"]),
        (
            "G10 L2 P1 R[#5061-12.5]\nG0 X1 Y2\n",
            ["rapid X0 Y12.75 Z5 named XY", "rapid X1 Y2 Z5 named XY"],
        ),
    ] {
        let rest = after(&format!("{begin}{program}M2\n"), &[touch]);
        assert_eq!(rest[..2], wanted, "{program}");
    }
}

#[test]
fn what_the_program_sets_of_a_result_is_in_force_until_the_next_probe() {
    let program = "G21 G90 F100\n#5070=1\no1 while [#5070 NE 0]\nG0 X0 Y0 Z5\nG38.3 Z-30\n\
                   o1 endwhile\nG0 X#5063\nM2\n";
    let missed = ProbeResult { has_touched: false, ..TOUCH };
    let rest = after(program, &[TOUCH, missed]);
    assert_eq!(rest, ["rapid X0 Y0 Z-12.52 named Z", "rapid X-12.5 Y0 Z-12.52 named X", "M2"]);
}

#[test]
fn each_probe_of_a_loop_has_a_stretch_and_an_end_of_its_own() {
    let program = "G21 G90 F100\nG0 X0 Y0 Z5\no<touch> sub\nG38.2 Z-30\n#<_low>=[#<_low> MIN #5063]\n\
                   G0 Z5\no<touch> endsub\n#<_low>=0\no1 repeat [3]\no<touch> call\nG91 G0 X10\nG90\no1 endrepeat\n\
                   G1 Z#<_low>\nM2\n"
        .replace("[#<_low> MIN #5063]", "[#<_low>+#5063]");
    let found = |z: f64| ProbeResult { contact: [0.0, 0.0, z], stands: [0.0, 0.0, z], ..TOUCH };
    let results = [found(-1.0), found(-2.0), found(-4.0)];
    for known in 1..=3 {
        after(&program, &results[..known]);
    }
    let whole = read(&program, &results);
    assert_eq!(whole.awaits, None);
    let texts = events(&whole);
    assert!(texts.iter().any(|text| text.starts_with("line X30 Y0 Z-7 ")), "{texts:#?}");
    let awaits = read(&program, &results[..1]).awaits.expect("a line");
    assert_eq!(awaits.line, 5);
    let chain = read(&program, &results[..1]).contour.calls.after(awaits);
    assert!(chain.contains("called from line 10, pass 2 of the loop in line 9"), "{chain}");
}

#[test]
fn what_is_refused_with_a_result_names_its_line_and_what_is_refused_before_is_said_once() {
    let loaded = read(&format!("{BEGIN}G0 Z[#5063/0]\nM2\n"), &[]);
    assert!(loaded.is_accepted() && loaded.findings.len() == 1, "{:#?}", loaded.findings);
    assert_eq!(loaded.findings[0].source.line, 4);
    let loaded = read(&format!("{BEGIN}G0 Z[#5063/0]\nM2\n"), &[TOUCH]);
    assert_eq!((loaded.findings.len(), loaded.findings[0].source.line), (1, 4));
    // All ten of them in one block.
    let sets: Vec<String> =
        (5061..=5070).map(|number| format!("#{}=#{number}", number - 5060)).collect();
    let ten = format!("{BEGIN}{}\nM2\n", sets.join(" "));
    assert!(read(&ten, &[]).is_accepted(), "{:#?}", read(&ten, &[]).findings);
    let loaded = read(&ten, &[TOUCH]);
    assert!(
        loaded.findings[0].message.contains("#5064 is the position of A"),
        "{:#?}",
        loaded.findings
    );
    assert!(read(&ten.replace("G38.2", "G0 A5 B0 C0 U0 V0 W0\nG38.2"), &[TOUCH]).is_accepted());
    // More results than probes are of another program, and change nothing.
    let loaded = read(&format!("{BEGIN}G0 Z10\nM2\n"), &[TOUCH, TOUCH]);
    assert_eq!(events(&loaded), events(&read(&format!("{BEGIN}G0 Z10\nM2\n"), &[])));
}

/// The moves of a program whose M66 have read so much, and the line where it waits for more.
fn with_inputs(program: &str, inputs: &[i32]) -> (Vec<String>, Option<u32>) {
    let measured = Measured { probes: Vec::new(), inputs: inputs.to_vec() };
    let text = with_results(format!("G21 G90\n{program}M2\n").as_bytes(), &measured);
    let loaded = load(&text, &profile("rs274"), &LoadOptions::default());
    assert!(loaded.is_accepted(), "{program}: {:#?}", loaded.findings);
    let moves = events(&loaded).into_iter().filter(|it| it.contains(" X")).collect();
    (moves, loaded.awaits.map(|source| source.line))
}

#[test]
fn what_reads_an_input_is_planned_from_its_value() {
    for (program, inputs, moves, awaits) in [
        ("M66 P0 L0\nG0 X1\n", &[][..], 1, None),
        ("M66 P0 L0\nG0 X1\nG0 X#5399\n", &[], 1, Some(4)),
        ("M66 P0 L0\nG0 X1\nG0 X[#5399+2]\nG0 X#5399\n", &[1], 3, None),
        // Only the last one counts, and the one before it is not asked for.
        ("M66 P0 L0\nG0 X1\nM66 P1 L0\nG0 X[#5399+2]\n", &[], 1, Some(5)),
        ("M66 P0 L0\nG0 X1\nM66 P1 L0\nG0 X[#5399+2]\n", &[0, 1], 2, None),
        ("M66 P0 L0\n#1=#5399\nM66 P1 L0\nG0 X[#1+2]\n", &[7], 1, None),
        (
            "o1 repeat [3]\nM66 P0 L3 Q1\no2 if [#5399 GE 0]\nG0 X#5399\no1 break\no2 endif\no1 endrepeat\n",
            &[-1],
            0,
            Some(4),
        ),
        (
            "o1 repeat [3]\nM66 P0 L3 Q1\no2 if [#5399 GE 0]\nG0 X#5399\no1 break\no2 endif\no1 endrepeat\n",
            &[-1, 5],
            1,
            None,
        ),
    ] {
        let (read, waits) = with_inputs(program, inputs);
        assert_eq!((read.len(), waits), (moves, awaits), "{program} {inputs:?}: {read:#?}");
    }
    let (read, _) = with_inputs("M66 P0 L0\nG0 X1\nG0 X[#5399+2]\nG0 X#5399\n", &[1]);
    assert!(read[1].contains("X3") && read[2].contains("X1"), "{read:#?}");
}

#[test]
fn a_program_may_probe_and_read_inputs() {
    let program = format!("{BEGIN}M66 P0 L0\nG0 Z[#5063+#5399]\nM2\n");
    let found = |probes: &[ProbeResult], inputs: &[i32]| {
        let measured = Measured { probes: probes.to_vec(), inputs: inputs.to_vec() };
        let text = with_results(program.as_bytes(), &measured);
        load(&text, &profile("rs274"), &LoadOptions::default())
    };
    assert_eq!(found(&[], &[]).awaits.map(|it| it.line), Some(5));
    let whole = found(&[TOUCH], &[5]);
    assert!(whole.is_accepted() && whole.awaits.is_none(), "{:#?}", whole.findings);
    let z = events(&whole).into_iter().rfind(|it| it.contains("Z")).expect("a move");
    assert!(z.contains("Z-7.5"), "{z}");
}
