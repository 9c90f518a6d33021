"""The state of `rclpy.init`: whether it was called, and with which arguments."""

import os

is_up = False
domain_id = 0
remaps = {}


def start(words, domain):
    """Takes remaps out of the words after `--ros-args`."""
    global is_up, domain_id
    is_up = True
    domain_id = int(os.environ.get('ROS_DOMAIN_ID') or 0) if domain is None else domain
    remaps.clear()
    ros = split(words)[1]
    for flag, rule in zip(ros, ros[1:]):
        if flag in ('-r', '--remap'):
            name, _, value = rule.partition(':=')
            remaps[name] = value


def split(words):
    """The words of the program, and those between `--ros-args` and `--`."""
    own, ros, is_ros = [], [], False
    for word in words:
        if word == '--ros-args':
            is_ros = True
        elif is_ros and word == '--':
            is_ros = False
        else:
            (ros if is_ros else own).append(word)
    return own, ros
