# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The configurations for RViz and Foxglove name topics of the contract."""

from collections.abc import Iterator
import json
from pathlib import Path
import re
from typing import Any

from crgame_ros.messages.contract import load_contract, Topic
from crgame_ros.timing.cycle_rows import CycleRows
import pytest
import yaml

DISPLAYED = {'MarkerArray': 'visualization_msgs/msg/MarkerArray', 'Path': 'nav_msgs/msg/Path',
             'Odometry': 'nav_msgs/msg/Odometry', 'LaserScan': 'sensor_msgs/msg/LaserScan',
             'Map': 'nav_msgs/msg/OccupancyGrid'}


@pytest.fixture(scope='module')
def contract() -> dict[str, Topic]:
    """Return the topics of a game of two humans and two AVs."""
    return {name: topic for topic in load_contract().topics.values()
            for name in topic.names(('hv0', 'hv1'), ('av0', 'av1'))}


@pytest.fixture(scope='module')
def topics(contract: dict[str, Topic]) -> dict[str, str]:
    """Return the types of these topics."""
    return {name: topic.type_name for name, topic in contract.items()}


@pytest.fixture(scope='module')
def rviz(project_root: Path) -> dict[str, Any]:
    """Return the configuration of RViz."""
    return yaml.safe_load((project_root / 'config' / 'crgame.rviz').read_text())[
        'Visualization Manager']


@pytest.fixture(scope='module')
def foxglove(project_root: Path) -> dict[str, Any]:
    """Return the layout of Foxglove."""
    return json.loads((project_root / 'config' / 'crgame_foxglove.json').read_text())


def test_rviz_shows_the_scene_from_above(rviz: dict[str, Any],
                                         contract: dict[str, Topic]) -> None:
    """The fixed frame is the markers'; each display has its topic, type and QoS as published."""
    assert rviz['Global Options']['Fixed Frame'] == 'map'
    assert rviz['Views']['Current']['Class'] == 'rviz_default_plugins/TopDownOrtho'
    seen = set()
    for display in rviz['Displays']:
        kind = display['Class'].removeprefix('rviz_default_plugins/')
        if kind == 'TF':
            # It names no topics: it takes /tf and /tf_static.
            continue
        topic = display['Topic']['Value']
        assert contract[topic].type_name == DISPLAYED[kind]
        # A best-effort publisher would send nothing to a reliable subscriber, or the reverse; and
        # a latched message comes to a late viewer only if it asks for it.
        qos = contract[topic].qos
        assert display['Topic']['Reliability Policy'] == qos.reliability.title() == 'Reliable'
        assert display['Topic']['Durability Policy'] == qos.durability.replace('_', ' ').title()
        seen.add((kind, topic, display['Enabled']))
    assert {('MarkerArray', '/markers', True), ('Path', '/av0/plan_path', True),
            ('Odometry', '/hv0/odom', False), ('LaserScan', '/av0/scan', True),
            ('LaserScan', '/av1/scan', True), ('Map', '/occupancy', True)} <= seen
    assert {display['Class'] for display in rviz['Displays']} >= {'rviz_default_plugins/TF'}


def _leaves(node: str | dict[str, Any]) -> Iterator[str]:
    if isinstance(node, str):
        yield node
    else:
        yield from (*_leaves(node['first']), *_leaves(node['second']))


def test_foxglove_places_every_panel_once(foxglove: dict[str, Any]) -> None:
    """Each panel that has a configuration has a place, and only these."""
    placed = list(_leaves(foxglove['layout']))
    assert sorted(placed) == sorted(foxglove['configById'])
    assert {name.partition('!')[0] for name in placed} == {'3D', 'Plot', 'DiagnosticSummary'}


def test_foxglove_names_topics_of_the_contract(
        foxglove: dict[str, Any], topics: dict[str, str]) -> None:
    """The scene in frame map from above, plots of speed and drift, and the diagnostics."""
    panels = foxglove['configById']
    scene = panels['3D!scene']
    assert (scene['followTf'], scene['cameraState']['perspective']) == ('map', False)
    assert {topics[name] for name in scene['topics']} == {
        'visualization_msgs/msg/MarkerArray', 'nav_msgs/msg/Path'}
    assert topics[panels['DiagnosticSummary!nodes']['topicToRender']] \
        == 'diagnostic_msgs/msg/DiagnosticArray'
    paths = [path['value'] for name in ('Plot!speed', 'Plot!drift')
             for path in panels[name]['paths']]
    assert all(path.partition('.')[0] in topics for path in paths)
    columns = CycleRows(['hv0'], 1).columns
    drift = [int(re.search(r'data\[(\d+)\]$', path['value'])[1])
             for path in panels['Plot!drift']['paths']]
    assert [columns[index] for index in drift] == ['cumulative_error_s', 'step_error_s']
