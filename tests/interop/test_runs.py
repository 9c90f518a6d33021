"""The action `run_program`, as an action client of another middleware sees it."""

import uuid

import pytest

from programs import QUICK, SLOW, MachineState, load, settle, until_state
from ros2 import LATCHED, ActionClient, Qos, action, message, until

GoalStatus = message('action_msgs/msg/GoalStatus')
Result = action('cnc_msgs/action/RunProgram').Result


@pytest.fixture
def runs(node):
    """A client of the action, and an idle machine."""
    until_state(node, MachineState.STATE_IDLE)
    return ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program')


def test_a_run_tells_how_far_it_is_and_how_it_ended(node, runs):
    loaded, _ = load(node, text=SLOW, name='slow.ngc')
    goal = runs.send_goal(program_id=loaded.program_id)
    assert goal.accepted

    on_its_way = goal.wait_for_feedback(lambda feedback: 0.2 < feedback.fraction < 0.8)
    assert on_its_way.state == MachineState.STATE_RUN
    end = len(SLOW.splitlines())
    assert 3 < on_its_way.line < end - 1
    assert on_its_way.time_left.sec > 0
    assert runs.statuses()[goal.number] == GoalStatus.STATUS_EXECUTING

    ended = goal.result()
    assert ended.status == GoalStatus.STATUS_SUCCEEDED
    assert ended.result.outcome == Result.OUTCOME_SUCCEEDED
    assert ended.result.error_code == 0
    assert ended.result.last_line == end - 1  # of M30 nothing is cut

    fractions = [feedback.fraction for feedback in goal.feedback()]
    assert fractions == sorted(fractions) and fractions[-1] == 1.0
    until('the status', lambda:
          runs.statuses().get(goal.number) == GoalStatus.STATUS_SUCCEEDED)


def test_the_loaded_program_runs_when_none_is_named(node, runs):
    load(node, text=QUICK, name='quick.ngc')
    assert runs.send_goal().result().status == GoalStatus.STATUS_SUCCEEDED
    state = until_state(node, MachineState.STATE_IDLE)
    assert abs(state.work_position.x - 0.005) < 1e-6


def test_a_goal_that_cannot_be_run_is_rejected_and_the_reason_is_published(node, runs):
    commands = node.subscription('cnc_msgs/msg/Command', 'command_log', Qos(depth=100))
    log = node.subscription('rcl_interfaces/msg/Log', '/rosout', Qos(depth=1000))
    settle(node, 'axis_driver')
    goal = runs.send_goal(program_id='0123456789abcdef')
    assert not goal.accepted
    # ROS has no field for a reason in the answer; it is published and logged.
    logged = commands.wait(lambda command: command.endpoint.endswith('run_program'))
    assert not logged.success
    assert logged.error_code == Result.UNKNOWN_PROGRAM
    assert '0123456789abcdef' in logged.message
    log.wait(lambda line: 'is rejected' in line.msg and logged.message in line.msg)
    assert goal.number not in runs.statuses()


def test_one_goal_at_a_time_whoever_sends_it(machine, node, runs):
    load(node, text=SLOW, name='slow.ngc')
    first = runs.send_goal()
    with machine.node('rival') as rival:
        others = ActionClient(rival, 'cnc_msgs/action/RunProgram', 'run_program')
        assert not others.send_goal().accepted
        # The rival sees the goal that is being run, and how it ends.
        assert others.statuses()[first.number] == GoalStatus.STATUS_EXECUTING
        assert first.result().status == GoalStatus.STATUS_SUCCEEDED
        load(rival, text=QUICK, name='quick.ngc')
        assert others.send_goal().result().status == GoalStatus.STATUS_SUCCEEDED


def test_a_result_is_kept_for_whoever_asks_late_and_often(machine, node, runs):
    load(node, text=QUICK, name='quick.ngc')
    goal = runs.send_goal()
    ended = goal.result()
    assert goal.result() == ended
    with machine.node('latecomer') as late:
        others = ActionClient(late, 'cnc_msgs/action/RunProgram', 'run_program')
        assert others.result(goal.number) == ended


def test_a_goal_that_nobody_sent_has_an_unknown_result(runs):
    assert runs.result(uuid.uuid4().bytes).status == GoalStatus.STATUS_UNKNOWN


def test_a_goal_that_is_sent_twice_is_run_once(node, runs):
    load(node, text=QUICK, name='quick.ngc')
    same = uuid.uuid4()
    first = runs.send_goal(same)
    again = runs.send_goal(same)
    assert first.accepted and again.accepted
    assert again.stamp == first.stamp
    assert first.result().status == GoalStatus.STATUS_SUCCEEDED
    assert runs.send_goal(same).stamp == first.stamp
    assert until_state(node, MachineState.STATE_IDLE)


def test_a_check_moves_nothing(node, runs):
    load(node, text=SLOW, name='slow.ngc')
    before = until_state(node, MachineState.STATE_IDLE).machine_position
    goal = runs.send_goal(check_only=True)
    assert goal.result().status == GoalStatus.STATUS_SUCCEEDED
    assert until_state(node, MachineState.STATE_IDLE).machine_position == before


def test_a_run_is_recorded_and_the_bag_is_announced(machine, node, runs):
    recordings = node.subscription('cnc_msgs/msg/Recording', 'recording', LATCHED)
    load(node, text=QUICK, name='quick.ngc')
    goal = runs.send_goal()
    assert goal.result().status == GoalStatus.STATUS_SUCCEEDED
    done = recordings.wait(lambda it: not it.is_recording and it.run_id
                           and goal.number.hex()[:8] in it.run_id)
    assert done.complete and done.message_count > 0
    until('the bag', lambda: (machine.folder / done.uri / 'metadata.yaml').exists())

