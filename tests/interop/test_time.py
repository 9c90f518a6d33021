"""`use_sim_time`: the nodes live in the time of `/clock`."""

import pytest

from contract import NODES
from chosen import Machine
from programs import QUICK, MachineState, settle
from ros2 import LATCHED, ParameterClient, Qos, message, service, until

Clock = message('rosgraph_msgs/msg/Clock')
Time = message('builtin_interfaces/msg/Time')


@pytest.fixture(scope='module')
def machine():
    """A machine that waits for `/clock` from its start."""
    made = Machine(ros_args=['-p', 'use_sim_time:=true'])
    yield made
    made.stop()


@pytest.fixture
def clock(node):
    """Sets the time."""
    # As rclcpp publishes it: best effort, the newest.
    publisher = node.publisher(Clock.ros_name, '/clock', Qos(reliable=False, depth=1))
    publisher.wait_for_subscribers(4)
    return lambda sec: publisher.publish(Clock(clock=Time(sec=sec, nanosec=0)))


def test_the_nodes_start_with_simulated_time(node):
    for name in NODES:
        assert ParameterClient(node, name).get('use_sim_time') == [True]


def test_stamps_are_those_of_the_clock(node, clock):
    states = node.subscription(MachineState.ros_name, 'machine_state', LATCHED)
    for second in (1000, 2000):
        until(f'the time {second}', lambda: clock(second) or any(
            # The time of the report, which is a little older than the message.
            0 <= second - state.header.stamp.sec <= 10 for state in states.take()))


def test_what_is_loaded_then_is_of_that_time(node, clock):
    programs = node.subscription('cnc_msgs/msg/Program', 'program', LATCHED)
    log = node.subscription('rcl_interfaces/msg/Log', '/rosout', Qos(depth=1000))
    settle(node, 'program_loader')
    loader = node.client(service('cnc_msgs/srv/LoadProgram').name, 'load_program')
    until('the time 3000', lambda: clock(3000) or (
        loader.call(text=QUICK, name='quick.ngc').success
        and programs.newest().stamp.sec == 3000))
    log.wait(lambda line: 'quick.ngc is loaded' in line.msg and line.stamp.sec == 3000)


def test_a_node_can_be_taken_out_of_simulated_time(node, clock):
    loader = ParameterClient(node, 'program_loader')
    assert loader.set(use_sim_time=False)[0].successful
    node.client('cnc_msgs/srv/LoadProgram', 'load_program').call(text=QUICK, name='quick.ngc')
    programs = node.subscription('cnc_msgs/msg/Program', 'program', LATCHED)
    programs.wait(lambda program: program.stamp.sec > 1_700_000_000)
