"""The state of another node, as `ros2 lifecycle` sees and changes it."""

from . import interfaces
from .node import TIMEOUT

State = interfaces.message('lifecycle_msgs/msg/State')
Transition = interfaces.message('lifecycle_msgs/msg/Transition')


class LifecycleClient:
    """What a manager of nodes does with one of them."""

    def __init__(self, node, target):
        def client(kind, name):
            return node.client(f'lifecycle_msgs/srv/{kind}', f'{target}/{name}')
        self._get = client('GetState', 'get_state')
        self._change = client('ChangeState', 'change_state')
        self._states = client('GetAvailableStates', 'get_available_states')
        self._transitions = client('GetAvailableTransitions', 'get_available_transitions')
        self._graph = client('GetAvailableTransitions', 'get_transition_graph')

    def state(self, timeout=TIMEOUT):
        """The label: `active`."""
        return self._get.call(timeout=timeout).current_state.label

    def change(self, transition):
        """By its number, as `ros2 lifecycle set` asks for it; whether it went."""
        return self._change.call(transition=Transition(id=transition)).success

    def states(self):
        return [state.label for state in self._states.call().available_states]

    def transitions(self):
        return {it.transition.label: it.transition.id
                for it in self._transitions.call().available_transitions}

    def graph(self):
        return [(it.start_state.label, it.transition.label, it.goal_state.label)
                for it in self._graph.call().available_transitions]
