"""A machine of real processes: `kerf up` with a virtual controller, in a folder of its own.

Knows where the command is and how its processes are found and ended. What the nodes say
over ROS is for the tests.
"""

import ctypes
import itertools
import os
import signal
import subprocess
import tempfile
from pathlib import Path

from ros2 import LATCHED, NoAnswer, Node, message, until

ROOT = Path(__file__).resolve().parents[2]
CONTOUR = ROOT / 'config/demo/contour.mpf'
TOOLS = ROOT / 'config/demo/tools.yaml'
MachineState = message('cnc_msgs/msg/MachineState')

_count = itertools.count()


def kerf():
    """The command, as it was built last; `KERF` says another one."""
    target = Path(os.environ.get('CARGO_TARGET_DIR', ROOT / 'target'))
    return Path(os.environ.get('KERF', target / 'debug' / 'kerf'))


def die_with_parent():
    """For a child, before it begins: nothing is left of tests that crash."""
    pr_set_pdeathsig = 1
    ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGKILL)


def domain():
    """A domain that hardly anybody else has."""
    return int(os.environ.get('ROS_DOMAIN_ID') or 40 + os.getpid() * 11 % 56)


class Machine:
    """`kerf up`, its nodes, and a controller that lives `time_factor` times as fast.

    `variables` of the environment, or what makes them from the namespace.
    """

    def __init__(self, time_factor=10, ros_args=(), args=(), tools=None,
                 rmw='rmw_cyclonedds_cpp', variables=()):
        number = f'{os.getpid()}_{next(_count)}'
        # A word that no other process on this host has in its command line.
        self.namespace = f'/mill_{number}'
        self.domain_id = domain()
        self._folder = tempfile.TemporaryDirectory(prefix='kerf-interop-')
        self.folder = Path(self._folder.name)
        # A copy: set_tool writes it.
        (self.folder / 'tools.yaml').write_text(tools or TOOLS.read_text())
        self._log = open(self.folder / 'up.log', 'wb')
        environment = {name: value for name, value in os.environ.items()
                       if not name.startswith(('ROS_', 'RMW_'))}
        environment |= {'ROS_DOMAIN_ID': str(self.domain_id), 'RMW_IMPLEMENTATION': rmw,
                        **(variables(self.namespace) if callable(variables) else dict(variables))}
        self._up = subprocess.Popen(
            [kerf(), 'up', '--virtual-controller', '--time-factor', str(time_factor), *args,
             '--ros-args', '-r', f'__ns:={self.namespace}',
             '-p', 'run_recorder:directory:=bags',
             '-p', 'compensation_planner:tool_table:=tools.yaml',
             # A controller on a busy host is not silent for missing three questions.
             '-p', 'axis_driver:poll_interval_ms:=500', *ros_args],
            cwd=self.folder, env=environment, stdin=subprocess.DEVNULL,
            stdout=self._log, stderr=self._log, start_new_session=True,
            preexec_fn=die_with_parent)
        # Where `kerf up` has the port of its controller.
        self._link = f'kerf-{self._up.pid}-controller'

    def node(self, name='cell'):
        """A node of a test, in the namespace of the machine."""
        return Node(name, self.namespace, self.domain_id)

    def until_idle(self):
        with self.node('looks_on') as node:
            states = node.subscription(MachineState.ros_name, 'machine_state', LATCHED)
            try:
                states.wait(lambda state: state.state == MachineState.STATE_IDLE)
            except NoAnswer as silence:
                said = self.log()
                self.stop()
                raise NoAnswer(f'{silence}; the log of {self.namespace}:\n{said}') from None
        return self

    def file(self, name, text):
        """A program for the loader."""
        path = self.folder / name
        path.write_text(text)
        return str(path)

    def log(self):
        return (self.folder / 'up.log').read_text(errors='replace')

    def processes(self):
        """The nodes, by name."""
        found = {}
        for entry in Path('/proc').iterdir():
            if not entry.name.isdigit():
                continue
            try:
                words = (entry / 'cmdline').read_bytes().decode(errors='replace').split('\0')
            except OSError:
                continue
            is_ours = any(self.namespace in word.split(':=') or self._link in word
                          for word in words)
            if is_ours and 'node' in words[:2]:
                found[next(word for word in words[2:] if not word.startswith('-'))] = int(entry.name)
        return found

    def stop(self):
        """Ends it at once: nodes leave when what started them is gone."""
        self._up.kill()
        self._up.wait()
        try:
            until('the end of all nodes', lambda: not self.processes(), timeout=30)
        finally:
            for pid in self.processes().values():
                os.kill(pid, signal.SIGKILL)
            (Path(tempfile.gettempdir()) / self._link).unlink(missing_ok=True)
            self._log.close()
            self._folder.cleanup()
