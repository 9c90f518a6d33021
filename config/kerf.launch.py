"""Starts the stack under `ros2 launch`, each node as a process of its own.

    ros2 launch kerf kerf.launch.py namespace:=/mill port:=/dev/ttyUSB0 tool_table:=tools.yaml
    ros2 launch kerf kerf.launch.py virtual_controller:=true time_factor:=10

Each is watched (`kerf node --watch`): one that is killed, hangs, is deaf or takes too much memory
is restarted; one that was asked to end, by its lifecycle or by a signal, stays away.

`kerf up` does the same without ROS, and stops the machine before its recorder; here all are
stopped at once, so the end of a run that is broken off may be missing from its bag.
"""

import os
import tempfile
from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.substitutions import ExecutableInPackage

NODES = ('program_loader', 'compensation_planner', 'axis_driver', 'run_recorder')

# Name, default, meaning.
ARGUMENTS = (
    ('namespace', '', 'namespace of the machine; two machines in one domain need two'),
    ('params_file', str(Path(__file__).with_name('kerf.yaml')), 'parameters of all nodes'),
    ('log_level', 'info', 'debug, info, warn, error or fatal'),
    ('port', '', "port of the controller, a device or a URL; empty: the parameters' own"),
    ('tool_table', '', "YAML file of the tools; empty: the parameters' own"),
    ('program_directories', '',
     "folders of programs that are loaded by path, with : between; empty: the parameters' own"),
    ('subroutine_directories', '',
     "folders of subroutines that programs call, with : between; empty: the parameters' own"),
    ('control_directories', '',
     "folders of profiles that requests name, with : between; empty: the parameters' own"),
    ('enclave', '', 'where the keys of the nodes are, /kerf for /kerf/axis_driver and so on'),
    ('virtual_controller', 'false', 'true: a virtual controller in place of the machine'),
    ('time_factor', '1', 'how many times faster than a real one it lives'),
)

# A driver brings its machine to a stop before it leaves, a recorder closes its bag. The watching
# process kills a node after 40 s.
LEAVE_WITHIN_S = '45'


def generate_launch_description():
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=default, description=meaning)
          for name, default, meaning in ARGUMENTS),
        OpaqueFunction(function=start),
    ])


def start(context):
    """The processes, once the arguments are known."""
    given = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    # What was given here counts more than the file.
    own = {name: {} for name in NODES}
    if given['tool_table']:
        own['compensation_planner']['tool_table'] = os.path.abspath(given['tool_table'])
    for name in ('program_directories', 'subroutine_directories', 'control_directories'):
        if given[name]:
            own['program_loader'][name] = [
                os.path.abspath(folder) for folder in given[name].split(':')]
    processes = []
    if given['virtual_controller'] == 'true':
        link = os.path.join(tempfile.gettempdir(), f'kerf-launch-{os.getpid()}-controller')
        given['port'] = link
        processes.append(ExecuteProcess(
            name='virtual_controller', output='screen',
            # No ROS node: it takes no arguments of ROS.
            cmd=[ExecutableInPackage(package='kerf', executable='kerf'), 'node',
                 'virtual_controller', '--link', link, '--time-factor', given['time_factor']]))
        factor = float(given['time_factor'])
        if factor > 1:
            # The axes are faster than their settings say, by the time factor.
            own['axis_driver']['rate_margin'] = 5.0 * factor
    if given['port']:
        own['axis_driver']['port'] = given['port']
    for name in NODES:
        processes.append(Node(
            # One binary is every node: one package to build.
            package='kerf', executable='kerf', arguments=['node', '--watch', name],
            namespace=given['namespace'],
            parameters=[given['params_file'], *([own[name]] if own[name] else [])],
            ros_arguments=['--log-level', given['log_level'], *keys(given['enclave'], name)],
            # The watching process restarts the node. It ends itself when the node was asked to.
            output='screen',
            sigterm_timeout=LEAVE_WITHIN_S, sigkill_timeout=LEAVE_WITHIN_S))
    return processes


def keys(enclave, name):
    """Each node has keys of its own, below what is named."""
    return ['--enclave', f'{enclave.rstrip("/")}/{name}'] if enclave else []
