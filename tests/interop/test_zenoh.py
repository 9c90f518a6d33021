"""The stack over Zenoh, commanded by a peer that speaks the conventions of rmw_zenoh.

Needs a `kerf` with the feature `zenoh`.
"""

import os
import subprocess
import time

import pytest

import ros2_zenoh
from contract import COMMON_SERVICES, NODES, SERVICES, TOPICS, TRIGGERS
from machine import die_with_parent, kerf
from programs import QUICK, SLOW, MachineState, load, load_demo, path_chunks, until_state
from ros2 import (LATCHED, ActionClient, NoAnswer, ParameterClient, interfaces, message,
                  until)
from ros2.lifecycle import LifecycleClient, Transition
from ros2_zenoh import attachment
from zenoh_machine import Machine, at, free_port

# Minutes of a machine in a hurry.
LONG = 'G21 G90 G94 G17\nG0 X10 Y10\nG1 X110 F1200\n' + 'X10\nX110\n' * 300 + 'M30\n'
Bool = message('std_msgs/msg/Bool')
WRONG_HASH = 'RIHS01_' + '0' * 64


def run(*words, timeout=20, **variables):
    """A command of the stack, to its end."""
    environment = {name: value for name, value in os.environ.items()
                   if not name.startswith(('ROS_', 'RMW_', 'ZENOH_'))}
    return subprocess.run([kerf(), *words], env=environment | variables, capture_output=True,
                          text=True, timeout=timeout, check=False)


def built_in():
    return 'has no Zenoh' not in run('status', RMW_IMPLEMENTATION='rmw_zenoh_cpp',
                                     ZENOH_ROUTER_CHECK_ATTEMPTS='none').stderr


pytestmark = pytest.mark.skipif(not built_in(), reason='this kerf is built without Zenoh')


@pytest.fixture(scope='module')
def machine():
    """One machine for the tests of this file, over Zenoh."""
    made = Machine().until_idle()
    yield made
    made.stop()


def test_a_program_is_loaded_planned_and_run(machine, node):
    answer, path = load_demo(node)
    assert (answer.line_count, answer.findings) == (14, [])
    assert path.element_count > 0
    answer, _ = load(node, text=SLOW, name='slow.ngc')
    runs = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program')
    goal = runs.send_goal(program_id=answer.program_id)
    assert goal.accepted
    on_its_way = goal.wait_for_feedback(lambda feedback: 0.2 < feedback.fraction < 0.8)
    assert on_its_way.state == MachineState.STATE_RUN
    ended = goal.result()
    assert ended.status == 4, ended.result.message
    # It comes after the result, on a topic of its own.
    until('the status', lambda: runs.statuses().get(goal.number) == 4)
    # The recorder is at the same router: it has what was said.
    until('the bag to be complete', lambda: 'is complete' in machine.log())
    [bag] = (machine.folder / 'bags').glob('run_*')
    assert run('replay', str(bag)).returncode == 0
    info = run('bag', 'info', str(bag)).stdout
    assert f'{machine.namespace}/machine_state' in info


def test_a_run_is_held_and_canceled(machine, node):
    until_state(node, MachineState.STATE_IDLE)
    load(node, text=SLOW, name='slow.ngc')
    goal = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program').send_goal()
    until_state(node, MachineState.STATE_RUN)
    assert node.client('std_srvs/srv/Trigger', 'feed_hold').call().success
    until_state(node, MachineState.STATE_HOLD)
    assert node.client('std_srvs/srv/Trigger', 'resume').call().success
    until_state(node, MachineState.STATE_RUN)
    goal.cancel()
    assert goal.result().status == 5
    until_state(node, MachineState.STATE_IDLE)


def test_who_comes_late_gets_all_that_is_latched(machine, node):
    answer, _ = load_demo(node)
    with machine.node('latecomer') as late:
        for topic, (_, type_name, qos) in TOPICS.items():
            if qos == LATCHED_QOS and topic not in ('run_result', 'markers') and '_action' not in topic:
                late.subscription(type_name, topic, LATCHED).wait()
        path = late.subscription('cnc_msgs/msg/CompensatedPath', 'compensated_path', LATCHED)
        path.wait(lambda path: path.program_id == answer.program_id)


LATCHED_QOS = (True, True)


def test_a_long_program_and_its_path_pass(node):
    moves = ''.join(f'X{number % 300}.{number % 10} Y{number % 7}\n' for number in range(4000))
    _, path = load(node, text=f'G21 G90 G1 F600\n{moves}M30\n', name='long.ngc')
    chunks = path_chunks(node, path)
    assert sum(len(chunk.elements) for chunk in chunks) == path.element_count > 3000


def test_parameters_and_lifecycle_as_of_any_node(machine, node):
    parameters = ParameterClient(node, 'axis_driver')
    assert 'baud' in parameters.list().names
    assert parameters.get('baud') == [115_200]
    # A request and an answer that are far longer than a datagram.
    assert parameters.get(*['baud'] * 20_000) == [115_200] * 20_000
    [result] = parameters.set(commander_timeout_ms=2500)
    assert result.successful, result.reason
    [result] = parameters.set(baud=9600)
    assert not result.successful and 'baud' in result.reason
    loader = LifecycleClient(node, 'program_loader')
    until('the loader', lambda: loader.state() == 'active')
    assert loader.change(Transition.TRANSITION_DEACTIVATE)
    answer = node.client('cnc_msgs/srv/LoadProgram', 'load_program').call(text=QUICK, name='q')
    assert not answer.success and 'inactive' in answer.message
    assert loader.change(Transition.TRANSITION_ACTIVATE)
    assert loader.state() == 'active'


def test_nodes_and_endpoints_are_announced_as_rcl_nodes_are(machine, node):
    def announced(kind):
        return {(token[8], token[9].replace('%', '/')): token[10:] for token in
                map(lambda text: text.split('/'), sorted(node.tokens)) if token[5] == kind
                and token[7] == ros2_zenoh.mangled(machine.namespace) and token[8] in NODES}
    wanted = {(owner, node.resolve(name)): f'cnc_msgs/srv/{kind}'
              for owner, services in SERVICES.items() for name, kind in services.items()}
    wanted |= {('axis_driver', node.resolve(name)): 'std_srvs/srv/Trigger' for name in TRIGGERS}
    wanted |= {(owner, node.resolve(f'{owner}/{name}')): kind
               for owner in NODES for name, kind in COMMON_SERVICES.items()}
    topics = {(owner, node.resolve(topic)) for topic, (owner, *_) in TOPICS.items()}
    # Tokens come one by one.
    until('all services', lambda: wanted.keys() <= announced('SS').keys())
    until('all topics', lambda: topics <= announced('MP').keys())
    until('all nodes', lambda: set(NODES) <= {
        text.split('/')[8] for text in node.tokens if text.split('/')[5] == 'NN'})
    publishers, servers = announced('MP'), announced('SS')
    for topic, (owner, type_name, (reliable, transient_local)) in TOPICS.items():
        kind, type_hash, qos = publishers[owner, node.resolve(topic)]
        assert kind == interfaces.dds_type(type_name), topic
        assert type_hash == interfaces.type_hash(type_name), topic
        assert qos.split(':')[:2] == ['' if reliable else '2', '1' if transient_local else '']
    for (owner, name), type_name in wanted.items():
        kind, type_hash, _ = servers[owner, name]
        assert (kind, type_hash) == (
            interfaces.dds_type(type_name), interfaces.type_hash(type_name)), name


def test_the_address_beside_a_sample_is_that_of_the_token(node):
    states = node.subscription('cnc_msgs/msg/MachineState', 'machine_state', LATCHED)
    states.wait()
    first, sent, gid = states.beside
    assert 0 <= time.time() - sent / 1e9 < 10
    # A sample may overtake the token of its publisher.
    until('the token', lambda: node.others('MP', states.topic))
    [token] = node.others('MP', states.topic)
    assert gid == ros2_zenoh.xxhash.xxh3_128('/'.join(token).encode()).intdigest().to_bytes(16, 'little')
    numbers = []
    for _ in range(3):
        states.wait()
        numbers.append(states.beside[0])
    assert numbers == sorted(numbers) and numbers[0] > first


def held(node):
    """Whether anything has held the machine, which runs otherwise."""
    seen = until_state(node, MachineState.STATE_RUN, MachineState.STATE_HOLD).state
    return seen == MachineState.STATE_HOLD


@pytest.fixture
def running(node):
    """A run that goes on for seconds."""
    until_state(node, MachineState.STATE_IDLE)
    load(node, text=LONG, name='long.ngc')
    goal = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program').send_goal()
    assert goal.accepted
    until_state(node, MachineState.STATE_RUN)
    yield goal
    goal.cancel()
    goal.result()
    until_state(node, MachineState.STATE_IDLE)


def test_no_message_of_another_definition_moves_or_holds_the_machine(machine, node, running):
    wrong = node.publisher('std_msgs/msg/Bool', 'feed_hold', type_hash=WRONG_HASH)
    right = node.publisher('std_msgs/msg/Bool', 'feed_hold').wait_for_subscribers()
    for _ in range(5):
        wrong.publish(Bool(data=False))
        wrong.publish(Bool(data=True))
    # To all topics at once; without numbers; with another encoding; no CDR.
    payload, numbers = Bool(data=True).serialize(), attachment(1, bytes(16))
    for key in ('**', f'{node.domain_id}/**', f'{node.domain_id}{right.topic}/**'):
        node.session.put(key, payload, attachment=numbers)
    right.put(payload, b'')
    right.put(b'\x00\x07\x00\x00' + payload[4:], numbers)
    right.put(b'', numbers)
    assert not held(node)
    client = node.client('std_srvs/srv/Trigger', 'feed_hold', type_hash=WRONG_HASH)
    assert not client.is_ready()
    number = client.send()
    for key in ('**', f'{node.domain_id}/**'):
        node.session.get(key, lambda _: None, payload=payload, attachment=numbers)
    with pytest.raises(NoAnswer):
        client.wait(number, timeout=1)
    assert not held(node)
    until('a word in the log', lambda: 'its definition of std_msgs/msg/Bool is another one'
          in machine.log() and WRONG_HASH in machine.log())
    assert 'panicked' not in machine.log()
    # The right one does.
    right.publish(Bool(data=False))
    right.publish(Bool(data=True))
    until_state(node, MachineState.STATE_HOLD)


def test_an_answer_may_take_longer_than_a_query_does_by_default(machine):
    override = at(machine.port)['ZENOH_CONFIG_OVERRIDE'] + ';queries_default_timeout=1000'
    variables = at(machine.port) | {'ROS_DOMAIN_ID': str(machine.domain_id),
                                    'ZENOH_CONFIG_OVERRIDE': override}
    since = time.monotonic()
    answer = run('mdi', 'G4 P40', '--ros-args', '-r', f'__ns:={machine.namespace}', **variables,
                 KERF_RUNTIME_DIR=str(machine.folder / 'no_sockets'))
    assert answer.returncode == 0, answer.stdout + answer.stderr
    assert time.monotonic() - since > 2.5


def test_the_commands_speak_zenoh_too(machine):
    variables = at(machine.port) | {'ROS_DOMAIN_ID': str(machine.domain_id)}
    answer = run('status', '--ros-args', '-r', f'__ns:={machine.namespace}', **variables)
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.startswith('IDLE'), answer.stdout
    elsewhere = run('hold', '--ros-args', '-r', '__ns:=/nobody', **variables)
    assert elsewhere.returncode != 0 and 'nobody' in elsewhere.stderr


def test_nodes_that_know_each_other_need_no_router_and_a_new_one_is_found():
    machine = Machine().until_idle()
    try:
        with machine.node() as node:
            states = node.subscription('cnc_msgs/msg/MachineState', 'machine_state', LATCHED)
            hold = node.client('std_srvs/srv/Trigger', 'feed_hold')
            assert hold.call().success
            machine.router.close()
            time.sleep(1)
            states.take()
            states.wait()
            assert hold.call().success
            load(node, text=QUICK, name='quick.ngc')
            machine.router = ros2_zenoh.router(machine.port)
            with machine.node('latecomer') as late:
                late.subscription('cnc_msgs/msg/MachineState', 'machine_state', LATCHED).wait()
                assert late.client('std_srvs/srv/Trigger', 'feed_hold').call().success
    finally:
        machine.stop()


def test_a_missing_router_is_named_within_two_seconds():
    port = free_port()
    since = time.monotonic()
    answer = run('node', 'program_loader', **at(port))
    # And the start of a process on a busy host; a call without a router would take 60 s.
    assert time.monotonic() - since < 10
    assert answer.returncode != 0
    for part in (f'no Zenoh router at tcp/127.0.0.1:{port}', 'refused', 'kerf router', 'rmw_zenohd',
                 'ZENOH_ROUTER_CHECK_ATTEMPTS'):
        assert part in answer.stderr, answer.stderr


def test_a_node_waits_for_a_router_where_it_is_told_to():
    port = free_port()
    since = time.monotonic()
    run('node', 'program_loader', **at(port), ZENOH_ROUTER_CHECK_ATTEMPTS='4')
    assert 3.5 < time.monotonic() - since < 20
    node = subprocess.Popen(
        [kerf(), 'node', 'program_loader', '--ros-args', '-r', '__ns:=/waits'],
        env=os.environ | at(port) | {'ZENOH_ROUTER_CHECK_ATTEMPTS': '0'}, stderr=subprocess.PIPE,
        text=True, preexec_fn=die_with_parent)
    try:
        assert 'waiting for one' in node.stderr.readline()
        router = subprocess.Popen(
            [kerf(), 'router'], stdout=subprocess.PIPE, text=True,
            env=os.environ | {'ZENOH_CONFIG_OVERRIDE': f'listen/endpoints=["tcp/127.0.0.1:{port}"]'},
            preexec_fn=die_with_parent)
        try:
            assert f'127.0.0.1:{port}' in router.stdout.readline()
            domain_id = int(os.environ.get('ROS_DOMAIN_ID') or 0)
            with ros2_zenoh.Node('cell', '/waits', domain_id, port) as cell:
                loader = LifecycleClient(cell, 'program_loader')
                until('the loader', lambda: loader.state() == 'active')
        finally:
            router.terminate()
            assert router.wait(40) == 0
    finally:
        node.terminate()
        assert node.wait(40) == 0


def test_without_a_router_two_nodes_find_each_other_by_address_alone():
    """Peers learn of each other by a router. Without one they need an address of the other."""
    port = free_port()
    node = subprocess.Popen(
        [kerf(), 'node', 'program_loader', '--ros-args', '-r', '__ns:=/alone'],
        env=os.environ | {
            'RMW_IMPLEMENTATION': 'rmw_zenoh_cpp', 'ROS_DOMAIN_ID': '5',
            'ZENOH_ROUTER_CHECK_ATTEMPTS': '-1',
            'ZENOH_CONFIG_OVERRIDE': 'connect/endpoints=[];'
                                     f'listen/endpoints=["tcp/127.0.0.1:{port}"]'},
        preexec_fn=die_with_parent)
    try:
        with ros2_zenoh.Node('cell', '/alone', 5, port) as cell:
            answer = cell.client('cnc_msgs/srv/LoadProgram', 'load_program').call(
                text=QUICK, name='quick.ngc')
            assert answer.success, answer.message
        # A peer without the address finds nobody.
        with ros2_zenoh.Node('stray', '/alone', 5, free_port()) as stray:
            time.sleep(1)
            assert not stray.others('SS', '/alone/load_program')
    finally:
        node.terminate()
        assert node.wait(40) == 0


@pytest.mark.parametrize('variables, parts', [
    ({'RMW_IMPLEMENTATION': 'rmw_connextdds'}, ['rmw_connextdds', 'rmw_zenoh_cpp']),
    ({'ROS_DOMAIN_ID': '233'}, ['ROS_DOMAIN_ID="233"', '0 to 232']),
    ({'ZENOH_ROUTER_CHECK_ATTEMPTS': 'often'}, ['often', 'whole number']),
    ({'ZENOH_SESSION_CONFIG_URI': '/no/such.json5'}, ['/no/such.json5', 'No such file']),
    ({'ZENOH_CONFIG_OVERRIDE': 'mode="boss"'}, ['mode="boss"']),
    ({'ZENOH_CONFIG_OVERRIDE': 'connect/endpoints=["quic/127.0.0.1:7447"]'}, ['quic', 'tcp and tls']),
    ({'ROS_SECURITY_ENABLE': 'true'}, ['ROS_SECURITY_ENABLE', 'ROS_SECURITY_KEYSTORE']),
    ({'ROS_SECURITY_ENABLE': 'true', 'ROS_SECURITY_KEYSTORE': '/no/keys',
      'ROS_SECURITY_STRATEGY': 'Enforce'}, ['/no/keys', 'make_keystore.py']),
    ({'ROS_SECURITY_ENABLE': 'true', 'ROS_SECURITY_KEYSTORE': '/no/keys',
      'ZENOH_SESSION_CONFIG_URI': '/a.json5'}, ['/a.json5', 'unset one']),
])
def test_what_is_wrong_is_said(variables, parts):
    answer = run('node', 'program_loader', **{'RMW_IMPLEMENTATION': 'rmw_zenoh_cpp'} | variables)
    assert answer.returncode != 0
    for part in parts:
        assert part in answer.stderr, answer.stderr


def test_a_domain_is_out_of_reach_of_another(machine):
    with ros2_zenoh.Node('cell', machine.namespace, machine.domain_id + 100, machine.port) as other:
        time.sleep(1)
        assert not other.others('SS', other.resolve('load_program'))
        states = other.subscription('cnc_msgs/msg/MachineState', 'machine_state', LATCHED)
        with pytest.raises(NoAnswer):
            states.wait(timeout=1)
