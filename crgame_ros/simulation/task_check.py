# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of a game's tasks against its vehicles, objects and events."""

from collections.abc import Sequence
from dataclasses import replace

from crgame_ros.errors import InputError
from crgame_ros.game.events import AtTime, Between, EventSpec, Near
from crgame_ros.game.task_spec import (
    answer_key,
    DetectionResponse,
    OnEvent,
    TakeOverPrompt,
    TaskSpec,
)


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
                             else 'the game has no driven vehicle', place, _listed(vehicles))
        for condition in (spec.when, spec.until):
            named: Sequence[str] = ()
            if isinstance(condition, OnEvent):
                _check_event(condition.event, by_name, place)
            elif isinstance(condition, Near):
                named = (condition.vehicle,)
            elif isinstance(condition, Between):
                named = condition.between
            for name in named:
                if name not in (*vehicles, *objects):
                    raise InputError(f'there is no vehicle or object "{name}"', place,
                                     _listed(vehicles))
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
        raise InputError(f'there is no event "{name}"', place, _listed(list(events)))


def _check_lead(spec: TaskSpec, task: TakeOverPrompt, event: EventSpec, place: str) -> None:
    """Refuse a request that would have to come before the run."""
    if spec.when is None and isinstance(event.when, AtTime) and event.when.time < task.lead:
        raise InputError(f'"{event.name}" is at {event.when.time:g} s, before the lead of '
                         f'{task.lead:g} s is over', place, 'let it happen later')


def _listed(names: Sequence[str]) -> str:
    return f'there is {", ".join(names[:12])}' if names else 'the game has none'
