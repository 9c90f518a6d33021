"""The layouts for RViz and Foxglove name what the machine publishes, as it publishes it."""

import json

import pytest
from ruamel.yaml import YAML

from contract import COMMON, LATCHED, TOPICS
from machine import ROOT
from ros2 import message, until
from ros2.graph import Graph

# What the displays of RViz subscribe.
DISPLAYS = {
    'rviz_default_plugins/Path': 'nav_msgs/msg/Path',
    'rviz_default_plugins/MarkerArray': 'visualization_msgs/msg/MarkerArray',
    'rviz_default_plugins/Pose': 'geometry_msgs/msg/PoseStamped',
}
# What the panels of Foxglove that take one type show.
PANELS = {
    'DiagnosticSummary': 'diagnostic_msgs/msg/DiagnosticArray', 'RosOut': 'rcl_interfaces/msg/Log',
}
# Types that the 3D panel of Foxglove draws.
DRAWN = ('nav_msgs/msg/Path', 'visualization_msgs/msg/MarkerArray',
         'geometry_msgs/msg/PoseStamped', 'tf2_msgs/msg/TFMessage')

CONTRACT = {topic: (kind, qos) for topic, (_, kind, qos) in TOPICS.items()} | COMMON


def offered(topic):
    """Type and quality of service of a topic in the default namespace."""
    return CONTRACT[topic] if topic in CONTRACT else CONTRACT[topic.removeprefix('/')]


@pytest.fixture
def rviz():
    return YAML(typ='safe').load(ROOT / 'config/kerf.rviz')['Visualization Manager']


@pytest.fixture
def foxglove():
    return json.loads((ROOT / 'config/kerf.foxglove.json').read_text())


def test_rviz_shows_path_markers_tool_and_frames(rviz):
    shown = {display['Class'].split('/')[1] for display in rviz['Displays'] if display['Enabled']}
    assert shown >= {'Path', 'MarkerArray', 'Pose', 'TF'}


def test_rviz_asks_for_topics_as_they_are_offered(rviz):
    topics = [(it['Class'], it['Topic']) for it in rviz['Displays'] if 'Topic' in it]
    assert topics
    for display, topic in topics:
        kind, qos = offered(topic['Value'])
        assert kind == DISPLAYS[display], topic
        assert topic['Reliability Policy'] == 'Reliable'
        # What is latched is seen at once, and what is not cannot be asked for so.
        wanted = 'Transient Local' if qos == LATCHED else 'Volatile'
        assert topic['Durability Policy'] == wanted, topic
        # Relative, so that a namespace of RViz is that of its machine.
        assert not topic['Value'].startswith('/')


def test_foxglove_names_topics_that_are_published(foxglove):
    panels = foxglove['configById']
    for panel, config in panels.items():
        kind = panel.split('!')[0]
        if kind == '3D':
            assert config['topics']
            assert {offered(topic)[0] for topic in config['topics']} <= set(DRAWN)
        elif kind in PANELS:
            assert offered(config['topicToRender'])[0] == PANELS[kind]
        elif kind == 'RawMessages':
            assert message(offered(config['topicPath'])[0])
        else:
            assert kind in ('Plot', 'StateTransitions') and config['paths']
            for path in config['paths']:
                assert field_of(path['value']) is not None, path


def test_foxglove_places_every_panel_once(foxglove):
    def leaves(node):
        return [node] if isinstance(node, str) else leaves(node['first']) + leaves(node['second'])
    assert sorted(leaves(foxglove['layout'])) == sorted(foxglove['configById'])


def test_the_state_is_shown(foxglove):
    paths = [path['value'] for config in foxglove['configById'].values()
             for path in config.get('paths', [])]
    assert '/machine_state.state' in paths


@pytest.mark.dds
def test_the_frames_of_the_layouts_are_those_of_the_machine(machine, node, rviz, foxglove):
    frames = set()

    def seen():
        for found in tf.take():
            for transform in found.transforms:
                frames.update((transform.header.frame_id, transform.child_frame_id))
        # The layouts are for a machine without a namespace, which stands before its frames.
        named = {rviz['Global Options']['Fixed Frame'],
                 rviz['Views']['Current']['Target Frame'],
                 foxglove['configById']['3D!path']['fixedFrame']}
        return {f'{machine.namespace[1:]}/{frame}' for frame in named} <= frames
    tf = node.subscription('tf2_msgs/msg/TFMessage', '/tf')
    until('the frames', seen)
    graph = Graph(node)
    until('the preview', lambda: node.resolve('markers') in graph.publishers())


def field_of(path):
    """The field that a message path of Foxglove names, in a message of its topic."""
    topic, _, fields = path.partition('.')
    value = message(offered(topic)[0])()
    for field in fields.split('.'):
        value = getattr(value, field)
    return value
