"""As much of `launch` and `launch_ros` as the launch file of the stack uses.

Neither can be had without ROS 2. Arguments are checked against the names that Jazzy knows,
and commands are put together as `launch_ros.actions.Node` does.
"""

import importlib.util
import sys
import tempfile
import types

import ruamel.yaml

# Of ExecuteProcess and what it is made of.
PROCESS = {'name', 'cwd', 'env', 'additional_env', 'output', 'respawn', 'respawn_delay',
           'sigterm_timeout', 'sigkill_timeout', 'emulate_tty', 'prefix', 'shell', 'condition',
           'on_exit'}


class Context:
    def __init__(self, arguments, executables):
        self.launch_configurations, self.executables = arguments, executables


class LaunchConfiguration:
    def __init__(self, variable_name):
        self._name = variable_name

    def perform(self, context):
        return context.launch_configurations[self._name]


class ExecutableInPackage:
    def __init__(self, executable, package):
        self._executable, self._package = executable, package

    def perform(self, context):
        return context.executables[self._package, self._executable]


class DeclareLaunchArgument:
    def __init__(self, name, *, default_value=None, description=None, choices=None):
        assert isinstance(default_value, (str, type(None))) and description
        self.name, self.default_value, self.description = name, default_value, description


class OpaqueFunction:
    def __init__(self, *, function):
        self.function = function


class LaunchDescription:
    def __init__(self, initial_entities):
        self.entities = list(initial_entities)


class ExecuteProcess:
    def __init__(self, *, cmd, **options):
        assert options.keys() <= PROCESS, options
        self._cmd = cmd

    def command(self, context):
        return [word if isinstance(word, str) else word.perform(context) for word in self._cmd]


class Node:
    def __init__(self, *, executable, package, namespace=None, name=None, parameters=(),
                 arguments=(), ros_arguments=(), **options):
        assert options.keys() <= PROCESS - {'name'}, options
        self._executable = ExecutableInPackage(executable, package)
        self._namespace, self._name = namespace, name
        self._parameters, self._arguments = parameters, arguments
        self._ros_arguments = ros_arguments

    def command(self, context):
        words = [self._executable.perform(context), *self._arguments, '--ros-args',
                 *self._ros_arguments]
        if self._name:
            words += ['-r', f'__node:={self._name}']
        if self._namespace:
            words += ['-r', f'__ns:={self._namespace}']
        for given in self._parameters:
            words += ['--params-file', given if isinstance(given, str) else _file(given)]
        return words


def _file(parameters):
    """Parameters that are given one by one go into a file, too."""
    with tempfile.NamedTemporaryFile('w', dir=_FOLDER.name, delete=False) as file:
        ruamel.yaml.YAML().dump({'/**': {'ros__parameters': parameters}}, file)
    return file.name


# Gone with the tests.
_FOLDER = tempfile.TemporaryDirectory(prefix='launch_params_')


MODULES = {
    'launch': {'LaunchDescription': LaunchDescription},
    'launch.actions': {'DeclareLaunchArgument': DeclareLaunchArgument,
                       'ExecuteProcess': ExecuteProcess, 'OpaqueFunction': OpaqueFunction},
    'launch.substitutions': {'LaunchConfiguration': LaunchConfiguration},
    'launch_ros': {},
    'launch_ros.actions': {'Node': Node},
    'launch_ros.substitutions': {'ExecutableInPackage': ExecutableInPackage},
}


def describe(path):
    """What the launch file at a path describes."""
    for name, content in MODULES.items():
        module = types.ModuleType(name)
        vars(module).update(content)
        sys.modules[name] = module
    spec = importlib.util.spec_from_file_location('launch_file', path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.generate_launch_description()


def commands(path, executables, **arguments):
    """The command lines that `ros2 launch FILE name:=value ...` would start."""
    description = describe(path)
    declared = {it.name: it.default_value for it in description.entities
                if isinstance(it, DeclareLaunchArgument)}
    assert arguments.keys() <= declared.keys(), arguments
    context = Context(declared | arguments, executables)
    return [process.command(context)
            for it in description.entities if isinstance(it, OpaqueFunction)
            for process in it.function(context)]
