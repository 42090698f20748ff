# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reading and checking of config/control.yaml."""

from dataclasses import fields
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.paths import config_directory
from crgame_ros.vehicle.control_settings import (
    control_settings,
    load_control_settings,
    with_options,
)
import pytest
import yaml

SHIPPED = config_directory() / 'control.yaml'


def test_every_value_of_the_file_is_read() -> None:
    values = yaml.safe_load(SHIPPED.read_text(encoding='utf-8'))
    settings = control_settings()
    for section in fields(settings):
        read = vars(getattr(settings, section.name))
        assert read == values[section.name.replace('_', '-')]


def test_every_value_has_a_unit_or_a_reason() -> None:
    lines = [line for line in SHIPPED.read_text(encoding='utf-8').splitlines()
             if line.startswith('  ')]
    assert len(lines) == 16
    assert all('#' in line for line in lines)


@pytest.mark.parametrize(('old', 'new', 'message'), [
    ('slip: 0.95', 'slip: 1.2', r'dynamic-bicycle: "slip" is 1.2; give a number from 0 to 1'),
    ('slip: 0.95', 'slip: some', r'dynamic-bicycle: "slip" is .some.; give a number'),
    ('slip: 0.95', 'grip: 0.95', r'dynamic-bicycle: "grip" is unknown; .*known are slip'),
    ('speed_gain: 1.2', 'speed_gain: .nan', r'speed-control: "speed_gain" is nan'),
    ('feed_forward: true', 'feed_forward: 1', r'lqr: "feed_forward" is 1; give true or'),
    ('lqr:', 'mpc:', r'"mpc" is unknown; known are dynamic-bicycle, .*; 1 more is wrong'),
    ('lqr:', '[', r'is no YAML')],
    ids=['bounds', 'text', 'unknown', 'nan', 'switch', 'section', 'yaml'])
def test_wrong_files_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    file = tmp_path / 'control.yaml'
    file.write_text(SHIPPED.read_text(encoding='utf-8').replace(old, new), encoding='utf-8')
    with pytest.raises(InputError, match=message) as caught:
        load_control_settings(file)
    assert str(file) in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='none.yaml: cannot read the file of gains'):
        load_control_settings(tmp_path / 'none.yaml')


def test_options_come_before_the_file() -> None:
    settings = control_settings().lqr
    assert with_options(settings, 'here', correction=None, lateral_error=None) == settings
    assert with_options(settings, 'here', correction=1.0).correction == 1.0
    with pytest.raises(InputError, match='here: "correction" is -1.0; give a number from 0.001'):
        with_options(settings, 'here', correction=-1.0)
