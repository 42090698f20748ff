# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The JSON Schema and the reader agree: own files fit, and both refuse the same files."""

from collections.abc import Iterator
import copy
import json
from pathlib import Path
import random
from typing import Any

from crgame_ros.cli import main
from crgame_ros.errors import InputError
from crgame_ros.game.game import load_game, parse_game
from crgame_ros.occupancy.map_file import map_text
from crgame_ros.paths import config_directory, scenarios_directory
from crgame_ros.schema.file_kinds import FILE_KINDS
from crgame_ros.study.questionnaire import SCALES
from jsonschema import Draft202012Validator
import pytest
import yaml

GAMES = sorted(path for path in scenarios_directory().glob('*.yaml') if path.suffixes == ['.yaml'])
FILES = {
    'game': GAMES,
    'vehicle': [config_directory() / 'vehicles' / f'{name}.yaml'
                for name in ('bmw_320i', 'bicycle')],
    'steering': [config_directory() / 'vehicles' / 'steering_ratio.yaml'],
    'device': sorted((config_directory() / 'devices').glob('*.yaml')),
    'timeline': sorted(path for ending in ('keys', 'joy')
                       for path in scenarios_directory().glob(f'*.{ending}.yaml')),
    'control': [config_directory() / 'control.yaml'],
    'study': [config_directory() / 'studies' / 'example' / 'study.yaml'],
    'questionnaire': sorted(SCALES.glob('*.yaml'))}
WHOLE = """\
scenario: a.xml
rate: 200
duration: 12.5
humans:
  - {id: hv0, driver: idle, spawn: {lanelet: 13, s: 40, d: -0.5, speed: 20}, dynamics: ks}
  - {spawn: {x: 1.0, y: -2.0, yaw: 0.5}, dynamics: {name: dynamic-bicycle, slip: 0.9}}
  - {spawn: auto}
avs:
  - {id: av7, planning_problem: 100, planner: idm, options: {v0: 20.0}, spawn: lanelet}
  - tracker: {name: pure-pursuit, pose: true, look_ahead_time: 0.5}
    perception:
      localisation: {position_bias: [0.5, -1], rate: 20}
      sensors: [{name: front, x: 4, rays: 181}, {}]
      seed: 4
prediction: {mode: plans, horizon: 4.0}
drivability: {collision: false}
timing: {pacing: false, clip: drop, dt_min: 0.001, warm_up_steps: 7}
events:
  - {name: a, release: {object: 42}, when: {time: 5}}
  - {name: b, brake: {object: 43}, when: {between: [hv0, o42], distance: 20.0}}
  - {name: c, obstacle: {x: 1, y: 2, width: 0.5, type: parkedVehicle}}
  - {name: d, speed_limit: {speed: 8.3, lanelets: [3, 4]}, when: {step: 3}}
  - {name: e, planner_run: {av: av0, run: false}, when: {vehicle: hv0, x: 1, y: 2, radius: 3}}
  - {name: f, traffic: {agent: t3, speed_factor: 1.3, red_runner: true}}
objects:
  - {id: bin, kind: static, type: unknown, at: [12.0, 3.0], size: [0.6, 0.6]}
  - {kind: particle, path: [[10, -4], [10, 6]], speed: 1.4, start: 2.0, headway: 4}
  - {kind: bicycle, path: [[0, 0], [20, 0]], speeds: [3, 4.5], reactive: true, end: vanish}
  - {kind: bicycle, type: truck, lanelet: 12, s: 5, radius: 1}
  - {kind: particle, trajectory: [[0, 0, 0], [1, 1, 0]]}
traffic: {recorded: reactive, agents: 3, options: {time_gap: 1.2}, capacity: 7, seed: null}
occupancy: map.yaml
tasks:
  - {name: light, detection_response: {interval: [3, 5], shown: 1.0}, when: {time: 0}}
  - {name: call, take_over: {lead: 4, before: slow}, seat: hv0, label: Take over}
  - {name: radio, secondary_task: {show: true}, when: {event: slow}, until: {step: 90}}
language: de
"""
# Checks that compare values with each other or use other files.
NO_SCHEMA = ('is there already', 'is larger than "dt_max"', 'the same place', 'km long',
             'size and', '"speed" and "speeds"', 'one for each way-point', 'the last may be 0',
             'vanishes', 'changes nothing', 'has both', 'name two ids', 'the trajectory',
             'comes after', 'it moves by', 'is no row', 'is no number that',
             'longest time first')
# JSON Schema takes 1.0 as an integer and the reader does not: no such value occurs here.
VALUES: list[Any] = [None, True, 0, -1, 0.5, 7, 1e9 + 0.5, 'x', '', 'reactive', 'lanelet', [],
                     [1], [0, 1], {}, {'x': 1}]


def validator(kind: str) -> Draft202012Validator:
    """Make a validator that uses the schema alone."""
    schema = FILE_KINDS[kind].schema()
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


@pytest.mark.slow
@pytest.mark.parametrize('kind', FILES)
def test_own_files_fit_their_schema(kind: str) -> None:
    assert FILES[kind]
    for path in FILES[kind]:
        validator(kind).validate(yaml.safe_load(path.read_text(encoding='utf-8')))


def test_written_files_fit_their_schema() -> None:
    """Files of a run's folder and of our own map fit too, as users may edit them."""
    validator('occupancy').validate(yaml.safe_load(map_text('map.pgm', 0.1, (0.0, 1.0))))
    found = validator('game')
    for path in GAMES:
        found.validate(yaml.safe_load(load_game(path).dump()))


def places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Yield every mapping and list inside a value with each of its keys."""
    items = value.items() if isinstance(value, dict) else enumerate(value) \
        if isinstance(value, list) else ()
    for key, inner in list(items):
        yield value, key
        yield from places(inner)


def mutated(values: Any, luck: random.Random) -> Any:
    """Change one place: another value, no value, or an unknown key."""
    changed = copy.deepcopy(values)
    holder, key = luck.choice(list(places(changed)))
    way = luck.randrange(4)
    if way == 0:
        del holder[key]
    elif way == 1 and isinstance(holder, dict):
        holder[luck.choice(
            ['speed', 'x', 'nonsense', 'kind', 'radius', 'at', 'lanelet'])] = luck.choice(VALUES)
    else:
        holder[key] = copy.deepcopy(luck.choice(VALUES))
    return changed


@pytest.mark.slow
@pytest.mark.matrix
@pytest.mark.parametrize('seed', [4, 5, 6, 7])
def test_reader_and_schema_refuse_the_same(seed: int) -> None:
    """They agree on 200 games with one mistake each; both outcomes are common."""
    luck, found = random.Random(seed), validator('game')
    sound = yaml.safe_load(WHOLE)
    found.validate(sound)
    parse_game(sound, 'game.yaml', Path())
    refused = 0
    for _ in range(200):
        values = mutated(sound, luck)
        reason = None
        try:
            parse_game(values, 'game.yaml', Path())
        except InputError as error:
            reason = str(error)
            assert len(reason) < 500
            if any(words in reason for words in NO_SCHEMA):
                continue
        refused += reason is not None
        assert found.is_valid(values) == (reason is None), (
            reason, [error.message for error in found.iter_errors(values)], values)
    assert 60 < refused < 175


@pytest.mark.parametrize(('seed', 'fits'), [(3, True), ('each', True), (-1, False), ('x', False)])
def test_a_marked_type_of_several_is_described_too(seed: object, fits: bool) -> None:
    """The seed of a study's settings is a number within bounds, or one word."""
    study = {'name': 'demo', 'blocks': [{'name': 'main'}], 'settings': {'seed': seed}}
    assert validator('study').is_valid(study) == fits


def test_every_key_is_described() -> None:
    """Each key has the sentence of its docstring, as in the documentation's tables."""
    for kind in FILE_KINDS:
        schema = FILE_KINDS[kind].schema()
        for name, part in {'': schema, **schema['$defs']}.items():
            part = part['anyOf'][1] if 'anyOf' in part and 'type' not in part else part
            for key, entry in part.get('properties', {}).items():
                keyed = name in ('EventSpec', 'TaskSpec', 'TimelineFile', 'StepEntry', 'Question')
                assert 'description' in entry or keyed, f'{name}.{key}'


def test_the_command_writes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It writes to standard output or a file; a missing folder gives one line."""
    assert main(['schema']) == 0
    assert json.loads(capsys.readouterr().out) == FILE_KINDS['game'].schema()
    assert main(['schema', 'vehicle', '--out', str(tmp_path / 'v.json')]) == 0
    written = json.loads((tmp_path / 'v.json').read_text(encoding='utf-8'))
    assert written == FILE_KINDS['vehicle'].schema()
    assert main(['schema', '--out', str(tmp_path / 'none' / 'v.json')]) == 2
    assert 'cannot be written (No such file' in capsys.readouterr().err
    assert main(['schema', 'cake']) == 2
