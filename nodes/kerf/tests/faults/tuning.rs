//! Parameters of the driver that change while it runs.

use super::cell::{Cell, Plan};
use super::machine::{kill_at_once, until};
use super::support::TIMEOUT;
use cnc_msgs::wire::rcl_interfaces::msg::{Parameter, ParameterType, ParameterValue};
use cnc_msgs::wire::rcl_interfaces::srv::{SetParameters, SetParametersRequest};
use cnc_msgs::wire::std_msgs::msg::Header;
use runtime::{Client, Qos};

/// Sets the time that a commander is given; an error has the reason.
fn set(cell: &Cell, client: &Client<SetParameters>, timeout_ms: i64) -> Result<(), String> {
    let value = ParameterValue {
        type_: ParameterType::PARAMETER_INTEGER,
        integer_value: timeout_ms,
        ..ParameterValue::default()
    };
    let name = "commander_timeout_ms".to_owned();
    let request = SetParametersRequest { parameters: vec![Parameter { name, value }] };
    let answer = cell.commander.wait(client.call_within(request, TIMEOUT)).expect("an answer");
    let result = answer.results.into_iter().next().expect("a result for each");
    if result.successful { Ok(()) } else { Err(result.reason) }
}

#[test]
fn what_was_set_between_runs_counts_for_the_next_also_after_the_ros_side_was_restarted() {
    let cell = Cell::new(&Plan::default());
    let node = cell.commander.node();
    let (client, beat) = cell.commander.wait(async {
        let client = node.client::<SetParameters>("axis_driver/set_parameters");
        (client.expect("a client"), node.publisher::<Header>("commander_heartbeat", Qos::DEFAULT))
    });
    let beat = beat.expect("a publisher");
    set(&cell, &client, 300).expect("nothing is under way");
    let face = cell.machine.face().expect("a face");
    kill_at_once(face);
    until("another face", || cell.machine.face().filter(|next| *next != face));
    cell.until_ready();
    let _run = cell.run_into_the_midst();
    let refusal = set(&cell, &client, 5_000).expect_err("a run is under way");
    assert!(refusal.contains("at work"), "{refusal}");
    until("a heartbeat to be missed", || {
        beat.publish(Header::default());
        std::thread::sleep(std::time::Duration::from_millis(500));
        Some(cell.commander.state().reason).filter(|reason| reason.starts_with("COMMANDER_LOST"))
    });
    let held = cell.commander.until_mode("HOLD");
    assert!(held.reason.contains("300 ms"), "{held:?}");
}
