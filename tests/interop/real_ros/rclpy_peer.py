"""A node of real rclpy next to a machine, for tests and for measuring times."""

import time

import rclpy
from rclpy.executors import SingleThreadedExecutor

# How long anything may take; generous, machines are slow.
TIMEOUT = 60.0


class Peer:
    """A node in the namespace of the machine, and how to wait with it."""

    def __init__(self, context, namespace, name='cell'):
        self.node = rclpy.create_node(name, context=context, namespace=namespace)
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.node)

    def until(self, what, look, timeout=TIMEOUT):
        """Spins until `look` returns something that is true, and returns it."""
        end = time.monotonic() + timeout
        while True:
            found = look()
            if found:
                return found
            assert time.monotonic() < end, f'{what}: not within {timeout} s'
            self.executor.spin_once(timeout_sec=0.05)

    def result(self, what, future, timeout=TIMEOUT):
        self.until(what, future.done, timeout)
        return future.result()

    def call(self, kind, service, /, **fields):
        """Asks a service."""
        client = self.node.create_client(kind, service)
        self.until(f'the service {service}', client.service_is_ready)
        answer = self.result(f'an answer of {service}', client.call_async(kind.Request(**fields)))
        self.node.destroy_client(client)
        return answer

    def listen(self, kind, topic, qos):
        """The messages of a topic, as a list that grows."""
        heard = []
        self.node.create_subscription(kind, topic, heard.append, qos)
        return heard

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()
