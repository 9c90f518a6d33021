"""Two computers, a router on each, and a bad link between them: 50 ms in each direction, and one packet in
fifty lost. Both routers are ours; the peer at the far one is of Eclipse's own library."""

import subprocess
import time

import pytest

import ros2_zenoh
from machine import die_with_parent, kerf
from programs import QUICK, SLOW, MachineState, load, path_chunks, until_state
from ros2 import LATCHED, ActionClient, until
from slow_link import Link
from test_zenoh import Machine as OneRouter, built_in, free_port

pytestmark = pytest.mark.skipif(not built_in(), reason='this kerf is built without Zenoh')

DELAY_S, LOSS = 0.05, 0.02


class Machine(OneRouter):
    """A machine at one router; peers are clients of the other, which has the link to the first."""

    def __init__(self):
        super().__init__()
        self.link = Link(self.port, DELAY_S, LOSS)
        self.far_port = free_port()
        self.far = subprocess.Popen(
            [kerf(), 'router'], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            preexec_fn=die_with_parent, env={'ZENOH_CONFIG_OVERRIDE': ';'.join((
                f'listen/endpoints=["tcp/127.0.0.1:{self.far_port}"]',
                f'connect/endpoints=["tcp/127.0.0.1:{self.link.port}"]'))})
        assert str(self.far_port).encode() in self.far.stdout.readline()

    def node(self, name='cell'):
        # A client has no way past its router.
        session = zenoh_client(self.far_port)
        return ros2_zenoh.Node(name, self.namespace, self.domain_id, None, session)

    def stop(self):
        self.far.terminate()
        assert self.far.wait(40) == 0
        self.link.close()
        super().stop()


def zenoh_client(port):
    return ros2_zenoh.zenoh.open(ros2_zenoh.config('client', connect=[f'tcp/127.0.0.1:{port}']))


@pytest.fixture(scope='module')
def machine():
    made = Machine().until_idle()
    yield made
    made.stop()


def age_s(state):
    stamp = state.header.stamp
    return time.time() - stamp.sec - stamp.nanosec / 1e9


def test_a_program_is_loaded_run_and_held_over_the_link(machine, node):
    answer, _ = load(node, text=SLOW, name='slow.ngc')
    runs = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program')
    goal = runs.send_goal(program_id=answer.program_id)
    assert goal.accepted
    state = until_state(node, MachineState.STATE_RUN)
    # Not from a queue that grows.
    assert age_s(state) < 2
    since = time.monotonic()
    assert node.client('std_srvs/srv/Trigger', 'feed_hold').call().success
    assert time.monotonic() - since > 2 * DELAY_S
    until_state(node, MachineState.STATE_HOLD)
    assert node.client('std_srvs/srv/Trigger', 'resume').call().success
    ended = goal.result()
    assert ended.status == 4, ended.result.message
    assert machine.link.lost > 0, machine.link.passed


def test_a_long_path_comes_whole(node):
    moves = ''.join(f'X{number % 300}.{number % 10} Y{number % 7}\n' for number in range(30_000))
    _, path = load(node, text=f'G21 G90 G1 F600\n{moves}M30\n', name='long.ngc')
    chunks = path_chunks(node, path)
    assert [chunk.index for chunk in chunks] == list(range(path.chunk_count))
    assert sum(len(chunk.elements) for chunk in chunks) == path.element_count > 29_000


def test_a_run_needs_no_link_and_its_end_is_known_when_it_is_back(machine):
    with machine.node() as node:
        answer, _ = load(node, text=SLOW, name='slow.ngc')
        runs = ActionClient(node, 'cnc_msgs/action/RunProgram', 'run_program')
        goal = runs.send_goal(program_id=answer.program_id)
        assert goal.accepted
        until_state(node, MachineState.STATE_RUN)
        states = node.subscription(MachineState.ros_name, 'machine_state', LATCHED)
        states.wait()
        machine.link.cut()
        # Longer than Zenoh keeps a link that is silent.
        time.sleep(13)
        states.take()
        time.sleep(1)
        assert states.take() == []
        machine.link.mend()
        idle = states.wait(lambda state: state.state == MachineState.STATE_IDLE)
        assert age_s(idle) < 5
        until('the driver', lambda: node.others('SS', node.resolve('run_program/_action/get_result')))
        assert goal.result().status == 4
        load(node, text=QUICK, name='quick.ngc')
