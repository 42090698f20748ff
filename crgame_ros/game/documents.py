# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The run described as JSON text: `/scenario/game` and `/scenario/objects`.

The simulation writes them; planners, monitor, recorder and conversion read them, and so need
neither the game's files nor the engine.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
import json
from pathlib import Path
from typing import Annotated, Any, get_args

from annotated_types import Interval
from crgame_ros.errors import InputError
from crgame_ros.game.driven_vehicle import (
    DrivenAv,
    DrivenHuman,
    DrivenVehicle,
    read_av,
    read_human,
)
from crgame_ros.game.events import EventList, EventSpec, FiredBy, FiredEvent
from crgame_ros.game.game import DrivabilitySpec, EnvironmentSpec, MAX_VEHICLES, TimingSpec
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.game.task_spec import TaskList, TaskSpec
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.schema.bounded import Bounded
from crgame_ros.schema.json_documents import DocumentReader
from crgame_ros.schema.reading import read
from crgame_ros.schema.writing import write
from crgame_ros.vehicle.lights import ALL_LIGHTS

GAME_TOPIC = '/scenario/game'
OBJECTS_TOPIC = '/scenario/objects'
EVENTS_TOPIC = '/scenario/events'
SIGNALS_TOPIC = '/scenario/signals'
RUN_STATE_TOPIC = '/sim/state'
# Upper limit of a ROS stamp [ns].
LARGEST_NUMBER = 2**31 * 10**9
# The errors of reading an untrusted text, including those of huge numbers and deep nesting.
MALFORMED = (AttributeError, KeyError, OverflowError, RecursionError, TypeError, ValueError)
# Keys of every event; the others are parameters of its kind.
_COMMON = ('name', 'label', 'kind', 'when')


@dataclass(frozen=True)
class GameDocument:
    """
    The content of `/scenario/game` that other programs need.

    :param epoch: counts resets.
    :param simulation: names the process that simulates: with the epoch, the run; '' in older
        recordings.
    :param benchmark_id: of the scenario.
    :param title: one displayed line.
    :param scenario_sha256: of the text on `/scenario/xml`.
    :param scheduler: time grids with the clock offset.
    :param seed: of everything random.
    :param duration_s: simulated time until the run ends; None without a limit [s]
    :param real_time_factor: simulated seconds per wall second at the start.
    :param humans: the humans' vehicles.
    :param avs: the AVs.
    :param drivability: which checks run.
    :param timing: of the time controller.
    :param traffic: vehicles that react; None for none.
    :param occupancy: file of the map of permanent obstacles; None for none.
    :param environment: light and air; None in older recordings without them.
    :param events: the game's events.
    :param event_entries: the same, in the form for pages.
    :param file: text of the game file; empty without one.
    :param sound: on or none: whether pages may play sound and gamepads rumble.
    :param tasks: the drivers' tasks besides driving.
    :param language: of the texts for drivers.
    """

    epoch: int
    simulation: str
    benchmark_id: str
    title: str
    scenario_sha256: str
    scheduler: ScenarioScheduler
    seed: int
    duration_s: float | None
    real_time_factor: float
    humans: tuple[DrivenHuman, ...]
    avs: tuple[DrivenAv, ...]
    drivability: DrivabilitySpec
    timing: TimingSpec
    traffic: TrafficSpec | None
    occupancy: Path | None
    environment: EnvironmentSpec | None
    events: tuple[EventSpec, ...]
    event_entries: tuple[Any, ...]
    file: str
    sound: str
    tasks: tuple[TaskSpec, ...]
    language: str

    @property
    def vehicles(self) -> tuple[DrivenVehicle, ...]:
        """Return all driven vehicles, in the order of `/vehicles/state`."""
        return (*self.humans, *self.avs)

    def human(self, vehicle_id: str) -> DrivenHuman | None:
        """Return a human's vehicle, None if it is not in the game."""
        return next((item for item in self.humans if item.id == vehicle_id), None)

    def av(self, vehicle_id: str) -> DrivenAv | None:
        """Return an AV, None if it is not in the game."""
        return next((item for item in self.avs if item.id == vehicle_id), None)


def parse_game_document(text: str) -> GameDocument:
    """
    Read `/scenario/game`.

    :raises InputError: if it is not what `simulation.document_writer` writes.
    """
    try:
        content = json.loads(text)
        humans, avs = content['humans'], content['avs']
        if len(humans) + len(avs) > MAX_VEHICLES:
            raise ValueError(f'{len(humans) + len(avs)} driven vehicles, at most {MAX_VEHICLES} '
                             'are read')
        for name, least in (('dt_c_ns', 1), ('steps_per_tick', 1), ('epoch', 0),
                            ('clock_offset_ns', 0), ('k0', 0)):
            if not least <= content[name] < LARGEST_NUMBER:
                raise ValueError(f'{name} is {str(content[name])[:40]}')
        duration_s, traffic = content.get('duration'), content.get('traffic')
        occupancy, events = content.get('occupancy'), content.get('events') or []
        environment = content.get('environment')
        game = GameDocument(
            epoch=int(content['epoch']), simulation=str(content.get('simulation', '')),
            benchmark_id=str(content.get('benchmark_id', '')),
            title=str(content.get('title') or ''),
            scenario_sha256=str(content['scenario_sha256']),
            scheduler=ScenarioScheduler(
                int(content['dt_c_ns']), int(content['steps_per_tick']), int(content['k0']),
                int(content['clock_offset_ns'])),
            seed=int(content['seed']),
            duration_s=None if duration_s is None else float(duration_s),
            real_time_factor=float(content.get('real_time_factor', 1.0)),
            humans=tuple(map(read_human, humans)), avs=tuple(map(read_av, avs)),
            drivability=read(
                DrivabilitySpec, content['drivability'], f'{GAME_TOPIC}: drivability'),
            timing=read(TimingSpec, content['timing'], f'{GAME_TOPIC}: timing'),
            traffic=None if traffic is None else read(
                TrafficSpec, traffic, f'{GAME_TOPIC}: traffic'),
            occupancy=None if occupancy is None else Path(occupancy),
            environment=None if environment is None else read(
                EnvironmentSpec, environment, f'{GAME_TOPIC}: environment'),
            events=parse_document_entries(events, GAME_TOPIC), event_entries=tuple(events),
            file=str(content.get('file') or ''), sound=str(content.get('sound') or 'on'),
            tasks=read(TaskList, content.get('tasks') or [], f'{GAME_TOPIC}: tasks'),
            language=str(content.get('language') or 'en'))
    except MALFORMED as error:
        raise InputError(f'is no game document ({type(error).__name__}: {error})',
                         GAME_TOPIC) from error
    names = [item.id for item in game.vehicles]
    if len(set(names)) < len(names):
        raise InputError('is no game document (ids come twice)', GAME_TOPIC)
    return game


def objects_document(descriptions: Sequence[ObjectDescription]) -> str:
    """Return the possible objects as JSON (fields as in the contract, `/scenario/objects`)."""
    return json.dumps([
        {'id': item.id, 'type': item.type, 'role': item.role.value, 'shape': asdict(item.shape),
         'reference_point': item.reference_point, 'rear_to_center': item.rear_to_center}
        for item in descriptions], allow_nan=False)


_OBJECTS: DocumentReader[tuple[ObjectDescription, ...]] = DocumentReader(
    Annotated[tuple[ObjectDescription, ...], Bounded(1_000_000)], OBJECTS_TOPIC, 'list of objects')


def parse_objects_document(text: str) -> tuple[ObjectDescription, ...]:
    """
    Read `/scenario/objects`.

    :raises InputError: if it is not what `objects_document` writes.
    """
    return _OBJECTS.read(text)


@dataclass(frozen=True)
class Signals:
    """
    What is shown from a scenario step on.

    :param k: scenario step.
    :param states: of each traffic light, by its id.
    :param objects: bits of `Light` of recorded vehicles with signals, by id; earlier recordings
        lack them.
    """

    k: int
    states: Annotated[dict[str, str], Bounded(10_000)]
    objects: Annotated[dict[str, Annotated[int, Interval(ge=0, le=ALL_LIGHTS)]],
                       Bounded(10_000)] = field(default_factory=dict)


_SIGNALS: DocumentReader[Signals] = DocumentReader(Signals, SIGNALS_TOPIC, 'list of states')


def parse_signals_document(text: str) -> Signals:
    """
    Read `/scenario/signals`.

    :raises InputError: if it is malformed.
    """
    return _SIGNALS.read(text)


@dataclass(frozen=True)
class _FiredEntry:
    name: str
    n: int
    k: int
    by: str


@dataclass(frozen=True)
class _FiredEvents:
    epoch: int
    fired: Annotated[tuple[_FiredEntry, ...], Bounded(1_000_000)]


_CAUSES: dict[str, FiredBy] = {cause: cause for cause in get_args(FiredBy)}
_EVENTS: DocumentReader[_FiredEvents] = DocumentReader(
    _FiredEvents, EVENTS_TOPIC, 'list of events')


def events_document(epoch: int, fired: Sequence[FiredEvent]) -> str:
    """Return the events of a run so far as JSON (fields as in the contract)."""
    return json.dumps({'epoch': epoch, 'fired': [asdict(event) for event in fired]})


def parse_events_document(text: str) -> tuple[int, tuple[FiredEvent, ...]]:
    """
    Read `/scenario/events`.

    :return: the epoch, and the events that took effect in it, in order.
    :raises InputError: if it is not what `events_document` writes.
    """
    found = _EVENTS.read(text)
    # A newer program may know more causes.
    return found.epoch, tuple(
        FiredEvent(item.name, item.n, item.k, _CAUSES.get(item.by, 'condition'))
        for item in found.fired)


@dataclass(frozen=True)
class RunStateDocument:
    """
    The content of `/sim/state` that names a run and tells whether it goes on.

    :param simulation: as in the game document, as is the epoch.
    :param state: waiting, running, paused or ended.
    """

    simulation: str
    epoch: int
    state: str


_RUN_STATE: DocumentReader[RunStateDocument] = DocumentReader(
    RunStateDocument, RUN_STATE_TOPIC, 'state of a run')


def parse_run_state(text: str) -> RunStateDocument:
    """
    Read `/sim/state`.

    :raises InputError: if it is not what sim_node writes.
    """
    return _RUN_STATE.read(text)


def document_entry(event: EventSpec) -> dict[str, Any]:
    """Return an event's entry of `/scenario/game`: name, label, kind, when and its parameters."""
    entry = write(event)
    parameters = entry.pop(event.kind)
    return {'name': None, 'label': None, 'kind': event.kind, 'when': None} | entry | parameters


def parse_document_entries(entries: Any, where: str) -> tuple[EventSpec, ...]:
    """
    Read the entries that `document_entry` writes.

    :raises InputError: if they are malformed.
    """
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise InputError('"events" is no list of events', where)
    events: tuple[EventSpec, ...] = read(EventList, [
        {key: entry[key] for key in _COMMON if key in entry and key != 'kind'}
        | {str(entry.get('kind')): {key: value for key, value in entry.items()
                                    if key not in _COMMON}}
        for entry in entries], where)
    return events
