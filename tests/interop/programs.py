"""What most tests do before they begin: load a program and see it planned."""

import time

from machine import CONTOUR
from ros2 import LATCHED, message

MachineState = message('cnc_msgs/msg/MachineState')

# A square of 40 mm, some tenths of a second of a machine in a hurry.
QUICK = 'G21 G90 G94 G17\nG0 X5 Y5\nG1 X45 F6000\nY45\nX5\nY5\nM30\n'
# Ten times there and back, 100 mm at 20 mm/s: ten seconds of a machine in a hurry, as a busy host may take some to
# find a new subscription.
SLOW = 'G21 G90 G94 G17\nG0 X10 Y10\nG1 X110 F1200\nX10\n' + 'X110\nX10\n' * 9 + 'M30\n'


def load(node, timeout=60.0, **request):
    """Loads a program and waits for its path; returns the answer and the manifest."""
    answer = node.client('cnc_msgs/srv/LoadProgram', 'load_program').call(
        timeout=timeout, **request)
    assert answer.success, answer.message
    paths = node.subscription('cnc_msgs/msg/CompensatedPath', 'compensated_path', LATCHED)
    path = paths.wait(lambda path: path.program_id == answer.program_id, timeout)
    return answer, path


def path_chunks(node, path):
    """All chunks of a path."""
    client = node.client('cnc_msgs/srv/GetPathChunks', 'compensated_path/get_chunks')
    chunks = []
    while len(chunks) < path.chunk_count:
        answer = client.call(first=len(chunks), program_id=path.program_id, revision=path.revision)
        assert answer.success, answer.message
        chunks += answer.chunks
    return chunks


def load_demo(node):
    """The contour of the demo."""
    return load(node, text=CONTOUR.read_text(), name=CONTOUR.name, control='sinumerik_840c')


def states(node):
    """The state of the machine, as it changes."""
    return node.subscription(MachineState.ros_name, 'machine_state', LATCHED)


def until_state(node, *wanted):
    """Waits until the machine is in one of these states.

    The newest one of before may be there first: it does not count.
    """
    since = time.time()

    def is_meant(state):
        stamp = state.header.stamp
        return state.state in wanted and stamp.sec + stamp.nanosec / 1e9 >= since
    return states(node).wait(is_meant)


def settle(node, *names):
    """Lets nodes take notice of the subscriptions that were just made.

    A publisher sends nothing to a subscription that it has not discovered yet; a node that
    answers to an endpoint that was made later has discovered it.
    """
    for name in names:
        node.client('rcl_interfaces/srv/ListParameters', f'{name}/list_parameters').call()
