"""A node, with its topics, services and its place in the graph.

All nodes of a process share one participant a domain, as the nodes of an rcl context do.

Everything is polled: a wait checks again every few milliseconds until its condition holds
or [TIMEOUT] is over. Nothing runs in the background but Cyclone's own threads,
so that a test reads from the top to the bottom.
"""

import dataclasses
import functools
import os
import time

from cyclonedds.core import (
    InstanceState, Policy, Qos as Policies, ReadCondition, SampleState, ViewState, WaitSet)
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from . import interfaces

# How long anything may take; generous, machines are slow.
TIMEOUT = 60.0
LOOK_AGAIN = 0.005

# What rmw_cyclonedds_cpp configures for ROS_AUTOMATIC_DISCOVERY_RANGE. Cyclone then takes the first interface
# that leads out of the host, where there is one.
RANGES = {
    'LOCALHOST': """
<CycloneDDS><Domain>
  <General><AllowMulticast>false</AllowMulticast></General>
  <Discovery>
    <ParticipantIndex>auto</ParticipantIndex>
    <MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
    <Peers><Peer address="localhost"/></Peers>
  </Discovery>
</Domain></CycloneDDS>
""",
    'SUBNET': """
<CycloneDDS><Domain>
  <Discovery>
    <ParticipantIndex>auto</ParticipantIndex>
    <MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
  </Discovery>
</Domain></CycloneDDS>
""",
}


class NoAnswer(AssertionError):
    """What was waited for did not come."""


def until(what, look, timeout=TIMEOUT):
    """Waits until `look` returns something that is true, and returns it."""
    end = time.monotonic() + timeout
    while True:
        found = look()
        if found:
            return found
        if time.monotonic() > end:
            raise NoAnswer(f'{what}: not within {timeout} s')
        time.sleep(LOOK_AGAIN)


@dataclasses.dataclass(frozen=True)
class Qos:
    """A ROS 2 QoS profile."""

    reliable: bool = True
    transient_local: bool = False
    depth: int = 10
    # What is announced of the type.
    type_hash: str = ''

    def policies(self):
        user_data = f'typehash={self.type_hash};' if self.type_hash else ''
        return Policies(
            Policy.Userdata(user_data.encode()),
            Policy.Reliability.Reliable(duration(milliseconds=100)) if self.reliable
            else Policy.Reliability.BestEffort,
            Policy.Durability.TransientLocal if self.transient_local
            else Policy.Durability.Volatile,
            Policy.History.KeepLast(self.depth),
            Policy.DataRepresentation(use_cdrv0_representation=True),
            Policy.IgnoreLocal.Nothing,
        )


DEFAULT = Qos()
LATCHED = Qos(transient_local=True, depth=1)
SENSOR = Qos(reliable=False, depth=5)
SERVICES = Qos(depth=10)


class Context:
    """A participant of this process, as `rmw_init` and the first node make it.

    It stays as long as the process. Cyclone forgets a type with the last topic that has it,
    and the library for Python crashes when one comes back while that goes on in the
    background: so a topic of each type stays too.
    """

    range = 'LOCALHOST'

    def __init__(self, domain_id):
        self._domain = self.domain(domain_id, RANGES[self.range])
        # rmw announces the enclave in the user data of the participant.
        self.participant = DomainParticipant(
            domain_id, qos=Policies(Policy.Userdata(b'enclave=/;')))
        self._kept = {}
        self._nodes = []
        self._graph = DataWriter(
            self.participant,
            self.topic('ros_discovery_info',
                       interfaces.message('rmw_dds_common/msg/ParticipantEntitiesInfo')),
            qos=LATCHED.policies())

    @staticmethod
    @functools.cache
    def domain(domain_id, settings):
        """The settings of a domain, which this process can make once."""
        return Domain(domain_id, settings)

    @classmethod
    @functools.cache
    def of(cls, domain_id):
        """The one of a domain."""
        return cls(domain_id)

    def topic(self, name, kind):
        """A DDS topic, of a type that Cyclone keeps from now on."""
        if kind not in self._kept:
            self._kept[kind] = Topic(self.participant, f'kept_{len(self._kept)}', kind)
        return Topic(self.participant, name, kind)

    def add(self, node):
        self._nodes.append(node)
        self.announce()

    def remove(self, node):
        self._nodes.remove(node)
        self.announce()

    def announce(self):
        """Says which nodes there are and which endpoints are theirs, as rmw_dds_common does."""
        self._graph.write(interfaces.message('rmw_dds_common/msg/ParticipantEntitiesInfo')(
            gid=_gid(self.participant),
            node_entities_info_seq=[node.entities() for node in self._nodes]))


def _gid(entity):
    return interfaces.message('rmw_dds_common/msg/Gid')(data=list(entity.get_guid().bytes))


class Node:
    """A node as `rclpy.create_node` makes one."""

    def __init__(self, name, namespace='/', domain_id=None, context=None):
        self.name, self.namespace = name, namespace
        self.domain_id = int(os.environ['ROS_DOMAIN_ID']) if domain_id is None else domain_id
        self._context = context or Context.of(self.domain_id)
        self.participant = self._context.participant
        self._readers, self._writers = [], []
        self._context.add(self)

    def close(self):
        """Leaves the graph in order, as `destroy_node` does."""
        self._context.remove(self)
        for entity in (*self._readers, *self._writers):
            entity.__del__()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    @property
    def full_name(self):
        return f'{self.namespace.rstrip("/")}/{self.name}'

    def resolve(self, name):
        """The absolute name of a relative, private or absolute one."""
        if name.startswith('/'):
            return name
        if name.startswith('~/'):
            return f'{self.full_name}/{name[2:]}'
        return f'{self.namespace.rstrip("/")}/{name}'

    def publisher(self, kind, topic, qos=DEFAULT):
        """Of a type name, or of a class."""
        kind = interfaces.message(kind) if isinstance(kind, str) else kind
        return Publisher(self, kind, self.resolve(topic), qos)

    def subscription(self, type_name, topic, qos=DEFAULT):
        return Subscription(self, interfaces.message(type_name), self.resolve(topic), qos)

    def client(self, type_name, name, type_hash=''):
        from .services import Client
        return Client(self, interfaces.service(type_name), self.resolve(name), type_hash)

    def service(self, type_name, name, handler):
        from .services import Service
        return Service(self, interfaces.service(type_name), self.resolve(name), handler)

    def writer(self, dds_topic, kind, qos):
        """A DDS writer that the graph knows as this node's."""
        topic = self._context.topic(dds_topic, kind)
        writer = DataWriter(self.participant, topic, qos=qos.policies())
        self._writers.append(writer)
        self._context.announce()
        return writer

    def reader(self, dds_topic, kind, qos):
        """A DDS reader that the graph knows as this node's."""
        topic = self._context.topic(dds_topic, kind)
        reader = DataReader(self.participant, topic, qos=qos.policies())
        self._readers.append(reader)
        self._context.announce()
        return reader

    def entities(self):
        """What this node announces to the graph."""
        return interfaces.message('rmw_dds_common/msg/NodeEntitiesInfo')(
            node_namespace=self.namespace, node_name=self.name,
            reader_gid_seq=[_gid(reader) for reader in self._readers],
            writer_gid_seq=[_gid(writer) for writer in self._writers])


class Arrivals:
    """Sleeps until something arrives at one of some readers, where polling is too slow."""

    def __init__(self, participant, *readers):
        self._set = WaitSet(participant)
        self._conditions = [
            ReadCondition(reader, ViewState.Any | InstanceState.Any | SampleState.NotRead)
            for reader in readers]
        for condition in self._conditions:
            self._set.attach(condition)

    def wait(self, timeout):
        self._set.wait(duration(seconds=timeout))


class Publisher:
    """`node.create_publisher`."""

    def __init__(self, node, kind, topic, qos):
        self.topic, self.kind = topic, kind
        self._writer = node.writer(f'rt{topic}', kind, qos)

    def publish(self, value):
        self._writer.write(value)

    def gid(self):
        """The address of the writer, sixteen bytes."""
        return self._writer.get_guid().bytes

    def subscription_count(self):
        return len(self._writer.get_matched_subscriptions())

    def wait_for_subscribers(self, count=1):
        until(f'{count} subscribers of {self.topic}', lambda: self.subscription_count() >= count)
        return self


class Waiting:
    """Waits for messages, whatever brings them: needs `topic`, `take` and `_one_by_one`."""

    def wait(self, what=lambda _: True, timeout=TIMEOUT):
        """The first message from now on for which `what` holds."""
        return until(f'a message on {self.topic}', lambda: next(
            (found for found in self._one_by_one() if what(found)), None), timeout)

    def newest(self, timeout=TIMEOUT):
        """The newest of those that are there, or the next one."""
        return until(f'a message on {self.topic}', lambda: (self.take() or [None])[-1], timeout)

    def collect(self, count, timeout=TIMEOUT):
        """So many messages."""
        got = []
        until(f'{count} messages on {self.topic}',
              lambda: got.extend(self.take()) or len(got) >= count, timeout)
        return got


class Subscription(Waiting):
    """`node.create_subscription`, polled."""

    def __init__(self, node, kind, topic, qos):
        self.topic, self.kind = topic, kind
        self._reader = node.reader(f'rt{topic}', kind, qos)

    def publisher_count(self):
        return len(self._reader.get_matched_publications())

    def wait_for_publishers(self, count=1):
        until(f'{count} publishers of {self.topic}', lambda: self.publisher_count() >= count)
        return self

    def take(self):
        """All that has arrived and was not taken before."""
        return [sample for sample in self._reader.take(N=1000) if isinstance(sample, self.kind)]

    def _one_by_one(self):
        while True:
            taken = self._reader.take(N=1)
            if not taken:
                return
            if isinstance(taken[0], self.kind):
                yield taken[0]
