"""A machine over Zenoh, with a router of its own."""

import socket

import ros2_zenoh
from machine import Machine as OverDds


def free_port():
    with socket.socket() as taken:
        taken.bind(('127.0.0.1', 0))
        return taken.getsockname()[1]


def at(port):
    """The variables with which a node finds the router of a test."""
    return {'RMW_IMPLEMENTATION': 'rmw_zenoh_cpp',
            'ZENOH_CONFIG_OVERRIDE': f'connect/endpoints=["tcp/127.0.0.1:{port}"]'}


class Machine(OverDds):
    """A machine whose nodes, and those of the tests, are at one router."""

    def __init__(self, **options):
        self.port = free_port()
        self.router = ros2_zenoh.router(self.port)
        super().__init__(rmw='rmw_zenoh_cpp', variables=at(self.port), **options)

    def node(self, name='cell'):
        return ros2_zenoh.Node(name, self.namespace, self.domain_id, self.port)

    def stop(self):
        super().stop()
        self.router.close()
