"""Services as `rmw_cyclonedds_cpp` carries them.

Each request and each reply begins with sixteen bytes: who asks, and the number of the
request. A client takes the replies that are its own and lets all others pass.
"""

import functools
import itertools
import time
from dataclasses import replace

from . import interfaces
from .node import TIMEOUT, SERVICES, Arrivals, NoAnswer, until


class Calling:
    """Calls a service, whatever carries it: needs `name`, `is_ready`, `send`, `answer` and `_answers`.

    `call_at_once` needs `block`, too.
    """

    def wait_for_service(self, timeout=TIMEOUT):
        until(f'the service {self.name}', self.is_ready, timeout)
        return self

    def wait(self, number, timeout=TIMEOUT):
        return until(f'an answer of {self.name}', lambda: self.answer(number), timeout)

    def call(self, request=None, timeout=TIMEOUT, **fields):
        """`client.call`: asks and waits for the answer."""
        self.wait_for_service()
        return self.wait(self.send(request, **fields), timeout)

    def call_at_once(self, timeout=TIMEOUT, **fields):
        """`call` that sleeps until the answer arrives, for measuring times. Needs a ready service."""
        number, end = self.send(**fields), time.monotonic() + timeout
        while self.answer(number) is None:
            left = end - time.monotonic()
            if left <= 0:
                raise NoAnswer(f'an answer of {self.name}: not within {timeout} s')
            self.block(left)
        return self._answers.pop(number)


class Client(Calling):
    """`node.create_client`."""

    def __init__(self, node, kind, name, type_hash=''):
        self.name, self.kind = name, kind
        self._reply_kind = interfaces.framed(f'{kind.name}_Response')
        self._request_kind = interfaces.framed(f'{kind.name}_Request')
        self._replies = node.reader(f'rr{name}Reply', self._reply_kind, SERVICES)
        self._requests = node.writer(
            f'rq{name}Request', self._request_kind, replace(SERVICES, type_hash=type_hash))
        # The handle is signed in Python.
        self._me = self._requests.get_instance_handle() % 2**64
        self._numbers = itertools.count(1)
        self._answers = {}

    def gid(self):
        """The address that requests come from."""
        return self._requests.get_guid().bytes

    def is_ready(self):
        """As `service_is_ready`: both ways are open, as far as this side knows."""
        return bool(self._requests.get_matched_subscriptions()
                    and self._replies.get_matched_publications())

    def send(self, request=None, **fields):
        """Asks; the answer is had by the number that is returned."""
        number = next(self._numbers)
        body = self.kind.Request(**fields) if request is None else request
        self._requests.write(self._request_kind(client=self._me, sequence=number, body=body))
        return number

    def answer(self, number):
        """The answer to this request if it is there."""
        for reply in self._replies.take(N=100):
            if isinstance(reply, self._reply_kind) and reply.client == self._me:
                self._answers[reply.sequence] = reply.body
        return self._answers.get(number)

    @functools.cached_property
    def _arrivals(self):
        return Arrivals(self._replies.participant, self._replies)

    def block(self, timeout):
        """Sleeps until there are replies."""
        self._arrivals.wait(timeout)


class Service:
    """`node.create_service`; answers when it is looked after."""

    def __init__(self, node, kind, name, handler):
        self.name, self.kind, self._handler = name, kind, handler
        self._request_kind = interfaces.framed(f'{kind.name}_Request')
        self._reply_kind = interfaces.framed(f'{kind.name}_Response')
        self._requests = node.reader(f'rq{name}Request', self._request_kind, SERVICES)
        self._replies = node.writer(f'rr{name}Reply', self._reply_kind, SERVICES)

    def serve(self):
        """Answers what has arrived; returns how much that was."""
        requests = [request for request in self._requests.take(N=100)
                    if isinstance(request, self._request_kind)]
        for request in requests:
            body = self._handler(request.body)
            self._replies.write(self._reply_kind(
                client=request.client, sequence=request.sequence, body=body))
        return len(requests)


def serve_forever(node, *services):
    """Answers at once, as `rclpy.spin` does."""
    arrivals = Arrivals(node.participant, *(service._requests for service in services))
    while True:
        arrivals.wait(3600)
        for service in services:
            service.serve()
