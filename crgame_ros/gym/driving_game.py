# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A game with agents in some seats, advanced from decision to decision without a clock."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from crgame_ros.drivability.collision import CIRCLE_SLACK, PERMANENT_OBSTACLE, PermanentObstacles
from crgame_ros.driver.source import DriverSource
from crgame_ros.errors import InputError
from crgame_ros.game.documents import DrivenHuman
from crgame_ros.game.objects import ObjectStates
from crgame_ros.geometry.outline import Footprint, Primitive
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.gym.av_pilot import AvPilot, stacked
from crgame_ros.gym.episode_setups import check_count
from crgame_ros.gym.reward import GoalWatch
from crgame_ros.planner.plan_check import TOLERANCE
from crgame_ros.policy.actions import (
    ActionKind,
    checked_action,
    PedalInverse,
    pedals,
    PLANNED_KINDS,
    planned_states,
    wanted_motion,
)
from crgame_ros.policy.manoeuvres import Manoeuvres
from crgame_ros.policy.route_guide import RouteGuide, RoutePlace
from crgame_ros.policy.seat_view import SeatView, Surrounded
from crgame_ros.roads.boundary import RoadBoundary
from crgame_ros.simulation.engine import Simulation, StepResult
from crgame_ros.simulation.observer import RunObserver
from crgame_ros.simulation.offline import offline_driver, perceive, PlannerSeat, show
from crgame_ros.simulation.setup import AvSetup, Setup
from crgame_ros.timing.publishing import steps_between_messages
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class ContactSearch:
    """
    A search for contacts at all simulation steps of a tick, done once at its end.

    Bodies that cannot be reached within the tick are excluded first.
    """

    def __init__(self, setup: Setup) -> None:
        self._ids = [item.id for item in setup.descriptions]
        self._footprints = [Footprint(item.shape) for item in setup.descriptions]
        self._driven = len(setup.vehicles)
        radii = np.array([footprint.radius for footprint in self._footprints])
        self._radii, self._object_radii = radii[:self._driven], radii[self._driven:]
        occupancy = setup.open_occupancy()
        self._permanent = None if occupancy is None else PermanentObstacles(
            occupancy, [item.shape for item in setup.vehicle_descriptions])

    def hits(self, row: int, centers: Array, since_s: Sequence[float], before: ObjectStates,
             after: ObjectStates) -> tuple[str, ...]:
        """
        Return the ids of those that a vehicle has touched.

        :param row: index of the vehicle among the driven ones.
        :param centers: (T, V, 3) centres of the driven vehicles at the steps after a tick; the
            last is at the next tick
        :param since_s: (T) time of each step since the tick [s]
        :param before: the objects at the tick.
        :param after: the objects at the next tick.
        """
        own = centers[:, row]
        placed: list[list[Primitive]] = []
        touched = []
        for number in self._near(row, own, centers, since_s, before, after):
            if not placed:
                placed = [self._footprints[row].at(0.0, 0.0, yaw) for yaw in own[:, 2].tolist()]
            relative = self._way(number, centers, since_s, before, after) - own
            footprint = self._footprints[number]
            reach = (self._footprints[row].radius + footprint.radius + CIRCLE_SLACK) ** 2
            for parts, (dx, dy, turned), yaw in zip(placed, relative.tolist(),
                                                    own[:, 2].tolist(), strict=True):
                # In this form, NaN counts as far away.
                if dx * dx + dy * dy <= reach and any(
                        a.collide(b) for a in parts for b in footprint.at(dx, dy, turned + yaw)):
                    touched.append(self._ids[number])
                    break
        if self._permanent is not None and any(
                self._permanent.is_hit(row, (x, y, yaw)) for x, y, yaw in own.tolist()):
            return (*sorted(touched), PERMANENT_OBSTACLE)
        return tuple(sorted(touched))

    def _near(self, row: int, own: Array, centers: Array, since_s: Sequence[float],
              before: ObjectStates, after: ObjectStates) -> list[int]:
        """Return the numbers of those whose circles can meet the vehicle's within the tick."""
        reach = self._radii + (self._radii[row] + CIRCLE_SLACK)
        apart = centers[:, :, :2] - own[:, None, :2]
        near = (np.einsum('tvi,tvi->tv', apart, apart).min(axis=0) <= reach * reach)
        near[row] = False
        found: list[int] = np.flatnonzero(near).tolist()
        if not len(self._object_radii):
            return found
        last = own[-1, :2]
        moved = float(np.abs(own[:, :2] - last).sum(axis=1).max())
        reach = self._object_radii + (self._radii[row] + moved + CIRCLE_SLACK)
        span_s = max(since_s)
        for states, passed_s in ((before, span_s), (after, 0.0)):
            apart = states.poses[:, :2] - last
            wide = reach + passed_s * np.abs(states.velocities[:, :2]).sum(axis=1)
            found += (self._driven + np.flatnonzero(
                np.einsum('mi,mi->m', apart, apart) <= wide * wide)).tolist()
        return sorted(set(found))

    def _way(self, number: int, centers: Array, since_s: Sequence[float], before: ObjectStates,
             after: ObjectStates) -> Array:
        """Return the poses (T, 3) of a vehicle or object at the steps."""
        if number < self._driven:
            return centers[:, number]
        index = number - self._driven
        way: Array = before.poses[index] + np.outer(since_s, before.velocities[index])
        # The pose at the next tick is known exactly.
        way[-1] = after.poses[index]
        return way


@dataclass
class AgentSeat:
    """
    The seat of an agent.

    :param row: index of the vehicle among the driven ones.
    :param vehicle: setup of the vehicle.
    :param inverse: inverse of its powertrain, from acceleration to pedals.
    :param watch: check of its goal.
    :param manoeuvres: its manoeuvres, if the actions are such.
    :param mask: (5) which of them there are at this decision.
    :param pilot: pilot of an AV; None in a human's seat.
    :param around: surroundings at the last decision.
    :param place: place on the route at the last decision.
    :param before: state at the decision before, and the place on the route then.
    :param centers: (T, 3) its centres in the road's coordinates, at the steps since the last
        decision
    :param hit: ids of those that it has touched since then.
    :param goal: whether it has been at its goal at a scenario step since then.
    :param refusal: why the engine refused its plan, or the manoeuvre is masked; None if neither.
    :param overhang: distance off the road at the start; it applies until the vehicle has been on
        the road [m]
    """

    id: str  # noqa: A003
    row: int
    vehicle: DrivenHuman | AvSetup
    view: SeatView
    guide: RouteGuide
    inverse: PedalInverse
    watch: GoalWatch
    manoeuvres: Manoeuvres | None = None
    pilot: AvPilot | None = None
    around: Surrounded = field(init=False)
    place: RoutePlace = field(init=False)
    before: tuple[VehicleState, RoutePlace] = field(init=False)
    action: Array = field(init=False)
    centers: Array = field(init=False)
    mask: NDArray[np.bool_] = field(init=False)
    hit: tuple[str, ...] = ()
    goal: bool = False
    refusal: str | None = None
    overhang: float = 0.0

    @property
    def state(self) -> VehicleState:
        """Return its current state, of the rear axle in the road's coordinates."""
        return self.around.state


class DrivingGame:
    """
    A game in which agents have some seats; all other vehicles drive as in an offline run.

    :param setup: setup of any of its episodes, which differ in traffic and in the starts.
    :param seats: ids of the agents' vehicles.
    :param ticks: number of scenario steps for which an action holds.
    :raises InputError: if there is no such seat, or it does not support these actions.
    """

    def __init__(self, setup: Setup, seats: Sequence[str], action: ActionKind, ticks: int) -> None:
        self._action, self._ticks = action, ticks
        ids, driven = setup.vehicle_ids, setup.vehicle_descriptions
        self._transforms = setup.road_transforms
        self._to_center = np.array([item.rear_to_center for item in driven])
        remedy = 'give 1 for plans, else a whole number from 1'
        check_count('ticks', ticks, remedy)
        if action == 'plan' and ticks > 1:
            raise InputError(f'"ticks" is {ticks!r}', 'environment', remedy)
        self.seats: list[AgentSeat] = []
        for name in seats:
            if name not in ids:
                raise InputError(f'there is no seat "{name}"', setup.loaded.source,
                                 'take one of ' + ', '.join(ids) if ids else
                                 'add a human or an AV to the game')
            row = ids.index(name)
            if row < len(setup.humans) and action in PLANNED_KINDS:
                raise InputError('a human drives by pedals, not by plans or manoeuvres', name,
                                 'choose the action acceleration or pedals, or an AV')
            vehicle = setup.vehicles[row]
            view = self._view(setup, row)
            problem = vehicle.planning_problem if isinstance(vehicle, AvSetup) else None
            start = view.own(stacked([item.state for item in setup.vehicles]))
            self.seats.append(AgentSeat(
                name, row, vehicle, view,
                RouteGuide(setup.loaded.scenario, problem, start, vehicle.vehicle),
                PedalInverse(vehicle.vehicle), GoalWatch(problem, vehicle.vehicle.rear_to_center),
                None if action != 'manoeuvre' else Manoeuvres(
                    setup.loaded.scenario, problem, start, vehicle.vehicle)))
        self._observers: Sequence[RunObserver] = ()
        self.setup = setup
        self.road: RoadBoundary | None = None
        if setup.game.drivability.road and setup.network.lanelet_ids:
            self.road = setup.road
            self.road.prepare([seat.view.own(stacked([item.state for item in setup.vehicles]))[:2]
                               for seat in self.seats])

    @property
    def objects(self) -> ObjectStates:
        """Return the current states of everything that is not a driven vehicle."""
        return self.simulation.objects

    @property
    def time_s(self) -> float:
        """Return the simulated time since the start [s]."""
        return self.simulation.n * self.simulation.scheduler.dt_s

    def begin(self, setup: Setup, observers: Sequence[RunObserver] = ()) -> None:
        """
        Begin an episode.

        :param observers: observers of its ticks.
        """
        self.setup = setup
        self.simulation = Simulation(setup)
        self._observers = observers
        agents = {item.row for item in self.seats}
        humans = len(setup.humans)
        self._hands: dict[int, DriverSource] = {
            row: offline_driver(setup, row) for row in range(humans) if row not in agents}
        self._planners = [PlannerSeat(setup, index, self.simulation, 0, None)
                          for index in range(len(setup.avs)) if humans + index not in agents]
        self._search = ContactSearch(setup) if setup.game.drivability.collision else None
        self._perceive_every = steps_between_messages(setup.game.timing.rate)
        for seat in self.seats:
            seat.vehicle = setup.vehicles[seat.row]
            # Agents in traffic have other shapes in each episode.
            seat.view = self._view(setup, seat.row)
            seat.pilot = None if seat.row < humans else AvPilot(
                setup, seat.row - humans, self.simulation, seat.view)
            seat.hit, seat.refusal = (), None
        perceptions = [planner.perception for planner in self._planners] + [
            seat.pilot.perception for seat in self.seats if seat.pilot]
        self._perceiving = [item for item in perceptions if item is not None]
        if self._perceiving:
            perceive(self.simulation, self._perceiving)
        states = stacked(self.simulation.states)
        for seat in self.seats:
            seat.guide.restart(seat.view.own(states))
        self._proceed(self.simulation.begin(), states)
        for seat in self.seats:
            seat.place = seat.guide.follow(seat.state)
            seat.before = seat.state, seat.place
            if seat.manoeuvres is not None:
                seat.manoeuvres.restart(seat.state)
                seat.mask = seat.manoeuvres.mask(seat.state)
            if self.road is not None:
                state, vehicle = seat.view.own(states), seat.vehicle.vehicle
                seat.overhang = self.road.overhang(
                    *state.center(vehicle.rear_to_center), state.yaw, vehicle.shape)

    def act(self, actions: Mapping[str, object]) -> None:
        """
        Advance to the next decision.

        :param actions: actions of all agents, by seat id.
        :raises PlanningError: if an action is invalid.
        """
        for seat in self.seats:
            seat.action = checked_action(self._action, actions[seat.id])
            seat.before = seat.state, seat.place
            seat.hit, seat.goal, seat.refusal = (), False, None
            if seat.manoeuvres is not None:
                seat.refusal = seat.manoeuvres.decide(int(seat.action), seat.state)
        ways = [self._tick() for _ in range(self._ticks)]
        for seat in self.seats:
            poses = np.concatenate([way[:, seat.row] for way in ways])
            transform = self._transforms[seat.row]
            seat.centers = poses if transform.is_identity else transform.to_scenario(poses)
            seat.place = seat.guide.follow(seat.state)
            if seat.manoeuvres is not None:
                seat.mask = seat.manoeuvres.mask(seat.state)

    def off_road(self) -> list[bool]:
        """
        Return for each seat whether its vehicle was off the road since the last decision.

        A vehicle that started off the road counts as off only if it moves farther off, until it
        has been on the road once.
        """
        return [self.road is not None and self._is_off(self.road, seat) for seat in self.seats]

    def _is_off(self, road: RoadBoundary, seat: AgentSeat) -> bool:
        shape, centers = seat.vehicle.vehicle.shape, seat.centers.tolist()
        off = [road.is_off_road(x, y, yaw, shape) for x, y, yaw in centers]
        if seat.overhang and not all(off):
            seat.overhang, off = 0.0, off[off.index(False):]
        if seat.overhang:
            x, y, yaw = centers[-1]
            return road.overhang(x, y, yaw, shape) > seat.overhang + TOLERANCE
        return any(off)

    def _view(self, setup: Setup, row: int) -> SeatView:
        return SeatView(row, setup.vehicle_descriptions, setup.obstacles.descriptions,
                        self._transforms[row])

    def _tick(self) -> Array:
        """Drive one scenario step; return the vehicles' centres (T, V, 3) at its steps."""
        simulation, scheduler = self.simulation, self.simulation.scheduler
        self._plan()
        before = self.objects
        trace, since_s = [], []
        for _ in range(scheduler.steps_per_tick):
            result, vehicles = self._step()
            trace.append(vehicles)
            since_s.append(scheduler.since_tick_s(simulation.n))
            if self._perceiving and simulation.n % self._perceive_every == 0:
                perceive(simulation, self._perceiving)
            if not result.tick:
                show(simulation, result, list(self._hands.values()))
        states = np.array(trace, dtype=np.float64)
        self._proceed(result, states[-1])
        centers = shifted(states[..., :3], self._to_center)
        if self._search is not None:
            for seat in self.seats:
                found = self._search.hits(seat.row, centers, since_s, before, self.objects)
                seat.hit = tuple(sorted({*seat.hit, *found})) if found else seat.hit
        return centers

    def _step(self) -> tuple[StepResult, Sequence[VehicleState]]:
        """Drive one simulation step; return its result and the states of the vehicles."""
        dt_s = self.simulation.scheduler.dt_s
        result = self.simulation.step(dt_s, self._commands(dt_s))
        return result, self.simulation.states

    def _proceed(self, result: StepResult, states: Array) -> None:
        """Pass a tick to planners and drivers, update agents' surroundings, notify observers."""
        for planner in self._planners:
            planner.proceed(result)
        show(self.simulation, result, list(self._hands.values()))
        for seat in self.seats:
            seat.around = seat.pilot.observe(result, states) if seat.pilot else seat.view.observe(
                states, self.objects)
            seat.goal |= seat.watch.is_met(seat.view.own(states),
                                           self.simulation.scheduler.k(result.n))
        for observer in self._observers:
            observer.observe(result.n, 0.0, states, self.objects)

    def _plan(self) -> None:
        """Plan for the AVs; for one driven by pedals, only if requests wait for it."""
        scheduler = self.simulation.scheduler
        for seat in self.seats:
            if seat.pilot is not None and (
                    self._action != 'pedals' or seat.pilot.perception is not None):
                refusal = seat.pilot.offer(
                    seat.manoeuvres.plan(seat.state, scheduler.time_step_s) if seat.manoeuvres
                    else planned_states(
                        self._action, seat.action, seat.state, seat.vehicle.vehicle,
                        scheduler.time_step_s, scheduler.steps_per_tick))
                seat.refusal = seat.refusal or refusal

    def _commands(self, dt_s: float) -> list[DriverCommand | None]:
        simulation = self.simulation
        commands: list[DriverCommand | None] = [None] * len(self.setup.vehicles)
        for row, hand in self._hands.items():
            commands[row] = hand.command(simulation.n, dt_s)
        for seat in self.seats:
            if self._action == 'pedals':
                commands[seat.row] = pedals(seat.action)
            elif seat.pilot is None:
                commands[seat.row] = seat.inverse.command(
                    wanted_motion(seat.action, seat.before[0].speed, seat.vehicle.vehicle),
                    simulation.humans[seat.row].state.speed)
        return commands
