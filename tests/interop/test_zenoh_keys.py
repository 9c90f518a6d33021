"""Certificates and rights: a router of Zenoh lets in whom the cell's authority has signed, and passes on
what the policy allows.

The files are those of `config/security/make_keystore.py`. The nodes are ours, in their enclaves; the
peers are of Eclipse's own library, with the file of their enclave as their session.
"""

import re
import subprocess
import sys
import time

import pytest
import zenoh

import ros2_zenoh
from contract import SERVICES, TRIGGERS
from machine import ROOT, Machine as OverDds, die_with_parent, kerf
from programs import QUICK, MachineState, until_state
from ros2 import LATCHED, ActionClient, NoAnswer, ParameterClient, message, until
from test_zenoh import built_in, free_port, run

pytestmark = pytest.mark.skipif(not built_in(), reason='this kerf is built without Zenoh')

Bool = message('std_msgs/msg/Bool')


def make_keystore(folder, namespace):
    subprocess.run([sys.executable, '-B', ROOT / 'config/security/make_keystore.py', folder,
                    '--namespace', namespace], check=True, capture_output=True)


def in_enclaves(keystore, port):
    """The variables of nodes with keys, whose router is at this port instead of the usual one."""
    return {'RMW_IMPLEMENTATION': 'rmw_zenoh_cpp', 'ROS_SECURITY_ENABLE': 'true',
            'ROS_SECURITY_STRATEGY': 'Enforce', 'ROS_SECURITY_KEYSTORE': str(keystore),
            'ZENOH_CONFIG_OVERRIDE': f'connect/endpoints=["tls/localhost:{port}"]'}


class Machine(OverDds):
    """A machine with keys: a router and nodes, each with the file of its enclave."""

    def __init__(self, folder):
        self.port, self.keystore = free_port(), folder / 'keys'
        super().__init__(rmw='rmw_zenoh_cpp', variables=self.made, ros_args=['--enclave', '/kerf'])

    def made(self, namespace):
        make_keystore(self.keystore, namespace)
        environment = {'ZENOH_ROUTER_CONFIG_URI': str(self.keystore / 'routers/localhost/router.json5'),
                       'ZENOH_CONFIG_OVERRIDE': f'listen/endpoints=["tls/localhost:{self.port}"]'}
        self.router = subprocess.Popen([kerf(), 'router'], env=environment, stdout=subprocess.PIPE,
                                       stderr=subprocess.STDOUT, preexec_fn=die_with_parent)
        # It says where it listens.
        assert str(self.port).encode() in self.router.stdout.readline()
        return in_enclaves(self.keystore, self.port)

    def peer(self, enclave, keystore=None, says=None):
        """A node of others; it may say another enclave than its certificate has."""
        file = (keystore or self.keystore) / 'enclaves' / enclave.lstrip('/') / 'zenoh.json5'
        config = zenoh.Config.from_file(str(file))
        config.insert_json5('connect/endpoints', f'["tls/localhost:{self.port}"]')
        return ros2_zenoh.Node(enclave.split('/')[-1], self.namespace, self.domain_id, None,
                               zenoh.open(config), says or enclave)

    def node(self, name='cell'):
        return self.peer('/kerf/viewer')

    def stop(self):
        super().stop()
        self.router.terminate()
        assert self.router.wait(40) == 0


@pytest.fixture(scope='module')
def machine(tmp_path_factory):
    made = Machine(tmp_path_factory.mktemp('keys')).until_idle()
    yield made
    made.stop()


def refused(client, allowed, **request):
    """Whether a call has no answer, while one that is allowed has its own."""
    sent = client.send(**request)
    assert allowed.call().success
    try:
        client.wait(sent, timeout=0.7)
    except NoAnswer:
        return True
    return False


def test_who_may_command_loads_and_runs(machine):
    with machine.peer('/kerf/commander') as commander:
        answer = commander.client('cnc_msgs/srv/LoadProgram', 'load_program').wait_for_service().call(
            text=QUICK, name='quick.ngc')
        assert answer.success, answer.message
        runs = ActionClient(commander, 'cnc_msgs/action/RunProgram', 'run_program')
        goal = runs.send_goal(program_id=answer.program_id)
        assert goal.accepted and goal.result().status == 4
        assert ParameterClient(commander, 'axis_driver').get('port')
    # The recorder has what latched topics and services of the others had for it.
    until('the bag to be complete', lambda: 'is complete' in machine.log())
    [bag] = (machine.folder / 'bags').glob('run_*')
    answer = run('replay', str(bag))
    assert answer.returncode == 0, answer.stderr


def test_the_command_has_an_enclave_too(machine):
    variables = in_enclaves(machine.keystore, machine.port) | {'ROS_DOMAIN_ID': str(machine.domain_id)}

    def as_one(enclave, *words):
        return run(*words, '--ros-args', '-r', f'__ns:={machine.namespace}', '--enclave', enclave, '--',
                   KERF_RUNTIME_DIR=str(machine.folder / 'no_sockets'), **variables)

    program = machine.file('part.ngc', QUICK)
    for words in (['status'], ['load', program], ['run']):
        answer = as_one('/kerf/commander', *words)
        assert answer.returncode == 0, answer.stderr
    answer = as_one('/kerf/viewer', 'status')
    assert answer.stdout.startswith('IDLE'), answer.stderr
    answer = as_one('/kerf/viewer', 'load', program)
    assert answer.returncode == 3 and 'has no right to it' in answer.stderr, answer.stderr
    answer = as_one('/kerf/nobody', 'status')
    assert answer.returncode == 2 and 'enclaves/kerf/nobody/zenoh.json5' in answer.stderr


def test_who_may_only_look_holds_and_does_nothing_else(machine):
    with machine.peer('/kerf/viewer') as viewer:
        allowed = {'feed_hold', 'get_tools', 'get_findings', 'program/get_chunks',
                   'programmed_contour/get_chunks', 'compensated_path/get_chunks'}
        hold = viewer.client('std_srvs/srv/Trigger', 'feed_hold').wait_for_service()
        assert hold.call().success
        services = {name: f'cnc_msgs/srv/{kind}' for of_node in SERVICES.values()
                    for name, kind in of_node.items()}
        services |= dict.fromkeys(TRIGGERS, 'std_srvs/srv/Trigger')
        assert allowed < services.keys()
        for name in services.keys() - allowed:
            assert refused(viewer.client(services[name], name), hold), name
        runs = viewer.client('cnc_msgs/action/RunProgram_SendGoal', 'run_program/_action/send_goal')
        assert refused(runs, hold)
    with machine.peer('/kerf/commander') as commander:
        until_state(commander, MachineState.STATE_HOLD)
        assert commander.client('std_srvs/srv/Trigger', 'resume').call().success
        until_state(commander, MachineState.STATE_IDLE)


def test_nobody_speaks_for_another(machine):
    with machine.peer('/kerf/viewer') as viewer, machine.peer('/kerf/commander') as commander:
        states = commander.subscription(MachineState.ros_name, 'machine_state', LATCHED)
        states.wait(lambda state: state.state == MachineState.STATE_IDLE)
        # What only the driver publishes.
        forged = viewer.publisher(MachineState.ros_name, 'machine_state', LATCHED)
        for _ in range(20):
            forged.publish(MachineState(state=MachineState.STATE_ALARM))
            time.sleep(0.05)
        assert all(state.state != MachineState.STATE_ALARM for state in states.take())
        # Its endpoint is seen under its own enclave.
        until('the publisher', lambda: any(
            token[6] == '%kerf%viewer' for token in commander.others('MP', states.topic)))
        # An answer in the name of the driver is not one either.
        key = viewer.key(viewer.resolve('resume'), 'std_srvs/srv/Trigger')
        asked = []
        viewer.session.declare_queryable(key, asked.append, complete=True)
        assert commander.client('std_srvs/srv/Trigger', 'resume').wait_for_service().call() is not None
        assert asked == []
    with machine.peer('/kerf/viewer', says='/kerf/axis_driver'), \
            machine.peer('/kerf/commander') as commander:
        time.sleep(1)
        assert not any('%kerf%axis_driver' in token and token.endswith('/viewer')
                       for token in commander.tokens)


def test_a_stranger_is_kept_out_and_a_node_says_why_it_finds_no_router(machine, tmp_path):
    make_keystore(tmp_path / 'strange', machine.namespace)
    with pytest.raises(zenoh.ZError):
        machine.peer('/kerf/commander', tmp_path / 'strange')
    since = time.monotonic()
    answer = run('node', 'run_recorder', '--ros-args', '--enclave', '/kerf/run_recorder',
                 **in_enclaves(tmp_path / 'strange', machine.port))
    # Two seconds, and the start of a process on a busy host; Zenoh alone would go on for ever.
    assert time.monotonic() - since < 10
    assert answer.returncode != 0
    assert 'certificates' in answer.stderr and str(machine.port) in answer.stderr


def test_a_node_with_keys_waits_for_its_router_as_long_as_it_is_told_to(machine):
    variables = in_enclaves(machine.keystore, free_port())
    words = ['node', 'run_recorder', '--ros-args', '--enclave', '/kerf/run_recorder']
    since = time.monotonic()
    answer = run(*words, **variables, ZENOH_ROUTER_CHECK_ATTEMPTS='3')
    assert time.monotonic() - since > 2.5
    assert answer.returncode != 0 and 'no Zenoh router at tls/localhost' in answer.stderr


def test_an_override_does_not_take_the_protection_away(machine):
    open_link = f'connect/endpoints=["tcp/localhost:{machine.port}"]'
    variables = in_enclaves(machine.keystore, machine.port) | {'ZENOH_CONFIG_OVERRIDE': open_link}
    answer = run('node', 'run_recorder', '--ros-args', '--enclave', '/kerf/run_recorder', **variables)
    assert answer.returncode != 0
    assert 'Enforce' in answer.stderr and 'is not tls/HOST:PORT' in answer.stderr, answer.stderr


def test_a_certificate_that_is_not_there_is_named(machine):
    (machine.keystore / 'enclaves/kerf/half').mkdir()
    session = (machine.keystore / 'enclaves/kerf/viewer/zenoh.json5').read_text()
    (machine.keystore / 'enclaves/kerf/half/zenoh.json5').write_text(
        re.sub('viewer/cert.pem', 'half/cert.pem', session))
    answer = run('node', 'run_recorder', '--ros-args', '--enclave', '/kerf/half',
                 **in_enclaves(machine.keystore, machine.port))
    assert answer.returncode != 0
    assert 'connect_certificate' in answer.stderr and 'half/cert.pem' in answer.stderr
