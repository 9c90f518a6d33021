"""A node on each middleware, with one interface: what `times.py` measures with.

Fast DDS is real rclpy; Cyclone DDS and Zenoh are the libraries for Python of the tests. Each is
imported where it is used, as no Python needs to have all of them.
"""

import contextlib
import dataclasses
import functools
import importlib
import os
import signal
import subprocess
import sys
from pathlib import Path

from machine import die_with_parent, kerf

# Where the peer of rclpy is, which the tests find by themselves.
sys.path.insert(0, str(Path(__file__).parent / 'real_ros'))

# How long a call may take, s.
CALL_WITHIN = 20.0
# Where the body of a serialized chunk without program_id and calls begins, and how much follows it.
BODY_FROM, AFTER_BODY = 36, 16
# Of an element without an N number, in a body: where the first begins, the length, and what is padding.
ELEMENT_FROM, ELEMENT_SIZE, PADDING = 4, 104, slice(9, 12)


@dataclasses.dataclass(frozen=True)
class Where:
    """Where a machine is found; `port` is that of its router."""

    namespace: str
    domain_id: int
    port: int


class OnFastDds:
    """A node of rclpy."""

    def __init__(self, name, where):
        from rclpy_peer import Peer
        os.environ['ROS_DOMAIN_ID'] = str(where.domain_id)
        self._peer = Peer(self._context(), where.namespace, name)
        self._node = self._peer.node

    @staticmethod
    @functools.cache
    def _context():
        import rclpy
        made = rclpy.Context()
        rclpy.init(context=made)
        return made

    @classmethod
    def prepare(cls, *names):
        """Imports what a node needs, which is not part of joining a domain."""
        importlib.import_module('rclpy_peer')
        for name in names:
            cls.type(name).__import_type_support__()

    @staticmethod
    def type(name):
        package, kind, base = name.split('/')
        return getattr(importlib.import_module(f'{package}.{kind}'), base)

    @staticmethod
    def _latched_qos():
        from rclpy.qos import DurabilityPolicy, QoSProfile
        return QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

    def caller(self, type_name, name):
        """A function that calls a service, which is there."""
        kind = self.type(type_name)
        client = self._node.create_client(kind, name)
        self._peer.until(f'the service {name}', client.service_is_ready)

        def call(within=CALL_WITHIN, **fields):
            answer = client.call_async(kind.Request(**fields))
            return self._peer.result(f'an answer of {name}', answer, within)
        return call

    def latched(self, type_name, topic, what=lambda _: True):
        """The first message of a latched topic for which `what` holds."""
        heard = self._peer.listen(self.type(type_name), topic, self._latched_qos())
        return self._peer.until(topic, lambda: next(filter(what, heard), None))

    def latch(self, type_name, topic, message):
        publisher = self._node.create_publisher(self.type(type_name), topic, self._latched_qos())
        publisher.publish(message)

    def service(self, type_name, name, handler):
        """`handler` makes the response of a request."""
        self._node.create_service(
            self.type(type_name), name, lambda request, _: handler(request))

    def serve_forever(self):
        self._peer.executor.spin()

    def start_run(self, program_id):
        """Starts a run, which goes on without this node."""
        from rclpy.action import ActionClient
        kind = self.type('cnc_msgs/action/RunProgram')
        runs = ActionClient(self._node, kind, 'run_program')
        self._peer.until('the action', runs.server_is_ready)
        goal = self._peer.result('a decision', runs.send_goal_async(
            kind.Goal(program_id=program_id)))
        assert goal.accepted, 'the goal is rejected'

    @staticmethod
    def body(chunk):
        """The bytes that the checks of a path are of; takes the name of the program away.

        Fast CDR leaves in the padding what was in memory before, and the checks are of zeros.
        """
        import numpy
        from rclpy.serialization import serialize_message
        assert not chunk.calls
        chunk.program_id = ''
        data = serialize_message(chunk)
        if chunk.events or any(element.block for element in chunk.elements):
            from ros2 import message
            return _body(message('cnc_msgs/msg/PathChunk').deserialize(data).serialize())
        made = bytearray(_body(data))
        end = ELEMENT_FROM + ELEMENT_SIZE * len(chunk.elements)
        rows = numpy.frombuffer(made, numpy.uint8)[ELEMENT_FROM:end].reshape(-1, ELEMENT_SIZE)
        rows[:, PADDING] = 0
        return bytes(made)

    def close(self):
        self._peer.close()


def _body(chunk):
    return bytes(chunk[BODY_FROM:-AFTER_BODY])


class _OfTheTests:
    """A node of the tests, of either library."""

    def __init__(self, node):
        self._node, self._services = node, []

    @staticmethod
    def type(name):
        from ros2 import message, service
        return (service if name.split('/')[1] == 'srv' else message)(name)

    def caller(self, type_name, name):
        client = self._node.client(type_name, name).wait_for_service()

        def call(within=CALL_WITHIN, **fields):
            return client.call_at_once(within, **fields)
        return call

    def latched(self, type_name, topic, what=lambda _: True):
        from ros2 import LATCHED
        return self._node.subscription(type_name, topic, LATCHED).wait(what)

    def latch(self, type_name, topic, message):
        from ros2 import LATCHED
        self._publisher = self._node.publisher(type_name, topic, LATCHED)
        self._publisher.publish(message)

    def service(self, type_name, name, handler):
        self._services.append(self._node.service(type_name, self._node.resolve(name), handler))

    def start_run(self, program_id):
        from ros2 import ActionClient
        runs = ActionClient(self._node, 'cnc_msgs/action/RunProgram', 'run_program')
        assert runs.send_goal(program_id=program_id).accepted, 'the goal is rejected'

    @staticmethod
    def body(chunk):
        """The bytes that the checks of a path are of; takes the name of the program away."""
        assert not chunk.calls
        chunk.program_id = ''
        return _body(chunk.serialize())

    def close(self):
        self._node.close()


class OnCyclone(_OfTheTests):
    """A node of the library of Cyclone DDS."""

    def __init__(self, name, where):
        from ros2 import Node
        super().__init__(Node(name, where.namespace, where.domain_id))

    @classmethod
    def prepare(cls, *names):
        for name in names:
            cls.type(name)

    def serve_forever(self):
        from ros2.services import serve_forever
        serve_forever(self._node, *self._services)


class OnZenoh(_OfTheTests):
    """A node of the library of Zenoh."""

    @classmethod
    def prepare(cls, *names):
        importlib.import_module('ros2_zenoh')
        for name in names:
            cls.type(name)

    def __init__(self, name, where):
        from ros2_zenoh import Node
        super().__init__(Node(name, where.namespace, where.domain_id, where.port))

    def serve_forever(self):
        signal.pause()


NODES = {'fastdds': OnFastDds, 'cyclone': OnCyclone, 'zenoh': OnZenoh}
RMW = {'fastdds': 'rmw_fastrtps_cpp', 'cyclone': 'rmw_cyclonedds_cpp', 'zenoh': 'rmw_zenoh_cpp'}


@contextlib.contextmanager
def router(middleware):
    """`kerf router` where the middleware needs one: its port, and the variables of the nodes."""
    if middleware != 'zenoh':
        yield 0, {}
        return
    from test_zenoh import at, free_port
    port = free_port()
    process = subprocess.Popen(
        [kerf(), 'router'], stdout=subprocess.PIPE, text=True, preexec_fn=die_with_parent,
        env=os.environ | {'ZENOH_CONFIG_OVERRIDE': f'listen/endpoints=["tcp/127.0.0.1:{port}"]'})
    try:
        assert str(port) in process.stdout.readline()
        yield port, at(port)
    finally:
        process.terminate()
        process.wait()
