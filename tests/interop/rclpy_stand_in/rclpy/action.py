"""`rclpy.action.ActionClient`."""

import time
import uuid

from ros2 import ActionClient as Inner
from ros2 import service
from ros2.actions import goal_id

from ._interfaces import check
from .node import Client
from .task import Future

CancelGoal = service('action_msgs/srv/CancelGoal')


class ActionClient:

    def __init__(self, node, action_type, action_name):
        self._inner = Inner(node._node, action_type.name, action_name)
        self._type = action_type
        self._send, self._result, self._cancel = (
            node._add(Client(inner)) for inner in (
                self._inner._send_goal, self._inner._get_result, self._inner._cancel_goal))
        self._callbacks = {}
        node._add(self)

    def wait_for_server(self, timeout_sec=None):
        end = None if timeout_sec is None else time.monotonic() + timeout_sec
        while not self._inner.is_ready():
            if end is not None and time.monotonic() >= end:
                return False
            time.sleep(0.01)
        return True

    def send_goal_async(self, goal, feedback_callback=None, goal_uuid=None):
        assert isinstance(goal, self._type.Goal), 'a goal of the type of the action'
        check(goal)
        number = uuid.uuid4().bytes if goal_uuid is None else bytes(goal_uuid.uuid)
        if feedback_callback is not None:
            self._callbacks[number] = feedback_callback
        sent, handled = self._send.call_async(
            self._type.SendGoal.Request(goal_id=goal_id(number), goal=goal)), Future()
        sent.add_done_callback(
            lambda answer: handled.set_result(ClientGoalHandle(self, number, answer.result())))
        return handled

    def work(self):
        """Hands feedback to whom it belongs."""
        for message in self._inner._feedback.take():
            callback = self._callbacks.get(bytes(message.goal_id.uuid))
            if callback is not None:
                callback(message)
        return False


class ClientGoalHandle:

    def __init__(self, client, number, answer):
        self._client, self.goal_id = client, goal_id(number)
        self.accepted, self.stamp = answer.accepted, answer.stamp

    def get_result_async(self):
        return self._client._result.call_async(
            self._client._type.GetResult.Request(goal_id=self.goal_id))

    def cancel_goal_async(self):
        request = CancelGoal.Request()
        request.goal_info.goal_id = self.goal_id
        return self._client._cancel.call_async(request)
