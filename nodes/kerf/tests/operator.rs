//! What an operator or a robot does apart from programs, with real nodes and the virtual
//! controller: a tool change, jogs and zeros, a start in the middle.

#[path = "support/machine.rs"]
#[allow(dead_code, reason = "each test program uses its part")]
mod machine;
mod support;

use machine::{Machine, SLOW_POLLING, Turn, domain};
use rustix::process::{Pid, Signal, kill_process};
use std::process::Stdio;
use support::Folder;

/// A machine with a tool table of its own, ten times faster than a real one.
fn machine(tools: &str, ros_args: &[&str]) -> (Machine, Folder) {
    let folder = Folder::new();
    let table =
        format!("compensation_planner:tool_table:={}", folder.file("tools.yaml", tools).display());
    let mut args = vec!["-p", table.as_str()];
    args.extend_from_slice(ros_args);
    (Machine::virtual_with(10, &args), folder)
}

#[test]
fn a_tool_is_confirmed_only_when_the_path_was_made_with_it() {
    let (machine, _folder) = machine("tools:\n  2: {diameter_mm: 8.0, length_mm: 50.0}\n", &[]);
    machine.folder.file("two.ngc", "G21 G90 G94\nG1 X5 F2000\nT2 M6\nG1 X10\nT9 M6\nG1 X15\nM30\n");
    let running = machine.kerf_meanwhile(&["run", "two.ngc"]);
    let status = machine.until_state("TOOL_CHANGE: put in T2 (line 3)");
    assert!(status.contains("X5.000"), "it is at the programmed point: {status}");

    // The robot measures another diameter than was planned with.
    machine.kerf(&["tool", "T2", "--wear", "-0.1"]).expect(0);
    machine
        .kerf(&["confirm"])
        .expect(4)
        .says(&["the path was made for another T2", "diameter 8.0000 mm, now 7.9000 mm"]);
    machine.until_state("TOOL_CHANGE: put in T2");
    machine.kerf(&["tool", "T2", "--wear", "0"]).expect(0);
    machine.kerf(&["confirm"]).expect(0).says(&["the run goes on"]);

    machine.until_state("TOOL_CHANGE: put in T9 (line 5)");
    machine.kerf(&["confirm"]).expect(4).says(&["T9 is not in the tool table"]);
    machine.kerf(&["tool", "T9", "--diameter", "3"]).expect(0);
    machine.kerf(&["confirm"]).expect(0);
    // The outputs are pipes.
    let ran = running.join().expect("it only runs a command").expect(0).says(&["done"]);
    for tool in [2, 9] {
        let said = format!("the run waits: TOOL_CHANGE: put in T{tool} ");
        assert_eq!(ran.err.matches(&said).count(), 1, "{}", ran.err);
    }
    assert_eq!(ran.err.matches("then `kerf confirm`").count(), 2, "{}", ran.err);
}

#[test]
fn a_program_that_reads_the_tool_table_is_read_again_when_it_changes() {
    let (machine, _folder) = machine("tools:\n  2: {diameter_mm: 8.0, length_mm: 50.0}\n", &[]);
    machine.folder.file("reads.ngc", "G21 G90 G94\nM61 Q2\nG1 X#5410 F2000\nM30\n");
    machine.kerf(&["run", "reads.ngc"]).expect(0);
    let stands = |place: &str| machine.kerf(&["status"]).expect(0).out.contains(place);
    assert!(stands("X8.000"));
    machine.kerf(&["tool", "T2", "--wear", "-0.5"]).expect(0);
    machine::until("it runs to another place", || {
        let _may_be_read_meanwhile = machine.kerf(&["run"]);
        stands("X7.500").then_some(())
    });
    // With a table that it cannot be read with it is not run at all; the next table may be a better one.
    machine.folder.file("inverse.ngc", "G21 G90 G94\nM61 Q2\nG1 X[1/[#5410-8.5]] F2000\nM30\n");
    machine.kerf(&["run", "inverse.ngc"]).expect(0);
    assert!(stands("X-1.000"));
    machine.kerf(&["tool", "T2", "--wear", "0.5"]).expect(0);
    machine::until("it is withdrawn", || {
        let running = machine.kerf_meanwhile(&["run"]);
        while !running.is_finished() {
            if stands(
                "PROGRAM_STOP: the tool table has changed, and the program was not read with it",
            ) {
                machine.kerf(&["abort"]).expect(0);
                let _canceled = running.join();
                return Some(());
            }
        }
        None
    });
    assert!(stands("X-1.000"));
    machine.kerf(&["tool", "T2", "--wear", "0"]).expect(0);
    machine::until("it is there again", || {
        let _may_be_read_meanwhile = machine.kerf(&["run"]);
        stands("X-2.000").then_some(())
    });
    machine.folder.file("other.ngc", "G21 G90 G94\nM61 Q3\nG1 X#5410 F2000\nM30\n");
    let says = "#5410 is a value of T3, which is not in the tool table";
    machine.kerf(&["load", "other.ngc"]).expect(4).says(&[says, "add T3 to the tool table"]);
}

#[test]
fn a_program_for_which_the_planner_has_too_little_memory_is_refused_with_numbers() {
    let (machine, _folder) =
        machine("tools: {}\n", &["-p", "compensation_planner:memory_mb_max:=64"]);
    let long = (0..150_000).map(|line| format!("X{} Y{}\n", line % 100, line % 7));
    let long: String = long.collect();
    machine.folder.file("long.ngc", format!("G21 G90 G94\nG1 X5 F2000\n{long}M30\n"));
    machine.kerf(&["load", "long.ngc"]).expect(4).says(&[
        "error[limit]: planning 150",
        "takes 88 MB of memory or more; the planner may take 64 MB",
        "split the program into several, or start the planner with a larger memory_mb_max",
        "long.ngc is refused by the planner: 1 error",
    ]);
    // This is short enough to be tried, and compensation takes more.
    let zigzag = (0..70_000).map(|line| format!("X{} Y{}\n", line + 1, line % 2));
    let zigzag: String = zigzag.collect();
    let tool = "G41.1 D0.01";
    let text =
        format!("G21 G90 G94\nG0 X0 Y-1\n{tool} G1 X0 Y0 F900\n{zigzag}G40 X70000 Y50\nM30\n");
    machine.folder.file("zigzag.ngc", text);
    machine.kerf(&["load", "zigzag.ngc"]).expect(3).says(&[
        "zigzag.ngc is loaded, but the planner ended twice while it planned it",
        "split the program, or start the planner with a larger memory_mb_max",
    ]);
    machine.folder.file("short.ngc", "G21 G90 G94\nG1 X5 F2000\nM30\n");
    machine.kerf(&["run", "short.ngc"]).expect(0).says(&["done"]);
}

#[test]
fn ctrl_c_at_the_command_cancels_what_it_began() {
    let machine = Machine::virtual_one(4);
    machine.folder.file("slow.ngc", "G21 G90 G94\nG1 X500 F300\nM30\n");
    for (arguments, state) in [
        (&["run", "slow.ngc"][..], "RUN"),
        (&["mdi", "G21 G91 G94 G1 X200 F300"], "RUN"),
        (&["jog", "X200", "--feed", "300"], "JOG"),
    ] {
        let mut command = machine.command(arguments);
        let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
        let child = child.expect("it starts");
        machine.until_state(state);
        kill_process(Pid::from_child(&child), Signal::INT).expect("it is there");
        let out = child.wait_with_output().expect("it ends by itself");
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(4), "{arguments:?}: {said}");
        assert!(said.contains("canceling;"), "{arguments:?}: {said}");
        machine.until_state("IDLE");
    }
}

#[test]
fn jogs_zeros_overrides_and_probes_are_typed() {
    let machine = Machine::virtual_one(10);
    machine.kerf(&["zero", "X0", "Y0"]).expect(0).says(&["X0Y0 in G54"]);
    machine.kerf(&["jog", "X12.5", "Y-3", "--feed", "3000"]).expect(0).says(&["X12.500 Y-3.000"]);
    machine.kerf(&["jog", "X1", "--from", "work"]).expect(0).says(&["X1.000 Y-3.000"]);
    machine.kerf(&["zero", "X10", "--system", "G55"]).expect(0).says(&["X10 in G55"]);
    machine.kerf(&["jog", "X1e9"]).expect(4).says(&["not between -10000 and 10000 mm"]);
    machine.kerf(&["jog", "X1", "X2"]).expect(2).says(&["X occurs twice"]);
    machine.kerf(&["jog", "A1"]).expect(4).says(&["no axis A: it has X Y Z"]);
    machine.kerf(&["jog", "Q1"]).expect(2).says(&["an axis and a number"]);
    machine
        .kerf(&["zero", "X0", "--system", "G60"])
        .expect(2)
        .says(&["write G54 to G59.3, or G92"]);
    machine.kerf(&["override", "--feed", "80", "--rapid", "25"]).expect(0);
    machine.kerf(&["override", "--rapid", "70"]).expect(2).says(&["25, 50 or 100"]);
    machine.kerf(&["override", "--feed", "500"]).expect(2).says(&["a percentage from 10 to 200"]);
    let status = machine::until("the overrides", || {
        let status = machine.kerf(&["status"]).expect(0).out;
        status.contains("overrides: feed 80, rapid 25, spindle 100 %").then_some(status)
    });
    assert!(status.starts_with("IDLE"), "{status}");
    // No probe is wired: the alarm says so, and nothing unlocks by itself.
    machine.kerf(&["probe", "Z-2", "--feed", "300"]).expect(4).says(&["ALARM:5", "error 319"]);
    machine.until_state("ALARM:5");
    machine.kerf(&["jog", "X1"]).expect(4).says(&["`kerf reset` to go on"]);
    machine.kerf(&["reset"]).expect(0);
    machine.kerf(&["unlock"]).expect(0);
    machine.kerf(&["jog", "X0", "--from", "work"]).expect(0);
}

#[test]
fn a_program_that_computes_with_its_probe_runs_in_stretches_and_probes_anew_each_time() {
    let folder = Folder::new();
    let scenario = folder.file("probe.yaml", "probe_z_mm: -62\n").display().to_string();
    let args = ["--virtual-controller", "--time-factor", "10", "--scenario", &scenario];
    let machine = Machine::start(&domain(), "mill", &args, &SLOW_POLLING, Some(Turn::wait()));
    machine.until_state("IDLE");
    let program = "G21 G90 G94 F600\no1 repeat [2]\nG38.2 Z-30\nG0 Z[#5063+5]\no1 endrepeat\nG1 Z[#5063/2]\nM2\n";
    machine.folder.file("touch.ngc", program);
    machine
        .kerf(&["load", "touch.ngc"])
        .expect(0)
        .says(&["planned and judged while the run waits here"]);
    let surface = |status: &str| status.contains(" Z-6.000 mm");
    for runs in 1..=2 {
        machine.kerf(&["run"]).expect(0).says(&["done"]);
        let status = machine.kerf(&["status"]).expect(0).out;
        assert!(surface(&status), "{status}");
        let log = machine.log();
        assert_eq!(log.matches("goes on with revision").count(), 2 * runs, "{log}");
        let bag = machine.until_bags(runs).remove(runs - 1);
        let bag = bag.to_str().expect("UTF-8").to_owned();
        machine.kerf(&["replay", &bag]).expect(0).says(&["reproduced"]);
    }
    // What is wrong with what was found ends the run where it stands.
    machine.folder.file("touch.ngc", program.replace("[#5063/2]", "[#5063/[#5063+12]]"));
    machine.kerf(&["load", "touch.ngc"]).expect(0);
    machine.kerf(&["run"]).expect(4).says(&[
        "line 4, pass 2 of the loop in line 2: what follows was not planned from what was measured",
        "line 6: a division by zero",
    ]);
    machine.kerf(&["jog", "Z0", "--from", "work"]).expect(0);
    // And what the planner finds.
    let slot = "G21 G90 G94 F600\nG38.2 Z-30\n#1=[0-#5063]\nG0 Z5\nG41.1 D#1 G1 X30 Y0\nX40\nY4\nX30\nY0\nG40 Y-30\nM2\n";
    machine.folder.file("slot.ngc", slot);
    machine.kerf(&["load", "slot.ngc"]).expect(0);
    machine
        .kerf(&["run"])
        .expect(4)
        .says(&["was refused by the planner", ": line 5: the tool (radius 6.000 mm"]);
    // So does a program that is loaded meanwhile.
    machine.kerf(&["jog", "Z0", "--from", "work"]).expect(0);
    machine.folder.file("other.ngc", "G21 G90\nG0 X1\nM2\n");
    machine.folder.file("slow.ngc", program.replace("F600", "F10"));
    machine.kerf(&["load", "slow.ngc"]).expect(0);
    let running = machine.kerf_meanwhile(&["run"]);
    machine.until_state("RUN");
    machine.kerf(&["load", "other.ngc"]).expect(0);
    let ran = running.join().expect("it only runs a command");
    ran.expect(4).says(&["another program was loaded since the run began"]);
}

#[test]
fn m28_without_a_home_the_tool_has_to_stand_where_a_run_from_the_middle_begins() {
    let (machine, _folder) = machine(
        "tools:\n  1: {diameter_mm: 4.0}\n",
        &["-p", "axis_driver:approach:=lift", "-p", "axis_driver:approach_z_mm:=0.0"],
    );
    // In from the side, perpendicular: along X, up along Y, out to the side again.
    let program = "G21 G90 G94 T1\nG0 X0 Y0 Z0\nG1 Z-1 F1000\nG41 D1 G1 X10 Y10\nG1 Y20\n\
                   G1 Y30\nG40 G1 X0 Y40\nG1 X-20\nG0 Z0\nM30\n";
    machine.folder.file("part.ngc", program);
    machine.kerf(&["load", "part.ngc"]).expect(0);
    // Not homed: heights of the machine frame mean nothing, and the tool is not there. Under
    // compensation that is the compensated point.
    machine.kerf(&["run", "--start-line", "6"]).expect(4).says(&[
        "the path begins at X8.000 Y20.000 Z-1.000 but the tool is at X0.000 Y0.000 Z0.000",
        "move it there first",
    ]);
    machine.kerf(&["run", "--start-line", "8"]).expect(4).says(&["move it there first"]);
    machine.kerf(&["run", "--start-line", "11"]).expect(4).says(&[
        "the program has no motion from line 11 on; its last is in line 9",
        "begin at line 9 or before",
    ]);
    machine.kerf(&["run"]).expect(0);
    // The driver knows no control: without the planner it begins nowhere but at the beginning.
    let planner = machine.node("compensation_planner");
    kill_process(planner, Signal::STOP).expect("it is there");
    let refused = machine.kerf(&["run", "--start-line", "6"]);
    kill_process(planner, Signal::CONT).expect("it is there");
    refused.expect(4).says(&["the planner did not answer whether a run can begin at line 6"]);
    machine.kerf(&["jog", "X8", "Y20", "Z-1", "--from", "work"]).expect(0);
    machine.kerf(&["run", "--start-line", "6"]).expect(0).says(&["done"]);
    machine.kerf(&["jog", "X0", "Y40", "Z-1", "--from", "work"]).expect(0);
    machine.kerf(&["run", "--start-line", "8"]).expect(0).says(&["done"]);
    let status = machine.kerf(&["status"]).expect(0).out;
    assert!(status.contains("X-20.000 Y40.000 Z0.000"), "{status}");
}

#[test]
fn a_run_that_was_broken_off_goes_on_where_that_is_confirmed() {
    let (machine, _folder) = machine("tools:\n  1: {diameter_mm: 4.0}\n", &[]);
    let resume = |arguments: &[&str]| machine.kerf(&[&["run", "--resume"], arguments].concat());
    resume(&[]).expect(4).says(&["no program is loaded"]);
    let program = "G21 G90 G94 T1\nG0 X0 Y0 Z0\nM3 S900 M8\nG1 Z-1 F1000\nG41 D1 G1 X10 Y10\n\
                   G1 Y20\nG1 Y380 F200\nG40 G1 X0 Y390\nG0 Z0\nM30\n";
    machine.folder.file("part.ngc", program);
    machine.kerf(&["load", "part.ngc"]).expect(0);
    resume(&[]).expect(4).says(&["the driver has run nothing", "--start-line LINE"]);

    let running = machine.kerf_meanwhile(&["run"]);
    machine::until("the long line", || {
        machine.kerf(&["status"]).out.contains("line 7").then_some(())
    });
    // A machine that cuts is not begun with.
    resume(&["--yes", "--start-line", "6"]).expect(4).says(&["the machine is in RUN: kerf abort"]);
    machine.kerf(&["abort"]).expect(0);
    running.join().expect("it only runs a command").expect(4);

    let page = machine.folder.path().join("start.html");
    resume(&["--html", "start.html"]).expect(4).says(&[
        "part.ngc: the last run: canceled at line 7",
        "the run begins with line 7 at X8.000 Y20.000 Z-1.000, cutter left of the contour, F200, S900 M3 M8",
        "nothing was sent",
        "the tool has to stand there",
        "there is no terminal to confirm on; --yes begins without asking",
    ]);
    let page = std::fs::read_to_string(page).expect("a page");
    assert!(page.contains("begins with line 7") && page.contains("left out"), "it shows the start");
    resume(&["--yes"]).expect(4).says(&["the path begins at X8.000 Y20.000 Z-1.000 but the tool"]);
    machine.kerf(&["jog", "X8", "Y20", "Z-1", "--from", "work"]).expect(0);
    resume(&["--yes"]).expect(0).says(&["done"]);
    resume(&[]).expect(4).says(&["the last run was cut to its end"]);
    resume(&["--start-line", "11"]).expect(4).says(&["begin at line 9 or before"]);

    // This control does not begin under compensation: the nearest line is proposed.
    let program = program.replace("T1", "T1 M6").replace(" D1", "");
    machine.folder.file("masso.ngc", program);
    machine.kerf(&["load", "masso.ngc", "--control", "masso"]).expect(0);
    resume(&[]).expect(4).says(&["masso.ngc, which is loaded, is not the program of the last run"]);
    resume(&["--start-line", "7"]).expect(4).says(&[
        "it cannot begin with line 7, so it begins with line 4",
        "the run begins with line 4 at X0.000 Y0.000 Z0.000",
    ]);

    // After G55 only the driver knows that the place of X and Y is lost.
    let program = "G21 G90 G94\nG0 X0 Y0 Z0\nG1 Z-1 F300\nG1 X10\nG55\nG0 Z10\nG0 X10 Y10\nM2\n";
    machine.folder.file("frames.ngc", program);
    machine.kerf(&["load", "frames.ngc"]).expect(0);
    resume(&["--start-line", "7"]).expect(4).says(&[
        "line 7 begins where XY have not been given since G55",
        "it cannot begin with line 7, so it begins with line 5",
        "the program goes on with G55 (line 5), G0Z10 (line 6)",
        "there is no terminal to confirm on",
    ]);
}

#[test]
fn a_run_of_four_axes_that_was_broken_off_goes_on_with_the_part_turned() {
    let folder = Folder::new();
    let scenario = folder.file("homing.yaml", "settings: {$22: 1}\n").display().to_string();
    let args = ["--virtual-controller", "--axes", "XYZA", "--time-factor", "10"];
    let ros_args = ["-p", "axis_driver:approach:=lift", "-p", "axis_driver:approach_z_mm:=-2.0"];
    let machine = Machine::start(
        &domain(),
        "mill",
        &[&args[..], &["--scenario", &scenario]].concat(),
        &[&SLOW_POLLING[..], &ros_args].concat(),
        Some(Turn::wait()),
    );
    machine.until_state("ALARM");
    machine.kerf(&["home"]).expect(0);
    machine.kerf(&["jog", "X-300", "Y-200", "Z-50", "--from", "machine"]).expect(0);
    machine.kerf(&["zero", "X0", "Y0", "Z0", "A0"]).expect(0);
    let program = "G21 G90 G94\nG0 Z5\nG0 X0 Y0 A0\nG1 Z-1 F1000\nG1 X20 A90\nG1 X220 A180 F300\n\
                   G1 Y10\nG0 Z5\nM30\n";
    machine.folder.file("rotary.ngc", program);
    let running = machine.kerf_meanwhile(&["run", "rotary.ngc"]);
    machine::until("the long line", || {
        machine.kerf(&["status"]).out.contains("line 6").then_some(())
    });
    machine.kerf(&["abort"]).expect(0);
    running.join().expect("it only runs a command").expect(4);
    // Somebody looks at the part from below.
    machine.kerf(&["jog", "Z40", "--from", "work"]).expect(0);
    machine.kerf(&["jog", "A-45", "--from", "work"]).expect(0);
    machine.kerf(&["run", "--resume", "--yes", "--html", "start.html"]).expect(0).says(&[
        "the run begins with line 6 at X20.000 Y0.000 Z-1.000 A90.000, F300",
        "s to the end\n",
        "tool as it is: the program has changed none before\n",
        "offsets G54\n",
        "spindle off\n",
        "coolant off\n",
        "Z40.000, up to Z48.000 (Z-2.000 in the machine frame), there to A90.000, over X20.000 Y0.000, down to Z-1.000 \
         at F1000\n",
        "first come G53G0Z-2, G0A90, G0X20Y0, G1Z-1F1000\n",
        "A is not homed: be sure that it stands at A-45.000\n",
        "the program goes on with X220A180G93F1.5 (line 6), Y10G94F300 (line 7), G0Z5 (line 8)\n",
        "done",
    ]);
    let page = machine.folder.path().join("start.html");
    let page = std::fs::read_to_string(page).expect("a page");
    for shown in
        ["\"approach\"", "the tool is here", "down to Z-1.000 at F1000", "\"letter\":\"A\""]
    {
        assert!(page.contains(shown), "{shown}");
    }
    let status = machine.kerf(&["status"]).expect(0).out;
    assert!(status.contains("X220.000 Y10.000 Z5.000 mm, A180.000 degrees"), "{status}");
}
