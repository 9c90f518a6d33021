"""Kerf on a computer to which many nodes of others have come before."""

import time

import rclpy
from cnc_msgs.action import RunProgram
from cnc_msgs.srv import LoadProgram
from rclpy.action import ActionClient

from machine import Machine, domain
from rclpy_peer import TIMEOUT, Peer

NODES = {'program_loader', 'compensation_planner', 'axis_driver', 'run_recorder'}


def test_thirteen_nodes_of_others_may_come_first():
    contexts = []
    for _ in range(13):
        # A participant each, as processes of their own have.
        context = rclpy.Context()
        rclpy.init(context=context, domain_id=domain())
        contexts.append(context)
    others = [rclpy.create_node(f'other_{number}', context=context)
              for number, context in enumerate(contexts)]
    machine = Machine(rmw='rmw_fastrtps_cpp').until_idle()
    try:
        end = time.monotonic() + TIMEOUT
        for other in others:
            while not {name for name, namespace in other.get_node_names_and_namespaces()
                       if namespace == machine.namespace} >= NODES:
                assert time.monotonic() < end, f'{other.get_name()} does not see all nodes'
                time.sleep(0.1)
        peer = Peer(contexts[-1], machine.namespace)
        answer = peer.call(LoadProgram, 'load_program', name='part.ngc',
                           text='G21 G90\nG0 X10\nG1 X20 F600\nM2\n')
        assert answer.success, answer.message
        client = ActionClient(peer.node, RunProgram, 'run_program')
        peer.until('the action', client.server_is_ready)
        # The path is planned meanwhile.
        goal = peer.until('a run', lambda: accepted(peer, client))
        assert peer.result('the end', goal.get_result_async()).result.outcome == \
            RunProgram.Result.OUTCOME_SUCCEEDED
        peer.close()
    finally:
        machine.stop()
        for other, context in zip(others, contexts):
            other.destroy_node()
            rclpy.shutdown(context=context)


def accepted(peer, client):
    goal = peer.result('a decision', client.send_goal_async(RunProgram.Goal()))
    return goal if goal.accepted else None
