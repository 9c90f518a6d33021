"""`rclpy.utilities`."""

import sys

from . import _state


def remove_ros_args(args=None):
    return _state.split(sys.argv if args is None else args)[0]
