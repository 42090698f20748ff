# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reading game files: YAML in, a checked `Game` or one clear error out."""

from collections.abc import Mapping
from dataclasses import asdict
import math
from pathlib import Path
import re
from typing import Any

import yaml

from crgame_ros.errors import InputError
from crgame_ros.perception.spec import parse_perception, perception_entry
from crgame_ros.scenario.checked_values import build, named_file
from crgame_ros.scenario.event_file import event_entry, parse_events
from crgame_ros.scenario.game import (
    AvSpec,
    DrivabilitySpec,
    Game,
    HumanSpec,
    LaneletSpawn,
    ModelSpec,
    PoseSpawn,
    PredictionSpec,
    TimingSpec,
    TrackerSpec,
)
from crgame_ros.scenario.object_file import object_entry, parse_objects
from crgame_ros.traffic.spec import parse_traffic, traffic_entry

MAX_BYTES = 1 << 20
PREFIX = {'humans': 'hv', 'avs': 'av'}


def read_yaml(path: Path, what: str) -> Any:
    """
    Read a small YAML file safely.

    :param what: what the file is, for the message.
    :raises InputError: if it is missing, too large or no YAML.
    """
    try:
        if path.is_dir():
            raise InputError(f'is a directory, not a {what}', str(path), 'name a file')
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f'is larger than 1 MiB, too large for a {what}', str(path))
        return yaml.safe_load(path.read_text(encoding='utf-8'))
    except OSError as error:
        raise InputError(f'cannot read the {what} ({error.strerror})', str(path),
                         'check the name') from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        detail = str(error).splitlines()[0] if str(error) else type(error).__name__
        mark = getattr(error, 'problem_mark', None)
        line = f', line {mark.line + 1}' if mark is not None else ''
        raise InputError(f'is no YAML ({detail}{line})', str(path), 'mend the file') from error


def load_game(path: Path) -> Game:
    """
    Read a game file.

    :raises InputError: naming the file, the key and the remedy.
    """
    values = read_yaml(path, 'game file')
    return parse_game(values, str(path), path.parent)


def parse_game(values: Any, where: str, base: Path) -> Game:
    """
    Check the content of a game file.

    :param values: what YAML gave.
    :param where: file name for messages.
    :param base: directory against which its file names are resolved.
    """
    if not isinstance(values, Mapping):
        raise InputError('is no mapping', where, 'see docs/games.md for the keys')
    table = dict(values)
    if 'base' in table:
        raise InputError('"base" is unknown', where, 'file names are relative to this file')
    if not isinstance(table.get('scenario'), str):
        raise InputError('"scenario" is missing', where, 'name a CommonRoad file')
    table['scenario'] = base / table['scenario']
    for group in ('humans', 'avs'):
        if table.get(group) is not None:
            table[group] = _vehicles(table[group], group, where, base)
    for key, kind in (('prediction', PredictionSpec), ('drivability', DrivabilitySpec),
                      ('timing', TimingSpec)):
        if key in table:
            table[key] = build(kind, table[key], f'{where}: {key}')
    if 'rate' in table:
        rate = table.pop('rate')
        table['timing'] = build(TimingSpec, {**vars(table.get('timing', TimingSpec())),
                                             'rate': rate}, where)
    if 'events' in table:
        table['events'] = parse_events(table['events'], f'{where}: events', base)
    if 'objects' in table:
        table['objects'] = parse_objects(table['objects'], f'{where}: objects', base)
    if table.get('traffic') is not None:
        table['traffic'] = parse_traffic(table['traffic'], f'{where}: traffic', base)
    if table.get('occupancy') is not None:
        table['occupancy'] = _map_file(table['occupancy'], where, base)
    table['base'] = base
    game = build(Game, table, where)
    if game.timing.dt_min > game.timing.dt_max:
        raise InputError('"dt_min" is larger than "dt_max"', f'{where}: timing')
    return game


def _vehicles(values: Any, group: str, where: str,
              base: Path) -> tuple[HumanSpec | AvSpec, ...]:
    if not isinstance(values, list):
        raise InputError(f'"{group}" is no list', where, 'give one entry for each vehicle')
    specs: list[HumanSpec | AvSpec] = []
    for index, entry in enumerate(values):
        place = f'{where}: {group}[{index}]'
        if not isinstance(entry, Mapping):
            raise InputError('is no mapping', place, 'see docs/games.md for the keys')
        table = {'id': f'{PREFIX[group]}{index}', **entry}
        for key in ('vehicle', 'planner'):
            if isinstance(table.get(key), str):
                table[key] = named_file(table[key], base)
        if group == 'humans' and isinstance(table.get('spawn'), Mapping):
            kind = LaneletSpawn if 'lanelet' in table['spawn'] else PoseSpawn
            table['spawn'] = build(kind, table['spawn'], f'{place}: spawn')
        elif table.get('spawn') == 'auto':
            table.pop('spawn')
        _take_models(table, place, base)
        kind_of: type[HumanSpec | AvSpec] = HumanSpec if group == 'humans' else AvSpec
        spec = build(kind_of, table, place)
        if not re.fullmatch(PREFIX[group] + r'\d{1,3}', spec.id):
            raise InputError(f'"{spec.id}" is no id', place,
                             f'use {PREFIX[group]}0, {PREFIX[group]}1, …')
        specs.append(spec)
    ids = [spec.id for spec in specs]
    if len(set(ids)) != len(ids):
        raise InputError('ids repeat', f'{where}: {group}', 'give each vehicle its own id')
    return tuple(specs)


def _take_models(table: dict[str, Any], where: str, base: Path) -> None:
    """Read what a vehicle's entry says of dynamics, tracking and perception."""
    if table.get('dynamics') is not None:
        table['dynamics'] = _model(table['dynamics'], f'{where}: dynamics', base)
    if 'tracker' in table:
        entry = table['tracker']
        pose = entry.get('pose', 'true') if isinstance(entry, Mapping) else 'true'
        # YAML reads a bare true as a truth value.
        pose = 'true' if pose is True else pose
        rest = {key: value for key, value in entry.items() if key != 'pose'} \
            if isinstance(entry, Mapping) else entry
        place = f'{where}: tracker'
        model = _model(rest, place, base) if rest else ModelSpec('lqr')
        table['tracker'] = build(TrackerSpec, {'model': model, 'pose': pose}, place)
    if table.get('perception') is not None:
        table['perception'] = parse_perception(
            table['perception'], f'{where}: perception', base)


def _model(value: Any, where: str, base: Path) -> ModelSpec:
    """Read a model: its name, or a mapping of its name and options."""
    options = dict(value) if isinstance(value, Mapping) else {'name': value}
    name = options.pop('name', None)
    if not isinstance(name, str):
        raise InputError('"name" is missing', where, 'name a model')
    return ModelSpec(named_file(name, base), options)


def _map_file(value: Any, where: str, base: Path) -> Path:
    if not isinstance(value, str):
        raise InputError('"occupancy" is no file name', where, 'name the YAML file of a map')
    return base / value


def dump_game(game: Game) -> str:
    """
    Write a game file that gives the same game from anywhere: its file names are absolute.

    :return: YAML text.
    """
    values: dict[str, Any] = {'title': game.title, 'scenario': str(game.scenario.resolve())}
    if math.isfinite(game.duration):
        values['duration'] = game.duration
    values['seed'] = game.seed
    here = Path.cwd()
    values['humans'] = [_without_empty(asdict(human)) | {
        'driver': _absolute_driver(human.driver, game.base),
        'vehicle': named_file(human.vehicle, here)}
        | ({'dynamics': model_entry(human.dynamics)} if human.dynamics else {})
        for human in game.humans]
    if game.avs is not None:
        values['avs'] = [_without_empty(asdict(av)) | {
            'vehicle': named_file(av.vehicle, here),
            'planner': named_file(av.planner, here)} | execution_entries(av) for av in game.avs]
    for key in ('prediction', 'drivability', 'timing'):
        values[key] = asdict(getattr(game, key))
    if game.events:
        values['events'] = [event_entry(event) for event in game.events]
    if game.objects:
        values['objects'] = [object_entry(item) for item in game.objects]
    if game.traffic is not None:
        values['traffic'] = traffic_entry(game.traffic)
    if game.occupancy is not None:
        values['occupancy'] = str(game.occupancy.resolve())
    return yaml.safe_dump(values, sort_keys=False, allow_unicode=True)


def model_entry(model: ModelSpec) -> dict[str, Any]:
    """Give a model as a game file says it, its file names absolute."""
    return {'name': named_file(model.name, Path.cwd()), **model.options}


def execution_entries(av: AvSpec) -> dict[str, Any]:
    """Give how an AV executes its plans and perceives the world, as a game file says it."""
    entries: dict[str, Any] = {
        'tracker': {**model_entry(av.tracker.model), 'pose': av.tracker.pose},
        'dynamics': model_entry(av.dynamics)}
    if av.perception is not None:
        entries['perception'] = perception_entry(av.perception)
    return entries


def _without_empty(values: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None}


def _absolute_driver(driver: str, base: Path) -> str:
    kind, colon, argument = driver.partition(':')
    if not colon or kind == 'evdev':
        return driver
    return f'{kind}:{(base / Path(argument).expanduser()).resolve()}'
