# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The default planner: the Intelligent Driver Model on the reference path."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import ClassVar, NamedTuple

from commonroad.scenario.scenario import Scenario
from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.planner.path_following import covering_steps, Longitudinal, PathPosition
from crgame_ros.planner.path_obstacles import Corridor, ObstacleProjector, PathObstacles
from crgame_ros.planner.path_planner import check_positive, PathPlanner
from crgame_ros.planner.reference_path import (
    admissible_speeds,
    default_speed,
    desired_speeds,
    DrivingPath,
)
from crgame_ros.planner.side_lanes import has_gap, LaneChange, OWN_LANE, SideLane, Verdict
from crgame_ros.roads.signs import (
    has_stop_sign,
    lights_for,
    lights_of,
    RED_STATES,
    SIGN_REACH,
    stop_line_middle,
    TrafficLights,
)
from crgame_ros.vehicle.idm_model import free_acceleration, IdmParameters, interaction
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import STANDING, StateColumn, VehicleState
import numpy as np
from numpy.typing import NDArray

TURN = 0.45
Array = NDArray[np.float64]
LINE_GAP = 0.5
# A standing vehicle starts when the model wants at least this share of a; it stops below it.
START_SHARE = 0.2
# For an obstacle that may still come into the way the ego brakes no harder than this [m/s^2],
# unless more is needed to stop before it: by this share more, with this reserve [m].
ANTICIPATION_LIMIT = 3.0
NEED_SHARE = 1.15
NEED_RESERVE = 1.0
# Share of the desired speed at which the ego lets others pass while it waits for a gap beside it.
YIELDING = 0.8
PASSING_MARGIN_S = 0.5
PASSING_MARGIN = 2.0
# A faster vehicle that comes into the way from beside is let in with this gap [m], if no more than
# this braking is needed [m/s^2].
LET_IN_GAP = 1.0
LET_IN_LIMIT = 3.0


@dataclass(frozen=True)
class StopLine:
    """
    A line across the path.

    :param s: arc length of the line on the path [m]
    :param lights: ids of the traffic lights that govern it.
    :param sign: True if a stop sign stands there.
    """

    s: float
    lights: tuple[int, ...]
    sign: bool


class StopLines:
    """
    The stop lines along a path.

    :param scenario: the scenario with its traffic lights and signs.
    :param driving: the path and its lanelets.
    :param max_deceleration: hardest braking for a red light [m/s^2]
    :param deceleration: hardest braking for a yellow light [m/s^2]
    """

    def __init__(self, scenario: Scenario, driving: DrivingPath, max_deceleration: float,
                 deceleration: float) -> None:
        self.lines = _find(scenario, driving)
        self._lights = TrafficLights(scenario)
        self._max_deceleration = max_deceleration
        self._deceleration = deceleration
        self._obeyed: set[float] = set()

    def halt_before(self, k: int, front: float, speed: float) -> float | None:
        """
        Find the nearest line to halt at.

        The vehicle halts at red and red-yellow if the hardest braking suffices, at yellow if
        comfortable braking suffices, and at a stop sign until it has stood there once.

        :param k: scenario time step of the light states.
        :param front: arc length of the vehicle's front [m]
        :param speed: [m/s]
        :return: arc length of the line [m], or None
        """
        if not self.lines:
            return None
        states = self._lights.states_at(k)
        for line in self.lines:
            distance = line.s - front
            if distance < -0.3:
                continue
            needed = speed ** 2 / (2.0 * max(distance, 0.1))
            shown = {states.get(light, 'inactive') for light in line.lights}
            if shown & RED_STATES and needed <= self._max_deceleration:
                return line.s
            if 'yellow' in shown and needed <= self._deceleration:
                return line.s
            if line.sign and line.s not in self._obeyed:
                if speed < STANDING and distance < SIGN_REACH:
                    self._obeyed.add(line.s)
                elif needed <= self._max_deceleration:
                    return line.s
        return None


def _find(scenario: Scenario, driving: DrivingPath) -> tuple[StopLine, ...]:
    network = scenario.lanelet_network
    found = []
    for index, (lanelet_id, (first, last)) in enumerate(
            zip(driving.lanelets, driving.lanelet_spans, strict=True)):
        lanelet = network.find_lanelet_by_id(lanelet_id)
        middle = stop_line_middle(lanelet)
        s = float(last) if middle is None else float(
            driving.path.project(middle[None], first - 5.0, last + 5.0)[0][0])
        lights = lights_for(lights_of(lanelet, network), _turn(driving, index))
        sign = has_stop_sign(lanelet, network)
        if lights or sign:
            found.append(StopLine(s, tuple(light.traffic_light_id for light in lights), sign))
    return tuple(sorted(found, key=lambda line: line.s))


def _turn(driving: DrivingPath, index: int) -> str:
    """Return the turn of the route behind a lanelet: left, right or straight."""
    if index + 1 >= len(driving.lanelets):
        return 'straight'
    start, end = driving.path.pose_at(driving.lanelet_spans[index + 1])[:, 2]
    return 'left' if end - start > TURN else 'right' if end - start < -TURN else 'straight'


class Leader(NamedTuple):
    """
    One obstacle on the path over the steps of a plan.

    :param rear: arc length of its rear at each step [m]
    :param center: of its centre [m]
    :param speed: along the path [m/s]
    :param blocking: whether it is in the corridor.
    :param coming: whether it is there now or later.
    :param let_in: acceleration that lets it in ahead, infinity where not needed [m/s^2]
    """

    rear: Sequence[float]
    center: Sequence[float]
    speed: Sequence[float]
    blocking: Sequence[bool]
    coming: Sequence[bool]
    let_in: Sequence[float]


class IdmPlanner(PathPlanner):
    """
    The Intelligent Driver Model on the reference path (Treiber, CRG reference 10).

    At each step of the horizon a = a0 (1 - (v / v0)^4 - (s* / s)^2) with the nearest obstacle
    that the request predicts to be in the corridor then. Red lights, stop signs and the end of
    the road count as standing obstacles. Curves and speed limits bound the speed. Where the route
    changes lanes the planner does so into a gap; without one it keeps its lane, if necessary to
    the lane's end.

    :param v0: desired speed; None takes speed limits, goal and initial speed [m/s]
    :param time_headway: desired time headway T [s]
    :param s0: gap at standstill [m]
    :param a: maximum acceleration [m/s^2]
    :param b: comfortable deceleration [m/s^2]
    :param b_max: hardest deceleration [m/s^2]
    :param horizon: length of a plan [s]
    :param lateral_acceleration: comfortable in curves [m/s^2]
    :param lateral_margin: distance to the side below which an obstacle is in the way [m]
    """

    name: ClassVar[str] = 'idm'

    def __init__(self, v0: float | None = None, time_headway: float = 1.5, s0: float = 2.0,
                 a: float = 1.5, b: float = 2.0, b_max: float = 8.0, horizon: float = 3.0,
                 lateral_acceleration: float = 2.5, lateral_margin: float = 0.3) -> None:
        check_positive(self.name, v0=v0, time_headway=time_headway, s0=s0, a=a, b=b, b_max=b_max,
                       horizon=horizon, lateral_acceleration=lateral_acceleration,
                       lateral_margin=lateral_margin)
        self._model = IdmParameters(time_headway, s0, a, b, b_max)
        self._v0 = v0
        self._horizon = horizon
        self._lateral_acceleration = lateral_acceleration
        self._lateral_margin = lateral_margin

    def prepare(self, driving: DrivingPath, vehicle: VehicleParameters) -> None:
        """Compute the speeds along a new path and find its stop lines."""
        context = self._context
        desired = desired_speeds(driving, self._v0, default_speed(context.planning_problem))
        if self._change is not None and driving is self._change.kept:
            desired = YIELDING * desired
        self._desired: list[float] = np.minimum(desired, vehicle.max_speed).tolist()
        self._admissible: list[float] = admissible_speeds(
            driving, desired, vehicle, self._lateral_acceleration, self._model.b).tolist()
        # No planner brakes harder than the road allows.
        self._hardest = min(self._model.b_max, vehicle.max_acceleration)
        self._stop_lines = StopLines(context.scenario, driving, self._hardest,
                                     self._model.b + 1.0)
        self._front = vehicle.front

    def setup(self, context: PlannerContext) -> None:
        """Plan the path from the planning problem's initial state."""
        self._projector = ObstacleProjector(context.objects)
        self._change: LaneChange | None = None
        super().setup(context)

    def follow(self, request: PlanRequest) -> PathPosition:
        """
        Find the ego on its path, and postpone the route's next lane change until there is a gap.

        :raises PlanningError: if there is no road to follow.
        """
        position = self.locate(request)
        change = self._change
        if change is None:
            return position
        verdict = change.judge(request)
        keeping = self._driving is change.kept
        if verdict is Verdict.BLOCKED and not keeping:
            self._set_path(change.kept, request.ego)
        elif verdict is Verdict.DONE and not keeping and self._driving.changes < 2:
            self._change = None
        elif verdict is Verdict.DONE or (keeping and verdict is Verdict.FREE):
            # Plan a path from here into the gap, or on to the next change.
            self._plan_path(request.ego)
        return self.locate(request)

    def _plan_path(self, start: VehicleState) -> None:
        super()._plan_path(start)
        self._change = None if self._driving.change_to is None else LaneChange(
            self._context, self._driving, start, self._projector)

    def plan(self, request: PlanRequest) -> Plan:
        """Plan over the horizon; see the class."""
        position = self.follow(request)
        steps = covering_steps(self._horizon, request.time_step_s)
        obstacles = self._obstacles(request, position, steps)
        leaders = _leaders(obstacles, request, position.s, self._context.vehicle)
        states = self.follower.drive(
            request.ego, position, steps, request.time_step_s,
            self._longitudinal(request, position, leaders))
        return self.answer(request, states)

    def speeds(self, request: PlanRequest, lane: SideLane = OWN_LANE, there: bool = False,
               alone: bool = False) -> Array:
        """
        Return the model's speeds over the horizon, for planners that need a target.

        :param lane: lane in which the ego drives.
        :param there: compute as if the ego were in that lane already.
        :param alone: compute as if there were no obstacles.
        :return: (S) [m/s]
        """
        position = self.locate(request)
        steps = covering_steps(self._horizon, request.time_step_s)
        leaders: list[Leader] = []
        if not alone:
            place = position._replace(d=lane.offset) if there else position
            obstacles = self._obstacles(request, place, steps, lane.offset)
            leaders = _leaders(obstacles, request, position.s, self._context.vehicle)
        states = self.follower.drive(
            request.ego, position, steps, request.time_step_s,
            self._longitudinal(request, position, leaders, lane.end_s))
        return states[:, StateColumn.SPEED]

    def has_gap(self, request: PlanRequest, lane: SideLane, ahead_too: bool = True) -> bool:
        """
        Return whether the ego may change into a lane beside the path.

        :param ahead_too: False to check only vehicles beside and behind.
        """
        return has_gap(self._projector, self._driving.path, request, self.locate(request).s,
                       lane.offset, self._context.vehicle, ahead_too)

    def _obstacles(self, request: PlanRequest, position: PathPosition, steps: int,
                   offset: float = 0.0) -> PathObstacles:
        speed = max(request.ego.speed, 0.0)
        model = self._model
        aside = position._replace(d=position.d - offset)
        corridor = Corridor(
            position.s, position.d, self.follower.correction_length(aside, speed),
            40.0 + speed * (model.time_headway + self._horizon) + speed ** 2 / (2.0 * model.b),
            0.5 * self._context.vehicle.width + self._lateral_margin, self._front, offset)
        return self._projector.project(self._driving.path, corridor, request, steps + 1)

    def _longitudinal(self, request: PlanRequest, position: PathPosition, leaders: list[Leader],
                      end_s: float = math.inf) -> Longitudinal:
        model, dt_s, hardest = self._model, request.time_step_s, self._hardest
        front, middle = self._front, self._context.vehicle.rear_to_center
        halts = [min(self._driving.end_s, end_s)]
        line = self._stop_lines.halt_before(
            request.k, position.s + front, max(request.ego.speed, 0.0))
        if line is not None:
            halts.append(line)
        # The gap at a standing obstacle is s0, at a line LINE_GAP.
        halt = min(halts) + model.s0 - LINE_GAP
        follower = [False] * len(leaders)
        desired, admissible, step = self._desired, self._admissible, self._driving.path.step
        last = len(desired) - 1

        def acceleration(i: int, s: float, speed: float) -> float:
            if speed < 0.0:
                return min(model.b, -speed / dt_s)
            here = int(s / step)
            here = 0 if here < 0 else last if here > last else here
            free = free_acceleration(speed, desired[here], model)
            wanted = free + interaction(speed, halt - s - front, 0.0, model)
            for number, leader in enumerate(leaders):
                let_in = leader.let_in[i]
                wanted = let_in if let_in < wanted else wanted
                behind = leader.center[i] <= s + middle
                # A vehicle predicted to drive through the ego from behind is no leader.
                follower[number] = leader.blocking[i] and (behind or follower[number])
                if behind or follower[number]:
                    continue
                gap = leader.rear[i] - s - front
                if leader.blocking[i]:
                    wanted = min(wanted, free + interaction(speed, gap, leader.speed[i], model))
                elif leader.coming[i]:
                    limit = max(ANTICIPATION_LIMIT, _needed(speed, gap, leader.speed[i]))
                    wanted = min(wanted, max(-limit, free + interaction(
                        speed, gap, leader.speed[i], model)))
            ahead = int((s + speed * dt_s) / step)
            ahead = 0 if ahead < 0 else last if ahead > last else ahead
            bound = (admissible[ahead] - speed) / dt_s
            wanted = min(wanted, max(bound, -2.0 * model.b))
            if speed < STANDING and wanted < START_SHARE * model.a:
                return -speed / dt_s
            return max(wanted, -hardest)

        return acceleration


def _needed(speed: float, gap: float, other: float) -> float:
    """
    Return the deceleration to the speed of another vehicle within a gap [m/s^2].

    For a vehicle that comes nearer (v' < 0) it is that to a stop, v^2 / 2 a - v' v / a = s.
    """
    closing = max(speed - max(other, 0.0), 0.0)
    way = closing * (0.5 * closing + max(-other, 0.0))
    return NEED_SHARE * way / max(gap - NEED_RESERVE, 0.1)


def _leaders(obstacles: PathObstacles, request: PlanRequest, s: float,
             vehicle: VehicleParameters) -> list[Leader]:
    """List the obstacles in the way, and those that come into it before the ego has passed."""
    result = []
    speed = max(request.ego.speed, 0.0)
    ego_rear = s + vehicle.rear_to_center - 0.5 * vehicle.length
    ego_front = ego_rear + vehicle.length
    for column in range(len(obstacles.ids)):
        blocking = obstacles.blocking[:, column]
        let_in = np.full(len(blocking), math.inf)
        coming = np.logical_or.accumulate(blocking[::-1])[::-1]
        rear = obstacles.rear[:, column]
        # Nobody is there before it appears.
        coming &= np.isfinite(rear)
        if not blocking[0]:
            steps = np.flatnonzero(blocking)
            first, last = steps[0], steps[-1]
            entry_s = request.time_step_s * first
            passed = ego_rear + speed * entry_s > obstacles.front[first, column] + PASSING_MARGIN
            leaves = last < len(blocking) - 1 and speed > 0.0
            arrival_s = (rear[last] - ego_front) / speed if leaves else 0.0
            gone = leaves and arrival_s > request.time_step_s * last + PASSING_MARGIN_S
            if passed or gone:
                coming = np.zeros_like(coming)
            if not passed and obstacles.speed[first, column] >= speed:
                let_in[:first] = _courtesy_acceleration(
                    entry_s, ego_front + speed * entry_s - float(rear[first]), speed)
        result.append(Leader(rear.tolist(), obstacles.center[:, column].tolist(),
                             obstacles.speed[:, column].tolist(), blocking.tolist(),
                             coming.tolist(), let_in.tolist()))
    return result


def _courtesy_acceleration(entry_s: float, overlap: float, speed: float) -> float:
    """
    Return the acceleration that lets a faster vehicle in ahead; infinity if it is too hard.

    Hard braking does not help a vehicle that is beside already, so the ego holds lane and speed.

    :param entry_s: time until it is in the way [s]
    :param overlap: by how much its rear would then be behind the ego's front [m]
    :param speed: of the ego [m/s]
    """
    wanted = -2.0 * (overlap + LET_IN_GAP) / entry_s ** 2
    return wanted if wanted >= -LET_IN_LIMIT and speed + wanted * entry_s > 0.0 else math.inf
