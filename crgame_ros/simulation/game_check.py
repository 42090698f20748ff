# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of a game's events and tasks against its scenario and vehicles."""

from collections.abc import Sequence
from dataclasses import replace

from crgame_ros.errors import InputError
from crgame_ros.game.events import (
    ALL_AGENTS,
    AtTime,
    Between,
    Brake,
    EventSpec,
    Near,
    PlanDisplay,
    PlannerRun,
    PlannerSwap,
    PutObstacle,
    Release,
    SpeedLimit,
    TrafficChange,
)
from crgame_ros.game.game import AvSpec, Game
from crgame_ros.game.objects import ObjectDescription, Role, whole_id
from crgame_ros.game.task_spec import (
    answer_key,
    DetectionResponse,
    OnEvent,
    TakeOverPrompt,
    TaskSpec,
)
from crgame_ros.geometry.shape import Shape
from crgame_ros.planner.registry import EXTERNAL
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.obstacles import ScenarioObstacles

MAX_LISTED = 12


def held_obstacles(game: Game) -> frozenset[int]:
    """Return the ids of the obstacles that wait for an event to release them."""
    return frozenset(event.action.object for event in game.events
                     if isinstance(event.action, Release))


def put_obstacles(game: Game) -> tuple[ObjectDescription, ...]:
    """Return the descriptions of obstacles that events may put on the road."""
    return tuple(
        ObjectDescription(str(event.object_id), event.action.type, Role.STATIC,
                          Shape.rectangle(event.action.length, event.action.width))
        for event in game.events if isinstance(event.action, PutObstacle))


def check_events(game: Game, where: str, network: RoadNetwork, obstacles: ScenarioObstacles,
                 humans: Sequence[str], avs: Sequence[AvSpec]) -> None:
    """
    Refuse events about things that do not exist.

    :param where: file name for messages.
    :param obstacles: of the scenario, including those that events may put on the road.
    :param humans: ids of the humans' vehicles.
    :raises InputError: naming the event and what there is.
    """
    if not game.events:
        return
    recorded = [item.id for item in obstacles.descriptions
                if item.role is Role.RECORDED and item.id == whole_id(item.id)]
    ids: dict[str, list[str | int]] = {
        'moving obstacle': [*recorded], 'lanelet': [*network.lanelet_ids],
        'AV': [spec.id for spec in avs],
        'vehicle or object': [*humans, *(spec.id for spec in avs),
                              *(item.id for item in obstacles.descriptions),
                              *(item.id for item in game.objects)]}
    for event in game.events:
        place = f'{where}: event {event.name}'
        for kind, name in _named(event):
            if name not in ids[kind]:
                raise InputError(f'there is no {kind} "{name}"', place, _known(ids[kind]))
        check_swap(event, place, avs)


def _named(event: EventSpec) -> list[tuple[str, str | int]]:
    """Return the names in an event, each with its kind."""
    named: list[tuple[str, str | int]] = []
    action = event.action
    if isinstance(action, Release | Brake):
        named.append(('moving obstacle', f'o{action.object}'))
    elif isinstance(action, SpeedLimit):
        named += [('lanelet', lanelet) for lanelet in action.lanelets]
    elif isinstance(action, PlanDisplay | PlannerSwap | PlannerRun):
        named.append(('AV', action.av))
    return [*named, *(('vehicle or object', name) for name in _named_by(event.when))]


def _named_by(condition: object) -> tuple[str, ...]:
    """Return the vehicles and objects that a condition names."""
    if isinstance(condition, Near):
        return (condition.vehicle,)
    return condition.between if isinstance(condition, Between) else ()


def check_changes(game: Game, where: str, agents: Sequence[str]) -> None:
    """
    Refuse events about agents that never appear, or with options unknown to their model.

    :param where: file name for messages.
    :param agents: ids of all that may be on the road.
    :raises InputError: naming the event and what there is.
    """
    for event in game.events:
        if not isinstance(event.action, TrafficChange):
            continue
        place = f'{where}: event {event.name}'
        if game.traffic is None or not agents:
            raise InputError('the game has no traffic', place, 'add "traffic" to the game')
        if event.action.agent not in (ALL_AGENTS, *agents):
            raise InputError(f'there is no agent "{event.action.agent}"', place,
                             f'{_known(agents)}; use {ALL_AGENTS} for all of them')
        # This imports numba, which only runs with agents should wait for.
        from crgame_ros.traffic.following.car_following import CAR_FOLLOWING
        CAR_FOLLOWING.create(game.traffic.model, {**game.traffic.options, **event.action.options},
                             place)


def check_swap(event: EventSpec, where: str, avs: Sequence[AvSpec]) -> None:
    """
    Refuse to swap in or out a planner that runs in an external process.

    :param where: the event, for messages.
    :raises InputError: if one of the planners is external.
    """
    action = event.action
    if not isinstance(action, PlannerSwap):
        return
    if action.planner == EXTERNAL:
        raise InputError('an event cannot bring in an external planner', where,
                         'name a planner of the registry, module:Class or file.py:Class')
    if any(spec.id == action.av and spec.planner == EXTERNAL for spec in avs):
        raise InputError(f'{action.av} has an external planner, which cannot be replaced', where,
                         'give it another planner, or leave the event out')


def _known(names: Sequence[str | int]) -> str:
    if not names:
        return 'the scenario has none'
    shown = ', '.join(map(str, names[:MAX_LISTED]))
    rest = len(names) - MAX_LISTED
    return f'there is {shown}' + (f' and {rest} more' if rest > 0 else '')


def task_seat(spec: TaskSpec, vehicles: Sequence[str]) -> str:
    """Return the vehicle whose driver gets a task: by default the first one."""
    return spec.seat or vehicles[0]


def check_tasks(tasks: Sequence[TaskSpec], events: Sequence[EventSpec], where: str,
                vehicles: Sequence[str], objects: Sequence[str]) -> None:
    """
    Refuse tasks that name missing vehicles, objects or events.

    :param where: file name for messages.
    :param vehicles: ids of the driven vehicles, humans first.
    :param objects: ids of everything else that moves or stands.
    :raises InputError: naming the task and the available names.
    """
    by_name = {event.name: event for event in events}
    for spec in tasks:
        place = f'{where}: task {spec.name}'
        if spec.name in by_name:
            raise InputError('an event of the game has the same name', place, 'rename one of them')
        if not vehicles or task_seat(spec, vehicles) not in vehicles:
            raise InputError(f'there is no vehicle "{spec.seat}"' if spec.seat
                             else 'the game has no driven vehicle', place, _defined(vehicles))
        for condition in (spec.when, spec.until):
            if isinstance(condition, OnEvent):
                _check_event(condition.event, by_name, place)
            for name in _named_by(condition):
                if name not in (*vehicles, *objects):
                    raise InputError(f'there is no vehicle or object "{name}"', place,
                                     _defined(vehicles))
        if isinstance(spec.task, TakeOverPrompt) and spec.task.before is not None:
            _check_event(spec.task.before, by_name, place)
            _check_lead(spec, spec.task, by_name[spec.task.before], place)
    _check_answers([replace(spec, seat=task_seat(spec, vehicles)) for spec in tasks], where)


def _check_answers(tasks: Sequence[TaskSpec], where: str) -> None:
    """Refuse a light and a request for one driver that have the same key or button."""
    for light in tasks:
        for request in tasks:
            if not isinstance(light.task, DetectionResponse) or light.seat != request.seat \
                    or not isinstance(request.task, TakeOverPrompt):
                continue
            place = f'{where}: tasks {light.name} and {request.name}'
            if answer_key(request, tasks) == light.task.key:
                raise InputError(f'both are answered by {light.task.key}', place,
                                 'give one of them another "key"')
            if light.task.button is not None and light.task.button == request.task.button:
                raise InputError(f'both are answered by button {light.task.button}', place,
                                 'give one of them another "button"')


def _check_event(name: str, events: dict[str, EventSpec], place: str) -> None:
    if name not in events:
        raise InputError(f'there is no event "{name}"', place, _defined(list(events)))


def _check_lead(spec: TaskSpec, task: TakeOverPrompt, event: EventSpec, place: str) -> None:
    """Refuse a request that would have to come before the run."""
    if spec.when is None and isinstance(event.when, AtTime) and event.when.time < task.lead:
        raise InputError(f'"{event.name}" is at {event.when.time:g} s, before the lead of '
                         f'{task.lead:g} s is over', place, 'let it happen later')


def _defined(names: Sequence[str]) -> str:
    return f'there is {", ".join(names[:12])}' if names else 'the game has none'
