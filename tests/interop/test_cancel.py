"""Canceling by the rules of `action_msgs/CancelGoal`."""

import uuid

import pytest

from programs import SLOW, MachineState, load, until_state
from ros2 import ActionClient, action, message, service, until

GoalStatus = message('action_msgs/msg/GoalStatus')
Codes = service('action_msgs/srv/CancelGoal').Response
Result = action('cnc_msgs/action/RunProgram').Result
Time = message('builtin_interfaces/msg/Time')


@pytest.fixture
def runs(node):
    """A client of the action, an idle machine and a loaded program that takes its time."""
    until_state(node, MachineState.STATE_IDLE)
    load(node, text=SLOW, name='slow.ngc')
    return ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program')


def running(runs):
    goal = runs.send_goal()
    assert goal.accepted
    goal.wait_for_feedback(lambda feedback: feedback.state == MachineState.STATE_RUN)
    return goal


def canceled(goal):
    """Whether the goal ends as canceled; the machine is at rest then."""
    ended = goal.result()
    assert ended.result.outcome == Result.OUTCOME_CANCELED
    assert ended.result.error_code == Result.CANCELED
    return ended.status == GoalStatus.STATUS_CANCELED


def ids(answer):
    return [bytes(goal.goal_id.uuid) for goal in answer.goals_canceling]


def test_one_goal_is_canceled_by_its_id(node, runs):
    goal = running(runs)
    answer = goal.cancel()
    assert answer.return_code == Codes.ERROR_NONE
    assert ids(answer) == [goal.number]
    assert canceled(goal)
    until_state(node, MachineState.STATE_IDLE)


def test_all_goals_are_canceled_without_an_id_and_a_time(runs):
    goal = running(runs)
    answer = runs.cancel()
    assert answer.return_code == Codes.ERROR_NONE
    assert ids(answer) == [goal.number]
    assert canceled(goal)


def test_goals_are_canceled_up_to_a_time(runs):
    goal = running(runs)
    before = Time(sec=goal.stamp.sec - 1, nanosec=goal.stamp.nanosec)
    assert ids(runs.cancel(stamp=before)) == []
    assert ids(runs.cancel(stamp=goal.stamp)) == [goal.number]
    assert canceled(goal)


def test_anybody_may_cancel(machine, runs):
    goal = running(runs)
    with machine.node('supervisor') as other:
        others = ActionClient(other, 'cnc_msgs/action/RunProgram', 'run_program')
        assert others.cancel(goal.number).return_code == Codes.ERROR_NONE
    assert canceled(goal)


def test_a_goal_that_nobody_knows_cannot_be_canceled(runs):
    goal = running(runs)
    answer = runs.cancel(uuid.uuid4().bytes)
    assert answer.return_code == Codes.ERROR_UNKNOWN_GOAL_ID
    assert ids(answer) == []
    assert runs.statuses()[goal.number] == GoalStatus.STATUS_EXECUTING
    goal.cancel()
    assert canceled(goal)


def test_a_goal_that_has_ended_cannot_be_canceled(runs):
    goal = running(runs)
    goal.cancel()
    assert canceled(goal)
    answer = goal.cancel()
    assert answer.return_code == Codes.ERROR_GOAL_TERMINATED
    assert ids(answer) == []


def test_the_status_goes_through_canceling_to_canceled(runs):
    goal = running(runs)
    goal.cancel()
    until('the end', lambda: runs.statuses().get(goal.number) == GoalStatus.STATUS_CANCELED)
    assert canceled(goal)


def test_canceling_nothing_is_no_error(runs):
    answer = runs.cancel()
    assert answer.return_code == Codes.ERROR_NONE
    assert ids(answer) == []
