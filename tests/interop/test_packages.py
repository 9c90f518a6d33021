"""The packages as colcon and rosdep read them."""

import tomllib
from pathlib import Path

import pytest
from catkin_pkg.package import parse_package

from machine import ROOT

WORKSPACE = tomllib.loads((ROOT / 'Cargo.toml').read_text())['workspace']
RUN_BY_USERS = ('program_loader', 'compensation_planner', 'axis_driver', 'run_recorder',
                'virtual_controller', 'kerf')


def found():
    """Where colcon finds a package: it does not look below one, nor below COLCON_IGNORE."""
    pending, packages = [ROOT], []
    while pending:
        folder = pending.pop()
        if (folder / 'COLCON_IGNORE').exists() or folder.name.startswith('.'):
            continue
        if (folder / 'package.xml').exists():
            packages.append(folder)
        else:
            pending += [child for child in folder.iterdir() if child.is_dir()]
    return sorted(folder.relative_to(ROOT) for folder in packages)


def test_colcon_finds_the_nodes_and_the_messages_and_nothing_else():
    # A checkout is built in target/, which is no part of it.
    packages = [folder for folder in found() if folder.parts[0] != 'target']
    assert packages == sorted([Path('msgs'), *(Path('nodes') / name for name in RUN_BY_USERS)])


def test_a_crate_that_is_no_package_is_out_of_sight():
    packages = found()
    for member in map(Path, WORKSPACE['members']):
        is_ignored = any((ROOT / path / 'COLCON_IGNORE').exists()
                         for path in (member, *member.parents))
        assert member in packages or is_ignored, member


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
    # `ros2 run NAME NAME`.
    assert name in [binary['name'] for binary in crate['bin']]


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
