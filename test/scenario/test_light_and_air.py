# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Light and air: values of the game, and of the scenario where the game has none."""

import json
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.game.documents import GAME
from crgame_ros.game.game import EnvironmentSpec, load_game, parse_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.scenario.light_and_air import environment_of
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import build_setup
import pytest
import yaml

ELEMENT = ('<environment><time>{time}</time><timeOfDay>{time_of_day}</timeOfDay>'
           '<weather>{weather}</weather><underground>wet</underground></environment>')


def scenario_with(time_of_day: str, weather: str) -> str:
    """Return one of the package's scenarios with an environment element, read by commonroad-io."""
    text = (scenarios_directory() / 'ZAM_CutIn-1_1_T-1.xml').read_text()
    element = ELEMENT.format(time='19:30', time_of_day=time_of_day, weather=weather)
    assert '</location>' in text
    return text.replace('</location>', f'{element}</location>')


@pytest.mark.parametrize(('time_of_day', 'weather', 'light', 'visibility'), [
    ('night', 'fog', 'dusk', 200.0), ('sunset', 'clear', 'dusk', 30_000.0),
    ('noon', 'heavy_rain', 'day', 30_000.0), ('unknown', 'unknown', 'day', 30_000.0)])
def test_a_scenarios_environment(time_of_day: str, weather: str, light: str,
                                 visibility: float) -> None:
    scenario = parse_scenario(scenario_with(time_of_day, weather), 'test').scenario
    assert environment_of(scenario, None) == EnvironmentSpec(light, visibility)  # type: ignore
    # Each key of the game separately overrides the file's.
    assert environment_of(scenario, EnvironmentSpec('day')) == EnvironmentSpec('day', visibility)
    assert environment_of(scenario, EnvironmentSpec(None, 60.0)) == EnvironmentSpec(
        light, 60.0)  # type: ignore


@pytest.mark.parametrize(('wrong', 'told'), [
    ({'light': 'night'}, 'use one of day, dusk'), ({'visibility': 5}, 'from 10 to 100000'),
    ({'visibility': float('inf')}, 'from 10 to 100000'), ({'haze': 1}, '"haze" is unknown')])
def test_what_cannot_be_shown_is_refused(wrong: dict[str, object], told: str) -> None:
    with pytest.raises(InputError, match=told):
        parse_game({'scenario': 'a.xml', 'environment': wrong}, 'test', Path('.'))


def test_a_run_records_what_was_resolved() -> None:
    game = load_game(scenarios_directory() / 'fog.yaml')
    text = GAME.write(describe_game(build_setup(game)))
    assert GAME.read(text).environment == EnvironmentSpec('day', 80.0)
    # The file itself omits the values that the game omits.
    assert yaml.safe_load(game.dump())['environment'] == {'visibility': 80.0}
    old = json.loads(text)
    del old['environment']
    assert GAME.read(json.dumps(old)).environment is None
    with pytest.raises(InputError, match='environment'):
        GAME.read(json.dumps(old | {'environment': {'visibility': -1}}))
