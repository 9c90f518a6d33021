//! Settings that are lost on the way, and kinematics whose travel is no box.

use super::*;

/// Connects over a line that loses the travel of Z.
fn losing(config: DriverConfig) -> Line {
    let mut settings = Settings::small_router();
    settings.set_line("$22=1").unwrap();
    settings.set_line("$20=1").unwrap();
    let mut line = Line::new(config, Build::new(settings), &["mute:$132=@time=0"]);
    line.until("locked or idle", |line| matches!(line.mode(), Mode::Alarm | Mode::Idle));
    line.ask(Command::Home).unwrap();
    set_zero(&mut line, [-500.0, -300.0, -60.0]);
    line
}

fn fits() -> RunRequest {
    request(path(&[[10.0, 0.0, 5.0], [20.0, 0.0, 5.0]]))
}

#[test]
fn settings_that_were_lost_are_asked_for_again_before_a_run() {
    let mut line = losing(refusing());
    let then = line.now;
    line.ask(Command::RunProgram(fits())).expect("it fits");
    let asked = line.said_since(then).matches("$$").count();
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    assert_eq!(asked, 1, "{:?}", line.log);
    // And what does not fit is refused as ever.
    let refusal = refused(&mut line, request(path(&OUT)));
    assert!(refusal.message.contains("beyond the travel"), "{refusal}");
}

#[test]
fn a_travel_that_stays_unreadable_refuses_programs_and_says_what_lets_them_run() {
    let unreadable = |config: DriverConfig| {
        let mut line = losing(config);
        line.inject("mute:$132=");
        line
    };
    let mut line = unreadable(refusing());
    let then = line.now;
    let refusal = line.ask(Command::RunProgram(fits())).expect_err("it is refused");
    assert_eq!(refusal.error_code, error_code::TRAVEL);
    let said = "the travel cannot be checked: $132 (Z-axis travel, mm) is missing: these are not \
                all settings of a grbl controller; correct it in the controller, or set check_travel \
                to warn to run without";
    assert_eq!(refusal.message.replace("Z-axis maximum travel", "Z-axis travel"), said);
    assert_eq!(line.said_since(then), "$$\n$#\n");
    // It is asked each time: this time the answer comes.
    line.ask(Command::RunProgram(fits())).expect("it fits");
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    // Who only wants to be warned is, and the other axes are judged.
    let warn = DriverConfig { check_travel: CheckTravel::Warn, ..refusing() };
    let mut line = losing(warn);
    line.ask(Command::RunProgram(fits())).expect("it runs");
    let has = |line: &Line, text: &str| line.log.iter().any(|it| it.contains(text));
    assert!(has(&line, "the travel was not checked: $132"), "{:?}", line.log);
    assert_eq!(line.result().outcome, RunOutcome::Succeeded);
    let check = RunRequest { check_only: true, ..request(path(&OUT)) };
    line.ask(Command::RunProgram(check)).expect("it is a check");
    assert!(has(&line, "X12.500 in the machine frame"), "{:?}", line.log);
    // Who wants none is asked nothing.
    let off = DriverConfig { check_travel: CheckTravel::Off, ..refusing() };
    let mut line = losing(off);
    let then = line.now;
    line.ask(Command::RunProgram(fits())).expect("it runs");
    assert!(!line.said_since(then).contains("$$"));
}

#[test]
fn boxes_need_no_travel() {
    let it = KeepOutBox {
        frame: Frame::Work(1),
        min_mm: [100.0, -20.0, -20.0],
        max_mm: [120.0, 20.0, 15.0],
    };
    let keep_out = KeepOut { keep_out: [("clamp".to_owned(), it)].into() };
    let warn = || DriverConfig {
        keep_out: keep_out.clone(),
        check_travel: CheckTravel::Warn,
        ..DriverConfig::default()
    };
    let across = || request(path(&[[10.0, 0.0, 5.0], [200.0, 0.0, 5.0]]));
    let mut line = losing(warn());
    let refusal = line.ask(Command::RunProgram(across())).expect_err("it is in the way");
    assert_eq!(refusal.error_code, error_code::KEEP_OUT, "{refusal}");
    // Nor a Cartesian machine: what it reports and takes is Cartesian. Its travel is no box.
    for (firmware, said, name) in [
        (Firmware::FluidNc, "[MSG:INFO: Kinematic system:ParallelDelta]", "ParallelDelta"),
        (Firmware::FluidNc, "[MSG:INFO: Kinematic system: WallPlotter]", "WallPlotter"),
        (Firmware::GrblHal, "[KINEMATICS:Delta v0.05]", "Delta"),
    ] {
        let mut line =
            homed(firmware, DriverConfig { check_travel: CheckTravel::Refuse, ..warn() });
        line.inject(&format!("push:{said}"));
        line.wait(0.3);
        let refusal = line.ask(Command::RunProgram(across())).expect_err("it is in the way");
        assert_eq!(refusal.error_code, error_code::KEEP_OUT, "{name}: {refusal}");
        let far = RunRequest { check_only: true, ..request(path(&OUT[..1])) };
        line.ask(Command::RunProgram(far)).expect("no travel is compared");
        let no_box = format!("not checked: the travel: with {name} kinematics it is no box");
        assert!(line.log.contains(&no_box), "{name}: {:?}", line.log);
    }
    // An axis that moves straight has its travel.
    let mut line = homed(Firmware::GrblHal, refusing());
    line.inject("push:[KINEMATICS:CoreXY v2.02]");
    line.wait(0.3);
    assert_eq!(refused(&mut line, request(path(&OUT))).error_code, error_code::TRAVEL);
}
