# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The events of a game, triggered by an experimenter or a condition (FS, external triggers)."""

from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal, TypeAlias

from crgame_ros.errors import InputError, short
from crgame_ros.game.traffic_spec import ReactionTime, Share, SpeedFactor
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.document_marks import Otherwise
from crgame_ros.schema.marks import Advice, Keyed, Listed, Named, Parts, Within, Wording

MAX_EVENTS = 100
# Stands for every agent of traffic.
ALL_AGENTS = 'all'
# Of an event or a task.
EntryName = Annotated[str, Wording('[a-z0-9_-]{1,40}',
                                   'give 1 to 40 of the characters a-z, 0-9, _ and -')]
Metres = Annotated[float, Within(0.0, above=True)]
PutType = Literal['constructionZone', 'parkedVehicle', 'roadBoundary', 'unknown']


@dataclass(frozen=True)
class Release:
    """
    Release a recorded obstacle, which stands at its first pose until then.

    :param object: obstacle id.
    """

    object: int  # noqa: A003


@dataclass(frozen=True)
class Brake:
    """
    Slow down a recorded obstacle along its own path, to a speed that it then keeps.

    :param object: obstacle id.
    :param deceleration: [m/s^2]
    :param speed: [m/s]; an obstacle that is slower keeps its own.
    """

    object: int  # noqa: A003
    deceleration: Annotated[float, Within(0.0, above=True)] = 4.0
    speed: Annotated[float, Within(0.0, 100.0)] = 0.0


@dataclass(frozen=True)
class PutObstacle:
    """
    Place a static, rectangular obstacle.

    :param x: of its centre [m]
    :param y: of its centre [m]
    :param yaw: [rad]
    :param length: [m]
    :param width: [m]
    :param type: CommonRoad's obstacle type.
    """

    x: float
    y: float
    yaw: float = 0.0
    length: Metres = 2.0
    width: Metres = 1.0
    type: PutType = 'constructionZone'  # noqa: A003


@dataclass(frozen=True)
class SpeedLimit:
    """
    Set the speed limit.

    :param speed: [m/s]
    :param lanelets: ids of lanelets; all if empty.
    """

    speed: Annotated[float, Within(0.0, 100.0, above=True)]
    lanelets: tuple[int, ...] = ()


@dataclass(frozen=True)
class PlanDisplay:
    """
    Show or hide an AV's plan in the cockpit.

    :param av: its id.
    :param show: whether the plan is shown.
    """

    av: str
    show: bool


@dataclass(frozen=True)
class PlannerSwap:
    """
    Replace an AV's planner.

    :param av: its id.
    :param planner: registered name, `module:Class` or `file.py:Class`.
    :param options: keyword arguments of the planner.
    """

    av: str
    planner: Annotated[str, Named(), Wording(r'[\s\S]+', 'give the name of a planner')]
    options: dict[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class PlannerRun:
    """
    Stop or restart an AV's planner: a stopped planner gets no requests.

    :param av: its id.
    :param run: whether it runs afterwards.
    """

    av: str
    run: bool


@dataclass(frozen=True)
class TrafficChange:
    """
    Change the driving of one agent of traffic, or of all; None leaves a value unchanged.

    :param agent: id of the agent, or `all`, which includes later agents.
    :param speed_factor: desired speed over speed limit; for all, its mean.
    :param desired_speed: desired speed instead, independent of the limit [m/s]
    :param options: of the car-following model, in addition to its present ones.
    :param politeness: weight of others' loss when changing lanes for speed (MOBIL).
    :param lane_changes: whether it changes lanes.
    :param reaction_time: delay between its decision and the execution [s]
    :param imperfection: random deviation, as a share of its greatest acceleration.
    :param red_runner: whether it ignores traffic lights.
    :param late_yielder: whether it notices late that it has to yield.
    """

    agent: str
    speed_factor: SpeedFactor | None = None
    desired_speed: Annotated[float, Within(0.0, 100.0)] | None = None
    options: dict[str, object] = field(default_factory=dict)
    politeness: Share | None = None
    lane_changes: bool | None = None
    reaction_time: ReactionTime | None = None
    imperfection: Share | None = None
    red_runner: bool | None = None
    late_yielder: bool | None = None

    def check(self) -> None:
        """Refuse an event without changes, and two changes of one thing."""
        if self == TrafficChange(self.agent):
            raise InputError('changes nothing', '', 'give what is to change, such as speed_factor')
        if self.speed_factor is not None and self.desired_speed is not None:
            raise InputError('has both "speed_factor" and "desired_speed"', '',
                             'give one of them')


@dataclass(frozen=True)
class AtTime:
    """
    A condition that holds from a time on.

    :param time: since the start of the run [s]
    """

    time: float


@dataclass(frozen=True)
class AtStep:
    """
    A condition that holds from a scenario time step on, to repeat a recorded run's events.

    :param step: scenario time step k.
    """

    step: int


@dataclass(frozen=True)
class Near:
    """
    A condition that holds while the centre of a vehicle or object is within a circle.

    :param vehicle: its id.
    :param x: of the circle's centre [m]
    :param y: of the circle's centre [m]
    :param radius: [m]
    """

    vehicle: str
    x: float
    y: float
    radius: Metres


@dataclass(frozen=True)
class Between:
    """
    A condition that holds while the centres of two vehicles or objects are near each other.

    :param between: their two ids.
    :param distance: maximum distance between them [m]
    """

    between: Annotated[tuple[str, str], Parts(('id', 'id')),
                       Advice('name two ids')]
    distance: Metres

    def check(self) -> None:
        """Refuse the distance from an object to itself."""
        if self.between[0] == self.between[1]:
            raise InputError(f'"between" is {short(self.between)}', '', 'name two ids')


# Orders that change the agents of traffic.
TrafficOrder = SpeedLimit | TrafficChange
Action = Release | Brake | PutObstacle | TrafficOrder | PlanDisplay | PlannerSwap | PlannerRun
Condition = AtTime | AtStep | Near | Between

# The key of each action in a game file, used as its kind elsewhere.
ACTIONS: dict[str, type[Action]] = {
    'release': Release, 'brake': Brake, 'obstacle': PutObstacle, 'speed_limit': SpeedLimit,
    'traffic': TrafficChange, 'plan_display': PlanDisplay, 'planner': PlannerSwap,
    'planner_run': PlannerRun}


@dataclass(frozen=True)
class EventSpec:
    """
    One event of a game; it takes effect at most once in a run.

    :param name: the name to trigger it by.
    :param action: its action.
    :param label: displayed text; by default the name.
    :param when: condition under which it fires by itself; None leaves it to triggers.
    """

    FORM: ClassVar[Form] = Form('see docs/games.md for the keys', first=('name', 'label'))

    name: EntryName
    action: Annotated[Action, Keyed(ACTIONS, 'action')]
    label: Annotated[str, Wording(r'[\s\S]{1,80}', 'give a text of 80 characters at most')] = ''
    when: Condition | None = None

    def __post_init__(self) -> None:
        """Set the name as the default label."""
        if not self.label:
            object.__setattr__(self, 'label', self.name)

    @property
    def kind(self) -> str:
        """Return the key of its action."""
        return next(key for key, kind in ACTIONS.items() if type(self.action) is kind)

    @property
    def object_id(self) -> str | None:
        """Return the id of the obstacle that it changes or places; None for other events."""
        if isinstance(self.action, Release | Brake):
            return f'o{self.action.object}'
        return f'e_{self.name}' if isinstance(self.action, PutObstacle) else None


EventList = Annotated[tuple[EventSpec, ...], Listed(0, MAX_EVENTS, 'event', 'name')]


FiredBy: TypeAlias = Literal['trigger', 'condition', 'driver', 'contact']
# No event of a game has a space in its name.
PUT_BACK = 'put back'
_CONTACT, _WITH = 'contact of ', ' with '


@dataclass(frozen=True)
class FiredEvent:
    """
    An event that took effect.

    :param name: of the event; `contact of hv0 with av0` if a contact stopped a vehicle, and
        `put back hv0` if its driver had it put back on its lane.
    :param n: simulation step; for an event of the game a tick of the scenario.
    :param k: scenario time step.
    :param by: what made it fire.
    """

    name: str
    n: int
    k: int
    by: Annotated[FiredBy, Otherwise('condition')]

    @classmethod
    def contact(cls, vehicle_id: str, other_id: str, n: int, k: int) -> 'FiredEvent':
        """Return the event of a contact that stopped a vehicle."""
        return cls(f'{_CONTACT}{vehicle_id}{_WITH}{other_id}', n, k, 'contact')

    @classmethod
    def put_back(cls, vehicle_id: str, n: int, k: int) -> 'FiredEvent':
        """Return the event of a vehicle that was put back on its lane at n."""
        return cls(f'{PUT_BACK} {vehicle_id}', n, k, 'driver')

    @property
    def vehicle(self) -> str | None:
        """Return the vehicle that was put back; None for any other event."""
        return self.name.removeprefix(f'{PUT_BACK} ') if self.by == 'driver' else None

    @property
    def touching(self) -> tuple[str, str] | None:
        """Return the vehicle that a contact stopped and the one it touched; None otherwise."""
        if self.by != 'contact':
            return None
        vehicle, _, other = self.name.removeprefix(_CONTACT).partition(_WITH)
        return vehicle, other

    @property
    def is_of_game(self) -> bool:
        """Return whether the game has an event of this name."""
        return self.by in ('trigger', 'condition')
