# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The game file: the participants of a scenario, their drivers and the rules."""

from dataclasses import dataclass, field
import math
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from crgame_ros.errors import InputError
from crgame_ros.game.events import EventList
from crgame_ros.game.expectation import ExpectationList
from crgame_ros.game.instruments_spec import InstrumentsSpec
from crgame_ros.game.object_spec import ObjectList
from crgame_ros.game.perception_spec import PerceptionSpec
from crgame_ros.game.task_spec import TaskList
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.game.variation_spec import named_uniquely, VariationList
from crgame_ros.library.lookup import find_scenario
from crgame_ros.paths import expanded
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import (
    Advice,
    Folder,
    LeftOut,
    Listed,
    Meaning,
    Named,
    Numbered,
    Sought,
    Within,
    Wording,
)
from crgame_ros.schema.reading import read
from crgame_ros.schema.writing import write
from crgame_ros.vehicle.parameters import AUTO
from crgame_ros.yaml_text import read_yaml

Light = Literal['day', 'dusk']
# Visibility on a clear day [m].
CLEAR_M = 30_000.0


@dataclass(frozen=True)
class EnvironmentSpec:
    """
    Light, air and the grip of the road. Light and air do not affect the sensors of AVs.

    :param light: day or dusk; None takes the scenario's, else day.
    :param visibility: meteorological visibility, at which 5 % of a contrast is left (Koschmieder)
        [m]; None takes the scenario's, else 30 km.
    :param friction: peak friction of the road: 0.4 to 0.6 when wet, 0.1 to 0.2 on ice. It limits
        how driven vehicles accelerate, brake and turn, and is told to planners; traffic agents
        have limits of their own. None keeps the friction of each vehicle's parameters [-].
    """

    light: Light | None = None
    visibility: Annotated[float, Within(10.0, 100_000.0)] | None = None
    friction: Annotated[float, Within(0.05, 2.0)] | None = None


DEFAULT_PLANNER = 'idm'
# Humans and AVs together.
MAX_VEHICLES = 200
Speed = Annotated[float, Within(-100.0, 100.0)]


class DriverName(Named):
    """The source of a human's commands; the part after the colon may be a file."""

    def resolved(self, name: str, base: Path) -> str:
        """Return the name unchanged: a driver's file is resolved when it is opened."""
        return name

    def written(self, name: str, base: Path) -> str:
        """Return the name with an absolute file name; a device's name is not a file."""
        kind, colon, argument = name.partition(':')
        if not colon or kind == 'evdev':
            return name
        return f'{kind}:{(base / expanded(argument)).resolve()}'


class ScenarioFile(Sought):
    """A CommonRoad file, or the benchmark id of a scenario in the user's places."""

    def find(self, name: str, base: Path) -> Path:
        """Return the path of the file."""
        return find_scenario(name, base)


@dataclass(frozen=True)
class ModelSpec:
    """
    A model by its registered name, `module:Class` or `file.py:Class`.

    :param name: of the model.
    :param options: keyword arguments of its constructor.
    """

    FORM: ClassVar[Form] = Form('name a model', short='name', rest='options')

    name: Annotated[str, Named(), Advice('name a model')]
    options: dict[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class TrackerSpec:
    """
    The controller that steers a tracked AV along its plan (FS II-C1).

    :param model: the tracking controller.
    :param pose: whether it steers by the true pose or by the estimated one.
    """

    FORM: ClassVar[Form] = Form('name a tracker', short='name', rest='model')

    model: ModelSpec = ModelSpec('lqr')
    # YAML reads a bare true as a boolean.
    pose: Annotated[Literal['true', 'estimated'], Meaning(True, 'true')] = 'true'


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
    speed: Speed = 0.0


@dataclass(frozen=True)
class PoseSpawn:
    """
    A pose in the scenario's frame.

    :param x: of the rear axle [m]
    :param y: of the rear axle [m]
    :param yaw: [rad]
    :param speed: initial speed [m/s]
    """

    x: float
    y: float
    yaw: float
    speed: Speed = 0.0


@dataclass(frozen=True)
class HumanSpec:
    """
    One human's vehicle.

    :param id: hv0, hv1, …
    :param driver: source of its commands: auto, cockpit, idle, evdev[:NAME], keys:FILE, joy:FILE,
        joy, policy:FILE.py:load, replay:BAG.
    :param vehicle: name of the vehicle parameters; `auto` is bmw_320i, or bicycle on a map without
        lanes for cars.
    :param spawn: where it starts; None places it beside or behind the first AV, where possible.
    :param dynamics: the model that moves it; None is the KS model of CRG 2-4.
    """

    id: Annotated[str, Numbered('hv'), Wording('hv[0-9]{1,3}', 'use hv0, hv1, …')]  # noqa: A003
    driver: Annotated[str, DriverName()] = 'auto'
    vehicle: Annotated[str, Named()] = AUTO
    spawn: Annotated[LaneletSpawn | PoseSpawn | None, Meaning('auto', None)] = None
    dynamics: ModelSpec | None = None


@dataclass(frozen=True)
class AvSpec:
    """
    One autonomous vehicle.

    :param id: av0, av1, …
    :param planner: registered name, `module:Class`, `file.py:Class` or `policy:FILE.py:load`.
    :param options: keyword arguments of the planner.
    :param planning_problem: id of its planning problem; None takes the next unused one.
    :param vehicle: name of the vehicle parameters; `auto` is bmw_320i, or bicycle on a map without
        lanes for cars.
    :param spawn: `problem` starts at the planning problem's pose; `lanelet` at the nearest pose
        of lanelet geometry, aligned to the former by CRG 6-10.
    :param speed: at its start; None takes the planning problem's [m/s].
    :param execution: `perfect` follows the plan exactly (CRG), `tracked` by a controller on a
        vehicle model (FS II-C).
    :param tracker: the controller of a tracked AV.
    :param dynamics: the vehicle model of a tracked AV (FS 2).
    :param perception: how it perceives the world; None is perfectly.
    :param lights: whether its planner receives others' indicators and horn; None takes the default
        of the planner's class.
    """

    id: Annotated[str, Numbered('av'), Wording('av[0-9]{1,3}', 'use av0, av1, …')]  # noqa: A003
    planner: Annotated[str, Named()] = DEFAULT_PLANNER
    options: dict[str, object] = field(default_factory=dict)
    planning_problem: int | None = None
    vehicle: Annotated[str, Named()] = AUTO
    spawn: Annotated[Literal['problem', 'lanelet'], Meaning('auto', 'problem')] = 'problem'
    speed: Annotated[float, Within(0.0, 100.0)] | None = None
    execution: Literal['perfect', 'tracked'] = 'perfect'
    tracker: TrackerSpec = TrackerSpec()
    dynamics: ModelSpec = ModelSpec('dynamic-bicycle')
    perception: PerceptionSpec | None = None
    lights: bool | None = None

    @property
    def localisation_steers(self) -> bool:
        """Return whether a tracking controller steers by the estimated pose."""
        return self.execution == 'tracked' and self.tracker.pose == 'estimated'


@dataclass(frozen=True)
class PredictionSpec:
    """
    The predictions of others that a planner receives.

    :param mode: `constant` (no knowledge of the future), `recorded` (recorded obstacles' true
        future), `plans` (other AVs' current plans); the last two leak the future.
    :param horizon: H_pred [s].
    """

    mode: Literal['constant', 'recorded', 'plans'] = 'constant'
    horizon: Annotated[float, Within(0.1, 60.0)] = 3.0


@dataclass(frozen=True)
class DrivabilitySpec:
    """
    The checks of drivability, and whether a human's violation ends the run (CRG III-D).

    :param collision: whether contacts are checked.
    :param road: whether vehicles have to stay on the road.
    :param stop: whether a human's violation ends the run.
    :param contact: effect of a contact on a vehicle with a human driver: with `through` it drives
        on through the other; with `stop` it stops immediately and can only drive away.
    """

    collision: bool = True
    road: bool = True
    stop: bool = False
    contact: Literal['through', 'stop'] = 'through'


@dataclass(frozen=True)
class TimingSpec:
    """
    The time controller of CRG III-A2; each mechanism can be switched off.

    :param rate: simulation rate [Hz]; the step becomes Delta t_c / N exactly (CRG 14).
    :param pacing: wait for the wall-clock schedule.
    :param frame_skipping: obey the supervisor's orders to suppress display messages.
    :param drift_reset: re-anchor the schedule when the lag exceeds `reset_threshold`.
    :param measured_interval: integrate humans over the measured, clipped interval (CRG 13).
    :param clip: `carry` moves the clipped time into later steps, `drop` discards it as in the
        paper.
    :param dt_min: Delta t_min [s].
    :param dt_max: Delta t_max [s].
    :param skip_threshold: lag above which frames are skipped [s].
    :param reset_threshold: lag above which the schedule is re-anchored [s].
    :param warm_up_steps: steps without reset at the start.
    :param max_catch_up_steps: steps in a row without time to spare after which orders are
        processed anyway.
    :param realign: `time` follows the request's stamp, `nearest` is CRG 16.
    :param sample: `interpolate` between plan states, `floor` is CRG 15.
    """

    FORM: ClassVar[Form] = Form('see docs/games.md for the keys')

    rate: Annotated[float, Within(1.0, 10000.0)] = 100.0
    pacing: bool = True
    frame_skipping: bool = True
    drift_reset: bool = True
    measured_interval: bool = True
    clip: Literal['carry', 'drop'] = 'carry'
    dt_min: Annotated[float, Within(1e-6, 1.0)] = 0.0001
    dt_max: Annotated[float, Within(1e-4, 10.0)] = 0.05
    skip_threshold: Annotated[float, Within(0.0)] = 0.02
    reset_threshold: Annotated[float, Within(0.0)] = 0.25
    warm_up_steps: Annotated[int, Within(0, 1e9)] = 50
    max_catch_up_steps: Annotated[int, Within(1, 1e9)] = 50
    realign: Literal['time', 'nearest'] = 'time'
    sample: Literal['interpolate', 'floor'] = 'interpolate'

    def check(self) -> None:
        """Refuse bounds in the wrong order."""
        if self.dt_min > self.dt_max:
            raise InputError('"dt_min" is larger than "dt_max"')


@dataclass(frozen=True)
class Game:
    """
    The content of a game file, before the scenario is loaded.

    :param title: one displayed line.
    :param scenario: path of the CommonRoad file; in a game file, also a benchmark id, whose file
        is found in the places of `crgame scenarios`.
    :param humans: the humans' vehicles.
    :param avs: the AVs; None makes one of each planning problem.
    :param duration: simulated seconds until the run ends; infinite by default.
    :param seed: seed of everything random.
    :param prediction: the predictions of others that planners receive.
    :param drivability: which checks run.
    :param timing: the time controller.
    :param base: directory against which file names inside the game are resolved.
    :param events: actions that triggers and conditions start.
    :param objects: objects of the game's own (FS II-A3).
    :param traffic: vehicles that react (FS III); None for none.
    :param occupancy: map of permanent obstacles (FS II-A2).
    :param sound: whether pages may play sound and gamepads rumble; `none` for a study without.
    :param environment: light and air in the displayed world.
    :param tasks: tasks that drivers answer or do besides driving.
    :param instruments: streams of the Lab Streaming Layer, and triggers; None for none.
    :param expect: what a run has to keep, for `crgame test`.
    :param vary: what may vary, for `crgame evaluate` and `crgame search`; a run without them takes
        the values as they are.
    :param language: of the texts for drivers during the drive, if the page's address names none.
    """

    FORM: ClassVar[Form] = Form(
        'see docs/games.md for the keys', moved=(('rate', 'timing'),),
        first=('title', 'scenario', 'duration', 'seed'))

    scenario: Annotated[Path, ScenarioFile(), Advice('name a CommonRoad file')]
    title: str = ''
    humans: Annotated[tuple[HumanSpec, ...], Listed(noun='vehicle', own='id')] = (
        HumanSpec('hv0'),)
    avs: Annotated[tuple[AvSpec, ...], Listed(noun='vehicle', own='id')] | None = None
    duration: Annotated[float, Within(0.0, endless=True), LeftOut()] = math.inf
    seed: Annotated[int, Within(0, 2**63 - 1)] = 0
    prediction: PredictionSpec = PredictionSpec()
    drivability: DrivabilitySpec = DrivabilitySpec()
    timing: TimingSpec = TimingSpec()
    base: Annotated[Path, Folder()] = Path('.')
    events: Annotated[EventList, LeftOut()] = ()
    objects: Annotated[ObjectList, LeftOut()] = ()
    traffic: TrafficSpec | None = None
    occupancy: Annotated[Path, Advice('name the YAML file of a map')] | None = None
    # YAML reads a bare on as a boolean.
    sound: Annotated[Literal['on', 'none'], Meaning(True, 'on'), LeftOut()] = 'on'
    environment: EnvironmentSpec | None = None
    tasks: Annotated[TaskList, LeftOut()] = ()
    instruments: InstrumentsSpec | None = None
    expect: Annotated[ExpectationList, LeftOut()] = ()
    vary: Annotated[VariationList, LeftOut()] = ()
    language: Annotated[Literal['en', 'de'], LeftOut()] = 'en'

    def _repr_html_(self) -> str:
        """Return the game file as HTML for notebooks."""
        from html import escape
        return f'<pre>{escape(self.dump())}</pre>'

    def dump(self) -> str:
        """
        Return a game file that gives the same game from any folder: its file names are absolute.

        :return: YAML text.
        """
        import yaml
        return yaml.safe_dump(write(self, self.base), sort_keys=False, allow_unicode=True)

    def check(self) -> None:
        """Refuse more than `MAX_VEHICLES` vehicles, and two entries that vary one thing."""
        named_uniquely(self.vary)
        count = len(self.humans) + len(self.avs or ())
        if count > MAX_VEHICLES:
            raise InputError(f'{count} humans and AVs', '', f'have {MAX_VEHICLES} at most')


def load_game(path: Path) -> Game:
    """
    Read a game file.

    :raises InputError: naming the file, the key and the remedy.
    """
    values = read_yaml(path, 'game file')
    return parse_game(values, str(path), path.parent)


def parse_game(values: object, where: str, base: Path) -> Game:
    """
    Check the content of a game file.

    :param values: the parsed YAML.
    :param where: file name for messages.
    :param base: directory against which its file names are resolved.
    """
    return read(Game, values, where, base)
