# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A reactive sampling planner that changes lanes, on commonroad-reactive-planner 2025.1."""

from collections.abc import Iterator
import math
from typing import ClassVar, NamedTuple

from crgame_ros.errors import PlanningError
from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.planner.idm import IdmPlanner
from crgame_ros.planner.interface import Planner, PlannerContext
from crgame_ros.planner.path_following import PathPosition
from crgame_ros.planner.path_obstacles import Clearance
from crgame_ros.planner.path_planner import check_positive
from crgame_ros.planner.plan_check import TOLERANCE
from crgame_ros.planner.reactive_core import configuration, ReactiveCore
from crgame_ros.planner.reference_path import DrivingPath
from crgame_ros.planner.side_lanes import OWN_LANE, road_bounds, side_lanes, SideLane
from crgame_ros.vehicle.state import REST
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Beginning of the model's speeds from which the target speed is extrapolated [s].
FIRST_S = 1.0
LEVELS = 3
# Least gain of speed to leave the route's lane (the package's cost of an offset of one lane is
# that of 2.5 m/s less than desired), additional gain to do so to the right, and to change the
# lane that is aimed at [m/s].
LEAVING = 2.5
RIGHT = 0.5
TURNING = 1.0
# Nearer than this to a lane's centre line the ego is in that lane [m].
INSIDE = 1.0
# The longest sampled stop takes this many times the time of the hardest stop.
STOP_SHARE = 2.5
# Greatest over mean deceleration of the package's profiles.
PEAK = 1.5
# Least distance ahead at which side lanes are searched [m].
SHORTEST_LOOK = 15.0


class _Samples:
    """The values that the package samples in one dimension, by sampling level."""

    # The package reads this when it replaces its own samples.
    _num_init_samples = 3

    def __init__(self, *levels: set[float]) -> None:
        self._levels = levels

    def samples_at_level(self, level: int) -> set[float]:
        return self._levels[level]


class _Aim(NamedTuple):
    """
    A lane to drive in, and the speed there.

    :param loss: loss of speed there against a free road, plus the cost of a change [m/s]
    :param offset: of the lane's centre line to the left of the path [m]
    :param speed: target over the horizon [m/s]
    """

    loss: float
    offset: float
    speed: float


class ReactivePlanner(Planner):
    """
    A planner that samples trajectories in the curvilinear frame and drives the cheapest free one.

    This is the reactive planner of CRG IV (figures 10 and 11) on the package of its authors. It
    predicts others at constant velocity and leaves its lane where another one of the same
    direction is faster and free. The Intelligent Driver Model gives the speed that each lane
    allows. The planner aims at another lane if the gain of speed exceeds the cost of a change, and
    if there is a gap. The package then samples quartic speed profiles and quintic offsets to that
    lane. Samples that break the vehicle's limits, hit a predicted obstacle or leave the road are
    dropped, and the cheapest of the rest is the plan. If none is left, the planner tries the next
    best lane, then evading within the lanes of the same direction, then emergency braking and
    evading on the whole carriageway. The number of samples bounds the time.

    :param v0: desired speed; None takes speed limits, goal and initial speed [m/s]
    :param horizon: length of a plan [s]
    :param safety_margin: enlargement of obstacles on each side [m]
    :param clearance: of people on foot and on bicycles; with less room they are passed slowly [m]
    """

    name: ClassVar[str] = 'reactive'

    def __init__(self, v0: float | None = None, horizon: float = 3.0,
                 safety_margin: float = 0.15, clearance: float = 1.5) -> None:
        check_positive(self.name, v0=v0, horizon=horizon, safety_margin=safety_margin,
                       clearance=clearance)
        self._idm = IdmPlanner(v0=v0, horizon=horizon)
        self._horizon = horizon
        self._margin, self._distance = safety_margin, clearance

    def setup(self, context: PlannerContext) -> None:
        """Plan the path and build the package's planner."""
        self._context = context
        self._idm.setup(context)
        config = configuration(context, self._horizon)
        self._steps: int = config.planning.time_steps_computation
        self._span_s = self._steps * context.time_step_s
        config.sampling.num_sampling_levels = LEVELS
        self._clearance = Clearance(context, self._distance)
        self._core = ReactiveCore(context, config, self._margin, self._clearance)
        self._heading_for = 0.0
        self._prepare(self._idm.driving)

    def plan(self, request: PlanRequest) -> Plan:
        """
        Plan over the horizon.

        :raises PlanningError: if no sample is feasible and free of collisions.
        """
        position = self._idm.follow(request)
        if self._idm.driving is not self._driving:
            self._prepare(self._idm.driving)
        self._core.start(request, self._driving, position)
        aims = []
        for aim in self._aims(request, position):
            aims.append(aim)
            states = self._comfortable(aim, position, request.ego.speed)
            if states is not None:
                self._heading_for = aim.offset
                return Plan(request.stamp_ns, states)
        states = self._evading(request, aims, position)
        if states is None:
            raise PlanningError('no sample is feasible and free of collisions')
        return Plan(request.stamp_ns, states)

    def _prepare(self, driving: DrivingPath) -> None:
        """Prepare for a new path."""
        self._driving = driving
        vehicle = self._context.vehicle
        self._lane = road_bounds(driving, vehicle, 'lane')
        self._lanes = road_bounds(driving, vehicle, 'lanes')
        self._carriageway = road_bounds(driving, vehicle, 'carriageway')

    def _aims(self, request: PlanRequest, position: PathPosition) -> Iterator[_Aim]:
        """Yield the lanes that may be driven in, the best first."""
        lanes, nearest = self._lanes_ahead(request, position)
        free = float(self._idm.speeds(request, alone=True)[-1])
        own = self._aim(request, position, OWN_LANE, nearest, free)
        if own is not None and own.loss < LEAVING:
            # No other lane can be better, so the others are judged only if this one fails.
            yield own
            own = None
        aims = [own, *(self._aim(request, position, lane, nearest, free) for lane in lanes[1:])]
        yield from sorted(aim for aim in aims if aim is not None)

    def _lanes_ahead(self, request: PlanRequest,
                     position: PathPosition) -> tuple[list[SideLane], SideLane]:
        """Return the own lane and those beside it, ahead, and the nearest of them."""
        ahead = max(SHORTEST_LOOK, max(request.ego.speed, 0.0) * self._span_s)
        lanes = [OWN_LANE, *side_lanes(self._driving, position.s + ahead, self._context.vehicle)]
        return lanes, min(lanes, key=lambda lane: abs(lane.offset - position.d))

    def _aim(self, request: PlanRequest, position: PathPosition, lane: SideLane,
             nearest: SideLane, free: float) -> _Aim | None:
        """Return one lane with its loss and speed; None if there is no gap in it."""
        inside = lane is nearest or abs(lane.offset - position.d) < INSIDE
        if not inside and not self._idm.has_gap(request, lane):
            return None
        # Vehicles passed during the change are no leaders: the samples keep clear of them.
        speeds = self._idm.speeds(request, lane, there=not inside)
        loss = free - float(speeds[-1])
        if lane is not OWN_LANE:
            loss += LEAVING + RIGHT * (lane.offset < 0.0)
        if abs(lane.offset - self._heading_for) > INSIDE:
            loss += TURNING
        limit = self._clearance.speed_limit(self._driving.path, position.s, lane.offset,
                                            request.ego.speed)
        return _Aim(loss, lane.offset, min(self._target(request, speeds), limit))

    def _target(self, request: PlanRequest, speeds: Array) -> float:
        """
        Return the target speed from the model's speeds.

        A profile that has the whole horizon to change its speed begins gently, and only its
        beginning is driven before the next replanning. Therefore the target extrapolates the
        model's first stretch, so that the beginning of the profile brakes as the model does.
        """
        speed = request.ego.speed
        first = float(speeds[min(round(FIRST_S / request.time_step_s), len(speeds) - 1)])
        target = max(0.0, speed + (first - speed) * self._horizon / FIRST_S)
        if first > speed:
            target = float(speeds[-1])
        # At rest, a lower target than this keeps the vehicle standing.
        return 0.0 if speed < REST and target < 5.0 * REST else target

    def _comfortable(self, aim: _Aim, position: PathPosition, speed: float) -> Array | None:
        """Sample trajectories to a lane and its speed."""
        middle, late = self._time(0.6), self._time(1.0)
        slower = max(aim.speed - 2.0, 0.0)
        # A lane change takes the whole horizon, for comfort.
        over = abs(aim.offset - position.d) > INSIDE
        return self._sample(0, aim, {late} if over else {middle, late},
                            {aim.speed, slower, 0.5 * (aim.speed + speed)}, {aim.offset})

    def _evading(self, request: PlanRequest, aims: list[_Aim],
                 position: PathPosition) -> Array | None:
        """Sample the free lanes of the same direction, then a stop, then the carriageway."""
        speed = request.ego.speed
        # Without an aim the ego keeps its offset and stops.
        aim = aims[0] if aims else _Aim(0.0, position.d, 0.0)
        times = {self._time(0.34), self._time(0.6), self._time(1.0)}
        own = {aim.offset for aim in aims}
        states = self._sample(1, aim, times, {aim.speed, 0.5 * aim.speed, 0.0, speed},
                              own | self._open_offsets(request, position))
        if states is None:
            states = self._stopping(aim, position, speed)
        if states is not None:
            return states
        self._core.slices.road_tolerance = TOLERANCE
        low, high = self._within(self._carriageway, position.s, speed)
        return self._sample(2, aim, times, {0.0, 0.5 * speed, speed}, {low, high})

    def _stopping(self, aim: _Aim, position: PathPosition, speed: float) -> Array | None:
        """Sample stops in the lane, up to the hardest."""
        # The package's profiles brake by half harder in their middle than on average, but less so
        # once the vehicle brakes. All times are tried, so that a stop that has begun continues.
        dt_s, brake = self._context.time_step_s, self._context.vehicle.max_acceleration
        first = max(2, math.ceil(abs(speed) / brake / dt_s))
        last = min(self._steps, max(first, round(STOP_SHARE * first)))
        times = {dt_s * count for count in range(first, last + 1)}
        # A vehicle that cannot stop within the horizon brakes for all of it.
        slower = 0.0 if times else speed - brake * self._span_s / PEAK
        self._core.sample_over_way()
        states = self._sample(1, aim, times or {self._time(1.0)}, {slower},
                              {aim.offset, position.d})
        self._core.sample_over_time()
        return states

    def _open_offsets(self, request: PlanRequest, position: PathPosition) -> set[float]:
        """
        Return the outermost offsets among the lanes of the same direction that may be used.

        These are the lane that the ego is in, and lanes without a vehicle beside the ego in which
        the vehicle behind keeps the gap that a lane change requires.
        """
        lanes, nearest = self._lanes_ahead(request, position)
        free = {lane for lane in lanes
                if lane is nearest or self._idm.has_gap(request, lane, ahead_too=False)}
        speed = request.ego.speed
        own, all_lanes = (self._within(bounds, position.s, speed)
                          for bounds in (self._lane, self._lanes))
        right, left = (any(lane.offset * side > 0.0 for lane in free) for side in (-1.0, 1.0))
        offsets = {nearest.offset}
        offsets |= set(own) if OWN_LANE in free else set()
        offsets |= {all_lanes[0]} if right else set()
        offsets |= {all_lanes[1]} if left else set()
        return offsets

    def _sample(self, level: int, aim: _Aim, times: set[float], speeds: set[float],
                offsets: set[float]) -> Array | None:
        planner = self._core.planner
        # With the current speed given, the package would use the goal's speed instead of 0 m/s.
        planner.set_desired_velocity(aim.speed)
        planner.cost_function.desired_d = aim.offset
        space = planner.sampling_space
        # The package adds the present offset to each set.
        for name, values in (('t', times), ('v', speeds), ('d', offsets)):
            setattr(space, f'samples_{name}', _Samples(*[values] * LEVELS))
        return self._core.plan(level)

    def _time(self, share: float) -> float:
        """Round a share of the horizon to the time grid, at least two steps [s]."""
        dt_s = self._context.time_step_s
        return max(2, round(share * self._span_s / dt_s)) * dt_s

    def _within(self, bounds: Array, s: float, speed: float) -> tuple[float, float]:
        """Return the offsets that stay within bounds as far as the vehicle can get."""
        first = int(s / self._driving.path.step)
        last = first + int((speed + 5.0) * self._horizon / self._driving.path.step) + 1
        return float(bounds[first:last, 0].max()), float(bounds[first:last, 1].min())
