"""Machines and nodes for the tests."""

import os

import pytest

from chosen import Machine


@pytest.fixture(scope='module')
def machine():
    """One machine for the tests of a file, ten times as fast as a real one."""
    made = Machine().until_idle()
    yield made
    made.stop()


@pytest.fixture
def node(machine):
    """A node next to those of the machine."""
    with machine.node() as made:
        yield made


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item):
    """What the nodes said is part of why a test failed."""
    report = (yield).get_result()
    if report.skipped and os.environ.get('KERF_MUST_PROVE'):
        report.outcome = 'failed'
    machine = item.funcargs.get('machine')
    if report.failed and machine is not None:
        report.sections.append((f'log of {machine.namespace}', machine.log()[-3000:]))
