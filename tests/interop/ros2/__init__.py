"""A ROS 2 node's side of the wire, on Eclipse Cyclone DDS alone.

Uses the names of `rmw_cyclonedds_cpp`: topics `rt/NAME`, services `rq/NAMERequest` and
`rr/NAMEReply` with the client's number before each payload, actions as five of those.
Shares no code with the nodes under test but the interface files in `msgs/`.
"""

from .actions import ActionClient, GoalHandle
from .interfaces import action, message, service
from .node import DEFAULT, LATCHED, SENSOR, NoAnswer, Node, Qos, until
from .parameters import ParameterClient

__all__ = [
    'DEFAULT', 'LATCHED', 'SENSOR', 'ActionClient', 'GoalHandle', 'NoAnswer', 'Node',
    'ParameterClient', 'Qos', 'action', 'message', 'service', 'until',
]
