"""What most tests do before they begin: load a program and see it planned."""

from machine import CONTOUR
from ros2 import LATCHED


def load(node, patience=60.0, **request):
    """Loads a program and waits for its path; returns the answer and the manifest."""
    answer = node.client('cnc_msgs/srv/LoadProgram', 'load_program').call(
        patience=patience, **request)
    assert answer.success, answer.message
    paths = node.subscription('cnc_msgs/msg/CompensatedPath', 'compensated_path', LATCHED)
    path = paths.wait(lambda path: path.program_id == answer.program_id, patience)
    return answer, path


def load_demo(node):
    """The contour of the demo."""
    return load(node, path=str(CONTOUR), controller='sinumerik_840c')
