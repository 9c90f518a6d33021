//! What the manuals say of the shell: offsets from outside, single block, manual data
//! input, status. Each row's numbers are in `tests/controls`.

#[path = "support/machine.rs"]
#[allow(dead_code, reason = "each test program uses its part")]
mod machine;
mod support;

use cnc_msgs::wire::cnc_msgs::msg::{MachineState, PathChunk, PathElement, ToolTable};
use kerf_tests::rows::check_at_node;
use machine::{Machine, SLOW_POLLING, Turn, domain, messages, transmitted, until};
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::path::Path;
use support::Folder;

/// The number after a word: `X` in `work     X35.528 Y82.236`, to 0.01 mm: steps.
fn number_after(text: &str, line: &str, word: &str) -> f64 {
    let line = text.lines().find(|text| text.trim_start().starts_with(line)).expect(line);
    let rest = &line[line.rfind(word).expect(word) + word.len()..];
    let end = rest.find([' ', ',']).unwrap_or(rest.len());
    (rest[..end].parse::<f64>().expect("a number") * 100.0).round() / 100.0
}

/// The position of the machine in `kerf status`.
fn stop_of(status: &str) -> Value {
    let role = status.lines().next().and_then(|line| line.strip_suffix(')'));
    let role = role.and_then(|line| line.split_once(", ")).map_or("none", |(_, role)| role);
    let side = |side: &str| status.contains(&format!("cutter {side} of the contour"));
    json!({
        "line": number_after(status, "program", "line "),
        "x": number_after(status, "work", "X"),
        "y": number_after(status, "work", "Y"),
        "role": role,
        "left": side("left"),
        "right": side("right"),
    })
}

/// Runs a program block by block and returns every stop.
fn stops(machine: &Machine, program: &str, mut at_stop: impl FnMut(&Value)) -> Vec<Value> {
    machine.kerf(&["single-block", "on"]).expect(0).says(&["stops after every block"]);
    let running = machine.kerf_meanwhile(&["run", program, "--control", "sinumerik_840c"]);
    let mut stops: Vec<Value> = Vec::new();
    while !running.is_finished() {
        let status = machine.kerf(&["status"]).out;
        if !status.starts_with("HOLD: SINGLE_BLOCK: resume to go on") {
            continue;
        }
        let stop = stop_of(&status);
        if stops.last() != Some(&stop) {
            at_stop(&stop);
            stops.push(stop);
            machine.kerf(&["resume"]).expect(0).says(&["the next block"]);
        }
    }
    running.join().expect("it only runs a command").expect(0);
    machine.kerf(&["single-block", "off"]).expect(0);
    stops
}

#[test]
fn s10_single_block_stops_after_every_block_of_the_corner_of_11_15() {
    let machine = Machine::virtual_one(10);
    let program = "N10 G0 X15 Y60\nN20 G41 G450 G1 D1 X30 Y60 F2000\nN30 X40 Y80\n\
                   N40 G2 X65 Y55 I0 J-25\nN50 G40 G1 X80 Y55\nN60 M30\n";
    machine.folder.file("corner.mpf", program);
    let stops = stops(&machine, "corner.mpf", |_| ());
    check_at_node(
        "S10",
        "s10_single_block_stops_after_every_block_of_the_corner_of_11_15",
        &json!({ "stops": stops }),
    );
    reproduced(&machine, &machine.until_bags(1)[0]);
}

/// The lines in which a side was active, and whether both ever were.
fn sides(bag: &Path) -> Value {
    let states = messages::<MachineState>(bag);
    let lines = |is_active: fn(&MachineState) -> bool| {
        let lines = states.iter().filter(|state| is_active(state)).map(|state| state.line);
        lines.collect::<std::collections::BTreeSet<u32>>()
    };
    json!({
        "left": lines(|state| state.cutter_radius_active_left),
        "right": lines(|state| state.cutter_radius_active_right),
        "both": lines(|s| s.cutter_radius_active_left && s.cutter_radius_active_right),
    })
}

#[test]
fn a18_a19_the_side_is_reported_from_the_lead_on_to_the_end_of_the_lead_off() {
    // Each line is to be seen.
    let machine = Machine::virtual_with(4, &[]);
    let program = "G71 G17 G90 G43 P2\nG1 X10 Y20 F600\nG41 G1 X30 Y0\nMoveLinear(X, 60)\n\
                   G40 G1 X80 Y20\nY60\nG42 G1 X60 Y40\nX30\nG40 X10 Y60\nX0\nM30\n";
    machine.folder.file("sides.ascript", program);
    machine.kerf(&["run", "sides.ascript", "--control", "automation1"]).expect(0);
    let bags = machine.until_bags(1);
    let seen = sides(&bags[0]);
    for row in ["A18", "A19"] {
        check_at_node(
            row,
            "a18_a19_the_side_is_reported_from_the_lead_on_to_the_end_of_the_lead_off",
            &seen,
        );
    }
}

#[test]
fn n09_c20_compensation_in_a_single_block_does_nothing_or_is_refused() {
    let machine = Machine::virtual_one(10);
    let block = "G41 D1 G1 X10 F3000";
    let done = machine.kerf(&["mdi", block, "--control", "nct"]).expect(0);
    let status = machine.until_state("IDLE");
    let refused =
        machine.kerf(&["mdi", "G41 D1 G1 X20 F3000", "--control", "sinumerik_840c"]).expect(4);
    let after = machine.until_state("IDLE");
    // Not in the middle of a program, and not two blocks.
    machine.kerf(&["mdi", "G0 X1\nG0 X2"]).expect(4).says(&["2 lines are not a single block"]);
    // Much longer than a command takes on a busy machine; it is ended below.
    let passes = "X200\nX0\n".repeat(20);
    machine.folder.file("long.ngc", format!("G21 G90 G1 F1200\n{passes}M30\n"));
    let running = machine.kerf_meanwhile(&["run", "long.ngc"]);
    machine.until_state("RUN");
    machine.kerf(&["mdi", "G0 X1"]).expect(4).says(&["the machine is not idle: RUN"]);
    machine.kerf(&["abort"]).expect(0);
    running.join().expect("it only runs a command");
    check_at_node(
        "N09",
        "n09_c20_compensation_in_a_single_block_does_nothing_or_is_refused",
        &json!({
            "x": number_after(&status, "work", "X"),
            "y": number_after(&status, "work", "Y"),
            "says": done.out.trim(),
            "forbidden": { "says": refused.err.trim(), "x": number_after(&after, "work", "X") },
        }),
    );
    reproduced(&machine, &machine.until_bags(1)[0]);
}

/// The elements of the newest plan in a bag.
fn newest_path(bag: &Path) -> Vec<PathElement> {
    let mut chunks = messages::<PathChunk>(bag);
    let newest = chunks.iter().map(|chunk| chunk.revision).max().expect("a path");
    chunks.retain(|chunk| chunk.revision == newest);
    chunks.sort_by_key(|chunk| chunk.index);
    chunks.dedup_by_key(|chunk| chunk.index);
    chunks.into_iter().flat_map(|chunk| chunk.elements).collect()
}

/// How far each straight of the contour has moved to its left, mm.
fn shifts(before: &[PathElement], after: &[PathElement]) -> Vec<f64> {
    let straights = before.iter().zip(after).filter(|(old, _)| {
        old.role == PathElement::ROLE_CONTOUR && old.kind == PathElement::KIND_LINE
    });
    let shift = straights.map(|(old, new)| {
        let along = (old.end.x - old.start.x, old.end.y - old.start.y);
        let off = (new.end.x - old.end.x, new.end.y - old.end.y);
        1e3 * (along.0 * off.1 - along.1 * off.0) / along.0.hypot(along.1)
    });
    shift.map(|mm| (mm * 1e6).round() / 1e6).collect()
}

const M12: &str = include_str!("../../program_loader/tests/programs/masso/m12.nc");

#[test]
fn m30_s46_an_offset_that_is_set_from_outside_moves_every_straight_and_is_kept() {
    let folder = Folder::new();
    let text = "# Of the mill in the corner.\ntools:\n  1: {diameter_mm: 10.0} # HSS\n";
    let tools = folder.file("tools.yaml", text);
    let table = format!("compensation_planner:tool_table:={}", tools.display());
    let machine = Machine::virtual_with(20, &["-p", &table]);
    machine.folder.file("m12.nc", M12);
    let run = |count: usize| {
        let running = machine.kerf_meanwhile(&["run", "m12.nc", "--control", "masso"]);
        // The program asks for its tool.
        machine.until_state("TOOL_CHANGE");
        machine.kerf(&["confirm"]).expect(0);
        running.join().expect("it only runs a command").expect(0);
        machine.until_bags(count).pop().expect("a bag")
    };
    let before = newest_path(&run(1));
    // What cannot be is refused, with its number, and nothing has changed.
    machine.kerf(&["tool", "T1", "--diameter", "-3"]).expect(4).says(&["T1 is -3 mm"]);
    machine.kerf(&["tool", "T9", "--wear", "-0.5"]).expect(4).says(&["there is no T9"]);
    let huge = machine.kerf(&["tool", "T1", "--diameter", "400"]).expect(4);
    let huge = huge.says(&["m12.nc could not be cut any more: line ", "nothing was changed"]);
    assert!(!huge.err.is_empty());
    assert_eq!(std::fs::read_to_string(&tools).expect("there"), text);

    machine
        .kerf(&["tool", "T1", "--wear", "-0.5"])
        .expect(0)
        .says(&["wear_diameter_mm -0.5; kept in"]);
    let kept = std::fs::read_to_string(&tools).expect("there");
    let after = run(2);
    let tables = messages::<ToolTable>(&after);
    let seen = json!({
        "shifts": shifts(&before, &newest_path(&after)),
        "file": kept.lines().nth(2),
        "comment": kept.lines().next(),
        "published": tables.last().map(|table| json!({
            "revision": table.revision,
            "wear": table.tools[0].wear_diameter * 1e3,
        })),
    });
    check_at_node(
        "S46",
        "m30_s46_an_offset_that_is_set_from_outside_moves_every_straight_and_is_kept",
        &seen,
    );
    // A file that was changed meanwhile is not overwritten.
    std::fs::write(&tools, "tools:\n  1: {diameter_mm: 12.0}\n").expect("written");
    machine.kerf(&["tool", "T1", "--wear", "-0.6"]).expect(4).says(&["somebody has changed"]);
    until("the other's file", || {
        std::fs::read_to_string(&tools).expect("there").contains("12.0").then_some(())
    });
}

#[test]
fn s48_a_value_that_is_entered_in_a_stop_is_in_force_from_the_next_corner_on() {
    let folder = Folder::new();
    let tools = folder.file("tools.yaml", "offsets:\n  1: {radius_mm: 5.0}\n");
    let table = format!("compensation_planner:tool_table:={}", tools.display());
    let machine = Machine::virtual_with(10, &["-p", &table]);
    let program = "N10 G0 X20 Y50\nN20 G41 G1 D1 X0 Y0 F3000\nN30 X100\nN40 Y100\nN50 X0\n\
                   N60 G40 X50 Y60\nN70 M30\n";
    machine.folder.file("square.mpf", program);
    let mut said = String::new();
    let held = stops(&machine, "square.mpf", |stop| {
        // The tool is at the end of the lead-on; N30 is the block that is ready.
        if stop["role"] == "lead_on" {
            said = machine.kerf(&["tool", "D1", "--diameter", "16"]).expect(0).out;
        }
    });
    let bag = machine.until_bags(1).remove(0);
    let again = stops(&machine, "square.mpf", |_| ());
    let corners = |stops: &[Value]| -> Vec<Value> {
        let ends = stops.iter().filter(|stop| stop["role"] == "contour");
        ends.map(|stop| json!({ "line": stop["line"], "x": stop["x"], "y": stop["y"] })).collect()
    };
    check_at_node(
        "S48",
        "s48_a_value_that_is_entered_in_a_stop_is_in_force_from_the_next_corner_on",
        &json!({
            "said": said.trim().rsplit("; ").next(),
            "held": corners(&held),
            "next_run": corners(&again),
        }),
    );
    reproduced(&machine, &bag);
    reproduced(&machine, &machine.until_bags(2)[1]);
}

const M11_15: &str = include_str!("../../../tests/golden_runs/contour.mpf");

#[test]
fn m28_a_run_from_the_middle_of_a_contour_is_refused_or_rebuilt_as_its_control_does() {
    let folder = Folder::new();
    let text = "tools:\n  1: {diameter_mm: 10.0}\noffsets:\n  1: {radius_mm: 5.0}\n";
    let tools = folder.file("tools.yaml", text).display().to_string();
    let scenario = folder.file("homing.yaml", "homing: true\n").display().to_string();
    let args = ["--virtual-controller", "--time-factor", "10", "--scenario", &scenario];
    let table = format!("compensation_planner:tool_table:={tools}");
    // The zero is set where homing ends, at the end of the travel.
    let driver = [
        "axis_driver:approach:=lift",
        "axis_driver:approach_z_mm:=60.0",
        "axis_driver:check_travel:=off",
    ];
    let ros_args =
        [SLOW_POLLING.as_slice(), &["-p", &table], &driver.map(|it| ["-p", it]).concat()].concat();
    let machine = Machine::start(&domain(), "mill", &args, &ros_args, Some(Turn::wait()));
    machine.until_state("ALARM");
    machine.kerf(&["home"]).expect(0);
    machine.kerf(&["zero", "X0", "Y0", "Z0"]).expect(0);
    machine.folder.file("m12.nc", M12);
    machine.folder.file("contour.mpf", M11_15);
    let said = |arguments: &[&str], status: i32| {
        let ran = machine.kerf(arguments).expect(status);
        json!({ "message": format!("{}{}", ran.out, ran.err) })
    };
    let control = |name| ["--control", name];
    let planned = |file, name, line, status| {
        let arguments = ["plan", file, "--tools", &tools, "--start-line", line];
        said(&[arguments.as_slice(), &control(name)].concat(), status)
    };
    let forbidden = json!({
        "plan": planned("m12.nc", "masso", "7", 1),
        "run": said(&["run", "m12.nc", "--control", "masso", "--start-line", "7"], 4),
        "nothing_was_sent": machine.bags().is_empty(),
    });

    let plan = planned("contour.mpf", "sinumerik_840c", "8", 0);
    let run = ["run", "contour.mpf", "--control", "sinumerik_840c", "--start-line", "8"];
    machine.kerf(&run).expect(0).says(&["done"]);
    let status = machine.kerf(&["status"]).expect(0).out;
    let bag = machine.until_bags(1).remove(0);
    let cutting = messages::<MachineState>(&bag).into_iter().filter(|state| state.line >= 8);
    let rpm = cutting.map(|state| (state.spindle_speed * 30.0 / PI).round()).fold(0.0, f64::max);
    check_at_node(
        "M28",
        "m28_a_run_from_the_middle_of_a_contour_is_refused_or_rebuilt_as_its_control_does",
        &json!({
            "forbidden": forbidden,
            "rebuilt": {
                "plan": plan,
                "sent": lines_of_the_run(&bag),
                "rpm": rpm,
                "end": {
                    "x": number_after(&status, "work", "X"),
                    "y": number_after(&status, "work", "Y"),
                },
            },
        }),
    );
    reproduced(&machine, &bag);
}

/// The first lines after the words that every run begins with, without checks among them.
fn lines_of_the_run(bag: &Path) -> Vec<String> {
    let sent = transmitted(bag).concat();
    let sent = String::from_utf8_lossy(&sent).replace(['?', '\u{18}'], "");
    let (_, lines) = sent.rsplit_once("G21G90G94G17G40G49G54\n").expect("the run has begun");
    let lines = lines.lines().filter(|line| !line.starts_with('$') && !line.starts_with("G4P"));
    lines.take(7).map(str::to_owned).collect()
}

/// Fails unless every core does today what it did then.
#[track_caller]
fn reproduced(machine: &Machine, bag: &Path) {
    let bag = bag.to_str().expect("UTF-8");
    machine.kerf(&["bag", "info", bag]).expect(0).says(&["complete:    yes"]);
    machine.kerf(&["replay", bag]).expect(0).says(&[
        "reproduced",
        "loader: 0 differences",
        "planner: 0 differences",
        "driver: 0 differences",
    ]);
}

/// The last point of the path in a picture, and how the X axis is drawn.
fn end_of_path(svg: &str) -> Value {
    let mut paths = svg.lines().filter_map(|line| line.strip_prefix("<path class=\"path\" d=\""));
    // That of the legend is drawn with h.
    let path = paths.find(|path| path.contains('L')).expect("the picture has a path");
    let path = path.trim_end_matches("\"/>");
    let last = path.rsplit(['M', 'L']).next().expect("a point");
    let numbers: Vec<f64> =
        last.split(' ').map(|number| number.parse().expect("a number")).collect();
    let title = svg.lines().find(|line| line.contains("to the right")).expect("a title");
    let side = ["tool centre, on the right", "tool centre, on the left"];
    json!({
        "right": numbers[0],
        "down": numbers[1],
        "axis": if title.contains("X down") { "down" } else { "up" },
        "legend": side.into_iter().find(|label| svg.contains(label)),
    })
}

#[test]
fn s02_in_front_of_the_centre_the_picture_has_x_downwards() {
    let folder = Folder::new();
    let program = "G18\nG0 X30 Z5\nN10 G42 G0 D1 X20 Z2\nN20 G1 Z-30 F100\nN30 G40 X40\nM30\n";
    let program = folder.file("turn.mpf", program);
    let tools = folder.file("tools.yaml", "offsets:\n  1: {radius_mm: 0.8, tip_direction: 3}\n");
    let shipped = kerf_tests::root().join("config/controls/sinumerik_840c.yaml");
    let behind = std::fs::read_to_string(shipped).expect("a shipped profile");
    let front = behind.replace("mirror_x: false", "mirror_x: true");
    assert_ne!(behind, front);
    let picture = |name: &str, profile: &str| {
        let profile = folder.file(&format!("{name}.yaml"), profile);
        let svg = folder.path().join(format!("{name}.svg"));
        let mut command = support::kerf();
        command.arg("plan").arg(&program).arg("--tools").arg(&tools);
        command.arg("--control").arg(profile).arg("--svg").arg(&svg);
        support::run(&mut command).expect(0);
        end_of_path(&std::fs::read_to_string(svg).expect("the picture"))
    };
    let observed =
        json!({"behind": picture("behind", &behind), "in_front": picture("front", &front)});
    check_at_node("S02", "s02_in_front_of_the_centre_the_picture_has_x_downwards", &observed);
}
