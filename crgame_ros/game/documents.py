# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The run described as JSON text: `/scenario/game`, `/scenario/objects`, events, signals and state.

The simulation writes them; planners, monitor, recorder and conversion read them, and so need
neither the game's files nor the engine.
"""

from dataclasses import dataclass, field
from functools import cached_property
import math
from pathlib import Path
import re
from typing import Annotated, Any, Literal

from annotated_types import Interval, Predicate
from crgame_ros.errors import InputError
from crgame_ros.game.events import EventList, EventSpec, FiredEvent
from crgame_ros.game.game import (
    AvSpec,
    DrivabilitySpec,
    EnvironmentSpec,
    MAX_VEHICLES,
    ModelSpec,
    PredictionSpec,
    TimingSpec,
    TrackerSpec,
)
from crgame_ros.game.instruments_spec import InstrumentsSpec
from crgame_ros.game.object_spec import ObjectList, ObjectSpec
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.game.perception_spec import PerceptionSpec
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.game.task_spec import TaskList, TaskSpec
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.rigid_transform import RigidTransform, road_transforms
from crgame_ros.schema.document_marks import Bounded, Declared, Derived, Row
from crgame_ros.schema.json_documents import JsonDocument
from crgame_ros.schema.writing import write
from crgame_ros.vehicle.lights import ALL_LIGHTS
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState

# Keys of every event; the others are parameters of its kind.
_COMMON = ('name', 'label', 'kind', 'when')
# Upper limit of a ROS stamp [ns].
_LARGEST = 2**31 * 10**9
Count = Annotated[int, Interval(ge=0, lt=_LARGEST)]
Period = Annotated[int, Interval(ge=1, lt=_LARGEST)]
Amount = Annotated[float, Interval(ge=0.0, lt=math.inf)]
VEHICLE_ID = re.compile(r'(hv|av)[0-9]{1,3}')
VehicleId = Annotated[str, Predicate(VEHICLE_ID.fullmatch)]


@dataclass(frozen=True)
class DrivenVehicle:
    """
    The common fields of humans' vehicles and AVs.

    :param id: hv0, av0, …
    :param vehicle: its parameters.
    :param state: initial state of the rear axle, in frame map.
    """

    id: VehicleId  # noqa: A003
    vehicle: VehicleParameters
    state: Annotated[VehicleState, Row()]


@dataclass(frozen=True)
class DrivenHuman(DrivenVehicle):
    """
    A human's vehicle.

    :param driver: source of its commands, as in a game file.
    :param timeline: text of the timeline that it plays, empty without one.
    :param dynamics: the model that moves it; None is the KS model of CRG 2-4.
    """

    driver: str
    timeline: str = ''
    dynamics: Annotated[ModelSpec, Declared()] | None = None


@dataclass(frozen=True)
class DrivenAv(DrivenVehicle):
    """
    An AV; what is not described here is as in a game file.

    :param options: of the planner.
    :param planning_problem: id of its planning problem.
    :param transform: from simulation to the scenario coordinates in which it plans (CRG 9).
    :param perception: how it perceives the world; None is perfectly.
    """

    planner: str
    options: dict[str, object] = field(default_factory=dict)
    planning_problem: int = 0
    transform: Annotated[RigidTransform, Row()] = RigidTransform()
    execution: Literal['perfect', 'tracked'] = AvSpec.execution
    tracker: Annotated[TrackerSpec, Declared()] = AvSpec.tracker
    dynamics: Annotated[ModelSpec, Declared()] = AvSpec.dynamics
    perception: Annotated[PerceptionSpec, Declared()] | None = None


def document_entry(event: EventSpec) -> dict[str, object]:
    """Return an event's entry of `/scenario/game`: name, label, kind, when and its parameters."""
    entry = write(event)
    parameters = entry.pop(event.kind)
    return {'name': None, 'label': None, 'kind': event.kind, 'when': None} | entry | parameters


class EventEntries(Declared):
    """A mark for events, each written as its `document_entry`."""

    def read(self, given: object, where: str) -> object:
        """Read the entries."""
        if not isinstance(given, list) or not all(isinstance(entry, dict) for entry in given):
            raise InputError('is no list of events', where)
        return super().read([
            {key: entry[key] for key in _COMMON if key in entry and key != 'kind'}
            | {str(entry.get('kind')): {key: value for key, value in entry.items()
                                        if key not in _COMMON}}
            for entry in given], where)

    def write(self, value: Any) -> object:
        """Return the entries."""
        return [document_entry(event) for event in value]


@dataclass(frozen=True, kw_only=True)
class GameDocument:
    """
    The resolved game; parts without a description are as in the game file.

    :param epoch: counts resets.
    :param simulation: names the process that simulates: with the epoch, the run; '' offline and
        in older recordings.
    :param benchmark_id: of the scenario.
    :param scenario_sha256: of the text on `/scenario/xml`.
    :param dt_ns: nominal simulation step [ns]
    :param dt_c_ns: scenario step [ns]
    :param steps_per_tick: N of CRG 14.
    :param k0: scenario step at n = 0.
    :param clock_offset_ns: simulation time of n = 0 [ns]
    :param real_time_factor: simulated seconds per wall second at the start.
    :param duration: simulated time until the run ends; None without a limit [s]
    :param humans: the humans' vehicles.
    :param avs: the AVs.
    :param occupancy: absolute path.
    :param environment: None only in older recordings.
    :param tasks: with their seats.
    :param file: text of the game file; empty without one.
    """

    epoch: Count
    simulation: str = ''
    title: str = ''
    benchmark_id: str = ''
    scenario_sha256: str
    dt_ns: int = 0
    dt_c_ns: Period
    steps_per_tick: Period
    k0: Count
    clock_offset_ns: Count
    real_time_factor: Amount = 1.0
    seed: int
    duration: Amount | None = None
    humans: Annotated[tuple[DrivenHuman, ...], Bounded(MAX_VEHICLES)]
    avs: Annotated[tuple[DrivenAv, ...], Bounded(MAX_VEHICLES)]
    prediction: Annotated[PredictionSpec, Declared()] = PredictionSpec()
    drivability: Annotated[DrivabilitySpec, Declared()]
    timing: Annotated[TimingSpec, Declared()]
    events: Annotated[tuple[EventSpec, ...], EventEntries(EventList)] = ()
    objects: Annotated[tuple[ObjectSpec, ...], Declared(ObjectList)] = ()
    traffic: Annotated[TrafficSpec, Declared()] | None = None
    occupancy: Path | None = None
    sound: str = 'on'
    environment: Annotated[EnvironmentSpec, Declared()] | None = None
    tasks: Annotated[tuple[TaskSpec, ...], Declared(TaskList)] = ()
    instruments: Annotated[InstrumentsSpec, Declared()] | None = None
    language: str = 'en'
    file: str = ''

    def __post_init__(self) -> None:
        """Refuse ids that come twice."""
        names = [item.id for item in self.vehicles]
        if len(set(names)) < len(names):
            raise ValueError('ids come twice')
        if len(names) > MAX_VEHICLES:
            raise ValueError(f'{len(names)} driven vehicles, at most {MAX_VEHICLES} are read')

    @cached_property
    def scheduler(self) -> ScenarioScheduler:
        """Return the time grids with the clock offset."""
        return ScenarioScheduler(
            self.dt_c_ns, self.steps_per_tick, self.k0, self.clock_offset_ns)

    @property
    def vehicles(self) -> tuple[DrivenVehicle, ...]:
        """Return all driven vehicles, in the order of `/vehicles/state`."""
        return (*self.humans, *self.avs)

    @property
    def road_transforms(self) -> tuple[RigidTransform, ...]:
        """Return the transform of each driven vehicle to the road's coordinates (CRG 28)."""
        return road_transforms(len(self.humans), [av.transform for av in self.avs])

    @property
    def gaze_seats(self) -> tuple[str, ...]:
        """Return the vehicles of whose drivers an instrument tells the gaze."""
        gaze = () if self.instruments is None else self.instruments.gaze
        return tuple(dict.fromkeys(each.seat for each in gaze if each.seat is not None))

    def human(self, vehicle_id: str) -> DrivenHuman | None:
        """Return a human's vehicle, None if it is not in the game."""
        return next((item for item in self.humans if item.id == vehicle_id), None)

    def av(self, vehicle_id: str) -> DrivenAv | None:
        """Return an AV, None if it is not in the game."""
        return next((item for item in self.avs if item.id == vehicle_id), None)


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


@dataclass(frozen=True)
class FiredEvents:
    """
    The events of a run so far.

    :param epoch: of the run.
    :param fired: in the order in which they took effect.
    """

    epoch: int
    fired: Annotated[tuple[FiredEvent, ...], Bounded(1_000_000)]


@dataclass(frozen=True)
class RunState:
    """
    Which run there is, and whether it goes on.

    :param simulation: as in the game document, as is the epoch.
    :param state: waiting, running, paused or ended.
    """

    simulation: str
    epoch: int
    state: str


GAME: JsonDocument[GameDocument] = JsonDocument(GameDocument, '/scenario/game', 'game document')
# Everything that can appear.
OBJECTS: JsonDocument[tuple[ObjectDescription, ...]] = JsonDocument(
    Annotated[tuple[Annotated[ObjectDescription, Derived(('reference_point',))], ...],
              Bounded(1_000_000)], '/scenario/objects', 'list of objects')
SIGNALS: JsonDocument[Signals] = JsonDocument(Signals, '/scenario/signals', 'list of states')
EVENTS: JsonDocument[FiredEvents] = JsonDocument(
    FiredEvents, '/scenario/events', 'list of events')
RUN_STATE: JsonDocument[RunState] = JsonDocument(RunState, '/sim/state', 'state of a run')
