"""All that the nodes offer, asked for by real rclpy: `contract.py` is the list."""

import importlib
import os
import signal
import subprocess
import sys
import time

import pytest
import rclpy
from cnc_msgs.action import Jog, Probe, RunProgram
from cnc_msgs.msg import MachineState
from cnc_msgs.srv import LoadProgram
from lifecycle_msgs.msg import State, Transition, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterType, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters, GetParameters, GetParameterTypes, ListParameters, SetParameters,
    SetParametersAtomically,
)
from rclpy.action import ActionClient
from rclpy.executors import MultiThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_srvs.srv import SetBool, Trigger

from contract import ACTIONS, COMMON, COMMON_SERVICES, NODES, SERVICES, TOPICS, TRIGGERS
from rclpy_peer import TIMEOUT

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
EVENTS = QoSProfile(depth=1000)
PART = 'G21 G90 G94 G17\nG0 X10 Y10\nG1 X60 F3000\nY40\nX10\nM30\n'
# 16 s of a machine in a hurry.
LONG = 'G21 G90\nG0 X10\n' + 'G1 X110 F600\nX10\n' * 8 + 'M30\n'


def kind_of(name):
    """`cnc_msgs/msg/Program` as rclpy knows it."""
    package, folder, kind = name.split('/')
    return getattr(importlib.import_module(f'{package}.{folder}'), kind)


def load(peer, text, name):
    answer = peer.call(LoadProgram, 'load_program', text=text, name=name)
    assert answer.success, answer.message
    reports = peer.listen(kind_of('cnc_msgs/msg/CompensationReport'), 'compensation_report', LATCHED)
    peer.until('the plan', lambda: any(it.program_id == answer.program_id for it in reports))
    return answer.program_id


def run(peer, **goal):
    """Begins a run, and gives its goal."""
    client = ActionClient(peer.node, RunProgram, 'run_program')
    peer.until('the action', client.server_is_ready)
    handle = peer.result('a decision', client.send_goal_async(RunProgram.Goal(**goal)))
    assert handle.accepted
    return handle


def until_idle(peer):
    states = peer.listen(MachineState, 'machine_state', LATCHED)
    peer.until('IDLE', lambda: states and states[-1].state == MachineState.STATE_IDLE
               and not states[-1].needs_reset)


@pytest.mark.parametrize('name', NODES)
def test_a_node_publishes_and_offers_what_the_contract_says(machine, peer, name):
    def at(word):
        word = word.replace('~', f'{machine.namespace}/{name}')
        return word if word.startswith('/') else f'{machine.namespace}/{word}'
    published = {at(topic): [kind] for topic, (owner, kind, _) in TOPICS.items() if owner == name}
    published |= {at(topic): [kind] for topic, (kind, _) in COMMON.items()}
    offered = {at(service): [f'cnc_msgs/srv/{kind}'] for service, kind in SERVICES[name].items()}
    offered |= {at(f'~/{service}'): [kind] for service, kind in COMMON_SERVICES.items()}
    if name == 'axis_driver':
        offered |= {at(trigger): ['std_srvs/srv/Trigger'] for trigger in TRIGGERS}

    def has(ask, wanted):
        found = dict(ask(name, machine.namespace))
        return all(found.get(key) == kind for key, kind in wanted.items())
    node = peer.node
    peer.until('the node', lambda: (name, machine.namespace)
               in node.get_node_names_and_namespaces())
    peer.until('its topics', lambda: has(node.get_publisher_names_and_types_by_node, published))
    peer.until('its services', lambda: has(node.get_service_names_and_types_by_node, offered))


@pytest.mark.parametrize('topic', [*TOPICS, *(it for it in COMMON if '~' not in it)])
def test_a_topic_has_the_quality_of_service_of_the_contract(machine, peer, topic):
    _, kind, (reliable, latched) = TOPICS.get(topic) or ('', *COMMON[topic])
    name = topic if topic.startswith('/') else f'{machine.namespace}/{topic}'

    def publishers():
        found = peer.node.get_publishers_info_by_topic(name)
        return [it for it in found if it.node_namespace == machine.namespace
                and it.node_name in NODES]
    found = peer.until('a publisher', publishers)
    assert {it.topic_type for it in found} == {kind}
    found = {(it.qos_profile.reliability == ReliabilityPolicy.RELIABLE,
              it.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL) for it in found}
    assert (reliable, latched) in found
    # Of these two each node has another one, which its library makes.
    assert len(found) == 1 or topic in ('/parameter_events', '/rosout')


def test_every_topic_is_heard_during_a_run(machine, peer):
    # Not of this run: a home, a probe, and a node that changes its state or a parameter.
    apart = {'home/_action/status', 'home/_action/feedback', 'probe/_action/status',
             'probe/_action/feedback', 'jog/_action/status', 'jog/_action/feedback',
             # Chunks go out for those who subscribe before the plan, or are fetched.
             'program/chunks', 'programmed_contour/chunks', 'compensated_path/chunks'}
    heard = {}
    for topic, (_, kind, (_, latched)) in {**TOPICS, '/rosout': ('', *COMMON['/rosout']),
                                           '/diagnostics': ('', *COMMON['/diagnostics'])}.items():
        # There is no wheel with the messages of `/tf`.
        if '/_action/' not in topic and topic != '/tf':
            heard[topic] = peer.listen(kind_of(kind), topic, LATCHED if latched else EVENTS)
    load(peer, PART, 'topics.ngc')
    goal = run(peer)
    assert peer.result('the end', goal.get_result_async()).result.outcome == \
        RunProgram.Result.OUTCOME_SUCCEEDED
    for topic, messages in heard.items():
        if topic not in apart:
            peer.until(topic, lambda: messages)


def test_what_a_run_leaves_is_there_for_who_comes_later(peer):
    program_id = load(peer, PART, 'late.ngc')
    goal = run(peer)
    peer.result('the end', goal.get_result_async())
    results = peer.listen(kind_of('cnc_msgs/msg/RunResult'), 'run_result', LATCHED)
    peer.until('the result', lambda: any(it.program_id == program_id for it in results))
    assert len(results) == 1


def test_a_path_is_fetched_whole(peer):
    # The longest message with structure.
    text = 'G21 G90 G17\nG0 X0 Y0\n' + ''.join(
        f'G2 X{x} I1 F600\nG1 Y{x / 10}\nG1 Y0\n' for x in range(2, 1200, 2)) + 'M30\n'
    program_id = load(peer, text, 'long.ngc')
    paths = peer.listen(kind_of('cnc_msgs/msg/CompensatedPath'), 'compensated_path', LATCHED)
    path = peer.until('the path', lambda: next(
        (it for it in paths if it.program_id == program_id), None))
    elements = []
    chunks = 0
    while chunks < path.chunk_count:
        answer = peer.call(kind_of('cnc_msgs/srv/GetPathChunks'), 'compensated_path/get_chunks',
                           first=chunks, program_id=program_id, revision=path.revision)
        assert answer.success, answer.message
        chunks += len(answer.chunks)
        elements += [element for chunk in answer.chunks for element in chunk.elements]
    assert path.chunk_count > 1 and len(elements) == path.element_count
    # Metres; half circles about a centre on X.
    arcs = [it for it in elements if it.kind == it.KIND_ARC]
    assert len(arcs) == 599
    for number, arc in enumerate(arcs):
        assert abs(arc.center.x - (2 * number + 1) / 1000) < 1e-9, arc


def test_every_service_answers(machine, peer):
    """With a request that changes nothing, or that is refused."""
    load(peer, PART, 'services.ngc')
    for services in SERVICES.values():
        for name, kind in services.items():
            answer = peer.call(kind_of(f'cnc_msgs/srv/{kind}'), name)
            assert answer is not None, name
    assert peer.call(SetBool, 'single_block', data=False).success
    # What they do in idle differs; `soft_reset` comes after `sleep`.
    for name in [it for it in TRIGGERS if it != 'soft_reset'] + ['soft_reset', 'unlock']:
        assert peer.call(Trigger, name).message, name
    until_idle(peer)
    for name in NODES:
        for service, kind in COMMON_SERVICES.items():
            if service != 'change_state':
                assert peer.call(kind_of(kind), f'{name}/{service}') is not None


def test_every_action_decides_on_a_goal(machine, peer):
    until_idle(peer)
    for name, kind in ACTIONS.items():
        action = kind_of(f'cnc_msgs/action/{kind}')
        client = ActionClient(peer.node, action, name)
        peer.until(name, client.server_is_ready)
        goal = action.Goal()
        if kind == 'RunProgram':
            goal.program_id = '0123456789abcdef'
        decision = peer.result(name, client.send_goal_async(goal))
        # Nothing is asked for, and there is no such program; the switches of this machine are found.
        assert decision.accepted == (name == 'home'), name
        if decision.accepted:
            peer.result(f'the end of {name}', decision.get_result_async())
        client.destroy()
    until_idle(peer)


def test_a_jog_arrives_and_a_probe_finds_or_misses(machine, peer):
    until_idle(peer)
    for kind, name, goal in (
            (Jog, 'jog', Jog.Goal(frame=Jog.Goal.FRAME_RELATIVE, axes=1, feed_rate=0.05)),
            (Probe, 'probe', Probe.Goal(axes=4, feed_rate=0.005, may_miss=True))):
        where = goal.target if kind is Jog else goal.distance
        where.x, where.z = 0.005, -0.002
        client = ActionClient(peer.node, kind, name)
        peer.until(name, client.server_is_ready)
        feedback = []
        handle = peer.result(name, client.send_goal_async(goal, feedback_callback=feedback.append))
        assert handle.accepted, name
        result = peer.result(f'the end of {name}', handle.get_result_async())
        assert result.result.error_code == 0, result.result.message
        client.destroy()


def test_a_run_is_canceled(machine, peer):
    load(peer, LONG, 'canceled.ngc')
    goal = run(peer)
    states = peer.listen(MachineState, 'machine_state', LATCHED)
    peer.until('the run', lambda: states and states[-1].state == MachineState.STATE_RUN)
    answer = peer.result('the cancel', goal.cancel_goal_async())
    assert len(answer.goals_canceling) == 1
    result = peer.result('the end', goal.get_result_async())
    assert result.result.outcome == RunProgram.Result.OUTCOME_CANCELED
    until_idle(peer)


def test_parameters_are_described_set_and_announced(machine, peer):
    events = peer.listen(ParameterEvent, '/parameter_events', EVENTS)
    at = 'axis_driver/'
    names = peer.call(ListParameters, at + 'list_parameters').result.names
    types = peer.call(GetParameterTypes, at + 'get_parameter_types', names=names).types
    described = peer.call(DescribeParameters, at + 'describe_parameters', names=names).descriptors
    assert [it.type for it in described] == list(types)
    values = peer.call(GetParameters, at + 'get_parameters', names=names).values
    assert [it.type for it in values] == list(types)

    def parameter(name, value):
        value = ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=value)
        return Parameter(name=name, value=value)
    good, bad = parameter('commander_timeout_ms', 2500), parameter('baud', 9600)
    results = peer.call(SetParameters, at + 'set_parameters', parameters=[good, bad]).results
    assert [it.successful for it in results] == [True, False] and 'baud' in results[1].reason
    result = peer.call(SetParametersAtomically, at + 'set_parameters_atomically',
                       parameters=[parameter('commander_timeout_ms', 3500), bad]).result
    assert not result.successful
    [value] = peer.call(GetParameters, at + 'get_parameters', names=['commander_timeout_ms']).values
    assert value.integer_value == 2500
    peer.until('the event', lambda: any(
        it.node == f'{machine.namespace}/axis_driver' and
        [(p.name, p.value.integer_value) for p in it.changed_parameters] ==
        [('commander_timeout_ms', 2500)] for it in events))


@pytest.mark.parametrize('name', NODES)
def test_a_node_goes_through_its_lifecycle(machine, peer, name):
    events = peer.listen(TransitionEvent, f'{name}/transition_event', EVENTS)
    peer.until('its publisher', lambda: peer.node.count_publishers(f'{name}/transition_event'))
    states = peer.call(GetAvailableStates, f'{name}/get_available_states').available_states
    assert {'unconfigured', 'inactive', 'active', 'finalized'} <= {it.label for it in states}
    ways = peer.call(GetAvailableTransitions, f'{name}/get_available_transitions')
    assert 'deactivate' in {it.transition.label for it in ways.available_transitions}
    for transition, state in ((Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE),
                              (Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_ACTIVE)):
        assert peer.call(ChangeState, f'{name}/change_state',
                         transition=Transition(id=transition)).success
        assert peer.call(GetState, f'{name}/get_state').current_state.id == state
    peer.until('the events', lambda: {'inactive', 'active'} <= {it.goal_state.label for it in events})
    until_idle(peer)


def test_fifty_clients_of_an_executor_make_thousands_of_calls_without_a_loss(machine, context):
    node = rclpy.create_node('crowd', context=context, namespace=machine.namespace)
    executor = MultiThreadedExecutor(num_threads=4, context=context)
    executor.add_node(node)
    clients = [node.create_client(GetParameters, f'{name}/get_parameters')
               for name in NODES for _ in range(13)][:50]
    end = time.monotonic() + TIMEOUT
    while not all(client.service_is_ready() for client in clients):
        assert time.monotonic() < end
        executor.spin_once(timeout_sec=0.05)
    request = GetParameters.Request(names=['use_sim_time'])
    answered = 0
    for _ in range(50):
        # In turn, four at a time: of more at the very same instant a client of rcl loses answers.
        for begin in range(0, len(clients), 4):
            futures = [client.call_async(request) for client in clients[begin:begin + 4]]
            end = time.monotonic() + TIMEOUT
            while not all(future.done() for future in futures):
                assert time.monotonic() < end, f'{answered} answers before'
                executor.spin_once(timeout_sec=0.05)
            answered += sum(len(future.result().values) for future in futures)
    assert answered == 2500
    executor.shutdown()
    node.destroy_node()


COMMANDER = '''
import sys
import rclpy
from cnc_msgs.action import RunProgram
from rclpy.action import ActionClient
rclpy.init()
node = rclpy.create_node('commander', namespace=sys.argv[1])
client = ActionClient(node, RunProgram, 'run_program')
client.wait_for_server()
future = client.send_goal_async(RunProgram.Goal())
rclpy.spin_until_future_complete(node, future)
print(bytes(future.result().goal_id.uuid).hex(), flush=True)
rclpy.spin(node)
'''


@pytest.fixture
def commander(machine):
    child = subprocess.Popen([sys.executable, '-B', '-c', COMMANDER, machine.namespace],
                             env=os.environ | {'ROS_DOMAIN_ID': str(machine.domain_id)},
                             stdout=subprocess.PIPE, text=True)
    yield child
    child.send_signal(signal.SIGCONT)
    child.kill()
    child.wait()


def test_a_killed_client_leaves_its_goal_and_its_result(machine, peer, request):
    load(peer, LONG, 'heir.ngc')
    commander = request.getfixturevalue('commander')
    goal_id = bytes.fromhex(commander.stdout.readline().strip())
    commander.kill()
    get = peer.node.create_client(RunProgram.Impl.GetResultService, 'run_program/_action/get_result')
    peer.until('the service', get.service_is_ready)
    question = RunProgram.Impl.GetResultService.Request()
    question.goal_id.uuid = list(goal_id)
    result = peer.result('the result', get.call_async(question), timeout=180)
    assert result.result.outcome == RunProgram.Result.OUTCOME_SUCCEEDED
    until_idle(peer)


def test_a_stopped_client_slows_nobody(machine, peer, request):
    load(peer, LONG, 'stopped.ngc')
    commander = request.getfixturevalue('commander')
    assert commander.stdout.readline().strip()
    commander.send_signal(signal.SIGSTOP)
    times = []
    for _ in range(20):
        begin = time.monotonic()
        assert peer.call(Trigger, 'feed_hold').message
        assert peer.call(Trigger, 'resume').message
        times.append(time.monotonic() - begin)
    assert sorted(times)[10] < 2.0
    peer.call(Trigger, 'cancel')
    until_idle(peer)
