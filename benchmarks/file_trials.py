# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The trials of broken files: kinds of file, each with the commands that read it."""

from collections.abc import Callable, Iterable
import contextlib
from dataclasses import dataclass
import io
from pathlib import Path
import random
import re
import shutil
import subprocess
import sys

from broken_text import broken_bytes, broken_json, broken_yaml
from crgame_ros import cli
from crgame_ros.analysis.outcome_line import NO_PLANS
from crgame_ros.driver.device_map import load_device_map
from crgame_ros.driver.source import ReplayDriver
from crgame_ros.errors import InputError
from crgame_ros.game.game import load_game
from crgame_ros.paths import config_directory, scenarios_directory
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_trajectories import read_trajectories, RunTrajectories
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.control_settings import load_control_settings
from mutations import mutate
import numpy as np
from sound_results import test_module

DURATION = '0.5'
ROADS = 'ZAM_CutIn-1_1_T-1.xml'
PLAIN = f'scenario: {ROADS}\nhumans: [{{id: hv0, driver: idle}}]\n'
# On stderr of a good run: notes, progress, planners that are slow or brake, its last line.
USUAL = re.compile(
    r'note: |rasterize: |driving .*: \d+ %$|av\d+: (brakes along|its planner|planner \S+ is slow)'
    r'|(\d+ contacts?|\d+ of \d+ plans?|nuPlan score)\b|/.*/summary\.html$')
UNDRIVEN = re.compile(r'error: av\d+: no plan of its planner was driven: ')
Breaker = Callable[[bytes, random.Random], tuple[bytes, str]]


class WrongResult(Exception):
    """A broken file was accepted as a good one and gave another result."""


@dataclass(frozen=True)
class Trial:
    """
    A kind of file.

    :param share: of all cases.
    :param files: that are broken in turn, relative to the folder of a case, or anywhere.
    :param breaks: how.
    :param reads: function that reads the broken file; it gets the file's path.
    """

    share: float
    files: tuple[Path, ...]
    breaks: Breaker
    reads: Callable[[Path, random.Random], None]


def prepare(folder: Path) -> None:
    """Fill the folder of the sound files: scenarios, games, a map, way-points, recordings."""
    for file in scenarios_directory().iterdir():
        if file.is_file():
            shutil.copy(file, folder)
    for file in (config_directory() / 'vehicles').iterdir():
        shutil.copy(file, folder)
    (folder / 'ride.csv').write_text('t,x,y,yaw\n0,0,0,0\n1,5,0.1,0\n2,11,0.2,0\n')
    command('rasterize', folder / ROADS, folder / 'map')
    command('roads', folder / ROADS, folder / 'roads.csv')
    (folder / 'mapped.yaml').write_text(f'{PLAIN}occupancy: map\n')
    _record(folder)
    # In another process: libraries of tables start threads, which no fork has.
    subprocess.run([sys.executable, str(Path(__file__).with_name('sound_results.py')),
                    str(folder)], check=True, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL)


def warm_up(folder: Path) -> None:
    """Use everything that is compiled at its first use."""
    command('offline', folder / 'dense_merge.yaml', '--duration', '0.3')
    command('offline', folder / 'fog.yaml', '--duration', '0.3')
    game = folder / 'warm.yaml'
    for name in ('Traffic', 'Intersection', 'Roundabout'):
        game.write_text(f'scenario: ZAM_{name}-1_1_T-1.xml\n'
                        'traffic: {recorded: reactive, agents: 5, flow: 1000}\n')
        command('offline', game, '--planner', 'reactive', '--duration', '2')


def trials(folder: Path, published: Iterable[Path]) -> dict[str, Trial]:
    """Return the kinds of file: those that `prepare` has made, and further scenarios."""
    scenarios = (*sorted(folder.glob('*.xml')), *published)
    timelines = sorted((*folder.glob('*.keys.yaml'), *folder.glob('*.joy.yaml')))
    games = sorted(path for path in folder.glob('*.yaml') if 'scenario:' in path.read_text())
    devices = sorted((config_directory() / 'devices').glob('*.yaml'))
    bag, database = folder / 'bag', folder / 'database'
    evaluation, study = folder / 'evaluation', folder / 'studied'
    return {
        'scenario, by element': Trial(0.42, scenarios, mutate, _scenario),
        'scenario, by byte': Trial(0.06, scenarios, broken_bytes, _scenario),
        'game': Trial(0.16, tuple(games), broken_yaml, _game),
        'vehicle': Trial(0.05, (folder / 'bmw_320i.yaml',), broken_yaml, _vehicle),
        'steering ratios': Trial(0.03, (folder / 'steering_ratio.yaml',), broken_yaml, _steering),
        'timeline': Trial(0.05, tuple(timelines), broken_yaml, _timeline),
        'device map': Trial(0.02, tuple(devices), broken_yaml,
                            lambda path, _: void(load_device_map(str(path)))),
        'gains': Trial(0.02, (config_directory() / 'control.yaml',), broken_yaml,
                       lambda path, _: void(load_control_settings(path))),
        'map': Trial(0.03, (folder / 'map' / 'map.yaml',), broken_yaml, _map),
        'trajectory': Trial(0.02, (folder / 'ride.csv',), broken_bytes, _trajectory),
        'way-points': Trial(0.02, (folder / 'roads.csv',), broken_bytes, _roads),
        'metadata': Trial(0.04, (bag / 'metadata.yaml', database / 'metadata.yaml'), broken_yaml,
                          _bag),
        'recording': Trial(0.04, (bag / 'bag_0.mcap', database / 'database.db3'), broken_bytes,
                           _bag),
        'evaluation, by value': Trial(0.01, (evaluation / 'evaluation.json',), broken_json,
                                      _evaluation),
        'evaluation, by byte': Trial(0.02, tuple(sorted(evaluation.glob('*/*.parquet'))),
                                     broken_bytes, _evaluation),
        'study, by value': Trial(0.02, (*sorted(study.glob('participants/*/*.json*')),
                                        *sorted(study.glob('data/.runs/*/run.json'))),
                                 broken_json, _study),
        'study, by byte': Trial(0.02, tuple(sorted(path for path in study.rglob('*')
                                                   if path.is_file())), broken_bytes, _study)}


def void(_: object) -> None:
    """Forget a result."""


def command(*words: object) -> None:
    """
    Run a command of `crgame` as a user does.

    :raises InputError: if the file is refused, with the only line that was printed.
    :raises WrongResult: if it ends in any other way than by success or refusal.
    """
    # Not of the standard library: text that cannot be encoded must fail here as in a terminal.
    told = io.TextIOWrapper(io.BytesIO(), 'utf-8')
    complaints = io.TextIOWrapper(io.BytesIO(), 'utf-8', 'backslashreplace')
    with contextlib.redirect_stdout(told), contextlib.redirect_stderr(complaints):
        code = cli.main([str(word) for word in words])
    told.flush()
    complaints.seek(0)
    lines = complaints.read().splitlines()
    errors = [line for line in lines if not USUAL.match(line)]
    longest = max((len(line) for line in lines), default=0)
    if longest > 1000:
        raise WrongResult(f'a note of {longest} characters')
    if code == 2 and len(errors) == 1 and errors[0].startswith('error: '):
        raise InputError(errors[0].removeprefix('error: '))
    if code == NO_PLANS and errors and all(map(UNDRIVEN.match, errors)):
        # The file is right, but a planner cannot drive there.
        return
    if code or errors:
        raise WrongResult(f'exit code {code}: {errors[:3]}')


def _offline(game: Path, *words: object) -> None:
    command('offline', game, '--duration', DURATION, '--out', game.with_name('out.xml'), *words)


def _scenario(path: Path, dice: random.Random) -> None:
    way = dice.random()
    if way < 0.1:
        command('rasterize', path, path.parent / 'drawn', '--resolution', '0.5')
    elif way < 0.2:
        command('roads', path, path.parent / 'roads_out.csv', '--all')
    else:
        humans = dice.choice(('[{id: hv0, driver: idle}]', '[]'))
        planner = dice.choice(('idm', 'reactive', 'constant-velocity'))
        traffic = dice.choice(('null', '{agents: 5}', '{recorded: reactive, flow: 300}'))
        game = path.with_name('mutated_game.yaml')
        game.write_text(f'scenario: {path.name}\nhumans: {humans}\ntraffic: {traffic}\n')
        _offline(game, '--planner', planner)


def _game(path: Path, _: random.Random) -> None:
    _offline(path)


def _with(path: Path, human: str, rest: str = '') -> None:
    root = path.parent if (path.parent / ROADS).exists() else path.parent.parent
    game = root / 'mutated_game.yaml'
    game.write_text(f'scenario: {ROADS}\nhumans: [{{id: hv0, {human}}}]\n{rest}')
    _offline(game)


def _vehicle(path: Path, _: random.Random) -> None:
    _with(path, f'driver: "joy:merge.joy.yaml", vehicle: {path.name}',
          f'avs: [{{id: av0, vehicle: {path.name}}}]\n')


def _steering(path: Path, dice: random.Random) -> None:
    vehicle = path.with_name('mutated_vehicle.yaml')
    text = (config_directory() / 'vehicles' / 'bmw_320i.yaml').read_text()
    vehicle.write_text(text.replace('steering_ratio.yaml', path.name))
    _vehicle(vehicle, dice)


def _timeline(path: Path, dice: random.Random) -> None:
    _with(path, f'driver: "{"keys" if ".keys." in path.name else "joy"}:{path.name}"')


def _map(path: Path, dice: random.Random) -> None:
    _with(path, 'driver: idle', f'occupancy: {path.parent.name}/{path.name}\n')


def _trajectory(path: Path, dice: random.Random) -> None:
    _with(path, 'driver: idle',
          f'objects: [{{id: rec, kind: bicycle, trajectory: {path.name}}}]\n')


def _roads(path: Path, dice: random.Random) -> None:
    made = path.with_name('made.xml')
    command('roads', path, made, '--force')
    _scenario(made, dice)


def _bag(path: Path, dice: random.Random) -> None:
    """Describe a recording, convert it to a scenario, finish it, and do both again."""
    bag = path.parent
    refusals = []
    conversion = ('convert', bag, '--out', bag.parent / 'converted.xml')
    for words in (('info', bag), conversion, ('recover', bag), ('info', bag), conversion):
        try:
            command(*words)
        except InputError as error:
            refusals.append(error)
    try:
        log = read_trajectories(bag)
        # SQLite has no checksums: a bit that turned in a number is another number.
        if path.suffix != '.db3':
            _compare(log, read_trajectories(bag.parent.parent / 'sound' / 'bag'))
    except InputError as error:
        refusals.append(error)
    if refusals:
        raise refusals[-1]


def _evaluation(path: Path, dice: random.Random) -> None:
    command('evaluate', _part_of(path, 'evaluation'), '--summary')


def _study(path: Path, dice: random.Random) -> None:
    command('study', 'data', _part_of(path, 'studied'))


def _part_of(path: Path, name: str) -> Path:
    return next(folder for folder in path.parents if folder.name == name)


def _compare(log: RunTrajectories, sound: RunTrajectories) -> None:
    """Check that the data read from a broken recording is the recorded data."""
    rows = log.ks - sound.ks[0]
    if rows[0] < 0 or rows[-1] >= len(sound.ks):
        raise WrongResult(f'scenario steps {log.ks[0]} to {log.ks[-1]}')
    told = any('interpolated' in notice for notice in log.notices)
    # Data that `recover` could not keep is bridged, with a report: no result imitates another.
    for name in ('object_poses',) if told else ('vehicle_states', 'object_poses'):
        found, recorded = getattr(log, name), getattr(sound, name)[rows]
        if not np.allclose(found, recorded, atol=1e-6, equal_nan=True):
            raise WrongResult(f'other {name}')


def _record(folder: Path) -> None:
    """Record a second, as the graph does and as `ros2 bag record` does into SQLite."""
    from rosbags.rosbag2 import StoragePlugin
    maker = test_module('conftest')
    recorder = maker.RunRecorder(maker.Samples())
    game = folder / 'recorded.yaml'
    game.write_text(f'{PLAIN}avs: [{{id: av0}}]\n')
    commands = np.random.default_rng(0).uniform((0, 0, -0.2, 0), (1, 0.2, 0.2, 0), (100, 4))
    messages = recorder.messages(run_offline(
        build_setup(load_game(game)), duration_s=1.0, drivers={'hv0': ReplayDriver(commands)}))
    recorder.ours(folder / 'bag', messages)
    recorder.rosbag2(folder / 'database', messages, StoragePlugin.SQLITE3)
    with BagReader(folder / 'bag') as reader:
        assert reader.complete
