"""The generators of ROS 2 themselves, where the host has them.

Debian carries the adapter, the parser and the generators for C and C++
(`rosidl-generator-c-cpp`, `python3-rosidl`, `librosidl-runtime-c-cpp-dev`, `librcutils-dev`);
they run under the Python of the system. Not there: the generator for Python, type support for a
middleware, and the packages that ours depends on, which are generated here from the
definitions in `msgs/share` as far as ours uses them.
"""

import json
import os
import subprocess
from pathlib import Path

from machine import ROOT
from ros2 import interfaces

PYTHON = '/usr/bin/python3'
GENERATOR = Path('/usr/libexec/rosidl/rosidl_generator_c')
RESOURCES = Path('/usr/share/rosidl_generator_c/resource')
NEEDED = (GENERATOR, RESOURCES, Path('/usr/share/rosidl_generator_cpp'),
          Path('/usr/include/rosidl_runtime_c'), Path('/usr/include/rcutils'))

DEPENDENCIES = ('action_msgs', 'builtin_interfaces', 'geometry_msgs', 'rcl_interfaces',
                'std_msgs', 'unique_identifier_msgs')


def is_there():
    return all(path.exists() for path in NEEDED)


def sources(package):
    """The interface files of a package, relative to its folder."""
    folder = ROOT / 'msgs' if package == 'cnc_msgs' else ROOT / 'msgs/share' / package
    files = sorted(path.relative_to(folder) for kind in ('msg', 'srv', 'action')
                   for path in (folder / kind).glob(f'*.{kind}'))
    if package != 'cnc_msgs':
        used = interfaces.used_by('cnc_msgs')
        files = [file for file in files if f'{package}/{file.with_suffix("")}' in used]
    return folder, files


def run(*words):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    assert done.returncode == 0, f'{words}\n{done.stdout}\n{done.stderr}'
    return done.stdout


def adapt(package, out):
    """Turns the files of a package into IDL, as the first step of its build does."""
    folder, files = sources(package)
    arguments = out / f'{package}.adapt.json'
    arguments.write_text(json.dumps({'non_idl_tuples': [f'{folder}:{file}' for file in files]}))
    tuples = out / 'tuples' / package
    run(PYTHON, '-m', 'rosidl_adapter', '--package-name', package, '--arguments-file', arguments,
        '--output-dir', out / 'idl' / package, '--output-file', tuples)
    return tuples.read_text().split()


def generate(language, package, tuples, out):
    """Makes the code of a package below `out/LANGUAGE/PACKAGE`."""
    generator = f'rosidl_generator_{language}'
    arguments = out / f'{package}.{language}.json'
    arguments.write_text(json.dumps({
        'package_name': package, 'output_dir': str(out / language / package),
        'template_dir': f'/usr/share/{generator}/resource', 'idl_tuples': tuples,
        'ros_interface_dependencies': [], 'target_dependencies': []}))
    run(PYTHON, GENERATOR.with_name(generator), '--generator-arguments-file', arguments)
    if language == 'c':
        # What CMake does with this one template.
        name = 'rosidl_generator_c__visibility_control.h'
        text = (RESOURCES / f'{name}.in').read_text()
        text = text.replace('@PROJECT_NAME_UPPER@', package.upper())
        (out / language / package / 'msg').mkdir(parents=True, exist_ok=True)
        (out / language / package / 'msg' / name).write_text(
            text.replace('@PROJECT_NAME@', package))


def includes():
    """Where the headers of the runtime are."""
    headers = Path('/usr/include')
    return [f'-I{path}' for path in (*headers.glob('rosidl_*'), headers / 'rcutils')]


def compile_c(out):
    """One library of all packages."""
    files = sorted((out / 'c').rglob('*.c'))
    library = out / 'libinterfaces.so'
    run(os.environ.get('CC', 'cc'), '-shared', '-fPIC', '-Wall', '-Werror', f'-I{out / "c"}',
        *includes(), *files, '-lrosidl_runtime_c', '-o', library)
    return library


def check_cpp(out):
    """All headers of our package in one translation unit."""
    headers = sorted((out / 'cpp' / 'cnc_msgs').glob('*/*.hpp'))
    unit = out / 'all.cpp'
    unit.write_text(''.join(
        f'#include "{header.relative_to(out / "cpp")}"\n' for header in headers)
        + 'int main() { cnc_msgs::msg::MachineState state; return state.state; }\n')
    run(os.environ.get('CXX', 'c++'), '-std=c++17', '-fsyntax-only', '-Wall', '-Werror',
        f'-I{out / "cpp"}', *includes(), unit)
    return len(headers)
