"""Managed nodes, as `ros2 lifecycle` and a manager of nodes use them."""

import pytest

from contract import NODES
from programs import QUICK, SLOW, MachineState, load, settle, until_state
from ros2 import ActionClient, ParameterClient, Qos, service, until
from ros2.lifecycle import LifecycleClient, Transition

LoadProgram = service('cnc_msgs/srv/LoadProgram')


@pytest.fixture
def loader(node):
    """The loader, active before and after."""
    client = LifecycleClient(node, 'program_loader')
    until('the loader', lambda: client.state() == 'active')
    yield client
    if client.state() == 'unconfigured':
        client.change(Transition.TRANSITION_CONFIGURE)
    client.change(Transition.TRANSITION_ACTIVATE)


@pytest.fixture
def driver(node):
    client = LifecycleClient(node, 'axis_driver')
    until('the driver', lambda: client.state() == 'active')
    yield client
    client.change(Transition.TRANSITION_ACTIVATE)


@pytest.mark.parametrize('name', NODES)
def test_every_node_makes_itself_active(node, name):
    client = LifecycleClient(node, name)
    until('the state', lambda: client.state() == 'active')
    assert ParameterClient(node, name).get('autostart') == [True]
    assert {'unconfigured', 'inactive', 'active', 'finalized'} <= set(client.states())
    assert client.transitions().keys() == {'deactivate', 'shutdown'}
    assert ('inactive', 'activate', 'activating') in client.graph()


def test_a_node_that_is_not_active_refuses_and_says_so(node, loader):
    load_program = node.client(LoadProgram.name, 'load_program')
    assert loader.change(Transition.TRANSITION_DEACTIVATE)
    assert loader.state() == 'inactive'
    answer = load_program.call(text=QUICK, name='quick.ngc')
    assert not answer.success
    assert answer.error_code == LoadProgram.Response.NOT_ACTIVE
    assert 'inactive' in answer.message
    assert loader.change(Transition.TRANSITION_ACTIVATE)
    assert load_program.call(text=QUICK, name='quick.ngc').success


def test_a_node_is_taken_down_and_set_up_again(loader):
    for transition, state in [
        (Transition.TRANSITION_DEACTIVATE, 'inactive'),
        (Transition.TRANSITION_CLEANUP, 'unconfigured'),
        (Transition.TRANSITION_CONFIGURE, 'inactive'),
        (Transition.TRANSITION_ACTIVATE, 'active'),
    ]:
        assert loader.change(transition)
        assert loader.state() == state


def test_a_transition_that_does_not_start_here_is_refused(loader):
    assert not loader.change(Transition.TRANSITION_CONFIGURE)
    assert not loader.change(77)
    assert loader.state() == 'active'


def test_changes_are_told_to_whoever_listens(node, loader):
    events = node.subscription('lifecycle_msgs/msg/TransitionEvent',
                               'program_loader/transition_event', Qos(depth=100))
    settle(node, 'program_loader')
    loader.change(Transition.TRANSITION_DEACTIVATE)
    events.wait(lambda event: event.goal_state.label == 'inactive')
    loader.change(Transition.TRANSITION_ACTIVATE)
    events.wait(lambda event: event.goal_state.label == 'active')


def test_a_driver_that_is_deactivated_in_a_run_holds_first(node, driver):
    until_state(node, MachineState.STATE_IDLE)
    load(node, text=SLOW, name='slow.ngc')
    runs = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program')
    goal = runs.send_goal()
    goal.wait_for_feedback(lambda feedback: feedback.state == MachineState.STATE_RUN)
    assert driver.change(Transition.TRANSITION_DEACTIVATE)
    # The goal has a result, and the machine is at rest.
    ended = goal.result()
    assert ended.status != 4, ended.result.message
    assert until_state(node, MachineState.STATE_IDLE, MachineState.STATE_HOLD).feed_rate == 0.0
    assert not runs.send_goal().accepted
    assert driver.change(Transition.TRANSITION_ACTIVATE)
    until_state(node, MachineState.STATE_IDLE)
    goal = runs.send_goal()
    assert goal.accepted
    goal.cancel()
    goal.result()


def test_the_level_of_a_logger_is_set_from_outside(machine, node):
    levels = node.client('rcl_interfaces/srv/SetLoggerLevels', 'program_loader/set_logger_levels')
    reads = node.client('rcl_interfaces/srv/GetLoggerLevels', 'program_loader/get_logger_levels')
    logger = f'{machine.namespace[1:]}.program_loader'
    kind = type(reads.call(names=[logger]).levels[0])
    for level in (10, 20):
        [result] = levels.call(levels=[kind(name=logger, level=level)]).results
        assert result.successful, result.reason
        assert reads.call(names=[logger]).levels[0].level == level


def test_a_type_is_described_to_who_has_not_built_it(node):
    from ros2.interfaces import type_hash
    describe = node.client('type_description_interfaces/srv/GetTypeDescription',
                           'axis_driver/get_type_description')
    name = 'cnc_msgs/msg/MachineState'
    answer = describe.call(type_name=name, type_hash=type_hash(name), include_type_sources=True)
    assert answer.successful, answer.failure_reason
    fields = {it.name for it in answer.type_description.type_description.fields}
    assert {'header', 'state', 'work_position'} <= fields
    text = {it.type_name: it.raw_file_contents for it in answer.type_sources}[name]
    assert 'uint8 STATE_IDLE=2' in text
