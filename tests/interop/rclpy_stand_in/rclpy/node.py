"""`rclpy.node.Node`."""

import time

import ros2
from ros2 import message

from . import _state
from ._interfaces import check
from .qos import profile
from .task import Future


class Node:

    def __init__(self, node_name, *, namespace=None):
        if not _state.is_up:
            raise RuntimeError('rclpy.init() has not been called')
        namespace = _state.remaps.get('__ns', namespace or '/')
        self._node = ros2.Node(
            _state.remaps.get('__node', node_name), namespace, _state.domain_id)
        self._sources = []

    def _work(self):
        """Runs a callback that is due; false when none is."""
        for source in self._sources:
            if source.work():
                # The next spin begins after it, so that none is skipped.
                self._sources.remove(source)
                self._sources.append(source)
                return True
        return False

    def _add(self, source):
        self._sources.append(source)
        return source

    def get_name(self):
        return self._node.name

    def get_namespace(self):
        return self._node.namespace

    def create_publisher(self, msg_type, topic, qos_profile):
        return Publisher(self._node.publisher(msg_type, topic, profile(qos_profile)))

    def create_subscription(self, msg_type, topic, callback, qos_profile):
        return self._add(Subscription(
            self._node.subscription(msg_type.ros_name, topic, profile(qos_profile)), callback))

    def create_client(self, srv_type, srv_name):
        return self._add(Client(self._node.client(srv_type.name, srv_name)))

    def create_timer(self, timer_period_sec, callback):
        return self._add(Timer(timer_period_sec, callback))

    def get_logger(self):
        return Logger(self._node.full_name[1:].replace('/', '.'))

    def get_clock(self):
        return Clock()

    def destroy_node(self):
        self._sources.clear()
        self._node.close()


class Publisher:

    def __init__(self, inner):
        self._inner = inner

    def publish(self, msg):
        check(msg)
        self._inner.publish(msg)

    def get_subscription_count(self):
        return self._inner.subscription_count()


class Subscription:

    def __init__(self, inner, callback):
        self._inner, self._callback, self._waiting = inner, callback, []

    def work(self):
        self._waiting = self._waiting or self._inner.take()
        if self._waiting:
            self._callback(self._waiting.pop(0))
            return True
        return False


class Client:

    def __init__(self, inner):
        self._inner, self._pending = inner, {}
        self.srv_name = inner.name

    def service_is_ready(self):
        return self._inner.is_ready()

    def wait_for_service(self, timeout_sec=None):
        end = None if timeout_sec is None else time.monotonic() + timeout_sec
        while not self._inner.is_ready():
            if end is not None and time.monotonic() >= end:
                return False
            time.sleep(0.01)
        return True

    def call_async(self, request):
        check(request)
        future = Future()
        self._pending[self._inner.send(request)] = future
        return future

    def work(self):
        for number in list(self._pending):
            answer = self._inner.answer(number)
            if answer is not None:
                self._pending.pop(number).set_result(answer)
                return True
        return False


class Timer:

    def __init__(self, period, callback):
        self._period, self._callback = period, callback
        self._next = time.monotonic() + period

    def work(self):
        if time.monotonic() < self._next:
            return False
        self._next = time.monotonic() + self._period
        self._callback()
        return True


class Clock:

    def now(self):
        return Time(time.time_ns())


class Time:

    def __init__(self, nanoseconds):
        self.nanoseconds = nanoseconds

    def to_msg(self):
        sec, nanosec = divmod(self.nanoseconds, 1_000_000_000)
        return message('builtin_interfaces/msg/Time')(sec=sec, nanosec=nanosec)


class Logger:

    def __init__(self, name):
        self._name = name

    def _log(self, level, text):
        assert isinstance(text, str), 'log messages are strings'
        print(f'[{level}] [{time.time():.9f}] [{self._name}]: {text}', flush=True)

    def debug(self, message):
        pass

    def info(self, message):
        self._log('INFO', message)

    def warning(self, message):
        self._log('WARN', message)

    warn = warning

    def error(self, message):
        self._log('ERROR', message)
