# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An autonomous vehicle between its planner's answers (CRG III-A1d, III-B; algorithm 2)."""

from collections import OrderedDict
from dataclasses import dataclass
import math
from math import cos, sin

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.control.progress_tracker import ProgressTracker
from crgame_ros.control.tracked_execution import TrackedExecution
from crgame_ros.control.tracker import Reference
from crgame_ros.errors import InputError
from crgame_ros.game.game import TimingSpec
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.geometry.curve import Curve
from crgame_ros.geometry.rigid_transform import Pose, RigidTransform
from crgame_ros.messages.joints import JointSeries, plan_from_joints
from crgame_ros.messages.plan import Plan
from crgame_ros.planner.plan_check import check_plan, RoadLimit
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.route import find_route, goal_lanelets, start_lanelet
from crgame_ros.simulation.setup import AvSetup
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.human_vehicle import HumanVehicle
from crgame_ros.vehicle.state import VehicleState
from crgame_ros.vehicle.stopping import (
    braking_acceleration,
    firm_braking,
    moving_time,
    step_to_rest,
)
import numpy as np
from numpy.typing import NDArray
import shapely

# How far the route goes on beyond its goal [m]: longer than any game.
BEYOND_GOAL = 1500.0


class RouteLane:
    """
    The centre lines of the route's lanelets, one for each stretch without a lane change.

    The lane is the map's: unlike a plan it doesn't follow a vehicle that drifts off.

    :param roads: roads with one lanelet at least.
    :param problem: its goal decides on the route.
    :param start: where the vehicle begins, rear axle, simulation coordinates.
    :param transform: from these to those of the roads as its planner knows them.
    """

    def __init__(self, roads: RoadNetwork, problem: PlanningProblem, start: VehicleState,
                 transform: RigidTransform) -> None:
        self._transform = transform
        lanelet, s = start_lanelet(roads, *self._on_map(start))
        route = find_route(roads, lanelet, s, goal_lanelets(roads, problem), BEYOND_GOAL)
        self._lines = [
            Curve.from_polyline(np.concatenate([roads.line(item).points for item in leg]))
            for leg in route.legs]
        # The fastest way to find the nearest point of a long line.
        self._strings = [shapely.LineString(line.points) for line in self._lines]
        self.error: float | None = None
        self.worst = 0.0

    def measure(self, state: VehicleState) -> None:
        """Find the rear axle's offset from the nearest of the centre lines, left positive [m]."""
        own_x, own_y, _ = self._on_map(state)
        here = shapely.Point(own_x, own_y)
        line, string = min(zip(self._lines, self._strings, strict=True),
                           key=lambda pair: here.distance(pair[1]))
        x, y, yaw, _ = line.pose_at(np.array(string.project(here))).tolist()
        self.error = (own_y - y) * cos(yaw) - (own_x - x) * sin(yaw)
        self.worst = max(self.worst, abs(self.error))

    def _on_map(self, state: VehicleState) -> Pose:
        if self._transform.is_identity:
            return state[:3]
        x, y, yaw = self._transform.to_scenario(np.array(state[:3])).tolist()
        return x, y, yaw


# A planner that has not answered for this long is asked again [s] (see the busy flag).
BUSY_TIMEOUT_S = 1.0
# After the driver hands the vehicle back, it rolls on for at most this long without a plan [s].
GIVE_BACK_TIMEOUT_S = 1.0
# Number of requests remembered, so that an overdue plan can still be checked and used.
REMEMBERED_REQUESTS = 64


@dataclass
class AvCounters:
    """Counters of an AV's requests and plans."""

    requests: int = 0
    skipped: int = 0
    timed_out: int = 0
    accepted: int = 0
    refused: int = 0
    of_others: int = 0
    realigned: int = 0
    steps_without_plan: int = 0
    last_refusal: str = ''
    last_latency_steps: int = 0


# Its counts, as a status and `timing.json` tell them.
PLAN_COUNTS = ('requests', 'accepted', 'refused', 'of_others', 'skipped', 'timed_out', 'realigned',
               'steps_without_plan')


@dataclass
class _Asked:
    """The true state of an AV at a request, and the state told to its planner; None: not known."""

    true: VehicleState
    told: VehicleState | None


class AutonomousVehicle:
    """
    Follows the latest accepted plan; owns the busy flag of algorithm 2.

    :param execution: tracks the plan on a vehicle model (FS II-C); None follows it exactly (CRG).
    :param road_limit: refuses plans that leave the road; None if their planner's adapter does.
    """

    def __init__(self, setup: AvSetup, scheduler: ScenarioScheduler, timing: TimingSpec,
                 execution: TrackedExecution | None = None,
                 road_limit: RoadLimit | None = None) -> None:
        self.setup = setup
        self._road_limit = road_limit
        self.state = setup.state
        self.counters = AvCounters()
        self.plan: Plan | None = None
        self._scheduler = scheduler
        self._tracker = ProgressTracker(scheduler.steps_per_tick, scheduler.time_step_s,
                                        setup.vehicle, timing.realign, timing.sample)
        self._asked: OrderedDict[int, _Asked] = OrderedDict()
        self._early: JointSeries | None = None
        self.execution = execution
        self._reference: Reference | None = None
        # The lane that a tracked AV should follow by the map, independent of its plans.
        self.route_lane: RouteLane | None = None
        # The estimated state of a tracked AV, if its tracker steers by it.
        self.believed: VehicleState | None = None
        self._busy_since: int | None = None
        self._followed_request_n = -1
        # Whether the vehicle brakes because its plan is used up or never came.
        self.uses_no_plan = False
        # A stopped planner gets no requests; the vehicle follows its last plan, then brakes.
        self.planner_running = True
        self._driven: HumanVehicle | None = None
        self._given_back_n: int | None = None
        # With which it moved in the last step, signed along its heading [m/s^2].
        self._acceleration = 0.0

    @property
    def driven(self) -> bool:
        """Return whether a person has taken the vehicle over."""
        return self._driven is not None

    @property
    def busy(self) -> bool:
        """Return whether a request has not been answered yet."""
        return self._busy_since is not None

    def plan_age_steps(self, n: int) -> int | None:
        """Return the steps since the request of the followed plan; None without a plan."""
        return None if self._followed_request_n < 0 else n - self._followed_request_n

    def wants_request(self, n: int) -> bool:
        """Return whether to send the planner a request at this tick (algorithm 2, line 6)."""
        if not self.planner_running:
            return False
        if self._busy_since is not None:
            if (n - self._busy_since) * self._scheduler.dt_s < BUSY_TIMEOUT_S:
                self.counters.skipped += 1
                return False
            self.counters.timed_out += 1
        return True

    def request_sent(self, n: int, stamp_ns: int, ego: VehicleState) -> None:
        """Store the request that was sent to the planner (algorithm 2, line 8)."""
        self._busy_since = n
        self._asked[stamp_ns] = _Asked(ego, None if self.setup.spec.perception else ego)
        if len(self._asked) > REMEMBERED_REQUESTS:
            self._asked.popitem(last=False)
        self.counters.requests += 1

    def request_perceived(self, stamp_ns: int, ego: VehicleState, n: int) -> str | None:
        """
        Store the AV's pose in the perceived request that its planner receives.

        :param ego: of the perceived request, in the AV's scenario coordinates.
        :param n: step from which a plan is followed that arrived before this request.
        :return: the reason for refusing such a plan, else None.
        """
        asked = self._asked.get(stamp_ns)
        if asked is not None:
            asked.told = ego
        early, self._early = self._early, None
        if early is None:
            return None
        if early.stamp_ns < stamp_ns:
            # Its perceived request never arrived, as while a restarted perception is still
            # being discovered. So it is unknown which pose the planner used.
            self._answered(self._scheduler.tick_of_stamp(early.stamp_ns))
            return None
        return self.offer(early, n)

    def offer(self, series: JointSeries, n: int) -> str | None:
        """
        Accept or refuse a planner's answer, to be followed from step n (algorithm 2, lines 2-3).

        :return: None if accepted, else the reason for refusing it; the last plan then stays.
        """
        reason = self._refusal(series, n)
        if reason is not None:
            self._count_refusal(reason)
        return reason

    def refuse_unasked(self, stamp_ns: int) -> str | None:
        """
        Count an answer that belongs to no request, from whichever sender.

        :return: the reason for refusing it; None if a request has that stamp.
        """
        if stamp_ns in self._asked:
            return None
        reason = _answers_nothing(stamp_ns)
        self._count_refusal(reason)
        return reason

    def refuse_malformed(self, reason: str) -> None:
        """Count an answer that could not be read; the planner may be asked again."""
        self._busy_since = None
        self._count_refusal(reason)

    def _count_refusal(self, reason: str) -> None:
        self.counters.refused += 1
        self.counters.last_refusal = reason

    def _refusal(self, series: JointSeries, n: int) -> str | None:
        asked = self._asked.get(series.stamp_ns)
        request_n = self._scheduler.tick_of_stamp(series.stamp_ns)
        if asked is None or request_n is None:
            return _answers_nothing(series.stamp_ns)
        if request_n == self._followed_request_n:
            # A second answer to the same request brings nothing new.
            return None
        if request_n < self._followed_request_n:
            return f'stamp {series.stamp_ns} ns is older than the followed plan'
        if asked.told is None:
            # The engine has not received the perceived request yet; the planner has.
            self._early = series
            return None
        self._answered(request_n)
        try:
            plan = plan_from_joints(series, self.setup.id, self._scheduler.time_step_ns)
        except InputError as error:
            return str(error)
        reason = check_plan(plan, asked.told, series.stamp_ns, self.setup.vehicle,
                            self._scheduler.time_step_s)
        if reason is None and self._road_limit is not None:
            reason = self._road_limit.refusal(plan.states)
        if reason is not None:
            return reason
        states = self._in_simulation(plan.states, asked.true, asked.told)
        if self.execution is not None:
            realigned = self._tracker.align(states, request_n, n, self.state)
            self._reference = Reference(states, self._scheduler.time_step_s)
        else:
            try:
                realigned = self._tracker.adopt(
                    states, request_n, n, self.state, self._acceleration)
            except InputError as error:
                return str(error)
        self.counters.realigned += realigned
        self.plan = plan
        self._followed_request_n = request_n
        self.counters.accepted += 1
        self.counters.last_latency_steps = n - request_n
        return None

    def _answered(self, request_n: int | None) -> None:
        if self._busy_since == request_n:
            self._busy_since = None

    def _in_simulation(self, states: NDArray[np.float64], true: VehicleState,
                       told: VehicleState) -> NDArray[np.float64]:
        """
        Return the planned states shifted to where the vehicle drives them.

        A plan that starts at a wrong estimate of the AV's pose is driven from the true pose,
        unless a tracker steers by the same estimate.
        """
        moved = told[:3] != true[:3] and not self.setup.spec.localisation_steers
        if self.setup.transform.is_identity and not moved:
            return states
        mapped = states.copy()
        if moved:
            mapped[:, :3] = RigidTransform.between(told[:3], true[:3]).to_scenario(mapped[:, :3])
        mapped[:, :3] = self.setup.transform.to_simulation(mapped[:, :3])
        return mapped

    def planned_state(self, n: int) -> VehicleState | None:
        """
        Return the followed plan's state at step n; None beyond its end or without one.

        No plan is followed while a person drives, and until there is one requested after that.
        """
        if self._driven is not None or self._given_back_n is not None:
            return None
        return self._tracker.sample(n)

    def drive(self, command: DriverCommand, dt_s: float) -> VehicleState:
        """
        Move one step by the command of a driver who has taken over the vehicle.

        The planner keeps planning from the vehicle's present state, so that a plan is ready when
        the driver hands the vehicle back.

        :param command: the normalised command, within its ranges
        :param dt_s: Delta t_eff [s]
        """
        if self._driven is None:
            self._driven = HumanVehicle(self.setup.vehicle, self.state)
        if self.execution is not None:
            self.execution.reset(self.state)
        self._given_back_n = None
        self.uses_no_plan = False
        self.state = self._driven.step(command, dt_s)
        return self.state

    def stand(self, state: VehicleState) -> None:
        """Set the state of a vehicle that was stopped, without speed, while a driver had it."""
        if self._driven is not None:
            self._driven.stand(state)
            self.state = state

    def advance(self, n: int) -> VehicleState:
        """
        Move to step n along the plan (algorithm 1, line 13), or brake once the plan is used up.

        After the driver hands the vehicle back, it keeps speed and steering until the first plan
        requested since then: an older plan starts elsewhere.
        """
        before = self.state.speed
        self.state = self._moved(n)
        self._acceleration = (self.state.speed - before) / self._scheduler.dt_s
        return self.state

    def _moved(self, n: int) -> VehicleState:
        if self._driven is not None:
            self._driven, self._given_back_n = None, n - 1
        if self._given_back_n is not None and self._followed_request_n >= self._given_back_n:
            self._given_back_n = None
        rolls = self._rolls_on(n)
        if self.execution is not None and not rolls:
            return self._tracked(self.execution, n)
        planned = None if self._given_back_n is not None else self._tracker.sample(n)
        self.uses_no_plan = planned is None and not rolls
        if rolls:
            return self._held(0.0)
        if planned is None:
            self.counters.steps_without_plan += 1
            return self._braking()
        return planned

    def _tracked(self, execution: TrackedExecution, n: int) -> VehicleState:
        """Move one step by the tracking controller."""
        reference = None
        if self._given_back_n is None and self._reference is not None:
            reference = self._reference.at(self._tracker.time_s(n - 1))
        self.uses_no_plan = reference is None or reference.used_up
        self.counters.steps_without_plan += self.uses_no_plan
        return execution.step(self.state, reference, self.believed)

    def _rolls_on(self, n: int) -> bool:
        return self._given_back_n is not None \
            and (n - self._given_back_n) * self._scheduler.dt_s <= GIVE_BACK_TIMEOUT_S

    def _held(self, acceleration: float) -> VehicleState:
        """Move one step at a fixed steering angle and an acceleration [m/s^2], or to a stop."""
        state, wheelbase, dt_s = self.state, self.setup.vehicle.wheelbase, self._scheduler.dt_s
        x, y, yaw, speed, angle = step_to_rest(
            *state[:5], acceleration, 0.0, wheelbase,
            moving_time(state.speed, acceleration, dt_s), dt_s)
        return VehicleState(x, y, wrap_pi(yaw), speed, angle, acceleration,
                            speed * math.tan(angle) / wheelbase, 0.0)

    def _braking(self) -> VehicleState:
        state = self.state
        if state.speed == 0.0:
            return state._replace(acceleration=0.0, yaw_rate=0.0, steering_rate=0.0)
        return self._held(braking_acceleration(state.speed, firm_braking(self.setup.vehicle)))


def _answers_nothing(stamp_ns: int) -> str:
    return f'stamp {stamp_ns} ns answers no request'
