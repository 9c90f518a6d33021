"""`msgs/` through the generators that `colcon build` runs, as far as Debian has them."""

import ctypes
import re

import pytest

import rosidl
from ros2 import interfaces

pytestmark = pytest.mark.skipif(
    not rosidl.is_there(),
    reason='no rosidl on this host: apt install rosidl-generator-c-cpp python3-rosidl '
           'librosidl-runtime-c-cpp-dev librcutils-dev')


@pytest.fixture(scope='module')
def out(tmp_path_factory):
    return tmp_path_factory.mktemp('rosidl')


@pytest.fixture(scope='module')
def tuples(out):
    """The IDL files of our package and of those it depends on."""
    (out / 'tuples').mkdir()
    return {package: rosidl.adapt(package, out)
            for package in (*rosidl.DEPENDENCIES, 'cnc_msgs')}


@pytest.fixture(scope='module')
def library(out, tuples):
    """The generated C code of all of them, compiled."""
    for package, files in tuples.items():
        rosidl.generate('c', package, files, out)
    return ctypes.CDLL(rosidl.compile_c(out))


def test_the_adapter_takes_every_file(tuples):
    _, files = rosidl.sources('cnc_msgs')
    assert len(files) > 40
    assert [re.split('[:.]', it)[-2] for it in tuples['cnc_msgs']] == [
        str(file.with_suffix('')) for file in files]


def test_the_generated_c_compiles_and_makes_every_message(library):
    messages = [name.split('/')[2] for name in interfaces.names()
                if name.startswith('cnc_msgs/msg/')]
    for name in messages:
        base = f'cnc_msgs__msg__{name}'
        create, destroy = (getattr(library, f'{base}__{what}') for what in ('create', 'destroy'))
        create.restype, destroy.argtypes = ctypes.c_void_p, [ctypes.c_void_p]
        made = create()
        assert made, name
        destroy(made)


def test_parts_of_services_and_actions_are_made_too(library):
    for base in ('cnc_msgs__srv__LoadProgram_Request', 'cnc_msgs__srv__SetTool_Response',
                 'cnc_msgs__action__RunProgram_SendGoal_Request',
                 'cnc_msgs__action__RunProgram_FeedbackMessage'):
        assert getattr(library, f'{base}__create')


def test_the_generated_cpp_is_well_formed(out, tuples):
    for package, files in tuples.items():
        rosidl.generate('cpp', package, files, out)
    assert rosidl.check_cpp(out) > 40


def test_every_constant_has_the_value_that_the_tests_use(out, library):
    text = ''.join(path.read_text() for path in (out / 'c/cnc_msgs').rglob('*__struct.h'))
    found = re.findall(r'cnc_msgs__(msg|srv|action)__(\w+?)__([A-Z0-9_]+) = (\d+)', text)
    assert len(found) > 100
    for kind, owner, name, value in found:
        if name == 'MAX_SIZE':
            # Of a field with a bound.
            continue
        assert getattr(interfaces.message(f'cnc_msgs/{kind}/{owner}'), name) == int(value)
