"""Parameters: all six services, descriptors, and the events."""

import subprocess

import pytest

from contract import NODES
from machine import kerf
from programs import QUICK, load, settle
from ros2 import ActionClient, ParameterClient, Qos, message, until

ParameterType = message('rcl_interfaces/msg/ParameterType')


@pytest.fixture
def loader(node):
    """The parameters of the loader."""
    return ParameterClient(node, 'program_loader')


@pytest.fixture
def driver(node):
    return ParameterClient(node, 'axis_driver')


@pytest.mark.parametrize('name', NODES)
def test_every_parameter_of_a_node_has_a_value_a_type_and_a_description(node, name):
    parameters = ParameterClient(node, name)
    names = parameters.list().names
    assert 'use_sim_time' in names
    assert None not in parameters.get(*names)
    descriptors = parameters.describe(*names)
    assert [it.name for it in descriptors] == names
    assert [it.type for it in descriptors] == parameters.types(*names)
    assert all(it.description for it in descriptors)


def test_a_value_is_what_the_node_was_started_with(driver):
    assert driver.get('poll_interval_ms', 'baud') == [500, 115_200]
    assert driver.types('poll_interval_ms', 'frame_prefix', 'position_mm_max') == [
        ParameterType.PARAMETER_INTEGER, ParameterType.PARAMETER_STRING,
        ParameterType.PARAMETER_DOUBLE]


def test_a_range_is_described(driver):
    [poll, position] = driver.describe('poll_interval_ms', 'position_mm_max')
    assert [(it.from_value, it.to_value) for it in poll.integer_range] == [(50, 1000)]
    assert [(it.from_value, it.to_value) for it in position.floating_point_range] == [
        (1.0, 100_000.0)]


def test_a_parameter_that_is_not_there_is_not_set(loader):
    assert loader.get('nothing') == [None]
    assert loader.types('nothing') == [ParameterType.PARAMETER_NOT_SET]


def test_an_answer_of_a_megabyte_arrives(driver):
    assert driver.get(*['frame_prefix', 'baud'] * 10_000) == ['', 115_200] * 10_000


def test_names_are_listed_by_prefix(driver):
    assert driver.list('baud').names == ['baud']
    assert driver.list('no_such_prefix').names == []


def test_a_parameter_is_set_and_everybody_hears_of_it(node, loader):
    events = node.subscription('rcl_interfaces/msg/ParameterEvent', '/parameter_events',
                               Qos(depth=1000))
    settle(node, 'program_loader')
    for value in (True, False):
        [result] = loader.set(use_sim_time=value)
        assert result.successful, result.reason
        assert loader.get('use_sim_time') == [value]
        event = events.wait(lambda event: event.changed_parameters
                            and event.node == node.resolve('program_loader'))
        [changed] = event.changed_parameters
        assert (changed.name, changed.value.bool_value) == ('use_sim_time', value)


def test_a_value_of_another_type_is_refused(loader):
    [result] = loader.set(use_sim_time=5)
    assert not result.successful
    assert 'use_sim_time' in result.reason and 'bool' in result.reason
    assert loader.get('use_sim_time') == [False]


def test_a_read_only_parameter_is_refused(loader):
    [descriptor] = loader.describe('frame_id')
    assert descriptor.read_only
    [result] = loader.set(frame_id='elsewhere')
    assert not result.successful and 'frame_id' in result.reason
    assert loader.get('frame_id') == ['work']


def test_a_parameter_that_nobody_declared_is_refused(loader):
    [result] = loader.set(nothing=1)
    assert not result.successful and 'nothing' in result.reason


def test_a_parameter_cannot_be_removed(loader):
    [result] = loader.set(use_sim_time=None)
    assert not result.successful
    assert loader.get('use_sim_time') == [False]


def test_one_by_one_the_good_ones_are_set(loader):
    bad, good = loader.set(nothing=1, use_sim_time=True)
    assert (bad.successful, good.successful) == (False, True)
    assert loader.get('use_sim_time') == [True]
    loader.set(use_sim_time=False)


def test_atomically_it_is_all_or_nothing(loader):
    result = loader.set_atomically(use_sim_time=True, nothing=1)
    assert not result.successful and 'nothing' in result.reason
    assert loader.get('use_sim_time') == [False]
    assert loader.set_atomically(use_sim_time=True).successful
    assert loader.get('use_sim_time') == [True]
    assert loader.set_atomically(use_sim_time=False).successful


def test_the_driver_is_tuned_between_runs_and_the_recorder_writes_elsewhere(node, machine, driver):
    [result] = driver.set(commander_timeout_ms=2500)
    assert result.successful, result.reason
    assert driver.get('commander_timeout_ms') == [2500]
    [result] = driver.set(baud=9600)
    assert not result.successful and 'start of the node' in result.reason
    recorder = ParameterClient(node, 'run_recorder')
    [kept] = recorder.get('directory')
    [result] = recorder.set(directory='/proc/nowhere')
    assert not result.successful and '/proc/nowhere' in result.reason
    elsewhere = str(machine.folder / 'other bags')
    for folder in (elsewhere, kept):
        [result] = recorder.set(directory=folder)
        assert result.successful, result.reason
    assert (machine.folder / 'other bags').is_dir()
    [result] = driver.set(commander_timeout_ms=1000)
    assert result.successful, result.reason


def test_the_bag_of_a_tuned_driver_replays(node, machine, driver):
    [result] = driver.set(hold_latency_ms_max=8)
    assert result.successful, result.reason
    loaded, _ = load(node, text=QUICK, name='quick.ngc')
    runs = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program')
    goal = runs.send_goal(program_id=loaded.program_id)
    assert goal.accepted
    goal.result()
    [bags] = ParameterClient(node, 'run_recorder').get('directory')
    until('the bag to be complete', lambda: 'is complete' in machine.log())
    [bag] = (machine.folder / bags).glob('run_*')
    replay = subprocess.run([kerf(), 'replay', bag], capture_output=True, text=True, check=False)
    assert replay.returncode == 0, replay.stdout + replay.stderr
    [result] = driver.set(hold_latency_ms_max=20)
    assert result.successful, result.reason
