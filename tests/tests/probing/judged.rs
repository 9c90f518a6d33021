//! Travel and keep-out boxes, from where a probe has ended.

use super::*;

/// Homed, with its work zero 20 mm below the top of the travel, which ends 80 mm below that.
pub(super) fn homed(config: DriverConfig) -> Line {
    let mut settings = Settings::small_router();
    settings.set_line("$22=1").expect("a setting");
    let build = Build { probe_surface_z_mm: Some(-80.0), ..Build::new(settings) };
    let mut line = Line::new(config, build, &[]);
    line.until("locked or idle", |line| matches!(line.mode(), Mode::Alarm | Mode::Idle));
    line.ask(Command::Home).expect("it homes");
    line.ask(zero([-300.0, -200.0, -20.0])).expect("the zero is set");
    line
}

fn zero(position: [f64; 3]) -> Command {
    let (axes, further) = (AxisSet::ALL, FurtherAxes::NONE);
    Command::SetWorkOffset(OffsetRequest { further, system: 1, axes, position, is_origin: true })
}

/// Two touches, and then so deep.
fn to_depth(depth: i32) -> CompensatedPath {
    let touch = "G38.2 Z-70 F120\nG10 L20 P1 Z0\nG0 Z5\n";
    path(&format!(
        "G21 G90 G94 G54\nG0 X0 Y0 Z2\n{touch}{}G1 Z-{depth} F600\nG0 Z5\nM2\n",
        touch.replace("-70", "-6")
    ))
}

#[test]
fn what_follows_a_probe_is_judged_where_it_has_touched() {
    for on_path_deviation in [OnPathDeviation::Hold, OnPathDeviation::Off] {
        let check_travel = CheckTravel::Refuse;
        let config = DriverConfig { check_travel, on_path_deviation, ..DriverConfig::default() };
        let mut line = homed(config);
        // The travel ends at -100. From where the probe may go to at most, 12 mm would be too much.
        let result = line.run(to_depth(12));
        assert_eq!(result.outcome, RunOutcome::Succeeded, "{on_path_deviation:?}: {result:?}");
        line.ask(zero([-300.0, -200.0, -20.0])).expect("the zero is set");
        let result = line.run(to_depth(25));
        let found = (result.outcome, result.error_code);
        assert_eq!(found, (RunOutcome::Aborted, error_code::TRAVEL), "{on_path_deviation:?}");
        assert!(result.message.starts_with("line 9"), "{on_path_deviation:?}: {result:?}");
        let at = line.axes();
        assert!((at[2] - -80.0).abs() < 0.1, "it stays where it touched: {at:?}");
    }
}

#[test]
fn a_way_back_from_where_a_probe_has_touched_stays_in_the_travel() {
    let config = DriverConfig { check_travel: CheckTravel::Refuse, ..DriverConfig::default() };
    let back = |mm: i32| {
        path(&format!("G21 G90\nG0 X0 Y0 Z0\nG38.2 Z-70 F600\nG91 G0 Z{mm}\nX5\nG90 G0 X0\nM2\n"))
    };
    // It touches 80 mm below the top.
    let result = homed(config.clone()).run(back(75));
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
    let mut line = homed(config);
    let result = line.run(back(85));
    assert_eq!(result.error_code, error_code::TRAVEL, "{result:?}");
    assert!(result.message.starts_with("line 4"), "{result:?}");
    assert!((line.axes()[2] - -80.0).abs() < 0.5, "{:?}", line.axes());
}

#[test]
fn a_box_stays_where_it_was_when_the_run_began_whatever_a_probe_sets() {
    let it = |min: f64, max: f64| {
        let frame = Frame::Work(1);
        let (min_mm, max_mm) = ([-10.0, -10.0, min], [10.0, 10.0, max]);
        let it = KeepOutBox { frame, min_mm, max_mm };
        let keep_out = KeepOut { keep_out: [("clamp".to_owned(), it)].into() };
        let check_travel = CheckTravel::Off;
        homed(DriverConfig { keep_out, check_travel, ..DriverConfig::default() })
    };
    // Zero is at the top, the part 60 mm below: a box from there to the end of the travel.
    let result = it(-80.0, -70.5).run(to_depth(8));
    assert_eq!(result.outcome, RunOutcome::Succeeded, "{result:?}");
    let result = it(-80.0, -70.5).run(to_depth(12));
    assert_eq!(result.error_code, error_code::KEEP_OUT, "{result:?}");
}
