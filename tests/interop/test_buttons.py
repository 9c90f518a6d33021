"""Hold, resume, overrides and tool changes in the middle of a run."""

import pytest

from programs import QUICK, SLOW, MachineState, load, states, until_state
from ros2 import ActionClient, message

GoalStatus = message('action_msgs/msg/GoalStatus')
Bool = message('std_msgs/msg/Bool')


@pytest.fixture
def runs(node):
    until_state(node, MachineState.STATE_IDLE)
    return ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program')


@pytest.fixture
def press(node):
    """Presses a button: `std_srvs/Trigger` by its name."""
    return lambda name: node.client('std_srvs/srv/Trigger', name).call()


def running(node, runs, text=SLOW):
    load(node, text=text, name='part.ngc')
    goal = runs.send_goal()
    until_state(node, MachineState.STATE_RUN)
    return goal


def test_a_hold_by_service_stops_and_resume_goes_on(node, runs, press):
    goal = running(node, runs)
    assert press('feed_hold').success
    held = until_state(node, MachineState.STATE_HOLD)
    # Feedback says so as well, and nothing moves.
    goal.wait_for_feedback(lambda feedback: feedback.state == MachineState.STATE_HOLD)
    assert held.reason == 'FEED_HOLD'
    assert press('resume').success
    until_state(node, MachineState.STATE_RUN)
    assert goal.result().status == GoalStatus.STATUS_SUCCEEDED


def test_a_hold_by_topic_stops_and_no_topic_resumes(node, runs, press):
    hold = node.publisher('std_msgs/msg/Bool', 'feed_hold').wait_for_subscribers()
    goal = running(node, runs)
    hold.publish(Bool(data=True))
    until_state(node, MachineState.STATE_HOLD)
    hold.publish(Bool(data=False))
    for _ in range(5):
        until_state(node, MachineState.STATE_HOLD)
    press('resume')
    until_state(node, MachineState.STATE_RUN)
    # Only the edge counts: the next `true` holds again.
    hold.publish(Bool(data=True))
    until_state(node, MachineState.STATE_HOLD)
    press('resume')
    assert goal.result().status == GoalStatus.STATUS_SUCCEEDED


def test_a_run_that_is_held_can_be_canceled(node, runs, press):
    goal = running(node, runs)
    press('feed_hold')
    until_state(node, MachineState.STATE_HOLD)
    goal.cancel()
    assert goal.result().status == GoalStatus.STATUS_CANCELED


def test_a_button_that_makes_no_sense_says_why(node, runs, press):
    answer = press('confirm_tool_change')
    assert not answer.success
    assert answer.message


def test_a_tool_change_waits_for_whoever_has_the_tool(node, runs, press):
    tool = node.client('cnc_msgs/srv/SetTool', 'set_tool')
    answer = tool.call(tool_number=2, mask=1, diameter=0.010)
    assert answer.success, answer.message
    load(node, text='G21 G90 G94\nG0 X5\nT2 M6\nG1 X45 F6000\nM30\n', name='change.ngc')
    goal = runs.send_goal()
    waiting = until_state(node, MachineState.STATE_TOOL_CHANGE)
    assert waiting.tool_wanted == 2
    answer = press('confirm_tool_change')
    assert answer.success, answer.message
    assert goal.result().status == GoalStatus.STATUS_SUCCEEDED


def test_an_override_is_in_force_at_once(node, runs):
    override = node.client('cnc_msgs/srv/SetOverrides', 'set_overrides')
    goal = running(node, runs)
    assert override.call(which=1, feed=1.5).success
    states(node).wait(lambda state: abs(state.feed_override - 1.5) < 1e-9)
    assert goal.result().status == GoalStatus.STATUS_SUCCEEDED
    answer = override.call(which=1, feed=7.0)
    assert not answer.success and 'feed' in answer.message
    assert override.call(which=1, feed=1.0).success


def test_single_block_stops_behind_every_block(node, runs, press):
    single = node.client('std_srvs/srv/SetBool', 'single_block')
    load(node, text=QUICK, name='quick.ngc')
    assert single.call(data=True).success
    goal = runs.send_goal()
    until_state(node, MachineState.STATE_HOLD)
    assert single.call(data=False).success
    assert press('resume').success
    assert goal.result().status == GoalStatus.STATUS_SUCCEEDED


def test_one_block_by_hand_runs_from_standstill_to_standstill(node, runs):
    answer = node.client('cnc_msgs/srv/ExecuteMdi', 'execute_mdi').call(text='G0 X20')
    assert answer.success, answer.message
    assert abs(until_state(node, MachineState.STATE_IDLE).work_position.x - 0.020) < 1e-6


def test_a_jog_goes_where_it_is_told(node, runs):
    jog = ActionClient(node, 'cnc_msgs/action/Jog', 'jog')
    before = until_state(node, MachineState.STATE_IDLE).machine_position
    target = message('geometry_msgs/msg/Point')(y=0.010)
    ended = jog.send_goal(frame=1, axes=2, target=target, feed_rate=0.05).result()
    assert ended.status == GoalStatus.STATUS_SUCCEEDED, ended.result.message
    assert abs(ended.result.machine_position.y - before.y - 0.010) < 1e-6
