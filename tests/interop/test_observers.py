"""What a dashboard, a log viewer and a recorder of bags get."""

import time

import pytest

from contract import NODES
from programs import QUICK, MachineState, load, settle, until_state
from ros2 import DEFAULT, LATCHED, ActionClient, Qos, message, until
from ros2.graph import Graph

Status = message('diagnostic_msgs/msg/DiagnosticStatus')
Log = message('rcl_interfaces/msg/Log')


@pytest.fixture
def health(machine, node):
    """Waits for the health of a node for which something holds."""
    arrays = node.subscription('diagnostic_msgs/msg/DiagnosticArray', '/diagnostics',
                               Qos(depth=100))

    def wait(name, what=lambda _: True):
        prefix = f'{machine.namespace[1:]}/{name}: '
        def found(array):
            # One status of a part, and one of the lifecycle.
            return [it for it in array.status if it.name.startswith(prefix) and what(it)]
        return found(arrays.wait(found))[0]
    return wait


@pytest.mark.parametrize('name', NODES)
def test_every_node_tells_its_health(health, name):
    status = health(name)
    assert status.level == Status.OK
    assert status.message


def test_health_comes_once_a_second(machine, node):
    arrays = node.subscription('diagnostic_msgs/msg/DiagnosticArray', '/diagnostics',
                               Qos(depth=100))
    stamps = {name: [] for name in NODES}

    def enough():
        for array in arrays.take():
            for name in NODES:
                if array.status[0].name.startswith(f'{machine.namespace[1:]}/{name}:'):
                    stamps[name].append(array.header.stamp.sec
                                        + array.header.stamp.nanosec / 1e9)
        return all(len(seen) >= 4 for seen in stamps.values())
    until('four messages of each node', enough)
    for name, seen in stamps.items():
        period = (seen[-1] - seen[0]) / (len(seen) - 1)
        # On a busy host any of them may be late, and the next one keeps its time.
        assert 0.5 < period < 5.0, name


def test_a_refused_program_is_a_warning_until_another_one_is_loaded(node, health):
    node.client('cnc_msgs/srv/LoadProgram', 'load_program').call(text='G99.7\n', name='bad.ngc')
    status = health('program_loader', lambda status: status.level == Status.WARN)
    assert 'bad.ngc' in status.message
    load(node, text=QUICK, name='quick.ngc')
    health('program_loader', lambda status: status.level == Status.OK
           and status.message == 'quick.ngc is loaded')
    health('compensation_planner', lambda status: status.message == 'quick.ngc is planned')


def test_who_looks_at_the_log_later_sees_what_was_said_before(machine, node):
    load(node, text=QUICK, name='heard.ngc')
    with machine.node('latecomer') as late:
        log = late.subscription(Log.ros_name, '/rosout', Qos(transient_local=True, depth=1000))
        line = log.wait(lambda line: 'heard.ngc is loaded' in line.msg)
    assert line.level == Log.INFO
    # Dots for slashes, as loggers of ROS 2 are named.
    assert line.name == f'{machine.namespace[1:]}.program_loader'
    assert line.stamp.sec > 0 and line.file and line.line


@pytest.mark.dds
def test_every_command_is_published_with_its_sender_and_its_answer(node):
    commands = node.subscription('cnc_msgs/msg/Command', 'command_log', Qos(depth=100))
    settle(node, 'axis_driver')
    client = node.client('std_srvs/srv/Trigger', 'confirm_tool_change')
    answer = client.call()
    logged = commands.wait(lambda command: command.endpoint.endswith('/confirm_tool_change'))
    assert logged.node == node.resolve('axis_driver')
    assert logged.endpoint_type == 'std_srvs/srv/Trigger'
    assert (logged.success, logged.message) == (answer.success, answer.message)
    # The first twelve bytes name the process.
    assert bytes(logged.sender)[:12] == node.participant.get_guid().bytes[:12]


def test_the_machine_moves_on_the_screen(machine, node):
    until_state(node, MachineState.STATE_IDLE)
    frames = node.subscription('tf2_msgs/msg/TFMessage', '/tf', Qos(depth=100))
    poses = node.subscription('geometry_msgs/msg/PoseStamped', 'tool_pose', DEFAULT)
    joints = node.subscription('sensor_msgs/msg/JointState', 'joint_states', DEFAULT)
    settle(node, 'axis_driver')
    load(node, text=QUICK, name='quick.ngc')
    runs = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program')
    assert runs.send_goal().result().status == 4
    pose = poses.wait()
    # Nothing is drawn without a frame and a time.
    assert pose.header.frame_id and pose.header.stamp.sec > 0
    joint = joints.wait()
    assert joint.name == ['x', 'y', 'z'] and len(joint.position) == 3
    seen = {(transform.header.frame_id, transform.child_frame_id)
            for transform in frames.wait(lambda message: message.transforms).transforms}
    machine_frame, work, tool = (
        f'{machine.namespace[1:]}/{frame}' for frame in ('machine', 'work', 'tool0'))
    assert (machine_frame, work) in seen and (work, tool) in seen


def test_the_preview_is_the_path_in_the_work_frame(machine, node):
    # A program of its own: of one that is loaded again, the path of before has the same id.
    _, path = load(node, text='(preview)\n' + QUICK, name='preview.ngc')
    preview = node.subscription('nav_msgs/msg/Path', 'compensated_path/preview', LATCHED).wait(
        lambda preview: preview.header.stamp == path.header.stamp)
    work = f'{machine.namespace[1:]}/work'
    assert preview.header.frame_id == work
    corners = [(round(pose.pose.position.x, 6), round(pose.pose.position.y, 6))
               for pose in preview.poses]
    assert corners[-4:] == [(0.045, 0.005), (0.045, 0.045), (0.005, 0.045), (0.005, 0.005)]
    markers = node.subscription(
        'visualization_msgs/msg/MarkerArray', 'markers', LATCHED).newest()
    assert {marker.header.frame_id for marker in markers.markers} == {work}


@pytest.mark.dds
def test_a_recorder_of_bags_can_subscribe_everything_with_what_is_offered(machine, node):
    graph = Graph(node)
    until('the graph', lambda: node.resolve('recording') in graph.publishers())
    # A reader of feedback has no file for its type; all others have.
    seen = {}
    for end in graph.writers():
        if end.topic and end.dds_type and machine.namespace in end.topic:
            seen[end.topic] = node.subscription(
                end.type, end.topic, Qos(end.reliable, end.transient_local, 1000))
    settle(node, *NODES)
    load(node, text=QUICK, name='quick.ngc')
    runs = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program')
    assert runs.send_goal().result().status == 4
    expected = {node.resolve(topic) for topic in (
        'program', 'program/chunks', 'programmed_contour', 'programmed_contour/chunks',
        'compensated_path', 'compensated_path/chunks', 'compensated_path/preview', 'markers',
        'compensation_report', 'tool_table', 'machine_state', 'controller_settings',
        'run_result', 'controller_traffic', 'joint_states', 'tool_pose', 'recording', 'command_log',
        'node_parameters', 'run_program/_action/status', 'run_program/_action/feedback')}
    got = set()

    def all_there():
        got.update(topic for topic, it in seen.items() if topic not in got and it.take())
        return expected <= got
    until('a message of every topic', all_there)


def test_traffic_is_numbered_without_a_gap(node):
    until_state(node, MachineState.STATE_IDLE)
    traffic = node.subscription('cnc_msgs/msg/ControllerTraffic', 'controller_traffic',
                                Qos(depth=1000))
    settle(node, 'axis_driver')
    load(node, text=QUICK, name='quick.ngc')
    runs = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program')
    assert runs.send_goal().result().status == 4
    time.sleep(0.2)
    numbers = [entry.sequence for batch in traffic.take() for entry in batch.entries]
    # At least each line and its answer.
    assert len(numbers) >= 2 * QUICK.count('\n')
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
