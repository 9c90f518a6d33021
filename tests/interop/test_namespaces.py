"""Two machines in one domain, and names that an integrator chooses."""

import pytest

from chosen import Machine
from programs import QUICK, MachineState, load, settle, until_state
from ros2 import LATCHED, ActionClient, Node


@pytest.fixture(scope='module')
def cell():
    """Two machines that live at the same time; the second calls some things its own way."""
    left = Machine()
    right = Machine(ros_args=['-r', 'machine_state:=state',
                              '-r', 'axis_driver:run_program:=/shop/run',
                              '-r', 'run_recorder:run_program/_action/status:='
                                    '/shop/run/_action/status',
                              '-r', 'program_loader:__node:=reader'])
    left.until_idle()
    yield left, right
    left.stop(), right.stop()


def test_a_command_to_one_machine_does_not_reach_the_other(cell):
    left, right = cell
    with left.node() as here, right.node() as there:
        received = [there.subscription('cnc_msgs/msg/Program', 'program', LATCHED),
                 there.subscription('cnc_msgs/msg/CompensatedPath', 'compensated_path', LATCHED)]
        settle(there, 'reader', 'compensation_planner')
        load(here, text=QUICK, name='left.ngc')
        runs = ActionClient(here, 'cnc_msgs/action/RunProgram', 'run_program')
        assert runs.send_goal().result().status == 4
        assert abs(until_state(here, MachineState.STATE_IDLE).work_position.x - 0.005) < 1e-6
        assert [topic.take() for topic in received] == [[], []]
        other = there.subscription(MachineState.ros_name, 'state', LATCHED).wait(
            lambda state: state.state == MachineState.STATE_IDLE)
        assert other.work_position.x == 0.0


def test_each_machine_runs_its_own_program_at_the_same_time(cell):
    left, right = cell
    with left.node() as here, right.node() as there:
        load(here, text=QUICK, name='left.ngc')
        load(there, text=QUICK, name='right.ngc')
        ours = ActionClient(here, 'cnc_msgs/action/RunProgram', 'run_program')
        theirs = ActionClient(there, 'cnc_msgs/action/RunProgram', '/shop/run')
        goals = [ours.send_goal(), theirs.send_goal()]
        assert all(goal.accepted for goal in goals)
        assert [goal.result().status for goal in goals] == [4, 4]


# Over Zenoh each of the two has a router of its own.
@pytest.mark.dds
def test_absolute_names_are_those_of_the_whole_domain(cell):
    left, right = cell
    with Node('dashboard', '/', left.domain_id) as dashboard:
        states = [dashboard.subscription(MachineState.ros_name, name, LATCHED)
                  for name in (f'{left.namespace}/machine_state', f'{right.namespace}/state')]
        # One /tf for both: each has frames of its own.
        assert [state.newest().header.frame_id for state in states] == [
            f'{machine.namespace[1:]}/machine' for machine in (left, right)]


def test_a_node_that_was_renamed_has_its_services_under_its_name(cell):
    _, right = cell
    with right.node() as node:
        client = node.client('rcl_interfaces/srv/ListParameters', 'reader/list_parameters')
        assert 'control' in client.call().result.names
