//! What the driver does while no node is reachable over ROS, in virtual time.

use axis_driver::driver::{Command, DriverConfig, OnRosLoss, RunOutcome};
use cnc_msgs::machine::Mode;
use kerf_tests::line::{Line, straight};
use virtual_controller::{Build, Settings};

fn running(on_ros_loss: OnRosLoss) -> Line {
    let config =
        DriverConfig { on_ros_loss, ros_loss_timeout_ms: 2_000, ..DriverConfig::default() };
    let mut line = Line::new(config, Build::new(Settings::small_router()), &[]);
    line.until("idle", |line| line.mode() == Mode::Idle);
    line.start(straight(115, 5.0), 0);
    line.wait(2.0);
    assert_eq!(line.mode(), Mode::Run);
    line
}

fn set_face(line: &mut Line, is_there: bool) {
    line.ask(Command::RosFace { is_there }).unwrap();
}

#[test]
fn without_ros_a_run_continues_or_holds_after_a_time_as_configured() {
    for (policy, gives_signs, expected) in [
        (OnRosLoss::AsCommander, false, Mode::Run),
        (OnRosLoss::AsCommander, true, Mode::Hold),
        (OnRosLoss::Finish, false, Mode::Run),
        (OnRosLoss::Finish, true, Mode::Run),
        (OnRosLoss::Hold, false, Mode::Hold),
        (OnRosLoss::Hold, true, Mode::Hold),
    ] {
        let mut line = running(policy);
        if gives_signs {
            line.ask(Command::Heartbeat).unwrap();
        }
        set_face(&mut line, false);
        line.wait(4.0);
        assert_eq!(line.mode(), expected, "{policy:?}, {gives_signs}: {}", line.state().reason);
        set_face(&mut line, true);
        line.wait(0.5);
        assert_eq!(line.mode(), expected, "{policy:?}: nothing resumes by itself");
        if expected == Mode::Hold {
            line.ask(Command::Resume).unwrap();
        }
        while gives_signs && line.finished.is_none() {
            line.ask(Command::Heartbeat).unwrap();
            line.wait(0.5);
        }
        assert_eq!(line.result().outcome, RunOutcome::Succeeded, "{policy:?}");
    }
}

#[test]
fn a_face_that_is_back_in_time_holds_nothing_and_a_second_loss_counts_anew() {
    let mut line = running(OnRosLoss::Hold);
    for _ in 0..3 {
        set_face(&mut line, false);
        line.wait(1.5);
        set_face(&mut line, true);
        line.wait(0.2);
    }
    assert_eq!(line.mode(), Mode::Run, "{}", line.state().reason);
    set_face(&mut line, false);
    line.wait(3.0);
    assert!(line.state().reason.starts_with("ROS_LOST"), "{:?}", line.state());
}

#[test]
fn a_commander_that_was_not_reachable_has_its_time_once_it_is() {
    let mut line = running(OnRosLoss::Finish);
    line.ask(Command::Heartbeat).unwrap();
    set_face(&mut line, false);
    line.wait(5.0);
    set_face(&mut line, true);
    line.wait(0.8);
    assert_eq!(line.mode(), Mode::Run, "it has a second: {}", line.state().reason);
    line.wait(2.0);
    assert!(line.state().reason.starts_with("COMMANDER_LOST"), "{:?}", line.state());
}
