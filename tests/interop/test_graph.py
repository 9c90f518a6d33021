"""What `ros2 node`, `ros2 topic`, `ros2 service` and `ros2 action` see, from DDS discovery."""

import re

import pytest
from cyclonedds.core import Policy

from contract import (ACTIONS, COMMON, COMMON_SERVICES, LATCHED, NODES, SERVICES, TOPICS,
                      TRIGGERS)
from ros2 import interfaces, until
from ros2.graph import Graph


@pytest.fixture(scope='module')
def node(machine):
    """One node that looks for all tests: the graph is the same for all."""
    with machine.node() as made:
        yield made


@pytest.fixture(scope='module')
def graph(machine, node):
    """The graph, once all nodes of the machine and their endpoints are in it."""
    made = Graph(node)
    names = {f'{machine.namespace}/{name}' for name in NODES}
    until('all nodes', lambda: names <= made.nodes().keys())
    until('all endpoints', lambda: all(
        topic in made.publishers() for topic in map(node.resolve, TOPICS)))
    return made


def test_every_node_is_in_the_list(machine, node, graph):
    found = {name for name in graph.nodes() if name.startswith(machine.namespace)}
    expected = {f'{machine.namespace}/{name}' for name in NODES}
    # And those of tests: the one of this test, and perhaps one that has just left.
    assert expected | {node.full_name} <= found


@pytest.mark.parametrize('name', NODES)
def test_a_node_publishes_what_it_should(machine, node, graph, name):
    full = f'{machine.namespace}/{name}'
    published = graph.info(full)['publishers']
    expected = {node.resolve(topic): kind for topic, (owner, kind, _) in TOPICS.items()
                if owner == name}
    expected |= {node.resolve(topic.replace('~', name)): kind
                 for topic, (kind, _) in COMMON.items()}
    if name != 'run_recorder':
        expected[node.resolve('command_log')] = 'cnc_msgs/msg/Command'
    assert published == expected


@pytest.mark.parametrize('name', NODES)
def test_a_node_offers_the_services_it_should(machine, node, graph, name):
    offered = graph.info(f'{machine.namespace}/{name}')['services']
    expected = {node.resolve(service): f'cnc_msgs/srv/{kind}'
                for service, kind in SERVICES[name].items()}
    expected |= {node.resolve(f'{name}/{service}'): kind
                 for service, kind in COMMON_SERVICES.items()}
    if name == 'axis_driver':
        expected |= {node.resolve(trigger): 'std_srvs/srv/Trigger' for trigger in TRIGGERS}
        expected[node.resolve('single_block')] = 'std_srvs/srv/SetBool'
        for action, kind in ACTIONS.items():
            base = node.resolve(f'{action}/_action')
            expected |= {
                f'{base}/send_goal': f'cnc_msgs/action/{kind}_SendGoal',
                f'{base}/get_result': f'cnc_msgs/action/{kind}_GetResult',
                f'{base}/cancel_goal': 'action_msgs/srv/CancelGoal'}
    assert offered == expected


def test_every_topic_is_offered_as_it_is_documented(node, graph):
    offered = {}
    for end in graph.writers():
        offered.setdefault(end.topic, set()).add((end.reliable, end.transient_local))
    for topic, (_, _, qos) in TOPICS.items():
        assert offered[node.resolve(topic)] == {qos}, topic
    for topic, (_, qos) in COMMON.items():
        # On /parameter_events a second, silent publisher of the client library is latched.
        assert qos in offered[node.resolve(topic.replace('~', 'axis_driver'))], topic


def test_a_latched_topic_of_the_machine_has_one_publisher(node, graph):
    # `ros2 bag record` asks for latched messages only where all publishers latch.
    for topic, (_, _, qos) in TOPICS.items():
        if qos == LATCHED:
            ends = [end for end in graph.writers() if end.topic == node.resolve(topic)]
            assert len(ends) == 1, topic


def test_nobody_asks_for_more_than_is_offered(machine, graph):
    offered = {}
    for end in graph.writers():
        offered.setdefault(end.dds_topic, []).append(end)
    for end in graph.readers():
        for writer in offered.get(end.dds_topic, []):
            assert end.reliable <= writer.reliable, end.dds_topic
            if 'parameter_events' not in end.dds_topic:
                assert end.transient_local <= writer.transient_local, end.dds_topic


def test_every_type_is_one_of_a_file(machine, graph):
    known = set(interfaces.names())
    for end in (*graph.writers(), *graph.readers()):
        if machine.namespace in end.dds_topic:
            assert end.type in known, end.dds_topic


def test_every_node_announces_itself_with_its_endpoints_alone(machine, graph):
    nodes = graph.nodes()
    own = {name: nodes[f'{machine.namespace}/{name}'] for name in NODES}
    for name, (readers, writers) in own.items():
        # All endpoints of a process begin with the same twelve bytes.
        assert len({gid[:12] for gid in readers | writers}) == 1, name
    assert len({next(iter(writers))[:12] for _, writers in own.values()}) == len(NODES)


def test_each_endpoint_announces_the_hash_of_its_type(machine, graph):
    ends = [*graph.writers(), *graph.readers()]
    own = [end for end in ends if machine.namespace in end.dds_topic]
    assert own
    for end in own:
        assert Policy.Userdata in end.qos, end.dds_topic
        announced = bytes(end.qos[Policy.Userdata].data).decode()
        assert re.fullmatch('typehash=RIHS01_[0-9a-f]{64};', announced), end.dds_topic
