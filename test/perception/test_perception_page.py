# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The examples of docs/perception.md work as described."""

import math
from pathlib import Path
import re

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.perception_spec import PerceptionSpec
from crgame_ros.schema.reading import read
from crgame_ros.schema.writing import write
from perception_support import CAR, VAN, World
import pytest
import yaml


def examples(root: Path, language: str) -> list[str]:
    """Return the page's code blocks of a language, in order."""
    page = (root / 'docs' / 'perception.md').read_text(encoding='utf-8')
    found: list[str] = re.findall(rf'```{language}\n(.*?)```', page, re.DOTALL)
    return found


def test_written_defaults_are_the_defaults(project_root: Path, tmp_path: Path) -> None:
    """The page lists every key of the specification with its default value."""
    values = yaml.safe_load(examples(project_root, 'yaml')[1])['perception']
    said = write(read(PerceptionSpec, values, 'docs/perception.md', tmp_path))
    sensor = write(PerceptionSpec())['sensors'][0]
    assert said['sensors'][0].pop('field_of_view') == pytest.approx(
        sensor.pop('field_of_view'), abs=1e-3)
    assert said['sensors'][0] == sensor
    assert values['sensors'][0].keys() == {*sensor, 'field_of_view'}
    expected = write(PerceptionSpec())
    for key in ('localisation', 'memory', 'seed'):
        assert said[key] == expected[key]
    assert values['localisation'].keys() == expected['localisation'].keys()


def test_the_sensor_of_the_page_works(project_root: Path, tmp_path: Path) -> None:
    """It sees a car only within its range of 100 m and its field of view."""
    (tmp_path / 'radar.py').write_text(examples(project_root, 'python')[0])
    spec = read(PerceptionSpec, yaml.safe_load(examples(project_root, 'yaml')[2]),
                'page', tmp_path)
    behind = ObjectDescription('o9', 'car', Role.RECORDED, CAR.shape)
    world = World([(CAR, (90.0, 5.0, 0.0), (0.0, 0.0, 0.0)),
                   (VAN, (120.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
                   (behind, (-20.0, 0.0, math.pi), (0.0, 0.0, 0.0))], spec.sensors).run(0, 0)
    assert world.perception.seen.tolist() == [True, True, False, False]
