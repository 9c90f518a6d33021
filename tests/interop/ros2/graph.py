"""Who is in the domain, as `ros2 node`, `ros2 topic` and `ros2 service` find out.

Endpoints come from DDS discovery; which node they belong to is said on
`ros_discovery_info`. Names go from DDS back to ROS as in rmw_dds_common.
"""

import dataclasses

from cyclonedds.builtin import (BuiltinDataReader, BuiltinTopicDcpsPublication,
                                BuiltinTopicDcpsSubscription)
from cyclonedds.core import InstanceState, Policy, ReadCondition, SampleState, ViewState

from . import interfaces
from .node import Qos


@dataclasses.dataclass(frozen=True)
class Endpoint:
    """A writer or a reader, as discovery reports it."""

    gid: bytes
    dds_topic: str
    dds_type: str
    reliable: bool
    transient_local: bool
    qos: object

    @property
    def topic(self):
        """The ROS topic; `None` for what is no topic of ROS."""
        return self.dds_topic[2:] if self.dds_topic.startswith('rt/') else None

    @property
    def type(self):
        """`pkg/msg/Type`."""
        package, kind, _, base = self.dds_type.split('::')
        return f'{package}/{kind}/{base[:-1]}'


class Graph:
    """What can be seen from a node."""

    def __init__(self, node):
        self._publications = BuiltinDataReader(node.participant, BuiltinTopicDcpsPublication)
        self._subscriptions = BuiltinDataReader(node.participant, BuiltinTopicDcpsSubscription)
        self._infos = node.reader(
            'ros_discovery_info',
            interfaces.message('rmw_dds_common/msg/ParticipantEntitiesInfo'),
            # One message a participant is newest; all of them are kept.
            Qos(transient_local=True, depth=1000))
        self._participants = {}

    def writers(self):
        return self._endpoints(self._publications)

    def readers(self):
        return self._endpoints(self._subscriptions)

    def publishers(self):
        """`ros2 topic list -t`: the types of all published topics."""
        return {end.topic: end.type for end in self.writers() if end.topic}

    def services(self):
        """`ros2 service list -t`."""
        return {end.dds_topic[2:-len('Request')]: end.type.removesuffix('_Request')
                for end in self.readers() if end.dds_topic.startswith('rq/')}

    def nodes(self):
        """`ros2 node list`: full names, and the GIDs of their readers and writers."""
        for info in self._infos.take(N=1000):
            self._participants[bytes(info.gid.data)] = info.node_entities_info_seq
        return {
            f'{node.node_namespace.rstrip("/")}/{node.node_name}': (
                {bytes(gid.data) for gid in node.reader_gid_seq},
                {bytes(gid.data) for gid in node.writer_gid_seq})
            for nodes in self._participants.values() for node in nodes
        }

    def info(self, name):
        """`ros2 node info`: subscribers, publishers and service servers of a node."""
        readers, writers = self.nodes()[name]
        own_readers = [end for end in self.readers() if end.gid in readers]
        own_writers = [end for end in self.writers() if end.gid in writers]
        return {
            'subscribers': {end.topic: end.type for end in own_readers if end.topic},
            'publishers': {end.topic: end.type for end in own_writers if end.topic},
            'services': {end.dds_topic[2:-len('Request')]: end.type.removesuffix('_Request')
                         for end in own_readers if end.dds_topic.startswith('rq/')},
        }

    @staticmethod
    def _endpoints(reader):
        alive = ReadCondition(
            reader, ViewState.Any | InstanceState.Alive | SampleState.Any)
        return [
            Endpoint(
                end.key.bytes, end.topic_name, end.type_name,
                isinstance(end.qos[Policy.Reliability], Policy.Reliability.Reliable),
                end.qos[Policy.Durability] == Policy.Durability.TransientLocal, end.qos)
            for end in reader.read(N=10_000, condition=alive)
        ]
