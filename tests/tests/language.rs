//! Programs in the language of rs274, from their text to the axes of a virtual controller: what
//! the program asks for is where the machine goes.

use axis_driver::driver::RunOutcome;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::{Planning, judge};
use kerf_tests::line::Line;
use program_loader::{LoadOptions, load};
use serde_json::Value;
use virtual_controller::{Build, Firmware, Settings};

/// The path of a program that is accepted.
#[track_caller]
fn plan(text: &str) -> CompensatedPath {
    let profile = kerf_tests::rows::observe::profile("rs274", &Value::Null);
    let loaded = load(text.as_bytes(), &profile, &LoadOptions::default());
    assert!(loaded.is_accepted(), "{:?}", loaded.findings);
    let verdict = judge(&loaded.contour, &profile, &ToolTable::default(), Planning::default());
    assert_eq!(verdict.disagreement, None, "{:#?}", verdict.audit);
    assert!(verdict.plan.accepted(), "{:?}", verdict.plan.findings);
    verdict.plan.path
}

/// Runs a program; returns where the axes stand in the machine frame, and what was sent.
#[track_caller]
fn run(text: &str, firmware: Firmware) -> ([f64; 3], String) {
    let mut line = Line::connected(Build::new(Settings::small_router_of(firmware)));
    let then = line.now;
    let result = line.run(plan(text));
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
    (line.axes(), line.said_since(then))
}

#[track_caller]
fn is_at(axes: [f64; 3], wanted: [f64; 3]) {
    let near = (0..3).all(|axis| (axes[axis] - wanted[axis]).abs() < 0.01);
    assert!(near, "{axes:?} and not {wanted:?}");
}

#[test]
fn loops_calls_and_cycles_reach_the_machine_as_moves() {
    let text = "O1001 (PLATE)\nG21 G90 F600 S1000\no<row> sub\n#5=0\no1 while [#5 LT #1]\n\
                G98 G81 X[#5*10] Y#2 Z-2 R1\n#5=[#5+1]\no1 endwhile\no<row> endsub [#5]\n\
                G0 X0 Y0 Z5\no<row> call [3] [0]\no<row> call [2] [15]\nG80\n\
                G0 X[#<_value>*7] Y0\nM2\n";
    let (axes, said) = run(text, Firmware::Grbl);
    is_at(axes, [14.0, 0.0, 5.0]);
    assert_eq!(said.matches("G1Z-2").count(), 5, "{said}");
    // The driver itself asks for the offsets before the first line.
    let program = said.replace("$#\n", "");
    assert!(!program.contains("G81") && !program.contains('#') && !program.contains('O'), "{said}");
}

#[test]
fn g92_moves_the_zero_of_the_program_and_leaves_nothing_in_the_controller() {
    let text = "G21 G90\nG0 X10 Y5 Z2\nG92 X0 Y0\nG0 X3 Y4\nG92.1\nG52 X100\nG0 X-90 Y0\nM2\n";
    let (axes, said) = run(text, Firmware::Grbl);
    is_at(axes, [10.0, 0.0, 2.0]);
    assert!(said.contains("X13Y9") && !said.contains("G92") && !said.contains("G52"), "{said}");
}

#[test]
fn g10_changes_the_work_system_of_the_controller() {
    for firmware in [Firmware::Grbl, Firmware::GrblHal, Firmware::FluidNc] {
        let text = "G21 G90\nG0 X10 Y10 Z0\nG10 L20 P2 X1 Y2 Z3\nG55 G0 X0 Y0 Z3\n\
                    G10 L2 P2 X-5 Y-6 Z0\nG0 X1 Y1 Z1\nM2\n";
        let (axes, said) = run(text, firmware);
        is_at(axes, [-4.0, -5.0, 1.0]);
        assert!(said.contains("G10L20P2X1Y2Z3\n") && said.contains("G10L2P2X-5Y-6Z0\n"), "{said}");
    }
}

#[test]
fn inverse_time_and_feed_per_revolution_are_feeds_in_millimetres_a_minute() {
    let text = "G21 G90 G0 X0 Y0 Z0\nG93 G1 X10 F6\nG95 S1000 M3 G1 X20 F0.2\nM5\nM2\n";
    let (axes, said) = run(text, Firmware::Grbl);
    is_at(axes, [20.0, 0.0, 0.0]);
    assert!(said.contains("F60\n") && said.contains("F200"), "{said}");
}
