# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reading and writing the events of a game file and of `/scenario/game`."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
import re
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.scenario.checked_values import BOUNDS, build, named_file, short
from crgame_ros.scenario.events import (
    Action,
    ACTIONS,
    Between,
    Brake,
    Condition,
    CONDITIONS,
    EventSpec,
    Near,
    PlannerSwap,
    PutObstacle,
    SpeedLimit,
    TrafficChange,
)
from crgame_ros.traffic.spec import BOUNDS as TRAFFIC_BOUNDS

MAX_EVENTS = 100
_NAME = re.compile(r'[a-z0-9_-]{1,40}')
_MAX_LABEL = 80
_BOUNDS = BOUNDS | TRAFFIC_BOUNDS | {'desired_speed': (0.0, 100.0)}


def parse_events(values: Any, where: str, base: Path) -> tuple[EventSpec, ...]:
    """
    Check the list `events` of a game file.

    :param where: file and key for messages.
    :param base: directory against which its file names are resolved.
    :raises InputError: naming the entry and the remedy.
    """
    if not isinstance(values, list):
        raise InputError('is no list', where, 'give one entry for each event')
    if len(values) > MAX_EVENTS:
        raise InputError(f'has {len(values)} entries', where, f'give {MAX_EVENTS} at most')
    events: list[EventSpec] = []
    for index, entry in enumerate(values):
        event = _event(entry, f'{where}[{index}]', base)
        if event.name in {other.name for other in events}:
            raise InputError(f'"{event.name}" is there already', f'{where}[{index}]',
                             'give each event its own name')
        events.append(event)
    return tuple(events)


def _event(entry: Any, where: str, base: Path) -> EventSpec:
    if not isinstance(entry, Mapping):
        raise InputError('is no mapping', where, 'see docs/games.md for the keys')
    known = ('name', 'label', 'when', *ACTIONS)
    for key in entry:
        if key not in known:
            raise InputError(f'"{key}" is unknown', where, 'known are ' + ', '.join(known))
    name = entry.get('name')
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise InputError(f'"name" is {short(name)}', where,
                         'give 1 to 40 of the characters a-z, 0-9, _ and -')
    label = entry.get('label', name)
    if not isinstance(label, str) or not 0 < len(label) <= _MAX_LABEL:
        raise InputError(f'"label" is {short(label)}', where,
                         f'give a text of {_MAX_LABEL} characters at most')
    kinds = [key for key in ACTIONS if key in entry]
    if len(kinds) != 1:
        found = 'no action' if not kinds else f'{len(kinds)} actions ({", ".join(kinds)})'
        raise InputError(f'has {found}', f'{where} ({name})',
                         'give exactly one of ' + ', '.join(ACTIONS))
    action = _action(kinds[0], entry[kinds[0]], f'{where} ({name}): {kinds[0]}', base)
    when = None if entry.get('when') is None \
        else _condition(entry['when'], f'{where} ({name}): when')
    return EventSpec(name, action, label, when)


def _action(kind: str, values: Any, where: str, base: Path) -> Action:
    table = _with_tuples(values, where)
    if kind == 'planner' and isinstance(table.get('planner'), str):
        table['planner'] = named_file(table['planner'], base)
    action = build(ACTIONS[kind], table, where, _BOUNDS)
    if isinstance(action, Brake):
        _positive(where, deceleration=action.deceleration)
        if action.speed < 0.0:
            raise InputError(f'"speed" is {action.speed:g}', where, 'give 0 or more')
    elif isinstance(action, PutObstacle):
        _positive(where, length=action.length, width=action.width)
    elif isinstance(action, SpeedLimit):
        _positive(where, speed=action.speed)
    elif isinstance(action, TrafficChange):
        _check_change(action, where)
    elif isinstance(action, PlannerSwap) and not action.planner:
        raise InputError('"planner" is empty', where, 'name a planner')
    return action


def _check_change(change: TrafficChange, where: str) -> None:
    """Refuse to change nothing, and one thing twice."""
    if change == TrafficChange(change.agent):
        raise InputError('changes nothing', where, 'give what is to change, such as speed_factor')
    if change.speed_factor is not None and change.desired_speed is not None:
        raise InputError('has both "speed_factor" and "desired_speed"', where, 'give one of them')


def _condition(values: Any, where: str) -> Condition:
    table = _with_tuples(values, where)
    kinds = [key for key in CONDITIONS if key in table]
    if len(kinds) != 1:
        raise InputError(f'has {len(kinds) or "no"} conditions', where,
                         'give {time:}, {vehicle:, x:, y:, radius:} or {between:, distance:}')
    condition = build(CONDITIONS[kinds[0]], table, where)
    if isinstance(condition, Near):
        _positive(where, radius=condition.radius)
    elif isinstance(condition, Between):
        if len(condition.between) != 2 or len(set(condition.between)) != 2:
            raise InputError(f'"between" is {short(condition.between)}', where, 'name two ids')
        _positive(where, distance=condition.distance)
    return condition


def _with_tuples(values: Any, where: str) -> dict[str, Any]:
    """Turn lists of numbers and names into the tuples that frozen specs hold."""
    if not isinstance(values, Mapping):
        raise InputError('is no mapping', where, 'see docs/games.md for the keys')
    table = dict(values)
    for key, kind in (('lanelets', int), ('between', str)):
        if key not in table:
            continue
        items = table[key]
        if not isinstance(items, list | tuple) or not all(
                isinstance(item, kind) and not isinstance(item, bool) for item in items):
            raise InputError(f'"{key}" is {short(items)}', where, f'give a list of {key}'
                             if key == 'lanelets' else 'give a list of two ids')
        table[key] = tuple(items)
    return table


def _positive(where: str, **values: float) -> None:
    for name, value in values.items():
        if not value > 0.0:
            raise InputError(f'"{name}" is {value:g}', where, 'give a positive number')


def event_entry(event: EventSpec) -> dict[str, Any]:
    """Give an event as an entry of a game file."""
    entry: dict[str, Any] = {'name': event.name, 'label': event.label or event.name,
                             event.kind: _plain(event.action)}
    if event.when is not None:
        entry['when'] = _plain(event.when)
    return entry


def document_entry(event: EventSpec) -> dict[str, Any]:
    """Give an event as `/scenario/game` has it: name, label, kind, when and its parameters."""
    return {'name': event.name, 'label': event.label or event.name, 'kind': event.kind,
            'when': None if event.when is None else _plain(event.when), **_plain(event.action)}


def parse_document_entries(entries: Any, where: str) -> tuple[EventSpec, ...]:
    """
    Read what `document_entry` writes.

    :raises InputError: if it is something else.
    """
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise InputError('"events" is no list of events', where)
    common = ('name', 'label', 'kind', 'when')
    return parse_events([
        {key: entry[key] for key in common if key in entry and key != 'kind'}
        | {str(entry.get('kind')): {key: value for key, value in entry.items()
                                    if key not in common}}
        for entry in entries], where, Path())


def _plain(spec: Action | Condition) -> dict[str, Any]:
    return {key: list(value) if isinstance(value, tuple) else value
            for key, value in asdict(spec).items() if value is not None}
