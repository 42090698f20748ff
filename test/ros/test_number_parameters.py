# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the nodes: numbers of both kinds, wrong ones in one line, all of them listed."""

import os
from pathlib import Path
import re
import subprocess
import sys

from crgame_ros.analysis.criticality.thresholds import OPTIONS
import pytest
from ros_domains import own_domain_id
import yaml


def start(node: str, *parameters: str) -> subprocess.CompletedProcess[str]:
    """Start a node with parameters that let it end by itself."""
    words = [word for item in parameters for word in ('-p', item)]
    return subprocess.run(
        [sys.executable, '-m', f'crgame_ros.nodes.{node}', '--ros-args', *words],
        env=os.environ | {'ROS_DOMAIN_ID': str(own_domain_id())}, capture_output=True, text=True,
        timeout=90.0, check=False)


@pytest.mark.exhaustive
def test_whole_numbers_are_numbers_and_a_game_has_a_name() -> None:
    """The factor and the duration as whole numbers, the game by its name alone."""
    done = start('sim_node', 'game:=traffic_jam_no_such', 'duration:=1')
    assert done.returncode == 2 and 'traffic_jam_no_such' in done.stderr
    done = start('sim_node', 'game:=cut_in', 'real_time_factor:=5', 'duration:=1',
                 'planner_timeout:=0')
    assert done.returncode == 0, done.stderr
    assert 'finished at 1.00 s' in done.stdout + done.stderr


@pytest.mark.matrix
@pytest.mark.parametrize(('node', 'parameter'), [
    ('sim_node', 'real_time_factor:=fast'), ('sim_node', 'real_time_factor:=1000'),
    ('sim_node', 'duration:=true'), ('sim_node', 'game:=7'), ('map_node', 'reach:=0'),
    ('planner_node', 'vehicle:=[1]')])
def test_what_a_parameter_cannot_be_is_said_in_one_line(node: str, parameter: str) -> None:
    done = start(node, parameter)
    assert done.returncode == 2
    assert 'Traceback' not in done.stderr
    assert parameter.split(':')[0] in done.stderr
    assert len([line for line in done.stderr.splitlines() if line.startswith('error:')]) == 1


def test_the_file_of_parameters_lists_every_one(project_root: Path) -> None:
    """`config/nodes.yaml` names what the nodes declare, and nothing else."""
    listed = yaml.safe_load((project_root / 'config' / 'nodes.yaml').read_text())
    nodes = project_root / 'crgame_ros' / 'nodes'
    for path in sorted(nodes.glob('*_node.py')):
        source = path.read_text()
        if path.stem == 'sim_node':
            source += (nodes / 'sim' / 'control.py').read_text()
        declared = set(re.findall(
            r"(?:declare_parameter|declare)\(\s*'([a-z_]+)'", source))
        declared |= set(re.findall(r"(?:declare_number|fixed)\(\s*self(?:\._node)?,\s*'([a-z_]+)'",
                                   source))
        if 'OPTIONS.items()' in source:
            declared |= {name for name, _ in OPTIONS.values()}
        if 'TrustedCode(' in source:
            declared.add('roster')
        names = set(listed.get(path.stem, {}).get('ros__parameters', {}))
        assert names == declared, path.stem
