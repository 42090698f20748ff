# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The resolved setup of a run: a game with its scenario loaded and its vehicles placed."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
import math
from pathlib import Path
from typing import TYPE_CHECKING

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.driver.source import load_timeline, parse_source
from crgame_ros.driver.timeline import timeline_text
from crgame_ros.errors import InputError, one_line
from crgame_ros.game.documents import DrivenHuman
from crgame_ros.game.game import AvSpec, Game
from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.geometry.rigid_transform import RigidTransform, road_transforms
from crgame_ros.occupancy.tiles import TiledOccupancy
from crgame_ros.paths import expanded
from crgame_ros.registry import POLICY
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.exact_values import exact_position
from crgame_ros.scenario.export_goals import refuse_unwritable
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.scenario.spawn import lanelet_pose, place_human, problem_pose
from crgame_ros.scripted.objects import ScriptedObjects
from crgame_ros.simulation.av_assignment import assign_avs, Part
from crgame_ros.simulation.av_models import check_models
from crgame_ros.simulation.game_check import (
    check_changes,
    check_events,
    check_tasks,
    held_obstacles,
    put_obstacles,
)
from crgame_ros.simulation.traffic_setup import adopted_columns, place_traffic, TrafficSetup
from crgame_ros.vehicle.parameters import load_vehicle_parameters, VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from crgame_ros.roads.boundary import RoadBoundary

# A vehicle recorded this close to an AV's start is a recording of the AV [m].
SAME_PLACE = 1.0
# Larger discrepancies of both initial poses give a notice: [m], half the room beside a car in its
# lane, and [rad], which makes the same offset 25 m ahead.
MAX_DISCREPANCY = 0.5
MAX_TURN = 0.02


@dataclass(frozen=True)
class AvSetup:
    """
    One autonomous vehicle, placed.

    :param spec: its entry in the game file.
    :param vehicle: its parameters.
    :param state: its state at n = 0, rear axle, simulation coordinates.
    :param transform: from simulation to scenario coordinates (CRG 6-8).
    :param planning_problem: its CommonRoad planning problem.
    """

    spec: AvSpec
    vehicle: VehicleParameters
    state: VehicleState
    transform: RigidTransform
    planning_problem: PlanningProblem

    @property
    def id(self) -> str:  # noqa: A003
        """Return the id of the vehicle, such as av0."""
        return self.spec.id

    @property
    def declared(self) -> VehicleState:
        """Return the state at n = 0 that the planning problem declares."""
        if self.transform.is_identity:
            return self.state
        x, y, yaw = self.transform.to_scenario(np.array(self.state[:3])).tolist()
        return self.state._replace(x=x, y=y, yaw=yaw)


@dataclass(frozen=True)
class Setup:
    """
    A run before its first step.

    :param game: the game as in its file.
    :param loaded: the scenario.
    :param network: its roads.
    :param obstacles: its obstacles.
    :param humans: the humans' vehicles.
    :param avs: the AVs.
    :param scheduler: time grids, with a clock offset of zero.
    :param notices: remarks for the user, one line each.
    :param traffic: the agents at the first tick; None without any.
    """

    game: Game
    loaded: LoadedScenario
    network: RoadNetwork
    obstacles: ScenarioObstacles
    humans: tuple[DrivenHuman, ...]
    avs: tuple[AvSetup, ...]
    scheduler: ScenarioScheduler
    notices: tuple[str, ...] = ()
    traffic: TrafficSetup | None = None

    @cached_property
    def scripted_columns(self) -> NDArray[np.int_]:
        """Return the columns of the game's own objects among all objects."""
        return self._columns(item.id for item in self.game.objects)

    @cached_property
    def agent_columns(self) -> NDArray[np.int_]:
        """Return the columns of the agents among all objects, in the order of traffic."""
        return self._columns(item.id for item in (
            () if self.traffic is None else self.traffic.descriptions))

    def _columns(self, ids: Iterable[str]) -> NDArray[np.int_]:
        places = {item: column for column, item in enumerate(self.obstacles.ids)}
        return np.array([places[item] for item in ids], dtype=int)

    def make_scripted(self) -> ScriptedObjects | None:
        """Build the game's own objects in their states at the first tick."""
        return ScriptedObjects(
            self.game.objects, self.network, self.scheduler.time_step_s, self.scheduler.k0) \
            if self.game.objects else None

    def open_occupancy(self) -> TiledOccupancy | None:
        """
        Open the map of permanent obstacles; None if the game has none.

        :raises InputError: if it cannot be used.
        """
        return None if self.game.occupancy is None else TiledOccupancy(self.game.occupancy)

    @cached_property
    def road(self) -> 'RoadBoundary':
        """Return the road boundary, computed at first use (3 to 50 ms): call this before a run."""
        from crgame_ros.roads.boundary import RoadBoundary
        return RoadBoundary(self.loaded.scenario.lanelet_network)

    @property
    def vehicles(self) -> tuple[DrivenHuman | AvSetup, ...]:
        """Return the driven vehicles: humans, then AVs."""
        return (*self.humans, *self.avs)

    @property
    def road_transforms(self) -> tuple[RigidTransform, ...]:
        """Return the transform of each driven vehicle to the road's coordinates (CRG 28)."""
        return road_transforms(len(self.humans), [av.transform for av in self.avs])

    @property
    def vehicle_ids(self) -> tuple[str, ...]:
        """Return the ids of the driven vehicles: humans, then AVs."""
        return tuple(vehicle.id for vehicle in self.vehicles)

    @property
    def vehicle_descriptions(self) -> tuple[ObjectDescription, ...]:
        """Return the descriptions of the driven vehicles: humans, then AVs."""
        return tuple(
            ObjectDescription(vehicle.id, vehicle.vehicle.type, role, vehicle.vehicle.shape,
                              vehicle.vehicle.rear_to_center)
            for vehicle, role in zip(
                self.vehicles, [Role.HUMAN] * len(self.humans)
                + [Role.AUTONOMOUS] * len(self.avs), strict=True))

    @property
    def descriptions(self) -> tuple[ObjectDescription, ...]:
        """Return the descriptions of all that can appear: driven vehicles, then other objects."""
        return (*self.vehicle_descriptions, *self.obstacles.descriptions)


def build_setup(game: Game, loaded: LoadedScenario | None = None) -> Setup:
    """
    Load the scenario of a game and place its vehicles.

    :param loaded: the scenario, if it has been loaded already.
    :raises InputError: if the scenario or the game cannot be used.
    """
    loaded = load_scenario(game.scenario) if loaded is None else loaded
    network = RoadNetwork(loaded.scenario.lanelet_network)
    parts, remarks = assign_avs(game, loaded)
    avs = _place_avs(game, parts, network)
    k0 = min((av.planning_problem.initial_state.time_step for av in avs), default=0)
    doubles = _recorded_egos(loaded, avs, k0)
    obstacles = ScenarioObstacles(loaded, doubles, held_obstacles(game), put_obstacles(game))
    vehicles = [*(human.id for human in game.humans), *(av.id for av in avs)]
    check_events(game, loaded.source, network, obstacles, [human.id for human in game.humans],
                 [av.spec for av in avs])
    check_tasks(game.tasks, game.events, loaded.source, vehicles,
                [*(item.id for item in obstacles.descriptions),
                 *(item.id for item in game.objects)])
    _check_gaze(game, loaded.source, vehicles)
    notices = [*loaded.notices, *(f'{loaded.source}: {remark}' for remark in remarks),
               *_discrepancies(avs), *(
        f'{loaded.source}: obstacle {number} is the recorded {av_id} itself and is left out'
        for number, av_id in doubles.items())]
    notices += [f'{loaded.source}: {av.id} starts at {av.state.speed:.1f} m/s, above the '
                f'{av.vehicle.max_speed:g} m/s of {av.vehicle.name}: its plans are refused until '
                'it is slower' for av in avs if av.state.speed > av.vehicle.max_speed]
    notices += [f'{loaded.source}: {av.id} starts at time step {k0}, before the {step} of its '
                'planning problem' for av in avs
                if (step := av.planning_problem.initial_state.time_step) > k0]
    if network.vehicle_type == 'bicycle':
        notices.append(f'{loaded.source}: no lane is for cars: those for bicycles or people '
                       'count, and vehicles are bicycles unless the game names others')
    humans: list[DrivenHuman] = []
    for spec in game.humans:
        parameters = _vehicle(game, spec.vehicle, network)
        taken = [human.state for human in humans]
        state = place_human(
            network, spec, parameters, [av.state for av in avs], obstacles.descriptions,
            obstacles.states_at(k0), taken,
            [av.vehicle for av in avs] + [human.vehicle for human in humans])
        source = parse_source(spec.driver)
        timeline = timeline_text(load_timeline(source, game.base)) \
            if source.has_timeline else ''
        humans.append(DrivenHuman(
            spec.id, parameters, state, _from_anywhere(spec.driver, game.base), timeline,
            spec.dynamics))
    scheduler = ScenarioScheduler.from_rate(loaded.time_step_s, game.timing.rate, k0)
    setup = Setup(game, loaded, network, obstacles, tuple(humans), avs, scheduler,
                  tuple(map(one_line, notices)))
    check_models([(av.spec, av.vehicle) for av in avs],
                 [(human.id, human.dynamics, human.vehicle) for human in humans])
    setup.open_occupancy()
    setup = _with_living(setup)
    check_changes(game, loaded.source, () if setup.traffic is None else [
        item.id for item in setup.traffic.descriptions])
    if not setup.descriptions:
        raise InputError('the game is empty: no human, no planning problem, no traffic and no '
                         'obstacle', loaded.source, 'add one of them to the game')
    refuse_unwritable(loaded, setup.obstacles.descriptions,
                      [av.planning_problem.planning_problem_id for av in avs])
    return setup


def _from_anywhere(driver: str, base: Path) -> str:
    """Return a policy driver with its file's absolute path; other drivers are unchanged."""
    if not driver.startswith(POLICY):
        return driver
    return POLICY + str((base / expanded(driver.removeprefix(POLICY))).resolve())


def _with_living(setup: Setup) -> Setup:
    """Return the setup with the objects that the run moves: the game's own and the agents."""
    game, base = setup.game, setup.obstacles
    scripted = setup.make_scripted()
    described = () if scripted is None else scripted.descriptions
    kept = {name for event in game.events if (name := event.object_id) is not None}
    agents = adopted_columns(game.traffic, base, setup.network, kept)
    setup = replace(setup, obstacles=base.with_living(agents, described))
    if game.traffic is None:
        return setup
    states = base.states_at(setup.scheduler.k0)
    if scripted is not None:
        states = ObjectStates(np.concatenate((states.poses, scripted.states.poses)),
                              np.concatenate((states.velocities, scripted.states.velocities)))
    traffic = place_traffic(
        game.traffic, setup.loaded, setup.network, setup.descriptions, base, agents,
        [vehicle.state for vehicle in setup.vehicles], states, setup.scheduler, game.seed)
    slots = traffic.descriptions[len(agents):]
    return replace(setup, traffic=traffic,
                   obstacles=base.with_living(agents, (*described, *slots)))


def _recorded_egos(loaded: LoadedScenario, avs: tuple[AvSetup, ...], k0: int) -> dict[int, str]:
    """Find recorded vehicles that start where an AV does: recordings of the same vehicle."""
    doubles: dict[int, str] = {}
    for obstacle in loaded.scenario.dynamic_obstacles:
        state = obstacle.state_at_time(k0)
        if state is None:
            continue
        x, y = exact_position(state.position)
        for av in avs:
            # A recording starts at the problem's state, wherever the simulator puts the AV.
            center = av.declared.center(av.vehicle.rear_to_center)
            if math.hypot(x - center[0], y - center[1]) < SAME_PLACE:
                doubles[obstacle.obstacle_id] = av.id
    return doubles


def _discrepancies(avs: Iterable[AvSetup]) -> Iterable[str]:
    """Yield notices about AVs placed far from their problems' initial states (CRG III-A1)."""
    for av in avs:
        apart = math.dist(av.state[:2], av.declared[:2])
        turned = abs(av.transform.yaw_offset)
        if not (apart <= MAX_DISCREPANCY and turned <= MAX_TURN):
            yield (f'{av.id}: lanelet geometry and its planning problem place it {apart:.2f} m '
                   f'and {math.degrees(turned):.1f} deg apart (more than {MAX_DISCREPANCY:g} m or '
                   f'{math.degrees(MAX_TURN):.1f} deg): it will drive beside its lane by as much; '
                   '"spawn: problem" has no such gap')


def _vehicle(game: Game, name: str, network: RoadNetwork) -> VehicleParameters:
    parameters = load_vehicle_parameters(name, network.vehicle_type)
    return parameters if game.environment is None \
        else parameters.on_road(game.environment.friction)


def _check_gaze(game: Game, where: str, vehicles: Sequence[str]) -> None:
    """Refuse the gaze of a driver who has no vehicle in the game."""
    for gaze in game.instruments.gaze if game.instruments is not None else ():
        if not vehicles or (gaze.seat or vehicles[0]) not in vehicles:
            raise InputError(f'there is no vehicle "{gaze.seat}"' if gaze.seat
                             else 'the game has no driven vehicle',
                             f'{where}: instruments: gaze {gaze.stream}',
                             f'it has {", ".join(vehicles) or "none"}')


def _place_avs(game: Game, parts: Sequence[Part], network: RoadNetwork) -> tuple[AvSetup, ...]:
    avs: list[AvSetup] = []
    for spec, problem in parts:
        parameters = _vehicle(game, spec.vehicle, network)
        declared = problem_pose(problem, parameters.rear_to_center,
                                parameters.wheelbase)
        state = declared
        if spec.spawn == 'lanelet':
            state = lanelet_pose(network, declared)
        if spec.speed is not None:
            state = state._replace(
                speed=spec.speed, acceleration=0.0,
                yaw_rate=spec.speed * math.tan(state.steering_angle) / parameters.wheelbase)
        transform = RigidTransform.between(state[:3], declared[:3])
        avs.append(AvSetup(spec, parameters, state, transform, problem))
    return tuple(avs)
