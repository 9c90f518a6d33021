"""`rclpy.qos`: what the programs name of it."""

import enum

from ros2 import Qos


class ReliabilityPolicy(enum.IntEnum):
    RELIABLE = 1
    BEST_EFFORT = 2


class DurabilityPolicy(enum.IntEnum):
    TRANSIENT_LOCAL = 1
    VOLATILE = 2


class HistoryPolicy(enum.IntEnum):
    KEEP_LAST = 1
    KEEP_ALL = 2


class QoSProfile:

    def __init__(self, *, history=HistoryPolicy.KEEP_LAST, depth,
                 reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE):
        self.history, self.depth = history, depth
        self.reliability, self.durability = reliability, durability


def profile(qos):
    """Of a profile or, as everywhere in rclpy, of a depth alone."""
    qos = qos if isinstance(qos, QoSProfile) else QoSProfile(depth=qos)
    return Qos(qos.reliability == ReliabilityPolicy.RELIABLE,
               qos.durability == DurabilityPolicy.TRANSIENT_LOCAL, qos.depth)
