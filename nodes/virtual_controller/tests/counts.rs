//! Every byte, line and block is accounted for.

mod common;
use common::{Bench, settings, settings_of};
use virtual_controller::{Build, Controller, Counts, Firmware};

/// Bytes to send, and when in seconds.
type Script<'a> = &'a [(f64, &'a [u8])];

/// Sends lines at their times in seconds and lets everything end; returns the counts.
fn run(build: Build, script: Script<'_>) -> Counts {
    let mut bench = Bench::with(build);
    for (at, bytes) in script {
        bench.wait(at - bench.now.as_secs_f64());
        bench.send(bytes);
    }
    bench.settle();
    bench.wait(100.0);
    bench.controller.counts()
}

fn grbl() -> Build {
    Build::new(settings(&[]))
}

#[test]
fn lines_answers_and_blocks_add_up() {
    let program = b"G21\nG41\n\n(comment)\nG1X10F600\nG1X10\nG2X10Y0I5\n?G1X20\nG4P0\n";
    let counts = run(grbl(), &[(0.0, program)]);
    assert_eq!(counts.bytes_received, program.len() as u64);
    assert_eq!((counts.lines_read, counts.oks, counts.errors), (9, 8, 1));
    assert_eq!(counts.blocks_planned, counts.blocks_executed);
    // 10 mm, no distance, a full circle of many chords, 10 mm.
    assert_eq!(counts.motions_finished, 4);
    assert!(counts.blocks_executed > 50, "{counts:?}");
    assert_eq!((counts.blocks_discarded, counts.underruns, counts.bytes_lost), (0, 0, 0));
    assert_eq!((counts.alarms, counts.reports), (0, 1));
}

#[test]
fn what_is_thrown_away_is_counted_and_so_is_what_is_lost() {
    // 15 blocks, one in work, 128 bytes after it; the rest is lost.
    let program: Vec<u8> =
        (0..60).flat_map(|x| format!("G1X{:03}F60\n", x + 1).into_bytes()).collect();
    let counts = run(grbl(), &[(0.0, &program), (0.5, b"\x18")]);
    assert_eq!(counts.bytes_received, 601);
    assert_eq!(counts.bytes_lost, 600 - 160 - 128);
    assert_eq!(counts.receive_buffer_bytes_max, 128);
    // The line in work is answered by the reset.
    assert_eq!((counts.lines_read, counts.oks, counts.errors), (16, 16, 0));
    assert_eq!((counts.blocks_planned, counts.blocks_executed), (15, 0));
    assert_eq!((counts.blocks_discarded, counts.motions_finished, counts.alarms), (15, 0, 1));
}

#[test]
fn a_probe_that_touches_is_a_motion_and_its_block_is_cut_short() {
    let mut build = grbl();
    build.start_in_machine = Some([0.0; 3]);
    build.probe_surface_z_mm = Some(-2.0);
    let counts = run(build, &[(0.0, b"G38.2Z-10F100\n")]);
    assert_eq!((counts.motions_finished, counts.blocks_discarded), (1, 1));
    let counts = run(grbl(), &[(0.0, b"G38.3Z-1F100\n")]);
    assert_eq!((counts.motions_finished, counts.blocks_discarded), (1, 0));
}

#[test]
fn a_stop_that_the_path_did_not_ask_for_is_an_underrun() {
    let cases: &[(&str, Script<'_>, u64)] = &[
        ("all at once", &[(0.0, b"G1X1F600\nG1X2\nG1X3\n")], 0),
        // A millimetre takes 0.2 s.
        ("late", &[(0.0, b"G1X1F600\n"), (0.5, b"G1X2\n"), (1.0, b"G1X3\n")], 2),
        ("in time", &[(0.0, b"G1X1F600\n"), (0.1, b"G1X2\n")], 0),
        ("a second later", &[(0.0, b"G1X1F600\n"), (1.21, b"G1X2\n")], 0),
        ("just before", &[(0.0, b"G1X1F600\n"), (1.19, b"G1X2\n")], 1),
        ("straight back", &[(0.0, b"G1X1F600\n"), (0.5, b"G1X0\n")], 0),
        ("a dwell between", &[(0.0, b"G1X1F600\nG4P0.3\n"), (0.6, b"G1X2\n")], 0),
        ("a dwell that comes late", &[(0.0, b"G1X1F600\n"), (0.4, b"G4P0.1\nG1X2\n")], 0),
        ("a line of length zero between", &[(0.0, b"G1X1F600\n"), (0.4, b"G1X1\nG1X2\n")], 1),
        ("a hold between", &[(0.0, b"G1X1F600\n"), (0.3, b"!"), (0.4, b"~G1X2\n")], 0),
        ("jogs", &[(0.0, b"$J=X1F600\n"), (0.5, b"$J=X2F600\n")], 0),
    ];
    for (name, script, expected) in cases {
        assert_eq!(run(grbl(), script).underruns, *expected, "{name}");
    }
}

#[test]
fn counts_outlive_a_power_cycle_and_are_json() {
    for firmware in Firmware::ALL {
        let mut bench = Bench::with(Build::new(settings_of(firmware, &[])));
        bench.settle();
        bench.send_line("G0X1");
        bench.wait(5.0);
        bench.controller.power_cycle();
        bench.settle();
        let counts = bench.controller.counts();
        assert_eq!((counts.lines_read, counts.motions_finished), (1, 1), "{firmware}");
    }
    let mut controller = Controller::with_build(grbl());
    controller.receive(std::time::Duration::from_millis(1500), b"\nG41\n");
    let json: serde_json::Value = serde_json::from_str(&controller.counts().to_json()).unwrap();
    assert_eq!(json["bytes_received"], 5);
    assert_eq!((json["oks"].clone(), json["errors"].clone()), (1.into(), 1.into()));
    assert_eq!(json["machine_seconds"], 1.5);
    assert_eq!(json.as_object().unwrap().len(), 14);
}
