"""The launch file starts the stack; on a stand-in for launch, see `launch_stand_in`."""

import contextlib
import os
import signal
import subprocess
import time

import pytest

import hostile
import launch_stand_in
from contract import NODES
from machine import ROOT, TOOLS, die_with_parent, domain, kerf
from programs import QUICK, MachineState, load, until_state
from ros2 import ActionClient, Node, NoAnswer, ParameterClient
from ros2.lifecycle import LifecycleClient

FILE = ROOT / 'config/kerf.launch.py'
EXECUTABLES = {('kerf', 'kerf'): str(kerf())}


def commands(**arguments):
    return launch_stand_in.commands(FILE, EXECUTABLES, **arguments)


def test_each_node_is_a_process_with_the_parameters_of_all():
    started = commands()
    assert [words[1:4] for words in started] == [['node', '--watch', name] for name in NODES]
    for words in started:
        file = words[words.index('--params-file') + 1]
        assert file == str(ROOT / 'config/kerf.yaml')
        assert words.count('--ros-args') == 1
        assert not any('__ns' in word for word in words)
        assert words[words.index('--log-level') + 1] == 'info'


def test_a_namespace_is_that_of_every_node():
    for words in commands(namespace='/cell/mill'):
        assert '__ns:=/cell/mill' in words


def test_an_enclave_is_above_those_of_the_nodes():
    for words in commands(enclave='/kerf'):
        assert words[words.index('--enclave') + 1] == f'/kerf/{words[3]}'
    assert not any('--enclave' in words for words in commands())


def test_a_port_is_that_of_the_driver_and_counts_more_than_the_file():
    driver = commands(port='/dev/ttyACM3')[2]
    files = [after for word, after in zip(driver, driver[1:]) if word == '--params-file']
    assert len(files) == 2
    assert '/dev/ttyACM3' in open(files[-1]).read()


def test_a_virtual_controller_takes_no_arguments_of_ros():
    controller, *nodes = commands(virtual_controller='true', time_factor='10')
    assert controller[1:3] == ['node', 'virtual_controller'] and '--ros-args' not in controller
    assert len(nodes) == len(NODES)
    link = controller[controller.index('--link') + 1]
    own = open(nodes[2][-1]).read()
    assert link in own
    # Else the driver takes the speed of its axes for a jump.
    assert 'rate_margin: 50.0' in own
    slow = commands(virtual_controller='true')[3]
    assert 'rate_margin' not in open(slow[-1]).read()


def test_folders_are_those_of_the_loader_and_count_more_than_the_file(tmp_path):
    loader = commands(program_directories=f'{tmp_path}:relative')[0]
    assert str(tmp_path) in open(loader[-1]).read()


@pytest.fixture
def launched(tmp_path):
    """The processes of the launch file, with a virtual controller."""
    parameters = tmp_path / 'mine.yaml'
    parameters.write_text(
        '/**/axis_driver:\n  ros__parameters:\n    poll_interval_ms: 400\n'
        '/**/program_loader:\n  ros__parameters:\n    memory_mb_max: 64\n')
    namespace = f'/launched_{os.getpid()}'
    environment = {name: value for name, value in os.environ.items()
                   if not name.startswith(('ROS_', 'RMW_'))}
    environment |= {'ROS_DOMAIN_ID': str(domain()), 'RMW_IMPLEMENTATION': 'rmw_cyclonedds_cpp'}
    with open(tmp_path / 'log', 'wb') as log:
        started = [
            subprocess.Popen(words, cwd=tmp_path, env=environment, stdout=log, stderr=log,
                             stdin=subprocess.DEVNULL, preexec_fn=die_with_parent)
            for words in commands(
                namespace=namespace, params_file=str(parameters), tool_table=str(TOOLS),
                program_directories=str(tmp_path),
                virtual_controller='true', time_factor='10', log_level='debug')]
    yield namespace, environment, started
    for process in started:
        process.kill()
        process.wait()


@pytest.fixture
def stack(launched, tmp_path):
    """The same, and a node with them."""
    namespace, _, started = launched
    with Node('cell', namespace, domain()) as node:
        yield node, started, tmp_path


def test_the_stack_that_was_launched_runs_a_program_and_leaves_in_order(stack):
    node, started, folder = stack
    until_state(node, MachineState.STATE_IDLE)
    assert ParameterClient(node, 'axis_driver').get('poll_interval_ms') == [400]
    assert ParameterClient(node, 'compensation_planner').get('tool_table') == [str(TOOLS)]
    load(node, text=QUICK, name='quick.ngc')
    runs = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program')
    assert runs.send_goal().result().status == 4
    for process in started:
        process.send_signal(signal.SIGINT)
    assert [process.wait(timeout=60) for process in started] == [0] * len(started)
    log = (folder / 'log').read_text()
    assert log.count(' stops: SIGTERM') == len(NODES), log


def test_a_node_that_was_stopped_and_continued_goes_on(stack):
    node, started, folder = stack
    until_state(node, MachineState.STATE_IDLE)
    watching = started[1 + NODES.index('program_loader')].pid
    child = children(watching)
    # Often: whether a thread waits for packets just then is chance.
    for _ in range(10):
        for number in (signal.SIGSTOP, signal.SIGCONT):
            os.kill(child, number)
            time.sleep(0.2)
    load(node, text=QUICK, name='quick.ngc')
    assert children(watching) == child
    assert ' ended (' not in (folder / 'log').read_text()


def test_a_node_that_was_killed_is_restarted(stack):
    node, started, folder = stack
    until_state(node, MachineState.STATE_IDLE)
    watching = started[1 + NODES.index('compensation_planner')].pid
    child = children(watching)
    os.kill(child, signal.SIGKILL)
    until(lambda: children(watching) not in (None, child))
    said = 'kerf: compensation_planner ended (signal: 9 (SIGKILL))'
    assert said in (folder / 'log').read_text()
    until_active(node)
    load(node, text=QUICK, name='quick.ngc')


def test_a_node_that_takes_too_much_memory_is_restarted(stack):
    node, started, folder = stack
    until_state(node, MachineState.STATE_IDLE)
    # Read, it takes far more than the loader may.
    moves = ''.join(f'G1 X{line % 90} F600\n' for line in range(300_000))
    (folder / 'long.ngc').write_text(f'G21 G90\n{moves}M30\n')
    with contextlib.suppress(NoAnswer):
        client = node.client('cnc_msgs/srv/LoadProgram', 'load_program')
        client.call(timeout=10, path='long.ngc')
    until(lambda: 'program_loader ended (exit status: 71)' in (folder / 'log').read_text())
    until_active(node)
    load(node, text=QUICK, name='quick.ngc')


def test_packets_with_numbers_beyond_all_measure_end_no_node(launched, tmp_path):
    namespace, environment, started = launched
    log = tmp_path / 'log'

    def is_idle():
        said = subprocess.run([kerf(), 'status', '--ros-args', '-r', f'__ns:={namespace}'],
                              env=environment, cwd=tmp_path, capture_output=True, text=True)
        return said.stdout.startswith('IDLE')

    until(is_idle)
    for name, make in hostile.PACKETS.items():
        hostile.send(domain(), make)
        # A node that hangs would be given five seconds.
        time.sleep(6)
        until(is_idle)
        assert ' ended (' not in log.read_text(), (name, log.read_text())
    with Node('cell', namespace, domain()) as node:
        until_state(node, MachineState.STATE_IDLE)
        until_active(node)
        load(node, text=QUICK, name='quick.ngc')
        runs = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program')
        assert runs.send_goal().result().status == 4


def until_active(node):
    """Waits until every node is active: one that was restarted refuses what comes while it still starts.

    A node that was killed is still asked for as long as nobody has missed it, and does not answer.
    """
    def is_active(client):
        with contextlib.suppress(NoAnswer):
            return client.state(timeout=2) == 'active'
        return False
    for name in NODES:
        client = LifecycleClient(node, name)
        until(lambda: is_active(client))


def children(process):
    """The only child of a process."""
    with open(f'/proc/{process}/task/{process}/children') as file:
        numbers = file.read().split()
    return int(numbers[0]) if numbers else None


def until(probe, seconds=60):
    end = time.monotonic() + seconds
    while not probe():
        assert time.monotonic() < end
        time.sleep(0.05)
