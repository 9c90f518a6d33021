"""Python classes of messages, services and actions, made of the interface files.

The files of `msgs/` are read by the parser of `rosbags`, so the classes are what another
implementation than ours makes of them. Each is an `IdlStruct` of cyclonedds with the
name that ROS 2 gives the type on DDS, and with the defaults that rosidl gives fields.
"""

import dataclasses
import functools
import sys
import types
from pathlib import Path

from cyclonedds.idl import IdlMeta, IdlStruct
from cyclonedds.idl import types as idl
from rosbags.interfaces import Nodetype

sys.path.insert(0, str(Path(__file__).parents[3] / 'msgs' / 'tests'))
import oracle  # noqa: E402  the reader of our files, which the test of the messages uses too

# byte and char are octets in ROS 2.
BASES = {
    'bool': (bool, False), 'byte': (idl.uint8, 0), 'char': (idl.uint8, 0), 'string': (str, ''),
    'float32': (idl.float32, 0.0), 'float64': (idl.float64, 0.0),
    **{f'{sign}int{bits}': (getattr(idl, f'{sign}int{bits}'), 0)
       for sign in ('', 'u') for bits in (8, 16, 32, 64)},
}


@functools.cache
def _definitions():
    store, _, problems = oracle.build()
    assert not problems, problems
    return store.fielddefs


def names():
    """All types that are known, as `pkg/msg/Type`."""
    return sorted(_definitions())


def used_by(package):
    """All types that those of a package are made of, themselves included."""
    found, pending = set(), [name for name in names() if name.startswith(f'{package}/')]
    # What carries actions is not written in their files.
    pending += ['action_msgs/msg/GoalStatusArray', 'action_msgs/srv/CancelGoal_Request']
    while pending:
        name = pending.pop()
        if name not in found:
            found |= {name, name.removesuffix('_Request')}
            pending += [inner for _, field in _definitions()[name][1] for inner in _named(field)]
    return found


def _named(field):
    kind, inner = field
    if kind == Nodetype.NAME:
        return [inner]
    return [] if kind == Nodetype.BASE else _named(inner[0])


@functools.cache
def type_hash(name):
    """`RIHS01_...` of a type."""
    return oracle.build()[0].hash_rihs01(name)


def dds_type(name):
    """`pkg::msg::dds_::Type_` of `pkg/msg/Type`."""
    package, kind, base = name.split('/')
    return f'{package}::{kind}::dds_::{base}_'


@functools.cache
def message(name):
    """The class of `pkg/msg/Type`, with its constants."""
    return _struct(name, dds_type(name))


@functools.cache
def service(name):
    """`Request` and `Response` of `pkg/srv/Type`, as `Type.Request` in rclpy."""
    return types.SimpleNamespace(
        name=name, Request=payload(f'{name}_Request'), Response=payload(f'{name}_Response'))


@functools.cache
def action(name):
    """`Goal`, `Result`, `Feedback` of `pkg/action/Type`, and what carries them."""
    parts = {part: message(f'{name}_{part}') for part in ('Goal', 'Result', 'Feedback')}
    return types.SimpleNamespace(
        name=name, SendGoal=service(f'{name}_SendGoal'), GetResult=service(f'{name}_GetResult'),
        FeedbackMessage=message(f'{name}_FeedbackMessage'), **parts)


@functools.cache
def payload(part):
    """A request or a response; on DDS it travels in its frame, which has its name."""
    return _struct(part, dds_type(part) + 'payload')


@functools.cache
def framed(part):
    """A request or a response with what Cyclone puts before it."""
    fields = {'client': idl.uint64, 'sequence': idl.int64, 'body': payload(part)}
    return _class(part, dds_type(part), fields,
                  {'client': 0, 'sequence': 0, 'body': payload(part)}, {})


def _struct(name, dds_name):
    constants, fields = _definitions()[name]
    kinds, defaults = {}, {}
    for field, definition in fields or oracle.EMPTY:
        kinds[field], defaults[field] = _kind(definition)
    constants = {key: value for key, _, value in constants}
    return _class(name, dds_name, kinds, defaults, constants)


def _kind(definition):
    kind, inner = definition
    if kind == Nodetype.NAME:
        return message(inner), message(inner)
    if kind == Nodetype.BASE:
        return BASES[inner[0]]
    element, size = inner
    of, default = _kind(element)
    if kind == Nodetype.ARRAY:
        make = (lambda: [default() for _ in range(size)]) if callable(default) else (
            lambda: [default] * size)
        return idl.array[of, size], make
    return idl.sequence[of], list


def _class(name, dds_name, kinds, defaults, constants):
    namespace = IdlMeta.__prepare__(name, (IdlStruct,), typename=dds_name.replace('::', '.'))
    namespace['__annotations__'].update(kinds)
    for field, default in defaults.items():
        made = {'default_factory': default} if callable(default) else {'default': default}
        namespace[field] = dataclasses.field(**made)
    made = dataclasses.dataclass(kw_only=True)(IdlMeta(name.split('/')[-1], (IdlStruct,), namespace))
    # Not in the namespace: the encoder takes what it finds there for fields.
    for key, value in constants.items():
        setattr(made, key, value)
    made.ros_name = name
    return made


def impostor(name, fields_of):
    """A class that says it is `name` and has the fields of another type.

    So looks another version of a definition: DDS knows types by their names alone.
    """
    return _struct(fields_of, dds_type(name))


def cdr_body(value, *names):
    """Some fields of a message in CDR, little-endian, without encapsulation."""
    kinds = {name: type(value).__annotations__[name] for name in names}
    defaults = {name: None for name in names}
    made = _class('body', 'body', kinds, defaults, {})
    return made(**{name: getattr(value, name) for name in names}).serialize()[4:]
