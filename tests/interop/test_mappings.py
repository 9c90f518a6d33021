"""A peer of another middleware than the nodes were started for.

Services of `rmw_fastrtps_cpp` and `rmw_cyclonedds_cpp` do not understand each other, in
ROS 2 itself no more than here. Topics do. What must not happen is that a request is taken
for another one.
"""

import os
import subprocess
import uuid

import pytest

from machine import Machine, kerf
from programs import QUICK, MachineState, until_state
from ros2 import ActionClient, ParameterClient, Qos, message, until
from ros2.actions import goal_id
from ros2.parameters import to_wire


@pytest.fixture(scope='module')
def machine():
    """A machine for peers on Fast DDS."""
    made = Machine(rmw='rmw_fastrtps_cpp').until_idle()
    yield made
    made.stop()


@pytest.mark.parametrize('type_name, name, request_fields', [
    ('std_srvs/srv/Trigger', 'soft_reset', {}),
    ('std_srvs/srv/Trigger', 'feed_hold', {}),
    ('std_srvs/srv/SetBool', 'single_block', {'data': True}),
    ('cnc_msgs/srv/LoadProgram', 'load_program', {'text': QUICK, 'name': 'quick.ngc'}),
    ('cnc_msgs/srv/SetTool', 'set_tool', {'offset_number': 1, 'mask': 1, 'diameter': 0.008}),
    ('cnc_msgs/srv/SetOverrides', 'set_overrides', {'which': 1, 'feed': 0.5}),
    ('cnc_msgs/srv/ExecuteMdi', 'execute_mdi', {'text': 'G0 X50'}),
])
def test_a_request_of_another_middleware_is_passed_over_with_a_reason(
        machine, node, type_name, name, request_fields):
    commands = node.subscription('cnc_msgs/msg/Command', 'command_log', Qos(depth=100))
    commands.wait_for_publishers(3)
    client = node.client(type_name, name).wait_for_service()
    number = client.send(**request_fields)
    gid = client.gid().hex()
    sender = '.'.join(gid[start:start + 8] for start in (0, 8, 16)) + '|' + gid[24:]
    until('a word in the log', lambda: sender in machine.log())
    [line] = [line for line in machine.log().splitlines() if sender in line]
    assert 'RMW_IMPLEMENTATION' in line
    assert client.answer(number) is None
    assert commands.take() == []
    assert until_state(node, MachineState.STATE_IDLE).feed_override == 1.0


def test_a_goal_of_another_middleware_is_not_begun(machine, node):
    runs = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program').wait_for_server()
    sending = runs._send_goal
    number = sending.send(goal_id=goal_id(uuid.uuid4().bytes), goal=runs.kind.Goal())
    gid = sending.gid().hex()
    until('a word in the log', lambda: f'|{gid[24:]}' in machine.log())
    assert sending.answer(number) is None
    assert until_state(node, MachineState.STATE_IDLE)


def test_a_parameter_of_another_middleware_is_not_set(machine, node):
    setting = ParameterClient(node, 'program_loader')._clients['set_parameters']
    setting.wait_for_service()
    setting.send(parameters=[to_wire('use_sim_time', True)])
    gid = setting.gid().hex()
    until('a word in the log', lambda: f'|{gid[24:]}' in machine.log())
    assert 'use_sim_time' not in machine.log()


def test_kerf_status_names_the_other_middleware(machine, node):
    node.subscription('std_msgs/msg/Bool', 'feed_hold')
    environment = {name: value for name, value in os.environ.items()
                   if not name.startswith(('ROS_', 'RMW_'))}
    environment['ROS_DOMAIN_ID'] = str(machine.domain_id)
    status = subprocess.run(
        [kerf(), 'status', '--ros-args', '-r', f'__ns:={machine.namespace}'],
        env=environment, capture_output=True, text=True, timeout=60, check=True)
    assert '1 participant of this ROS domain uses rmw_cyclonedds_cpp, and this node ' \
        'rmw_fastrtps_cpp: ' in status.stdout


def test_topics_work_across_middlewares(node):
    hold = node.publisher('std_msgs/msg/Bool', 'feed_hold').wait_for_subscribers()
    hold.publish(message('std_msgs/msg/Bool')(data=True))
    until_state(node, MachineState.STATE_HOLD)
