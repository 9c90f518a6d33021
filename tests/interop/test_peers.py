"""Peers that do not keep to the rules, or go without a word."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from programs import SLOW, MachineState, load, states, until_state
from ros2 import DEFAULT, LATCHED, ActionClient, Node, Qos, interfaces, message, until
from ros2.node import Context, NoAnswer

# Sends a goal, says its id and waits for ever.
CLIENT = '''
import sys, time
from ros2 import ActionClient
if len(sys.argv) > 3:
    from ros2_zenoh import Node
else:
    from ros2 import Node
node = Node('commander', sys.argv[1], *map(int, sys.argv[2:]))
states = node.subscription('cnc_msgs/msg/MachineState', 'machine_state')
goal = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program').send_goal()
print(goal.number.hex(), flush=True)
time.sleep(1000)
'''

# On a host with a cable: a node on Cyclone DDS with the range SUBNET, the default of ROS 2, and a machine that keeps to
# its host.
STOCK = '''
from machine import Machine
from programs import SLOW, MachineState, load, until_state
from ros2 import ActionClient, ParameterClient
from ros2.node import Context
Context.range = 'SUBNET'
machine = Machine().until_idle()
try:
    with machine.node() as node:
        until_state(node, MachineState.STATE_IDLE)
        assert ParameterClient(node, 'axis_driver').get('poll_interval_ms') == [500]
        load(node, text=SLOW, name='slow.ngc')
        goal = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program').send_goal()
        until_state(node, MachineState.STATE_RUN)
        goal.cancel()
        assert goal.result().status == 5
finally:
    machine.stop()
'''
HOST = '''
ip link set lo up
ip link add cable type veth peer name end
ip addr add 10.78.0.1/24 dev cable
ip link set cable up
ip link set end up
exec "$@"
'''


@pytest.fixture
def commander(machine):
    """A client of its own process, with a goal that is being run."""
    # Over Zenoh, the port of its router.
    where = [machine.domain_id, *([machine.port] if hasattr(machine, 'port') else [])]
    child = subprocess.Popen(
        [sys.executable, '-B', '-c', CLIENT, machine.namespace, *map(str, where)],
        cwd=Path(__file__).parent, stdout=subprocess.PIPE, text=True)
    child.goal = bytes.fromhex(child.stdout.readline().strip())
    yield child
    child.kill()
    child.wait()


@pytest.fixture
def loaded(node):
    until_state(node, MachineState.STATE_IDLE)
    return load(node, text=SLOW, name='slow.ngc')


def load_and_run(node):
    load(node, text=SLOW, name='slow.ngc')
    goal = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program').send_goal()
    until_state(node, MachineState.STATE_RUN)
    return goal


def test_a_client_that_is_killed_leaves_its_goal_and_its_result(node, loaded, commander):
    until_state(node, MachineState.STATE_RUN)
    commander.kill()
    # Without a heartbeat a job is on its own: it is cut to its end.
    runs = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program')
    ended = runs.result(commander.goal)
    assert ended.status == 4, ended.result.message
    # And the next client gets its turn.
    goal = runs.send_goal()
    assert goal.accepted
    goal.cancel()
    goal.result()


def test_a_client_that_is_stopped_slows_nobody(node, loaded, commander):
    until_state(node, MachineState.STATE_RUN)
    os.kill(commander.pid, signal.SIGSTOP)
    seen = states(node)
    ages = [state.link_age for state in seen.collect(20)]
    # A client that holds the driver up does so all the time.
    assert max(ages) < 10
    runs = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program')
    assert runs.result(commander.goal).status == 4
    os.kill(commander.pid, signal.SIGCONT)


@pytest.mark.dds
@pytest.mark.parametrize('topic, type_name, other, value, qos', [
    ('feed_hold', 'std_msgs/msg/Bool', 'std_msgs/msg/String', {'data': 'hold!'}, DEFAULT),
    ('commander_heartbeat', 'std_msgs/msg/Header', 'std_msgs/msg/Float64', {}, DEFAULT),
    ('programmed_contour', 'cnc_msgs/msg/ProgrammedContour', 'std_msgs/msg/String', {}, LATCHED),
    ('recording', 'cnc_msgs/msg/Recording', 'geometry_msgs/msg/Pose', {}, LATCHED),
])
def test_another_version_of_a_type_is_passed_over_and_told_once(
        machine, node, topic, type_name, other, value, qos):
    until_state(node, MachineState.STATE_IDLE)
    with machine.node('stranger') as stranger:
        kind = interfaces.impostor(type_name, other)
        publisher = stranger.publisher(kind, topic, qos).wait_for_subscribers()
        for _ in range(20):
            publisher.publish(kind(**value))
        gid = publisher.gid().hex()
        name = '.'.join(gid[start:start + 8] for start in (0, 8, 16)) + '|' + gid[24:]
        until('a word in the log', lambda: name in machine.log())
        assert machine.log().count(name) == 1
    assert until_state(node, MachineState.STATE_IDLE)
    assert 'panicked' not in machine.log()


@pytest.mark.dds
def test_an_endpoint_whose_type_has_another_hash_is_not_connected(machine, node):
    until_state(node, MachineState.STATE_IDLE)
    other = 'RIHS01_' + 64 * '0'
    with machine.node('stranger') as stranger:
        kind = message('std_msgs/msg/Bool')
        # Cyclone itself does not compare hashes.
        publisher = stranger.publisher(kind, 'feed_hold', Qos(type_hash=other))
        publisher.wait_for_subscribers()
        until('a word in the log', lambda: other in machine.log())
        assert 'build both with the same definitions' in machine.log()
        goal = load_and_run(node)
        for _ in range(20):
            publisher.publish(kind(data=True))
        assert MachineState.STATE_HOLD not in [state.state for state in states(node).collect(20)]
        goal.cancel()
        goal.result()


@pytest.mark.dds
def test_a_client_whose_service_has_another_hash_commands_nothing(machine, node):
    until_state(node, MachineState.STATE_IDLE)
    other = 'RIHS01_' + 64 * '1'
    with machine.node('stranger') as stranger:
        client = stranger.client('std_srvs/srv/Trigger', 'feed_hold', other)
        goal = load_and_run(node)
        until('a word in the log', lambda: other in machine.log())
        number = client.send()
        with pytest.raises(NoAnswer):
            client.wait(number, timeout=1)
        assert MachineState.STATE_HOLD not in [state.state for state in states(node).collect(10)]
        # The right one is answered.
        assert node.client('std_srvs/srv/Trigger', 'feed_hold').call().success
        goal.cancel()
        goal.result()


def test_a_publisher_of_another_type_does_not_disturb_the_right_one(machine, node):
    until_state(node, MachineState.STATE_IDLE)
    with machine.node('stranger') as stranger:
        wrong = stranger.publisher('std_msgs/msg/Float64', 'feed_hold')
        right = node.publisher('std_msgs/msg/Bool', 'feed_hold').wait_for_subscribers()
        for _ in range(20):
            wrong.publish(message('std_msgs/msg/Float64')(data=1.0))
        assert until_state(node, MachineState.STATE_IDLE)
        goal = load_and_run(node)
        right.publish(message('std_msgs/msg/Bool')(data=True))
        until_state(node, MachineState.STATE_HOLD)
        goal.cancel()
        goal.result()


def test_a_subscriber_of_another_type_gets_nothing_and_hurts_nobody(machine, node):
    with machine.node('stranger') as stranger:
        wrong = stranger.subscription('std_msgs/msg/String', 'machine_state', LATCHED)
        right = node.subscription('cnc_msgs/msg/MachineState', 'machine_state', LATCHED)
        right.collect(5)
        assert wrong.take() == []


def test_numbers_that_are_none_are_refused_by_name(node):
    nan = float('nan')
    answer = node.client('cnc_msgs/srv/SetOverrides', 'set_overrides').call(which=1, feed=nan)
    assert not answer.success and 'feed' in answer.message
    point = message('geometry_msgs/msg/Point')(x=nan)
    answer = node.client('cnc_msgs/srv/SetWorkOffset', 'set_work_offset').call(
        system=1, axes=1, position=point)
    assert not answer.success and answer.message
    jog = ActionClient(node, 'cnc_msgs/action/Jog', 'jog')
    goal = jog.send_goal(frame=1, axes=1, target=point, feed_rate=0.01)
    assert not goal.accepted or goal.result().status != 4


def test_a_client_that_has_just_come_gets_its_first_answer(machine):
    # It asks as soon as it has found the service, before the service may have found it.
    for number in range(10):
        with machine.node(f'newcomer_{number}') as newcomer:
            client = newcomer.client('cnc_msgs/srv/GetTools', 'get_tools')
            assert client.call(timeout=20).success


@pytest.mark.dds
def test_a_node_without_settings_commands_a_machine_that_keeps_to_its_host():
    ran = subprocess.run(
        ['unshare', '--net', 'sh', '-e', '-c', HOST, 'sh', sys.executable, '-B', '-c', STOCK],
        cwd=Path(__file__).parent, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout + ran.stderr


@pytest.mark.dds
def test_a_second_context_of_a_process_is_served(machine, node):
    until_state(node, MachineState.STATE_IDLE)
    second = Context(machine.domain_id)
    with Node('second', machine.namespace, machine.domain_id, second) as other:
        until_state(other, MachineState.STATE_IDLE)
        load(other, text=SLOW, name='slow.ngc')
    until_state(node, MachineState.STATE_IDLE)
