"""The packages as colcon and rosdep read them."""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from catkin_pkg.package import parse_package

from machine import ROOT

WORKSPACE = tomllib.loads((ROOT / 'Cargo.toml').read_text())['workspace']
RUN_BY_USERS = ('program_loader', 'compensation_planner', 'axis_driver', 'run_recorder',
                'virtual_controller', 'kerf')


@pytest.fixture(scope='module')
def listed(tmp_path_factory):
    """What `colcon list` says of a checkout, by package."""
    workspace = tmp_path_factory.mktemp('workspace')
    files = subprocess.run(
        ['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard'],
        cwd=ROOT, capture_output=True, text=True, check=True).stdout.split('\0')
    for file in map(Path, filter(None, files)):
        # All that colcon looks at.
        if file.name in ('Cargo.toml', 'package.xml', 'CMakeLists.txt', 'COLCON_IGNORE'):
            copy = workspace / 'src' / file
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / file, copy)
    colcon = Path(sys.executable).with_name('colcon')
    said = subprocess.run([colcon, '--log-base', workspace / 'log', 'list'], cwd=workspace,
                          capture_output=True, text=True, check=True).stdout
    return {name: (Path(path).relative_to('src'), kind)
            for name, path, kind in (line.split('\t') for line in said.splitlines()
                                     if line.count('\t') == 2)}


def test_colcon_finds_the_nodes_and_the_messages_and_nothing_else(listed):
    assert listed == {
        'cnc_msgs': (Path('msgs'), '(ros.ament_cmake)'),
        **{name: (Path('nodes') / name, '(ros.ament_cargo)') for name in RUN_BY_USERS}}


@pytest.mark.parametrize('name', RUN_BY_USERS)
def test_a_package_says_what_its_crate_says(name):
    folder = ROOT / 'nodes' / name
    crate = tomllib.loads((folder / 'Cargo.toml').read_text())
    # parse_package refuses what breaks the rules of the format.
    warnings = []
    package = parse_package(folder, warnings=warnings)
    assert not warnings
    assert package.package_format == 3
    assert package.name == crate['package']['name'] == name
    assert package.version == WORKSPACE['package']['version']
    assert ' OR '.join(package.licenses) == WORKSPACE['package']['license']
    assert package.get_build_type() == 'ament_cargo'
    assert len(package.description) > 60
    # `ros2 run NAME NAME`; what asks for features cargo-ament-build does not install.
    [binary] = crate['bin']
    assert binary['name'] == name
    assert 'required-features' not in binary


def test_the_launch_file_is_installed_with_the_command():
    metadata = tomllib.loads((ROOT / 'nodes/kerf/Cargo.toml').read_text())['package']['metadata']
    [folder] = metadata['ros']['install_to_share']
    assert (ROOT / 'nodes/kerf' / folder / 'kerf.launch.py').resolve().exists()
    package = parse_package(ROOT / 'nodes/kerf')
    assert {'launch', 'launch_ros'} <= {it.name for it in package.exec_depends}


def test_the_messages_are_an_interface_package():
    package = parse_package(ROOT / 'msgs')
    assert package.get_build_type() == 'ament_cmake'
    assert [group.name for group in package.member_of_groups] == ['rosidl_interface_packages']
