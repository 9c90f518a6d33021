"""A machine, and a node of real rclpy next to it.

Run by `.ci/ros`, with the Python that has ROS 2; the parent folder has the machine.
"""

import os

import pytest
import rclpy

from machine import Machine
from rclpy_peer import Peer


@pytest.fixture(scope='session')
def machine():
    made = Machine(rmw='rmw_fastrtps_cpp').until_idle()
    yield made
    made.stop()


@pytest.fixture(scope='session')
def context(machine):
    """One context for all tests, as a process of rclpy has."""
    os.environ['ROS_DOMAIN_ID'] = str(machine.domain_id)
    made = rclpy.Context()
    rclpy.init(context=made)
    yield made
    rclpy.shutdown(context=made)


@pytest.fixture
def peer(machine, context):
    made = Peer(context, machine.namespace)
    yield made
    made.close()
