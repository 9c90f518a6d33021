"""The programs in the documentation do what their pages say, as printed, with real rclpy."""

import os
import signal
import subprocess
import time

import pytest

from documented import PART, TOOLS, program_of, start
from machine import Machine, kerf
from ros2 import until

# Some two minutes of cutting.
LONG = 'G21 G90\nG0 X10\n' + 'G1 X110 F600\nX10\n' * 9 + 'M30\n'


@pytest.fixture(scope='module')
def machine():
    """Slower than the other: it is held in the middle of a part."""
    made = Machine(time_factor=4, tools=TOOLS, rmw='rmw_fastrtps_cpp').until_idle()
    yield made
    made.stop()


def command(machine, *words):
    """What a command says of the machine."""
    environment = os.environ | {'ROS_DOMAIN_ID': str(machine.domain_id)}
    ran = subprocess.run([kerf(), *words, '--ros-args', '-r', f'__ns:={machine.namespace}'],
                         env=environment, capture_output=True, text=True)
    return ran.stdout


def until_status(machine, *words):
    """Waits for words in the status of the machine."""
    until(words, lambda: all(word in command(machine, 'status') for word in words))


def test_the_commander_of_the_guide_cuts_two_parts(machine):
    path = machine.file('part.ngc', PART)
    child = start(machine, program_of('docs/commanding.md'), path)
    said, _ = child.communicate(timeout=180)
    assert child.returncode == 0, said
    assert said.count('held in line') == 1
    assert [said.count(f'the robot puts T{tool} in') for tool in (1, 2)] == [2, 2], said
    assert 'both parts are done' in said
    # The correction is kept in the tool file.
    assert '-0.04' in (machine.folder / 'tools.yaml').read_text()


def test_the_commander_says_why_a_program_is_refused(machine):
    path = machine.file('bad.ngc', 'G21\nG99.7 X1\nM30\n')
    child = start(machine, program_of('docs/commanding.md'), path)
    said, _ = child.communicate(timeout=60)
    assert child.returncode == 1, said
    assert 'bad.ngc is refused' in said and 'Traceback' not in said


def test_ctrl_c_cancels_the_run_of_the_commander(machine):
    path = machine.file('slow.ngc', LONG)
    child = start(machine, program_of('docs/commanding.md'), path)
    # It has its goal's answer with the first feedback.
    while 'line' not in child.stdout.readline():
        assert child.poll() is None
    child.send_signal(signal.SIGINT)
    said, _ = child.communicate(timeout=60)
    assert child.returncode == 1, said
    assert 'the run is canceled' in said and '(code 313,' in said


def test_a_commander_that_is_killed_leaves_the_machine_held(machine):
    child = start(machine, program_of('docs/commanding.md'), machine.file('slow.ngc', LONG))
    until_status(machine, 'RUN')
    # Only who gave signs of life is missed.
    time.sleep(2)
    child.kill()
    child.wait()
    until_status(machine, 'HOLD', 'COMMANDER_LOST')
    command(machine, 'abort')
    until_status(machine, 'IDLE')


def run(machine, text):
    """Loads and runs a program by command; status and what was said."""
    path = machine.file('called.ngc', text)
    environment = os.environ | {'ROS_DOMAIN_ID': str(machine.domain_id)}
    said = ''
    for words in (['load', path], ['run']):
        ran = subprocess.run(
            [kerf(), *words, '--ros-args', '-r', f'__ns:={machine.namespace}'],
            env=environment, capture_output=True, text=True, timeout=120)
        said += ran.stdout + ran.stderr
        if ran.returncode != 0:
            break
    return ran.returncode, said


def test_the_cell_does_the_functions_of_the_user(machine):
    called = 'G21 G90\nG1 X1 F3000\nM101 P2\nX2\nM101 P3\nM30\n'
    status, said = run(machine, called)
    assert status != 0 and 'line 3: M101 P2: ' in said and 'nobody offers' in said, said
    child = start(machine, program_of('docs/commanding.md', 1))
    try:
        for tries in range(20):
            status, said = run(machine, called)
            if status == 0:
                break
            time.sleep(1)
        assert status == 0, said
        status, said = run(machine, called.replace('P3', ''))
        assert status != 0 and 'line 5: M101: this cell has M101 with P' in said, said
    finally:
        child.send_signal(signal.SIGINT)
    said, _ = child.communicate(timeout=60)
    assert [line for line in said.splitlines() if 'robot' in line] == [
        f'line {line}: the robot takes the part of place {place}'
        for line, place in ((3, 2), (5, 3))], said


def test_the_first_program_of_the_documents_runs(machine):
    path = machine.file('bracket.ngc', 'G21 G90\nG0 X5\nG1 X15 F3000\nM30\n')
    program = program_of('docs/ros.md').replace('/parts/bracket.ngc', path)
    assert path in program
    child = start(machine, program)
    said, _ = child.communicate(timeout=60)
    assert child.returncode == 0, said
    assert said.strip().endswith('done')
