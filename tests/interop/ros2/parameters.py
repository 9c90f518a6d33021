"""Parameters of another node, by its six services."""

from . import interfaces

Parameter = interfaces.message('rcl_interfaces/msg/Parameter')
ParameterValue = interfaces.message('rcl_interfaces/msg/ParameterValue')
ParameterType = interfaces.message('rcl_interfaces/msg/ParameterType')

FIELDS = {
    ParameterType.PARAMETER_BOOL: 'bool_value',
    ParameterType.PARAMETER_INTEGER: 'integer_value',
    ParameterType.PARAMETER_DOUBLE: 'double_value',
    ParameterType.PARAMETER_STRING: 'string_value',
    ParameterType.PARAMETER_BOOL_ARRAY: 'bool_array_value',
    ParameterType.PARAMETER_INTEGER_ARRAY: 'integer_array_value',
    ParameterType.PARAMETER_DOUBLE_ARRAY: 'double_array_value',
    ParameterType.PARAMETER_STRING_ARRAY: 'string_array_value',
}


def to_wire(name, value):
    """A parameter as rclpy guesses its type."""
    kinds = {
        bool: ParameterType.PARAMETER_BOOL, int: ParameterType.PARAMETER_INTEGER,
        float: ParameterType.PARAMETER_DOUBLE, str: ParameterType.PARAMETER_STRING,
    }
    made = ParameterValue()
    if value is not None:
        made.type = kinds[type(value)]
        setattr(made, FIELDS[made.type], value)
    return Parameter(name=name, value=made)


def from_wire(value):
    """The Python value; `None` when it is not set."""
    return getattr(value, FIELDS[value.type]) if value.type in FIELDS else None


class ParameterClient:
    """What `ros2 param` does with a node."""

    SERVICES = ('list_parameters', 'get_parameters', 'get_parameter_types',
                'describe_parameters', 'set_parameters', 'set_parameters_atomically')

    def __init__(self, node, target):
        self._clients = {
            name: node.client(
                'rcl_interfaces/srv/' + name.title().replace('_', ''), f'{target}/{name}')
            for name in self.SERVICES
        }

    def list(self, *prefixes, depth=0):
        return self._clients['list_parameters'].call(prefixes=list(prefixes), depth=depth).result

    def get(self, *names):
        values = self._clients['get_parameters'].call(names=list(names)).values
        return [from_wire(value) for value in values]

    def types(self, *names):
        return list(self._clients['get_parameter_types'].call(names=list(names)).types)

    def describe(self, *names):
        return self._clients['describe_parameters'].call(names=list(names)).descriptors

    def set(self, **values):
        parameters = [to_wire(name, value) for name, value in values.items()]
        return self._clients['set_parameters'].call(parameters=parameters).results

    def set_atomically(self, **values):
        parameters = [to_wire(name, value) for name, value in values.items()]
        return self._clients['set_parameters_atomically'].call(parameters=parameters).result
