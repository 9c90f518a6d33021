"""A ROS 2 node's side of Zenoh, on Eclipse's own library for Python.

Written from the documentation of rmw_zenoh: keys of domain, name, type and type hash, tokens for
the graph, 33 bytes beside each sample, requests as queries. Shares no code with the nodes under
test; messages are those of `ros2`, and their hashes those of `rosbags`.
"""

import itertools
import queue
import struct
import threading
import time

import xxhash
import zenoh
from zenoh import ext

from ros2 import interfaces
from ros2.node import DEFAULT, Waiting, until
from ros2.services import Calling


def config(mode, connect=(), listen=(), **settings):
    """A configuration without multicast, on the loopback interface."""
    made = zenoh.Config()
    for key, value in {
        'mode': f'"{mode}"',
        'connect/endpoints': str(list(connect)).replace("'", '"'),
        'listen/endpoints': str(list(listen)).replace("'", '"'),
        'scouting/multicast/enabled': 'false',
        'timestamping/enabled': '{ router: true, peer: true, client: true }',
        **settings,
    }.items():
        made.insert_json5(key, value)
    return made


def router(port, **settings):
    """A router, as `rmw_zenohd` is one."""
    return zenoh.open(config('router', listen=[f'tcp/127.0.0.1:{port}'], **settings))


def mangled(name):
    return name.replace('/', '%')


def attachment(sequence, gid):
    return struct.pack('<qqB16s', sequence, time.time_ns(), 16, gid)


class Node:
    """A node of its own session, as `rclpy.create_node` makes one."""

    def __init__(self, name, namespace, domain_id, port, session=None, enclave='/'):
        self.name, self.namespace, self.domain_id = name, namespace, domain_id
        self.enclave = enclave
        self.session = session or zenoh.open(config(
            'peer', connect=[f'tcp/127.0.0.1:{port}'], listen=['tcp/127.0.0.1:0']))
        self._ids = itertools.count()
        self._kept = [self.session.liveliness().declare_token(self.token('NN')[0])]
        self.tokens = set()
        self._kept.append(self.session.liveliness().declare_subscriber(
            f'@ros2_lv/{domain_id}/**', self._seen, history=True))

    def _seen(self, sample):
        change = self.tokens.add if sample.kind == zenoh.SampleKind.PUT else self.tokens.discard
        change(str(sample.key_expr))

    def close(self):
        self.session.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def resolve(self, name):
        """The absolute name of a relative or absolute one."""
        return name if name.startswith('/') else f'{self.namespace.rstrip("/")}/{name}'

    def token(self, kind, name='', type_name='', type_hash='', qos=DEFAULT):
        """The text that announces the node or an endpoint, and the address that follows from it."""
        text = '/'.join([
            '@ros2_lv', str(self.domain_id), str(self.session.zid()), '0', str(next(self._ids)),
            kind, mangled(self.enclave), mangled(self.namespace), self.name])
        if name:
            text += '/' + '/'.join([
                mangled(name), interfaces.dds_type(type_name), type_hash,
                f'{"" if qos.reliable else 2}:{1 if qos.transient_local else ""}:,{qos.depth}'
                ':,:,:,,'])
        return text, xxhash.xxh3_128(text.encode()).intdigest().to_bytes(16, 'little')

    def key(self, name, type_name, type_hash=None):
        type_hash = type_hash or interfaces.type_hash(type_name)
        return f'{self.domain_id}{name}/{interfaces.dds_type(type_name)}/{type_hash}'

    def announce(self, *description, qos=DEFAULT):
        """Announces an endpoint; returns its address."""
        text, gid = self.token(*description, qos=qos)
        self._kept.append(self.session.liveliness().declare_token(text))
        return gid

    def others(self, kind, name):
        """The tokens of endpoints of others."""
        return [token.split('/') for token in sorted(self.tokens)
                if token.split('/')[5] == kind and mangled(name) in token.split('/')[9:10]
                and token.split('/')[2] != str(self.session.zid())]

    def publisher(self, type_name, topic, qos=DEFAULT, type_hash=None):
        return Publisher(self, type_name, self.resolve(topic), qos, type_hash)

    def subscription(self, type_name, topic, qos=DEFAULT):
        return Subscription(self, interfaces.message(type_name), self.resolve(topic), qos)

    def client(self, type_name, name, type_hash=None):
        return Client(self, interfaces.service(type_name), self.resolve(name), type_hash)

    def service(self, type_name, name, handler):
        return Service(self, interfaces.service(type_name), self.resolve(name), handler)


class Publisher:
    """`node.create_publisher`."""

    def __init__(self, node, type_name, topic, qos, type_hash):
        type_hash = type_hash or interfaces.type_hash(type_name)
        self.node, self.topic, self.kind = node, topic, interfaces.message(type_name)
        key = node.key(topic, type_name, type_hash)
        latched = {}
        if qos.transient_local:
            latched = {'cache': ext.CacheConfig(qos.depth), 'publisher_detection': True,
                       'sample_miss_detection': ext.MissDetectionConfig(sporadic_heartbeat=0.5)}
        self._publisher = ext.declare_advanced_publisher(node.session, key, **latched)
        self._gid = node.announce('MP', topic, type_name, type_hash, qos=qos)
        self._numbers = itertools.count(1)

    def publish(self, value):
        self.put(value.serialize(), attachment(next(self._numbers), self._gid))

    def put(self, payload, beside):
        self._publisher.put(payload, attachment=beside)

    def wait_for_subscribers(self, count=1):
        until(f'{count} subscribers of {self.topic}',
              lambda: len(self.node.others('MS', self.topic)) >= count)
        return self


class Subscription(Waiting):
    """`node.create_subscription`, polled."""

    def __init__(self, node, kind, topic, qos):
        self.node, self.topic, self.kind = node, topic, kind
        self._samples = queue.Queue()
        latched = {}
        if qos.transient_local:
            latched = {'history': ext.HistoryConfig(
                           detect_late_publishers=True, max_samples=qos.depth),
                       'recovery': ext.RecoveryConfig(heartbeat=True),
                       'subscriber_detection': True}
        self._subscriber = ext.declare_advanced_subscriber(
            node.session, node.key(topic, kind.ros_name), self._samples.put, **latched)
        node.announce('MS', topic, kind.ros_name, interfaces.type_hash(kind.ros_name), qos=qos)
        # The numbers beside the last sample: number, time, address.
        self.beside = None

    def publisher_count(self):
        return len(self.node.others('MP', self.topic))

    def take(self):
        """All that has arrived and was not taken before."""
        return list(self._one_by_one())

    def _one_by_one(self):
        while not self._samples.empty():
            sample = self._samples.get()
            number, sent, length, gid = struct.unpack('<qqB16s', sample.attachment.to_bytes())
            assert length == 16
            self.beside = number, sent, gid
            yield self.kind.deserialize(sample.payload.to_bytes())


class Client(Calling):
    """`node.create_client`."""

    def __init__(self, node, kind, name, type_hash):
        type_hash = type_hash or interfaces.type_hash(kind.name)
        self.node, self.name, self.kind = node, name, kind
        self.type_hash = type_hash
        self._querier = node.session.declare_querier(
            node.key(name, kind.name, type_hash), target=zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=zenoh.ConsolidationMode.NONE, timeout=3600)
        self._gid = node.announce('SC', name, kind.name, type_hash)
        self._numbers = itertools.count(1)
        self._answers = {}
        self._has_answered = threading.Event()

    def is_ready(self):
        """As `service_is_ready`, and the way there is known, too."""
        is_announced = any(token[11] == self.type_hash for token in self.node.others('SS', self.name))
        return is_announced and self._querier.matching_status.matching

    def send(self, request=None, **fields):
        """Asks; the answer is had by the number that is returned."""
        number = next(self._numbers)
        body = self.kind.Request(**fields) if request is None else request

        def reply(it):
            if it.ok is None:
                return
            count, _, length, gid = struct.unpack('<qqB16s', it.ok.attachment.to_bytes())
            assert (count, length, gid) == (number, 16, self._gid)
            self._answers[number] = self.kind.Response.deserialize(it.ok.payload.to_bytes())
            self._has_answered.set()
        self._querier.get(reply, payload=body.serialize(), attachment=attachment(number, self._gid))
        return number

    def answer(self, number):
        """The answer to this request if it is there."""
        return self._answers.get(number)

    def block(self, timeout):
        """Sleeps until there is an answer."""
        self._has_answered.wait(timeout)
        self._has_answered.clear()


class Service:
    """`node.create_service`; answers on a thread of the library."""

    def __init__(self, node, kind, name, handler):
        self.kind, self._handler = kind, handler
        self._queryable = node.session.declare_queryable(
            node.key(name, kind.name), self._serve, complete=True)
        node.announce('SS', name, kind.name, interfaces.type_hash(kind.name))

    def _serve(self, query):
        number, _, length, gid = struct.unpack('<qqB16s', query.attachment.to_bytes())
        assert length == 16
        with query:
            answer = self._handler(self.kind.Request.deserialize(query.payload.to_bytes()))
            query.reply(query.key_expr, answer.serialize(), attachment=attachment(number, gid))
