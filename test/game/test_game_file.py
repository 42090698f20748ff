# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Game files: every key, every refusal, and the way back to YAML."""

from dataclasses import replace
import math
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.game.game import (
    AvSpec,
    DrivabilitySpec,
    Game,
    HumanSpec,
    LaneletSpawn,
    load_game,
    PoseSpawn,
    PredictionSpec,
    TimingSpec,
)
from crgame_ros.paths import scenarios_directory
from crgame_ros.yaml_text import MAX_BYTES
import pytest
import yaml

FULL = """\
title: Everything at once
scenario: map/road.xml
rate: 200
duration: 12.5
seed: 42
humans:
  - id: hv0
    driver: keys:hand.yaml
    vehicle: own/car.yaml
    spawn: {lanelet: 13, s: 40, d: -0.5, speed: 20}
  - driver: evdev:Logitech G29
    spawn: {x: 1.0, y: -2.0, yaw: 0.5}
  - spawn: auto
avs:
  - id: av7
    planning_problem: 100
    planner: own/planner.py:Mine
    options: {v0: 20.0, deep: [1, 2]}
    vehicle: bmw_320i
    spawn: lanelet
  - planner: some.module:Other
prediction: {mode: plans, horizon: 4.0}
drivability: {collision: false, road: false, stop: true}
timing:
  pacing: false
  frame_skipping: false
  drift_reset: false
  measured_interval: false
  clip: drop
  dt_min: 0.001
  dt_max: 0.1
  skip_threshold: 0.03
  reset_threshold: 0.5
  warm_up_steps: 7
  max_catch_up_steps: 8
  realign: nearest
  sample: floor
"""


def write(folder: Path, text: str, name: str = 'game.yaml') -> Path:
    """Write a game file."""
    path = folder / name
    path.write_text(text, encoding='utf-8')
    return path


def test_every_key(tmp_path: Path) -> None:
    """Each value is read into its field; file names are relative to the game file."""
    game = load_game(write(tmp_path, FULL))
    assert game == Game(
        tmp_path / 'map' / 'road.xml', 'Everything at once',
        (HumanSpec('hv0', 'keys:hand.yaml', str(tmp_path / 'own' / 'car.yaml'),
                   LaneletSpawn(13, 40.0, -0.5, 20.0)),
         HumanSpec('hv1', 'evdev:Logitech G29', spawn=PoseSpawn(1.0, -2.0, 0.5)),
         HumanSpec('hv2')),
        (AvSpec('av7', f'{tmp_path}/own/planner.py:Mine', {'v0': 20.0, 'deep': [1, 2]}, 100,
                'bmw_320i', 'lanelet'),
         AvSpec('av1', 'some.module:Other')),
        12.5, 42, PredictionSpec('plans', 4.0), DrivabilitySpec(False, False, True),
        TimingSpec(200.0, False, False, False, False, 'drop', 0.001, 0.1, 0.03, 0.5, 7, 8,
                   'nearest', 'floor'),
        tmp_path)


def test_defaults(tmp_path: Path) -> None:
    """A scenario is enough: one human, an AV of each planning problem, 100 Hz, no end."""
    game = load_game(write(tmp_path, 'scenario: road.xml\n'))
    assert game.humans == (HumanSpec('hv0', 'auto', 'auto', None),)
    assert game.avs is None
    assert game.sound == 'on'
    assert (game.timing.rate, game.duration, game.seed) == (100.0, math.inf, 0)
    assert (game.prediction.mode, game.prediction.horizon) == ('constant', 3.0)
    assert (game.timing.realign, game.timing.sample, game.timing.clip) == (
        'time', 'interpolate', 'carry')


def test_rate_inside_timing(tmp_path: Path) -> None:
    """Both places work; the outer one does not change the other values of timing."""
    inner = load_game(write(tmp_path, 'scenario: a.xml\ntiming: {rate: 50}\n'))
    both = load_game(write(
        tmp_path, 'scenario: a.xml\nrate: 80\ntiming: {rate: 50, clip: drop}\n'))
    assert inner.timing == TimingSpec(rate=50.0)
    assert both.timing == TimingSpec(rate=80.0, clip='drop')


MALFORMED = {
    'nothing in it': ('', 'is no mapping', 'docs/games.md'),
    'a list': ('- 1\n', 'is no mapping', 'docs/games.md'),
    'broken YAML': ('scenario: [1\n', 'is no YAML (', 'mend the file'),
    'a YAML tag that runs code': ('scenario: !!python/object:os.system {}\n', 'is no YAML (', ''),
    'half a character': ('scenario: a.xml\ntitle: "\\ud800"\n', 'is no YAML (', 'mend the file'),
    'no scenario': ('title: x\n', '"scenario" is missing', 'name a CommonRoad file'),
    'scenario a number': ('scenario: 7\n', '"scenario" is 7', 'name a CommonRoad file'),
    'unknown key': ('scenario: a.xml\nspeed: 3\n', '"speed" is unknown', 'known are'),
    'base set': ('scenario: a.xml\nbase: /etc\n', '"base" is unknown',
                 'known are scenario, title'),
    'title a number': ('scenario: a.xml\ntitle: 7\n', '"title" is 7', 'give a text'),
    'duration a word': ('scenario: a.xml\nduration: long\n', '"duration" is \'long\'', 'number'),
    'duration negative': ('scenario: a.xml\nduration: -1\n', '"duration" is -1', 'from 0 to inf'),
    'duration NaN': ('scenario: a.xml\nduration: .nan\n', '"duration" is nan', 'give a number'),
    'rate nought': ('scenario: a.xml\nrate: 0\n', '"rate" is 0', 'from 1 to 10000'),
    'rate true': ('scenario: a.xml\nrate: true\n', '"rate" is True', 'give a number'),
    'seed half': ('scenario: a.xml\nseed: 0.5\n', '"seed" is 0.5', 'give a whole number from 0'),
    'humans a mapping': ('scenario: a.xml\nhumans: {id: hv0}\n', '"humans" is no list',
                         'one entry'),
    'human a name': ('scenario: a.xml\nhumans: [hv0]\n', 'humans[0]: is no mapping', 'docs/games'),
    'human id': ('scenario: a.xml\nhumans: [{id: me}]\n', 'humans[0]: "id" is \'me\'', 'use hv0'),
    'av id': ('scenario: a.xml\navs: [{id: hv0}]\n', 'avs[0]: "id" is \'hv0\'', 'use av0'),
    'ids twice': ('scenario: a.xml\nhumans: [{id: hv1}, {id: hv1}]\n',
                  'humans[1]: "hv1" is there already',
                  'give each vehicle its own id'),
    'driver a list': ('scenario: a.xml\nhumans: [{driver: [a]}]\n', '"driver" is [\'a\']',
                      'give a text'),
    'spawn a word': ('scenario: a.xml\nhumans: [{spawn: there}]\n', '"spawn" is \'there\'',
                     'give {lanelet:, s:} or {x:, y:, yaw:}, or auto'),
    'spawn incomplete': ('scenario: a.xml\nhumans: [{spawn: {lanelet: 3}}]\n',
                         'humans[0]: spawn: "s" is missing', 'give a number'),
    'spawn infinite': ('scenario: a.xml\nhumans: [{spawn: {x: .inf, y: 0, yaw: 0}}]\n',
                       '"x" is inf', 'give a number'),
    'spawn huge': ('scenario: a.xml\nhumans: [{spawn: {x: 1' + '0' * 400 + ', y: 0, yaw: 0}}]\n',
                   'a number has 401 digits', 'mend the file'),
    'spawn speed': ('scenario: a.xml\nhumans: [{spawn: {x: 0, y: 0, yaw: 0, speed: 300}}]\n',
                    '"speed" is 300', 'from -100 to 100'),
    'key of an AV': ('scenario: a.xml\navs: [{planer: idm}]\n', 'avs[0]: "planer" is unknown',
                     'did you mean "planner"? known are id, planner'),
    'options a list': ('scenario: a.xml\navs: [{options: [1]}]\n', '"options" is [1]',
                       'give a mapping'),
    'problem a word': ('scenario: a.xml\navs: [{planning_problem: first}]\n',
                       '"planning_problem" is \'first\'', 'give a whole number'),
    'AV spawn': ('scenario: a.xml\navs: [{spawn: somewhere}]\n', '"spawn" is \'somewhere\'',
                 'use one of problem, lanelet'),
    'prediction mode': ('scenario: a.xml\nprediction: {mode: oracle}\n',
                        'prediction: "mode" is \'oracle\'', 'constant, recorded, plans'),
    'prediction horizon': ('scenario: a.xml\nprediction: {horizon: 600}\n',
                           'prediction: "horizon" is 600', 'from 0.1 to 60'),
    'drivability a number': ('scenario: a.xml\ndrivability: {stop: 1}\n', '"stop" is 1',
                             'give true or false'),
    'timing a list': ('scenario: a.xml\ntiming: []\n', 'timing: is no mapping', ''),
    'timing unknown': ('scenario: a.xml\ntiming: {dt: 1}\n', 'timing: "dt" is unknown',
                       'known are'),
    'dt_min nought': ('scenario: a.xml\ntiming: {dt_min: 0}\n', '"dt_min" is 0',
                      'give a number from 1e-06 to 1'),
    'dt bounds crossed': ('scenario: a.xml\ntiming: {dt_min: 0.5}\n', '"dt_min" is larger', ''),
    'clip': ('scenario: a.xml\ntiming: {clip: keep}\n', '"clip" is \'keep\'', 'carry, drop')}


@pytest.mark.parametrize('case', MALFORMED)
def test_malformed_game_is_refused(tmp_path: Path, case: str) -> None:
    """The command prints one line with file, key and valid values, and exits with code 2."""
    text, named, remedy = MALFORMED[case]
    path = write(tmp_path, text)
    with pytest.raises(InputError) as caught:
        load_game(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert named in message
    assert remedy in message
    assert '\n' not in message
    assert caught.value.exit_code == 2


def test_alias_bomb_is_refused_shortly(tmp_path: Path) -> None:
    """Ten levels of ten aliases are 10^10 words; the message doesn't expand them."""
    levels = ['a0: &a0 [lol]'] + [
        f'a{i}: &a{i} [{", ".join([f"*a{i - 1}"] * 10)}]' for i in range(1, 11)]
    bomb = write(tmp_path, 'scenario: a.xml\ntitle:\n' + '\n'.join(f'  {line}' for line in levels))
    with pytest.raises(InputError, match='aliases .* stand for more than 1000000') as caught:
        load_game(bomb)
    assert len(str(caught.value)) < 500


def test_unreadable_files_are_refused(tmp_path: Path) -> None:
    """A directory, an empty file, one that is too large and one without text are refused."""
    with pytest.raises(InputError, match='is a directory, not a game file; name a file'):
        load_game(tmp_path)
    with pytest.raises(InputError, match=r'none\.yaml: cannot read the game file .No such file'):
        load_game(tmp_path / 'none.yaml')
    with pytest.raises(InputError, match='larger than 1 MiB'):
        load_game(write(tmp_path, ' ' * (MAX_BYTES + 1)))
    (tmp_path / 'binary.yaml').write_bytes(b'\xff\xfe\x80scenario')
    with pytest.raises(InputError, match='is no YAML'):
        load_game(tmp_path / 'binary.yaml')


def test_dump_gives_the_same_game_from_another_directory(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Read from another folder, a dumped game still names the files beside the original."""
    home, elsewhere = tmp_path / 'home', tmp_path / 'elsewhere'
    for folder in (home, elsewhere):
        folder.mkdir()
    write(home, FULL)
    monkeypatch.chdir(home)
    original = load_game(Path('game.yaml'))
    text = original.dump()
    monkeypatch.chdir(elsewhere)
    again = load_game(write(elsewhere, text, 'other.yaml'))
    human = again.humans[0]
    assert human.driver == f'keys:{home}/hand.yaml'
    assert human.vehicle == f'{home}/own/car.yaml'
    assert again.scenario == home / 'map' / 'road.xml'
    assert again.avs is not None
    assert again.avs[0].planner == f'{home}/own/planner.py:Mine'
    assert again.humans[1:] == original.humans[1:]
    assert again.avs[1:] == original.avs[1:]
    assert replace(again.avs[0], planner='') == replace(original.avs[0], planner='')
    for field in ('title', 'duration', 'seed', 'prediction', 'drivability', 'timing'):
        assert getattr(again, field) == getattr(original, field)
    # An absolute path stays unchanged.
    assert again.dump() == text


def test_dump_of_a_minimal_game(tmp_path: Path) -> None:
    """Infinity and an unset list of AVs are left out, so that reading restores the defaults."""
    game = Game(tmp_path / 'a.xml')
    values = yaml.safe_load(game.dump())
    assert 'duration' not in values
    assert 'avs' not in values
    again = load_game(write(tmp_path, game.dump()))
    assert replace(again, base=game.base) == game


@pytest.mark.parametrize('path', sorted(
    path for path in scenarios_directory().glob('*.yaml') if path.suffixes == ['.yaml']),
    ids=lambda path: path.stem)
def test_own_games_round_trip(tmp_path: Path, path: Path) -> None:
    """The package's games survive the launcher's way of writing them into a run's folder."""
    game = load_game(path)
    again = load_game(write(tmp_path, game.dump()))
    assert again.scenario == game.scenario.resolve()
    for before, after in zip(game.humans, again.humans, strict=True):
        kind, _, name = before.driver.partition(':')
        assert after == replace(before, driver=f'{kind}:{path.parent / name}')
    assert again.avs == game.avs


@pytest.mark.parametrize(('written', 'meant'), [('on', 'on'), ("'on'", 'on'), ('none', 'none')])
def test_sound_is_on_or_none(tmp_path: Path, written: str, meant: str) -> None:
    """YAML reads a bare `on` as a truth value; only a value other than the default is written."""
    game = load_game(write(tmp_path, f'scenario: road.xml\nsound: {written}\n'))
    assert game.sound == meant
    again = game.dump()
    assert ('\nsound:' in again) == (meant == 'none')
    assert load_game(write(tmp_path, again, 'again.yaml')).sound == meant
