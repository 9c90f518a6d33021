"""The programs in the documentation do what their pages say, as printed.

Without ROS 2 they run on a stand-in for rclpy, see `rclpy_stand_in`.
"""

import re
import signal
from pathlib import Path

import pytest

import documented
from documented import PART, TOOLS, program_of
from machine import Machine
from programs import MachineState, until_state
from ros2 import Qos, until


@pytest.fixture(scope='module')
def machine():
    made = Machine(time_factor=4, tools=TOOLS).until_idle()
    yield made
    made.stop()


def start(machine, program, *words):
    """With the stand-in for rclpy."""
    stand_in = str(Path(__file__).parent / 'rclpy_stand_in')
    return documented.start(machine, program, *words, PYTHONPATH=stand_in)


def test_the_commander_of_the_guide_cuts_two_parts(machine, node):
    path = machine.file('part.ngc', PART)
    states = node.subscription(MachineState.ros_name, 'machine_state',
                               Qos(transient_local=True, depth=1000))
    child = start(machine, program_of('docs/commanding.md'), path)
    said, _ = child.communicate(timeout=120)
    assert child.returncode == 0, said
    seen = [state.state for state in states.take()]
    # It held and went on once, and changed both tools in both parts.
    assert MachineState.STATE_HOLD in seen
    assert said.count('held in line') == 1
    assert [said.count(f'the robot puts T{tool} in') for tool in (1, 2)] == [2, 2], said
    assert 'both parts are done' in said
    assert re.search(r'line \d+, 100 %', said), said
    # The correction is kept in the tool file, together with the comment.
    assert '-0.04' in (machine.folder / 'tools.yaml').read_text()
    assert 'the mill' in (machine.folder / 'tools.yaml').read_text()
    until_state(node, MachineState.STATE_IDLE)


def test_the_commander_says_why_a_program_is_refused(machine):
    path = machine.file('bad.ngc', 'G21\nG99.7 X1\nM30\n')
    child = start(machine, program_of('docs/commanding.md'), path)
    said, _ = child.communicate(timeout=60)
    assert child.returncode == 1
    assert 'bad.ngc is refused' in said and 'Traceback' not in said


def test_ctrl_c_cancels_the_run_of_the_commander(machine, node):
    path = machine.file('slow.ngc', 'G21 G90\nG0 X10\n' + 'G1 X110 F600\nX10\n' * 9 + 'M30\n')
    child = start(machine, program_of('docs/commanding.md'), path)
    until_state(node, MachineState.STATE_RUN)
    # It has its goal's answer with the first feedback.
    until('feedback', lambda: 'line' in child.stdout.readline())
    child.send_signal(signal.SIGINT)
    said, _ = child.communicate(timeout=60)
    assert child.returncode == 1, said
    assert 'the run is canceled' in said and '(code 313,' in said
    until_state(node, MachineState.STATE_IDLE)


def test_a_commander_that_is_killed_leaves_the_machine_held(machine, node):
    path = machine.file('slow.ngc', 'G21 G90\nG0 X10\n' + 'G1 X110 F600\nX10\n' * 9 + 'M30\n')
    child = start(machine, program_of('docs/commanding.md'), path)
    until_state(node, MachineState.STATE_RUN)
    # Only who gave signs of life is missed.
    node.subscription('std_msgs/msg/Header', 'commander_heartbeat').collect(4)
    child.kill()
    child.wait()
    held = until_state(node, MachineState.STATE_HOLD)
    assert 'COMMANDER_LOST' in held.reason
    assert node.client('std_srvs/srv/Trigger', 'cancel').call().success
    until_state(node, MachineState.STATE_IDLE)


def test_the_first_program_of_the_documents_runs(machine, node):
    path = machine.file('bracket.ngc', 'G21 G90\nG0 X5\nG1 X15 F3000\nM30\n')
    program = program_of('docs/ros.md').replace('/parts/bracket.ngc', path)
    assert path in program
    child = start(machine, program)
    said, _ = child.communicate(timeout=60)
    assert child.returncode == 0, said
    assert said.strip() == 'done'
