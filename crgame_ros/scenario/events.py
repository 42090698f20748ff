# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The events of a game: what an experimenter triggers, or a condition (FS, external triggers)."""

from dataclasses import dataclass, field
from typing import Any, Literal

# Names every agent of traffic.
ALL_AGENTS = 'all'
PutType = Literal['constructionZone', 'parkedVehicle', 'roadBoundary', 'unknown']


@dataclass(frozen=True)
class Release:
    """Let a recorded obstacle go, which stands at its first pose until then."""

    object: int


@dataclass(frozen=True)
class Brake:
    """
    Slow a recorded obstacle down along its own path, to a speed that it then keeps.

    :param object: obstacle id.
    :param deceleration: [m/s^2]
    :param speed: [m/s]; an obstacle that is slower keeps its own.
    """

    object: int
    deceleration: float = 4.0
    speed: float = 0.0


@dataclass(frozen=True)
class PutObstacle:
    """
    Put a static obstacle, a rectangle with its centre at x [m], y [m].

    :param type: CommonRoad's name of what it is.
    """

    x: float
    y: float
    yaw: float = 0.0
    length: float = 2.0
    width: float = 1.0
    type: PutType = 'constructionZone'


@dataclass(frozen=True)
class SpeedLimit:
    """Set the speed limit [m/s] of lanelets, of all where none is named."""

    speed: float
    lanelets: tuple[int, ...] = ()


@dataclass(frozen=True)
class PlanDisplay:
    """Show or hide an AV's plan in the cockpit."""

    av: str
    show: bool


@dataclass(frozen=True)
class PlannerSwap:
    """Replace an AV's planner."""

    av: str
    planner: str
    options: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class PlannerRun:
    """Stop an AV's planner, or let it go on: while stopped it is asked for no plan."""

    av: str
    run: bool


@dataclass(frozen=True)
class TrafficChange:
    """
    Let one agent of traffic, or all of them, drive otherwise; None leaves things as they are.

    :param agent: id of the agent, or `all`: whoever comes later included.
    :param speed_factor: desired speed over speed limit; of all, its mean.
    :param desired_speed: whatever the limit, instead [m/s]
    :param options: of the car-following model, besides those that it has.
    :param politeness: weight of others' loss when changing lanes for speed (MOBIL).
    :param lane_changes: whether it changes lanes.
    :param reaction_time: after which it does what it has decided [s]
    :param imperfection: random share of its greatest acceleration by which it fails to do so.
    :param red_runner: whether it ignores traffic lights.
    :param late_yielder: whether it sees late that it has to yield.
    """

    agent: str
    speed_factor: float | None = None
    desired_speed: float | None = None
    options: dict[str, Any] = field(default_factory=dict)
    politeness: float | None = None
    lane_changes: bool | None = None
    reaction_time: float | None = None
    imperfection: float | None = None
    red_runner: bool | None = None
    late_yielder: bool | None = None


@dataclass(frozen=True)
class AtTime:
    """From a time since the start of the run on [s]."""

    time: float


@dataclass(frozen=True)
class AtStep:
    """From a scenario time step k on: how a recorded run's events are repeated."""

    step: int


@dataclass(frozen=True)
class Near:
    """While the centre of a vehicle or object is within a radius [m] of the point x [m], y [m]."""

    vehicle: str
    x: float
    y: float
    radius: float


@dataclass(frozen=True)
class Between:
    """While the centres of two vehicles or objects are at most a distance [m] apart."""

    between: tuple[str, str]
    distance: float


# What agents of traffic do otherwise from then on.
TrafficOrder = SpeedLimit | TrafficChange
Action = Release | Brake | PutObstacle | TrafficOrder | PlanDisplay | PlannerSwap | PlannerRun
Condition = AtTime | AtStep | Near | Between

# The key of each action in a game file, which is its kind everywhere else.
ACTIONS: dict[str, type[Action]] = {
    'release': Release, 'brake': Brake, 'obstacle': PutObstacle, 'speed_limit': SpeedLimit,
    'traffic': TrafficChange, 'plan_display': PlanDisplay, 'planner': PlannerSwap,
    'planner_run': PlannerRun}
# The key by which each condition is known.
CONDITIONS: dict[str, type[Condition]] = {
    'time': AtTime, 'step': AtStep, 'vehicle': Near, 'between': Between}


@dataclass(frozen=True)
class EventSpec:
    """
    One event of a game; it takes effect at most once in a run.

    :param name: by which it is triggered.
    :param action: what it does.
    :param label: text for people.
    :param when: condition under which it fires by itself; None leaves it to triggers.
    """

    name: str
    action: Action
    label: str = ''
    when: Condition | None = None

    @property
    def kind(self) -> str:
        """Key of its action."""
        return next(key for key, kind in ACTIONS.items() if type(self.action) is kind)

    @property
    def object_id(self) -> str | None:
        """Id of the obstacle that it changes or puts; None if it leaves all as they are."""
        if isinstance(self.action, Release | Brake):
            return f'o{self.action.object}'
        return f'e_{self.name}' if isinstance(self.action, PutObstacle) else None


@dataclass(frozen=True)
class FiredEvent:
    """
    An event that took effect.

    :param name: of the event.
    :param n: simulation step, a tick of the scenario.
    :param k: scenario time step.
    :param by: what made it fire.
    """

    name: str
    n: int
    k: int
    by: Literal['trigger', 'condition']
