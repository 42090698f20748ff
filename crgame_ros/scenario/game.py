# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The game file: who takes part in a scenario, driven by what, under which rules."""

from dataclasses import dataclass, field
import math
from pathlib import Path
from typing import Any, Literal

from crgame_ros.perception.spec import PerceptionSpec
from crgame_ros.scenario.events import EventSpec
from crgame_ros.scenario.object_file import ObjectSpec
from crgame_ros.traffic.spec import TrafficSpec
from crgame_ros.vehicle.parameters import DEFAULT_VEHICLE

DEFAULT_PLANNER = 'idm'


@dataclass(frozen=True)
class ModelSpec:
    """
    A model by its registered name, `module:Class` or `file.py:Class`.

    :param options: keyword arguments of its constructor.
    """

    name: str
    options: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class TrackerSpec:
    """
    What steers a tracked AV along its plan (FS II-C1).

    :param model: the tracking controller.
    :param pose: whether it steers by the true pose or by the estimated one.
    """

    model: ModelSpec = ModelSpec('lqr')
    pose: Literal['true', 'estimated'] = 'true'


@dataclass(frozen=True)
class LaneletSpawn:
    """
    A pose on a lanelet.

    :param lanelet: lanelet id.
    :param s: rear-axle position along its centre line [m].
    :param d: offset to the left of the centre line [m].
    :param speed: initial speed [m/s].
    """

    lanelet: int
    s: float
    d: float = 0.0
    speed: float = 0.0


@dataclass(frozen=True)
class PoseSpawn:
    """A rear-axle pose x [m], y [m], yaw [rad] in the scenario frame, and a speed [m/s]."""

    x: float
    y: float
    yaw: float
    speed: float = 0.0


@dataclass(frozen=True)
class HumanSpec:
    """
    One human's vehicle.

    :param id: hv0, hv1, …
    :param driver: where its command comes from: auto, cockpit, idle, evdev[:NAME], keys:FILE,
        joy:FILE, joy, replay:BAG.
    :param vehicle: name of the vehicle parameters.
    :param spawn: where it starts; None places it beside or behind the first AV, where it can.
    :param dynamics: the model that moves it; None is the KS model of CRG 2-4.
    """

    id: str
    driver: str = 'auto'
    vehicle: str = DEFAULT_VEHICLE
    spawn: LaneletSpawn | PoseSpawn | None = None
    dynamics: ModelSpec | None = None


@dataclass(frozen=True)
class AvSpec:
    """
    One autonomous vehicle.

    :param id: av0, av1, …
    :param planner: registered name or `module:Class`.
    :param options: keyword arguments of the planner.
    :param planning_problem: id of its planning problem; None takes the next unused one.
    :param vehicle: name of the vehicle parameters.
    :param spawn: `problem` starts at the planning problem's pose; `lanelet` at the nearest pose
        of lanelet geometry, aligned to the former by CRG 6-10.
    :param execution: `perfect` follows the plan exactly (CRG), `tracked` by a controller on a
        vehicle model (FS II-C).
    :param tracker: the controller of a tracked AV.
    :param dynamics: the vehicle model of a tracked AV (FS 2).
    :param perception: how it perceives the world; None is perfectly.
    """

    id: str
    planner: str = DEFAULT_PLANNER
    options: dict[str, Any] = field(default_factory=dict)
    planning_problem: int | None = None
    vehicle: str = DEFAULT_VEHICLE
    spawn: Literal['problem', 'lanelet'] = 'problem'
    execution: Literal['perfect', 'tracked'] = 'perfect'
    tracker: TrackerSpec = TrackerSpec()
    dynamics: ModelSpec = ModelSpec('dynamic-bicycle')
    perception: PerceptionSpec | None = None

    @property
    def localisation_steers(self) -> bool:
        """Tell whether a tracking controller steers by the estimated pose."""
        return self.execution == 'tracked' and self.tracker.pose == 'estimated'


@dataclass(frozen=True)
class PredictionSpec:
    """
    What a planner is told about the future of others.

    :param mode: `constant` (nobody's future is known), `recorded` (recorded obstacles' true
        future), `plans` (other AVs' current plans); the last two leak.
    :param horizon: H_pred [s].
    """

    mode: Literal['constant', 'recorded', 'plans'] = 'constant'
    horizon: float = 3.0


@dataclass(frozen=True)
class DrivabilitySpec:
    """Which checks run, and whether a human's violation ends the run (CRG III-D)."""

    collision: bool = True
    road: bool = True
    stop: bool = False


@dataclass(frozen=True)
class TimingSpec:
    """
    The time controller of CRG III-A2; each mechanism can be switched off.

    :param rate: simulation rate [Hz]; the step becomes Delta t_c / N exactly (CRG 14).
    :param pacing: wait for the wall-clock schedule.
    :param frame_skipping: obey the supervisor's orders to suppress messages for people.
    :param drift_reset: re-anchor the schedule when the lag exceeds `reset_threshold`.
    :param measured_interval: integrate humans over the measured, clipped interval (CRG 13).
    :param clip: `carry` brings what the clip cuts off into later steps, `drop` is the paper.
    :param dt_min: Delta t_min [s].
    :param dt_max: Delta t_max [s].
    :param skip_threshold: lag above which frames are skipped [s].
    :param reset_threshold: lag above which the schedule is re-anchored [s].
    :param warm_up_steps: steps without reset at the start.
    :param max_catch_up_steps: late steps in a row after which orders are served all the same.
    :param realign: `time` follows the request's stamp, `nearest` is CRG 16.
    :param sample: `interpolate` between plan states, `floor` is CRG 15.
    """

    rate: float = 100.0
    pacing: bool = True
    frame_skipping: bool = True
    drift_reset: bool = True
    measured_interval: bool = True
    clip: Literal['carry', 'drop'] = 'carry'
    dt_min: float = 0.0001
    dt_max: float = 0.05
    skip_threshold: float = 0.02
    reset_threshold: float = 0.25
    warm_up_steps: int = 50
    max_catch_up_steps: int = 50
    realign: Literal['time', 'nearest'] = 'time'
    sample: Literal['interpolate', 'floor'] = 'interpolate'


@dataclass(frozen=True)
class Game:
    """
    A game as its file says it, before the scenario is loaded.

    :param title: one line for people.
    :param scenario: path of the CommonRoad file.
    :param humans: the humans' vehicles.
    :param avs: the AVs; None makes one of each planning problem.
    :param duration: simulated seconds until the run ends; infinite if nobody says.
    :param seed: seed of everything random.
    :param base: directory against which file names inside the game are resolved.
    :param events: what triggers and conditions bring about.
    :param objects: objects of the game's own (FS II-A3).
    :param traffic: vehicles that react (FS III); None for none.
    :param occupancy: map of permanent obstacles (FS II-A2).
    """

    scenario: Path
    title: str = ''
    humans: tuple[HumanSpec, ...] = (HumanSpec('hv0'),)
    avs: tuple[AvSpec, ...] | None = None
    duration: float = math.inf
    seed: int = 0
    prediction: PredictionSpec = PredictionSpec()
    drivability: DrivabilitySpec = DrivabilitySpec()
    timing: TimingSpec = TimingSpec()
    base: Path = Path('.')
    events: tuple[EventSpec, ...] = ()
    objects: tuple[ObjectSpec, ...] = ()
    traffic: TrafficSpec | None = None
    occupancy: Path | None = None
