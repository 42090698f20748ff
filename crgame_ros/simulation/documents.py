# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The run described as JSON text: `/scenario/game` and `/scenario/objects`.

Written by the engine's side, read by planners, monitor, recorder and conversion, so that nobody
needs the game's files.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
import json
import math
from typing import Any, TYPE_CHECKING

from crgame_ros.errors import InputError
from crgame_ros.geometry.shape import Shape
from crgame_ros.scenario.event_file import document_entry, parse_document_entries
from crgame_ros.scenario.events import EventSpec, FiredEvent
from crgame_ros.scenario.game import DrivabilitySpec
from crgame_ros.scenario.game_file import dump_game, execution_entries, model_entry
from crgame_ros.scenario.object_file import object_entry
from crgame_ros.scenario.objects import ObjectDescription, Role
from crgame_ros.timing.scenario_scheduler import ScenarioScheduler
from crgame_ros.traffic.spec import traffic_entry
from crgame_ros.vehicle.parameters import VehicleParameters

# Whoever reads a document needs none of the engine, which takes half a second to load.
if TYPE_CHECKING:
    from crgame_ros.simulation.setup import Setup

GAME_TOPIC = '/scenario/game'
OBJECTS_TOPIC = '/scenario/objects'
EVENTS_TOPIC = '/scenario/events'
# What reading a text that somebody else wrote can raise: huge numbers and deep nesting included.
MALFORMED = (AttributeError, KeyError, OverflowError, RecursionError, TypeError, ValueError)


def game_document(setup: 'Setup', *, epoch: int, clock_offset_ns: int,
                  real_time_factor: float) -> str:
    """
    Write the resolved game (fields as in the contract, `/scenario/game`).

    :param epoch: counts resets.
    :param clock_offset_ns: simulation time of n = 0 [ns]
    :param real_time_factor: simulated seconds per wall second.
    """
    scheduler, game = setup.scheduler, setup.game
    duration = game.duration if math.isfinite(game.duration) else None
    document = {
        'epoch': epoch, 'title': game.title, 'benchmark_id': setup.loaded.benchmark_id,
        'scenario_sha256': setup.loaded.sha256, 'dt_ns': round(scheduler.dt_s * 1e9),
        'dt_c_ns': scheduler.time_step_ns, 'steps_per_tick': scheduler.steps_per_tick,
        'k0': scheduler.k0, 'clock_offset_ns': clock_offset_ns,
        'real_time_factor': real_time_factor, 'seed': game.seed, 'duration': duration,
        'humans': [
            {'id': human.id, 'vehicle': _vehicle_entry(human.vehicle),
             'state': list(human.state), 'driver': human.driver, 'timeline': human.timeline,
             'dynamics': None if human.dynamics is None else model_entry(human.dynamics)}
            for human in setup.humans],
        'avs': [
            {'id': av.id, 'vehicle': _vehicle_entry(av.vehicle),
             'state': list(av.state), 'planner': av.spec.planner, 'options': av.spec.options,
             'planning_problem': av.planning_problem.planning_problem_id,
             'transform': [av.transform.yaw_offset, av.transform.offset_x,
                           av.transform.offset_y],
             'execution': av.spec.execution, **execution_entries(av.spec)}
            for av in setup.avs],
        'prediction': asdict(game.prediction), 'drivability': asdict(game.drivability),
        'timing': asdict(game.timing),
        'events': [document_entry(event) for event in game.events],
        'objects': [object_entry(item) for item in game.objects],
        'traffic': None if game.traffic is None else traffic_entry(game.traffic),
        'occupancy': None if game.occupancy is None else str(game.occupancy.resolve()),
        'file': dump_game(game)}
    return json.dumps(document, allow_nan=False)


def _vehicle_entry(vehicle: VehicleParameters) -> dict[str, Any]:
    """Write a vehicle; JSON has no infinity, so a limit that is none becomes null."""
    values = asdict(vehicle) | {'steering_ratio': ''}
    return {key: None if value == math.inf else value for key, value in values.items()}


@dataclass(frozen=True)
class GameDocument:
    """
    What others need of `/scenario/game`.

    :param epoch: counts resets.
    :param scenario_sha256: of the text on `/scenario/xml`.
    :param scheduler: time grids with the clock offset.
    :param humans: entries of the humans, as written.
    :param avs: entries of the AVs, as written.
    :param content: the whole document.
    :param events: the game's events.
    """

    epoch: int
    scenario_sha256: str
    scheduler: ScenarioScheduler
    humans: tuple[dict[str, Any], ...]
    avs: tuple[dict[str, Any], ...]
    drivability: DrivabilitySpec
    content: dict[str, Any]
    events: tuple[EventSpec, ...] = ()

    def vehicle(self, vehicle_id: str) -> dict[str, Any] | None:
        """Give the entry of a driven vehicle, None if it takes no part."""
        for entry in (*self.humans, *self.avs):
            if entry['id'] == vehicle_id:
                return entry
        return None


def parse_game_document(text: str) -> GameDocument:
    """
    Read `/scenario/game`.

    :raises InputError: if it is not what `game_document` writes.
    """
    try:
        content = json.loads(text)
        for entry in (*content['humans'], *content['avs']):
            entry['vehicle'] = {key: math.inf if value is None else value
                                for key, value in entry['vehicle'].items()}
        if min(content['dt_c_ns'], content['steps_per_tick']) < 1:
            raise ValueError('a step that is not positive')
        return GameDocument(
            int(content['epoch']), str(content['scenario_sha256']),
            ScenarioScheduler(int(content['dt_c_ns']), int(content['steps_per_tick']),
                              int(content['k0']), int(content['clock_offset_ns'])),
            tuple(content['humans']), tuple(content['avs']),
            DrivabilitySpec(**content['drivability']), content,
            parse_document_entries(content.get('events', []), GAME_TOPIC))
    except MALFORMED as error:
        raise InputError(f'is no game document ({type(error).__name__}: {error})',
                         GAME_TOPIC) from error


def objects_document(descriptions: Sequence[ObjectDescription]) -> str:
    """Write what can appear (fields as in the contract, `/scenario/objects`)."""
    return json.dumps([
        {'id': item.id, 'type': item.type, 'role': item.role.value, 'shape': asdict(item.shape),
         'reference_point': item.reference_point, 'rear_to_center': item.rear_to_center}
        for item in descriptions], allow_nan=False)


def parse_objects_document(text: str) -> tuple[ObjectDescription, ...]:
    """
    Read `/scenario/objects`.

    :raises InputError: if it is not what `objects_document` writes.
    """
    try:
        return tuple(
            ObjectDescription(
                str(item['id']), str(item['type']), Role(item['role']),
                Shape(item['shape']['kind'], float(item['shape']['length']),
                      float(item['shape']['width']),
                      tuple((float(x), float(y)) for x, y in item['shape']['vertices'])),
                float(item['rear_to_center']))
            for item in json.loads(text))
    except MALFORMED as error:
        raise InputError(f'is no list of objects ({type(error).__name__}: {error})',
                         OBJECTS_TOPIC) from error


def events_document(epoch: int, fired: Sequence[FiredEvent]) -> str:
    """Write what has taken effect in a run so far (fields as in the contract)."""
    return json.dumps({'epoch': epoch, 'fired': [asdict(event) for event in fired]})


def parse_events_document(text: str) -> tuple[int, tuple[FiredEvent, ...]]:
    """
    Read `/scenario/events`.

    :return: the epoch, and what took effect in it, in order.
    :raises InputError: if it is not what `events_document` writes.
    """
    try:
        content = json.loads(text)
        return int(content['epoch']), tuple(
            FiredEvent(str(item['name']), int(item['n']), int(item['k']),
                       'trigger' if item['by'] == 'trigger' else 'condition')
            for item in content['fired'])
    except MALFORMED as error:
        raise InputError(f'is no list of events ({type(error).__name__}: {error})',
                         EVENTS_TOPIC) from error
