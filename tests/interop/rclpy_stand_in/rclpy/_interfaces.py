"""`import cnc_msgs.srv` and the like, of the interface files.

Messages that go out are checked as those that rosidl makes check what they are given: a
whole number in a field for a float is an error there, and so it is here.
"""

import importlib.abc
import importlib.machinery
import sys
import types

import ros2
from ros2 import interfaces

KINDS = {'msg': interfaces.message, 'srv': interfaces.service, 'action': interfaces.action}


class Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Makes a module of `package`, and of `package.msg`, `.srv` and `.action`."""

    def __init__(self):
        self._names = [name.split('/') for name in interfaces.names()]

    def find_spec(self, fullname, path=None, target=None):
        package, _, kind = fullname.partition('.')
        if any(package == name[0] and kind in ('', name[1]) for name in self._names):
            return importlib.machinery.ModuleSpec(fullname, self, is_package=not kind)
        return None

    def create_module(self, spec):
        return types.ModuleType(spec.name)

    def exec_module(self, module):
        package, _, kind = module.__name__.partition('.')
        for name in self._names:
            # `Type_Request` and its like are parts of `Type`.
            if kind and name[:2] == [package, kind] and '_' not in name[2]:
                setattr(module, name[2], KINDS[kind]('/'.join(name)))


def install():
    if not any(isinstance(finder, Finder) for finder in sys.meta_path):
        sys.meta_path.append(Finder())


def check(value, path='message'):
    """Fails where a field has a value that rosidl would not take."""
    for field, default in vars(type(value)()).items():
        found, where = getattr(value, field), f"the '{field}' field of {path}"
        if hasattr(default, '__idl__'):
            assert isinstance(found, type(default)), f'{where} must be a {type(default)}'
            check(found, where)
        elif isinstance(default, list):
            assert not isinstance(found, (str, dict)), f'{where} must be a sequence'
        else:
            # bool is an int in Python, and not in ROS.
            assert type(found) is type(default), f'{where} must be of type {type(default)}'


__all__ = ['Finder', 'check', 'install', 'ros2']
