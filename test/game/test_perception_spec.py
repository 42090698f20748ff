# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The key `perception` of a game file: read, refused, written."""

from pathlib import Path
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.game.perception_spec import (
    LocalisationSpec,
    PerceptionSpec,
    SensorSpec,
)
from crgame_ros.schema.reading import read
from crgame_ros.schema.writing import write
import pytest
import yaml

BASE = Path('/games')
EVERYTHING = """
localisation:
  position_noise: 0.2
  yaw_noise: 0.02
  speed_noise: 1
  position_bias: [0.5, -1]
  yaw_bias: 0.01
  bias_walk: 0.05
  rate: 20
  acceleration_noise: 0.03
  yaw_rate_noise: 0.003
  motion_noise: 0.01
  dropout_rate: 0.1
  dropout_duration: 4
sensors:
  - {name: front, x: 4, yaw: 0.1, field_of_view: 1.5, horizon: 120, rays: 181, rate: 12.5,
     latency: 0.1, range_noise: 0, position_noise: 0, yaw_noise: 0, velocity_noise: 0,
     min_rays: 2}
  - {model: 'radar.py:Radar', y: -0.5, options: {power: 3.0}}
memory: 2
seed: 4
"""


def parse(text: str) -> PerceptionSpec:
    return read(PerceptionSpec, yaml.safe_load(text), 'game.yaml: avs[0]: perception', BASE)


def test_nothing_said_is_a_front_lidar_and_a_noisy_pose() -> None:
    """`perception: {}` gives a front lidar and a noisy pose."""
    spec = parse('{}')
    assert spec == PerceptionSpec()
    assert spec.localisation == LocalisationSpec()
    assert [sensor.name for sensor in spec.sensors] == ['front']


def test_everything_said_is_understood() -> None:
    """Integers become lengths and times; names and files are resolved."""
    spec = parse(EVERYTHING)
    assert spec.localisation is not None
    assert spec.localisation.position_bias == (0.5, -1.0)
    assert spec.localisation.speed_noise == 1.0
    first, second = spec.sensors
    assert first.x == 4.0
    assert isinstance(first.x, float)
    assert first.horizon == 120.0
    assert second == SensorSpec('sensor1', '/games/radar.py:Radar', y=-0.5,
                                options={'power': 3.0})
    assert (spec.memory, spec.seed) == (2.0, 4)


@pytest.mark.parametrize('text', [
    '{}', EVERYTHING, 'localisation: null', 'sensors: []', 'localisation: {}\nsensors: [{}]'],
    ids=['default', 'everything', 'true pose', 'sees all', 'defaults'])
def test_what_is_written_reads_the_same(text: str) -> None:
    """A specification survives YAML and back."""
    spec = parse(text)
    assert parse(yaml.safe_dump(write(spec))) == spec


def test_null_and_empty_list_switch_off() -> None:
    """Null gives the true pose, and an empty list makes all objects visible."""
    spec = parse('{localisation: null, sensors: []}')
    assert spec.localisation is None
    assert spec.sensors == ()


@pytest.mark.parametrize(('text', 'message'), [
    ('1', 'perception: is no mapping; give {} for a front lidar'),
    ('sensor: []', '"sensor" is unknown; did you mean "sensors"? known are localisation, sensors'),
    ('sensors: {}', '"sensors" is no list; give one entry for each sensor'),
    ('sensors: [1]', 'sensors[0]: is no mapping'),
    ('sensors: [{horizont: 3}]',
     'sensors[0]: "horizont" is unknown; did you mean "horizon"? known are name, model, x'),
    ('sensors: [{horizon: 0}]', '"horizon" is 0; give a number from 0.1 to 1000'),
    ('sensors: [{rays: 1.5}]', '"rays" is 1.5; give a whole number from 1 to 10000'),
    ('sensors: [{field_of_view: 360}]', '"field_of_view" is 360; give a number from 0.001'),
    ('sensors: [{x: front}]', '"x" is \'front\'; give a number'),
    ('sensors: [{name: Front}]', '"name" is \'Front\'; begin with a-z'),
    ('sensors: [{name: a}, {name: a}]', 'sensors[1]: "a" is there already'),
    ('sensors: [{options: 3}]', '"options" is 3; give a mapping'),
    ('sensors: [{position_noise: -1}]', '"position_noise" is -1; give a number from 0 to 100'),
    ('localisation: 3', 'localisation: is no mapping; give {} for a noisy pose, null'),
    ('localisation: {position_noise: 0}', '"position_noise" is 0; give a number from 1e-06'),
    ('localisation: {position_bias: 3}',
     '"position_bias" is 3; give [x, y], numbers from -1000 to 1000'),
    ('localisation: {position_bias: [1, .nan]}', '"position_bias" holds nan; give [x, y]'),
    ('localisation: {rate: .inf}', '"rate" is inf'),
    ('memory: -1', '"memory" is -1; give a number from 0 to 3600'),
    ('seed: -1', '"seed" is -1'),
], ids=range(20))
def test_one_clear_line_for_what_is_wrong(text: str, message: str) -> None:
    """The message is one line with the place, the key and valid values."""
    with pytest.raises(InputError) as caught:
        parse(text)
    line = str(caught.value)
    assert line.startswith('game.yaml: avs[0]: perception')
    assert message in line
    assert '\n' not in line


def test_too_many_sensors_are_refused() -> None:
    """The number of sensors is limited, as each costs a scan."""
    values: dict[str, Any] = {'sensors': [{}] * 33}
    with pytest.raises(InputError, match='has 33 entries; give 32 at most'):
        read(PerceptionSpec, values, 'game.yaml', BASE)
