"""A stand-in for rclpy, so that programs for it can be run without ROS 2.

It has the part of rclpy's interface that the programs in the documentation use, with the
signatures of Jazzy, above the library in `../../ros2`. It is no rclpy: what it proves is
that a program is complete, calls what exists with arguments of the right types, and does
with the nodes what its page says. Callbacks run during a spin, as in rclpy.
"""

import signal
import sys
import time
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[2]))

from . import _interfaces, _state  # noqa: E402
from .signals import SignalHandlerOptions  # noqa: E402

_interfaces.install()


def init(*, args=None, context=None, domain_id=None, signal_handler_options=None):
    """Reads the arguments for ROS; with its own signal handlers Ctrl-C ends the context."""
    assert context is None, 'the stand-in knows the default context alone'
    if _state.is_up:
        raise RuntimeError('Context.init() must only be called once')
    _state.start(sys.argv if args is None else args, domain_id)
    if signal_handler_options is not SignalHandlerOptions.NO:
        signal.signal(signal.SIGINT, lambda *_: shutdown())


def ok(*, context=None):
    return _state.is_up


def shutdown(*, context=None, uninstall_handlers=None):
    _state.is_up = False


def create_node(node_name, *, namespace=None):
    from .node import Node
    return Node(node_name, namespace=namespace)


def spin_once(node, *, executor=None, timeout_sec=None):
    """Runs one callback, or waits for one."""
    end = None if timeout_sec is None else time.monotonic() + timeout_sec
    while _state.is_up and not node._work():
        if end is not None and time.monotonic() >= end:
            return
        time.sleep(0.002)


def spin(node, executor=None):
    while _state.is_up:
        spin_once(node, timeout_sec=0.1)


def spin_until_future_complete(node, future, executor=None, timeout_sec=None):
    end = None if timeout_sec is None else time.monotonic() + timeout_sec
    while _state.is_up and not future.done():
        if end is not None and time.monotonic() >= end:
            return
        spin_once(node, timeout_sec=0.05)
