"""The machine as rclpy sees it, with messages that colcon has built from `msgs/`."""

import math
import time

import pytest
from cnc_msgs.action import RunProgram
from cnc_msgs.msg import (
    CompensatedPath, CompensationReport, ControllerSettings, MachineState, NodeParameters,
    Program, ProgrammedContour, Recording, ToolTable,
)
from cnc_msgs.srv import LoadProgram
from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from nav_msgs.msg import Path
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
EVERY_STATE = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
NODES = ('program_loader', 'compensation_planner', 'axis_driver', 'run_recorder')

# Six times there and back, 100 mm at 20 mm/s: six seconds of a machine in a hurry.
SLOW = 'G21 G90 G94 G17\nG0 X10 Y10\nG1 X110 F1200\nX10\n' + 'X110\nX10\n' * 5 + 'M30\n'


def load(peer, text, name):
    """Loads a program and waits until it can be run."""
    answer = peer.call(LoadProgram, 'load_program', text=text, name=name)
    assert answer.success, answer.message
    paths = peer.listen(CompensatedPath, 'compensated_path', LATCHED)
    peer.until('the path', lambda: any(it.program_id == answer.program_id for it in paths))
    return answer


def test_every_node_is_in_the_graph_active_and_has_described_parameters(machine, peer):
    def names():
        found = peer.node.get_node_names_and_namespaces()
        return {name for name, namespace in found if namespace == machine.namespace}
    peer.until('all nodes', lambda: names().issuperset(NODES))
    for name in NODES:
        assert peer.call(GetState, f'{name}/get_state').current_state.id == \
            State.PRIMARY_STATE_ACTIVE
        listed = peer.call(ListParameters, f'{name}/list_parameters').result.names
        assert 'use_sim_time' in listed
        described = peer.call(DescribeParameters, f'{name}/describe_parameters', names=listed)
        assert all(it.description for it in described.descriptors), name
        values = peer.call(GetParameters, f'{name}/get_parameters', names=listed).values
        assert len(values) == len(listed)


def test_an_answer_of_a_megabyte_arrives(machine, peer):
    asked = ['baud'] * 20_000
    values = peer.call(GetParameters, 'axis_driver/get_parameters', names=asked).values
    assert [it.integer_value for it in values] == [115_200] * len(asked)


def test_the_first_call_of_a_client_takes_no_second(machine, peer):
    """It may reach the node before its client is discovered, and is fetched then."""
    for _ in range(20):
        client = peer.node.create_client(GetParameters, 'axis_driver/get_parameters')
        peer.until('the service', client.service_is_ready)
        begin = time.monotonic()
        peer.result('an answer', client.call_async(GetParameters.Request(names=['baud'])))
        # Fast DDS sends what was lost by itself after three seconds; it is asked again after 0.2 s.
        assert time.monotonic() - begin < 1.5
        peer.node.destroy_client(client)


@pytest.mark.parametrize('kind, topic', [
    (Program, 'program'),
    (ProgrammedContour, 'programmed_contour'),
    (CompensatedPath, 'compensated_path'),
    (CompensationReport, 'compensation_report'),
    (ToolTable, 'tool_table'),
    (MachineState, 'machine_state'),
    (ControllerSettings, 'controller_settings'),
    (Recording, 'recording'),
    (NodeParameters, 'node_parameters'),
    (Path, 'compensated_path/preview'),
    (MarkerArray, 'markers'),
])
def test_who_comes_late_gets_all_that_is_latched(peer, kind, topic):
    load(peer, SLOW, 'slow.ngc')
    heard = peer.listen(kind, topic, LATCHED)
    peer.until(topic, lambda: heard)


def test_who_comes_late_gets_the_newest_alone(peer):
    for number in range(4):
        newest = load(peer, SLOW, f'part_{number}.ngc').program_id
    heard = peer.listen(Program, 'program', EVERY_STATE)
    peer.until('the program', lambda: heard)
    end = time.monotonic() + 1
    peer.until('a second', lambda: time.monotonic() > end)
    assert [it.program_id for it in heard] == [newest]


def test_who_comes_late_gets_the_state_of_now(peer):
    # One that was seen late is a wrong one.
    for _ in range(5):
        heard = peer.listen(MachineState, 'machine_state', EVERY_STATE)
        peer.until('a state', lambda: heard)
        stamp = heard[0].header.stamp
        assert time.time() - stamp.sec - stamp.nanosec / 1e9 < 1.5, heard[0]


def test_type_hashes_are_those_of_rclpy(machine, peer):
    def hashes(infos):
        for info in infos:
            assert info.topic_type_hash.version == 1, info
        return {bytes(info.topic_type_hash.value) for info in infos}
    node = peer.node
    for kind, topic in ((MachineState, 'machine_state'), (Program, 'program')):
        # Of another middleware than those of Kerf's publisher.
        node.create_subscription(kind, topic, lambda _: None, LATCHED)
        name = f'{machine.namespace}/{topic}'
        peer.until('the publisher', lambda: node.get_publishers_info_by_topic(name))
        theirs = hashes(node.get_publishers_info_by_topic(name))
        assert theirs == hashes(node.get_subscriptions_info_by_topic(name)) and len(theirs) == 1
    for kind, service in ((Trigger, 'feed_hold'), (LoadProgram, 'load_program')):
        client = node.create_client(kind, service)
        peer.until('the service', client.service_is_ready)
        for name, ask in (('rq{}Request', node.get_subscriptions_info_by_topic),
                          ('rr{}Reply', node.get_publishers_info_by_topic)):
            name = name.format(f'{machine.namespace}/{service}')
            both = (node.get_publishers_info_by_topic, node.get_subscriptions_info_by_topic)
            assert hashes(ask(name, no_mangle=True))
            assert len(set.union(*(hashes(it(name, no_mangle=True)) for it in both))) == 1, name


def test_the_recorder_is_named_as_a_subscriber(machine, peer):
    topic = f'{machine.namespace}/machine_state'

    def subscribers():
        found = peer.node.get_subscriptions_info_by_topic(topic)
        return {(it.node_name, it.node_namespace) for it in found}
    peer.until('the recorder', lambda: ('run_recorder', machine.namespace) in subscribers())
    of_recorder = dict(peer.node.get_subscriber_names_and_types_by_node(
        'run_recorder', machine.namespace))
    assert of_recorder[topic] == ['cnc_msgs/msg/MachineState']


def test_no_bound_of_a_program_without_z_is_an_infinity(peer):
    answer = load(peer, 'G21 G90\nG0 X5 Y1\nG1 X40 F600\nM30\n', 'flat.ngc')
    corners = [answer.bounds_min, answer.bounds_max]
    assert [round(it.x, 6) for it in corners] == [0.005, 0.04]
    assert all(math.isnan(it.z) for it in corners)
    contours = peer.listen(ProgrammedContour, 'programmed_contour', LATCHED)
    peer.until('the contour', lambda: any(
        it.program_id == answer.program_id and math.isnan(it.bounds_min.z) for it in contours))


def test_the_reason_of_a_rejected_goal_is_on_rosout(machine, peer):
    heard = []
    peer.node.create_subscription(
        Log, '/rosout', lambda log: heard.append((time.monotonic(), log)), 100)
    client = ActionClient(peer.node, RunProgram, 'run_program')
    peer.until('the action', client.server_is_ready)
    peer.until('the log of the driver', lambda: peer.node.count_publishers('/rosout') >= 4)
    goal = peer.result('a decision', client.send_goal_async(
        RunProgram.Goal(program_id='0123456789abcdef')))
    decided = time.monotonic()
    assert not goal.accepted

    def reasons():
        return [(at, it) for at, it in heard if 'is rejected: ' in it.msg]
    [(at, reason)] = peer.until('the reason', reasons)
    assert reason.level == Log.WARN
    assert reason.name.endswith('axis_driver')
    assert '0123456789abcdef' in reason.msg
    # On a busy host the reader may be slow.
    assert at - decided < 10
    client.destroy()


def test_a_resume_right_after_hold_is_not_refused(peer):
    """Whoever has seen HOLD may press resume, also while the machine slows down."""
    load(peer, SLOW, 'slow.ngc')
    states = peer.listen(MachineState, 'machine_state', EVERY_STATE)
    client = ActionClient(peer.node, RunProgram, 'run_program')
    peer.until('the action', client.server_is_ready)
    goal = peer.result('a decision', client.send_goal_async(RunProgram.Goal()))
    assert goal.accepted
    ended = goal.get_result_async()
    for _ in range(10):
        peer.until('the run', lambda: ended.done() or
                   (states and states[-1].state == MachineState.STATE_RUN))
        if ended.done():
            break
        states.clear()
        assert peer.call(Trigger, 'feed_hold').success
        peer.until('a hold', lambda: any(it.state == MachineState.STATE_HOLD for it in states)
                   or ended.done())
        if ended.done():
            break
        answer = peer.call(Trigger, 'resume')
        assert answer.success, answer.message
        states.append(MachineState())
    assert peer.result('the end', ended).result.outcome == RunProgram.Result.OUTCOME_SUCCEEDED
    client.destroy()
