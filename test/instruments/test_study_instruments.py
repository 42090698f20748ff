# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Instruments that a study gives once, for the games of all its trials."""

from dataclasses import replace
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.game.game import load_game, parse_game
from crgame_ros.game.instruments_spec import InstrumentsSpec
from crgame_ros.paths import scenarios_directory
from crgame_ros.schema.reading import read
from crgame_ros.simulation.roster import Participants
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import build_setup
from crgame_ros.study.trial_game import trial_game
from crgame_ros.study.trial_settings import laid, TrialSettings
import pytest
import yaml

TEXT = """
outlets: true
inlets: [Gaze, {type: ECG}]
triggers: {address: '127.0.0.1:5555', codes: {stimulus: 1, event/brake: 9}}
"""


def _settings(given: dict[str, object]) -> TrialSettings:
    found: TrialSettings = read(TrialSettings, given, 'settings', Path('.'))
    return found


def test_a_study_gives_them_once(tmp_path: Path) -> None:
    """They reach each trial's game, its file, and the processes; a trial may have others."""
    game = tmp_path / 'game.yaml'
    game.write_text(load_game(scenarios_directory() / 'cut_in.yaml').dump())
    study = _settings({'game': str(game), 'instruments': yaml.safe_load(TEXT)})
    spec: InstrumentsSpec = read(InstrumentsSpec, yaml.safe_load(TEXT), '')
    made = trial_game(laid(study, _settings({'sound': False})), 'idle')
    assert made.instruments == spec
    assert parse_game(yaml.safe_load(made.dump()), 'trial', tmp_path).instruments == spec
    assert trial_game(laid(study, _settings({'instruments': {}})), 'idle').instruments \
        == InstrumentsSpec()
    setup = build_setup(made)
    assert Participants.from_setup(setup).instruments
    assert describe_game(setup).instruments == spec
    bare = build_setup(load_game(game))
    assert not Participants.from_setup(bare).instruments
    assert describe_game(bare).instruments is None


def test_gaze_is_recorded_and_is_of_the_participant(tmp_path: Path) -> None:
    """By default it is the first human's, in a study whoever takes part; others are refused."""
    game = load_game(scenarios_directory() / 'cut_in.yaml')
    gaze: InstrumentsSpec = read(InstrumentsSpec, {
        'inlets': ['Heart'], 'gaze': ['Eyes', {'stream': 'B', 'seat': 'av0'}]}, '')
    assert [inlet.name for inlet in gaze.recorded] == ['Heart', 'Eyes', 'B']
    assert gaze.streams
    described = describe_game(build_setup(replace(game, instruments=gaze)))
    assert described.gaze_seats == ('hv0', 'av0')
    assert describe_game(build_setup(game)).gaze_seats == ()
    with pytest.raises(InputError, match='no vehicle "hv7"'):
        build_setup(replace(game, instruments=read(
            InstrumentsSpec, {'gaze': [{'stream': 'Eyes', 'seat': 'hv7'}]}, '')))
    file = tmp_path / 'game.yaml'
    file.write_text(game.dump())
    settings = {'game': str(file), 'seat': 'av0', 'instruments': {'gaze': ['Eyes']}}
    made = trial_game(laid(_settings(settings)), 'cockpit')
    assert describe_game(build_setup(made)).gaze_seats == ('av0',)
    other = settings | {'instruments': {'gaze': [{'stream': 'Eyes', 'seat': 'hv0'}]}}
    with pytest.raises(InputError, match='is for hv0, and nobody who takes part'):
        trial_game(laid(_settings(other)), 'cockpit')
