"""Actions: three services and two topics below `NAME/_action`."""

import uuid

from . import interfaces
from .node import DEFAULT, LATCHED, TIMEOUT, until

GoalStatus = interfaces.message('action_msgs/msg/GoalStatus')
CancelGoal = interfaces.service('action_msgs/srv/CancelGoal')


def goal_id(number):
    """`unique_identifier_msgs/UUID` of sixteen bytes."""
    return interfaces.message('unique_identifier_msgs/msg/UUID')(uuid=list(number))


class ActionClient:
    """`rclpy.action.ActionClient`."""

    def __init__(self, node, type_name, name):
        self.kind = interfaces.action(type_name)
        self.name = node.resolve(name)
        base = f'{self.name}/_action'
        self._send_goal = node.client(self.kind.SendGoal.name, f'{base}/send_goal')
        self._get_result = node.client(self.kind.GetResult.name, f'{base}/get_result')
        self._cancel_goal = node.client(CancelGoal.name, f'{base}/cancel_goal')
        # As rcl asks for them.
        self._feedback = node.subscription(
            self.kind.FeedbackMessage.ros_name, f'{base}/feedback', DEFAULT)
        self._status = node.subscription(GoalStatus.ros_name + 'Array', f'{base}/status', LATCHED)
        self._all_feedback = []

    def wait_for_server(self, timeout=TIMEOUT):
        until(f'the action server {self.name}', self.is_ready, timeout)
        return self

    def is_ready(self):
        """As `server_is_ready`: all five ways are open."""
        services = (self._send_goal, self._get_result, self._cancel_goal)
        return (all(service.is_ready() for service in services)
                and self._feedback.publisher_count() and self._status.publisher_count())

    def send_goal(self, goal_uuid=None, **fields):
        """Sends a goal and waits until it is accepted or rejected."""
        self.wait_for_server()
        number = (goal_uuid or uuid.uuid4()).bytes
        answer = self._send_goal.call(goal_id=goal_id(number), goal=self.kind.Goal(**fields))
        return GoalHandle(self, number, answer)

    def statuses(self, timeout=TIMEOUT):
        """The newest status of every goal that the server knows, by id."""
        newest = self._status.newest(timeout)
        return {bytes(status.goal_info.goal_id.uuid): status.status
                for status in newest.status_list}

    def cancel(self, number=bytes(16), stamp=None):
        """The raw service: one goal, all (no id, no stamp), or all up to a time."""
        request = CancelGoal.Request()
        request.goal_info.goal_id = goal_id(number)
        if stamp is not None:
            request.goal_info.stamp = stamp
        return self._cancel_goal.call(request)

    def result(self, number, timeout=TIMEOUT):
        """The raw service: any client that knows the id may call it."""
        self._get_result.wait_for_service()
        return self._get_result.call(goal_id=goal_id(number), timeout=timeout)

    def feedback_of(self, number):
        """All feedback of a goal that has arrived so far."""
        self._all_feedback += self._feedback.take()
        return [message.feedback for message in self._all_feedback
                if bytes(message.goal_id.uuid) == number]


class GoalHandle:
    """`ClientGoalHandle`: one goal that was sent."""

    def __init__(self, client, number, answer):
        self._client, self.number = client, number
        self.accepted, self.stamp = answer.accepted, answer.stamp

    def feedback(self):
        return self._client.feedback_of(self.number)

    def wait_for_feedback(self, what=lambda _: True, timeout=TIMEOUT):
        return until('feedback', lambda: next(
            (feedback for feedback in self.feedback() if what(feedback)), None), timeout)

    def cancel(self):
        return self._client.cancel(self.number)

    def result(self, timeout=TIMEOUT):
        """Waits for the end; the status is that of `action_msgs/GoalStatus`."""
        return self._client.result(self.number, timeout)
