"""Numbered parameters that a run leaves to the next program, in the file of the loader."""

import pytest

from chosen import Machine
from programs import SLOW, MachineState, load, until_state
from ros2 import ActionClient, message, until

DiagnosticArray = message('diagnostic_msgs/msg/DiagnosticArray')

COUNTER = 'G21 G90\n#31=[#31+1]\nG0 X#31\nM30\n'


@pytest.fixture(scope='module')
def machine():
    made = Machine(ros_args=('-p', 'program_loader:parameter_file:=mill.var')).until_idle()
    yield made
    made.stop()


@pytest.fixture
def runs(node):
    until_state(node, MachineState.STATE_IDLE)
    return ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program')


def until_told(told, text):
    told.wait(lambda array: any(text in status.message for status in array.status))


def test_a_finished_run_counts_and_no_other_run_does(machine, node, runs):
    file = machine.folder / 'mill.var'
    file.write_text('# parts\n31\t7.000000\n5220\t1.000000\n')
    load(node, text=COUNTER, name='counter.ngc')
    assert runs.send_goal(check_only=True).result().result.outcome == 1

    # A run that does not come to its end.
    load(node, text=SLOW.replace('M30', '#31=[#31+1]\nM30'), name='slow.ngc')
    canceled = runs.send_goal()
    canceled.wait_for_feedback(lambda feedback: feedback.state == MachineState.STATE_RUN)
    canceled.cancel()
    canceled.result()
    until_state(node, MachineState.STATE_IDLE, MachineState.STATE_HOLD)
    assert file.read_text() == '# parts\n31\t7.000000\n5220\t1.000000\n'

    for count in (8, 9):
        load(node, text=COUNTER, name='counter.ngc')
        assert runs.send_goal().result().result.outcome == 1
        wanted = f'# parts\n31\t{count}.0\n5220\t1.000000\n'
        until('the count in the file', lambda: file.read_text() == wanted)
        # The program has read it.
        state = until_state(node, MachineState.STATE_IDLE)
        assert abs(state.work_position.x - count / 1000) < 1e-6
    assert 'load it again to go on with the new ones' in machine.log()

    # What is loaded began with 8: once more it does not count, and that is said.
    with machine.node('watcher') as watcher:
        told = watcher.subscription(DiagnosticArray.ros_name, '/diagnostics')
        assert runs.send_goal().result().result.outcome == 1
        until_told(told, '#31 is 9 in it, and the program began with 8; load the program again')
        assert file.read_text() == wanted

        # A program that only sets it needs no load between its runs.
        load(node, text=COUNTER.replace('[#31+1]', '3'), name='sets.ngc')
        for by_hand in ('9', '5'):
            file.write_text(f'# parts\n31 {by_hand}\n')
            assert runs.send_goal().result().result.outcome == 1
            until('3 in the file', lambda: file.read_text() == '# parts\n31\t3.0\n')


def test_a_file_that_is_gone_after_the_run_is_said(machine, node, runs):
    file = machine.folder / 'mill.var'
    file.write_text('31 1\n')
    load(node, text=COUNTER, name='counter.ngc')
    file.unlink()
    with machine.node('watcher') as watcher:
        told = watcher.subscription(DiagnosticArray.ros_name, '/diagnostics')
        assert runs.send_goal().result().result.outcome == 1
        until_told(told, 'mill.var was not changed after a run: No such file')
    assert not file.exists()
