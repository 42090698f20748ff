# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""nuPlan's closed-loop score of one drive: four multipliers times a weighted mean of four."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

from commonroad.common.common_lanelet import RoadUser
from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.analysis.scores.collisions_by_kind import (
    AHEAD,
    angle_to,
    BEHIND,
    find_collisions,
    first_contact,
    JudgedCollision,
)
from crgame_ros.analysis.scores.route_progress import (
    ComparedRoute,
    find_lanes,
    LanesDriven,
    progress_ratio,
    route_of,
)
from crgame_ros.analysis.scores.scored_drive import ScoredDrive, Track, TrackKind
from crgame_ros.errors import InputError
from crgame_ros.filters import smoothed
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.roads.boundary import RoadBoundary
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.route import find_route, goal_lanelets, start_lanelet
from crgame_ros.scenario.exact_values import exact_position
from crgame_ros.scenario.loading import LoadedScenario
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Horizon and sampling of the time to collision [s].
HORIZON_S, STRIDE_S = 3.0, 0.1
# A slower vehicle has no time to collision [m/s] (nuplan-devkit,
# time_to_collision_within_bound.py).
STANDS = 0.005
# nuPlan smooths over windows of samples of 0.1 s: a short one for accelerations and yaw, a long
# one for jerks.
_SAMPLE_S, _SHORT, _LONG = 0.1, 5, 15
# Jerk needs at least so many steps.
LEAST_STEPS = 5
# A mean excess over the limit of this gives a score of 0 [m/s] (nuplan-devkit,
# speed_limit_compliance.py).
TOO_FAST = 2.23
# Within the window [s], driving against the lane for less than the first distance is no violation,
# for less than the second it halves the score [m] (nuplan-devkit,
# driving_direction_compliance.py).
WINDOW_S, TOLERATED, VIOLATED = 1.0, 2.0, 6.0
_CARS = frozenset({RoadUser.VEHICLE, RoadUser.CAR})


def times_to_contact(drive: ScoredDrive, lanes: LanesDriven,
                     collisions: Sequence[JudgedCollision]) -> FloatArray:
    """
    Return the time to collision of each step (K), inf where none is within the horizon [s].

    Others ahead count; others beside count while the vehicle is between lanes or in an
    intersection. One that was touched does not count from that step on. The time is 0 at the step
    of a collision at fault.
    """
    times = np.full(len(drive.poses), np.inf)
    beside = lanes.in_intersection | ~lanes.in_one_lane
    touched = {each.other_id: each.step for each in collisions}
    moving = np.abs(drive.speeds) > STANDS
    for track in drive.tracks:
        angle = angle_to(drive.rear_axles, track.poses[:, :2])
        counts = (angle < AHEAD) | beside & (angle <= BEHIND)
        counts[touched.get(track.id, len(counts)):] = False
        reach = drive.shape.radius + track.shape.radius \
            + HORIZON_S * (np.abs(drive.speeds) + track.speeds)
        apart = np.hypot(*(track.poses[:, :2] - drive.poses[:, :2]).T)
        for step in np.flatnonzero(counts & moving & (apart <= reach)).tolist():
            times[step] = min(times[step], _time(drive, track, step))
    for each in collisions:
        if each.at_fault:
            times[each.step] = 0.0
    return times


def _time(drive: ScoredDrive, track: Track, step: int) -> float:
    """Return the time of the first sample at which two footprints touch, at constant velocity."""
    ahead_s = STRIDE_S * np.arange(1.0, round(HORIZON_S / STRIDE_S))
    hit = first_contact(drive.shape, shifted(drive.poses[step], drive.speeds[step] * ahead_s),
                        track.shape, shifted(track.poses[step], track.speeds[step] * ahead_s))
    return np.inf if hit is None else float(ahead_s[hit])


class Bound(NamedTuple):
    """The comfortable range of a quantity, and its unit."""

    lowest: float
    highest: float
    unit: str


# nuplan-devkit, docs/metrics_description.md, "Comfort".
BOUNDS = {
    'longitudinal_acceleration': Bound(-4.05, 2.40, 'm/s^2'),
    'lateral_acceleration': Bound(-4.89, 4.89, 'm/s^2'),
    'jerk': Bound(-8.37, 8.37, 'm/s^3'),
    'longitudinal_jerk': Bound(-4.13, 4.13, 'm/s^3'),
    'yaw_rate': Bound(-0.95, 0.95, 'rad/s'),
    'yaw_acceleration': Bound(-1.93, 1.93, 'rad/s^2'),
}


class DriveComfort(NamedTuple):
    """The extremes of a drive, by the names of `BOUNDS`."""

    lowest: dict[str, float]
    highest: dict[str, float]

    @property
    def exceeded(self) -> tuple[str, ...]:
        """Return the names of quantities beyond their bounds."""
        return tuple(name for name, bound in BOUNDS.items()
                     if self.lowest[name] < bound.lowest or self.highest[name] > bound.highest)

    def as_dict(self) -> dict[str, object]:
        """Return the fields as a JSON-compatible dictionary."""
        return {name: {'lowest': self.lowest[name], 'highest': self.highest[name],
                       'unit': bound.unit, 'comfortable': name not in self.exceeded}
                for name, bound in BOUNDS.items()}


def measure_comfort(drive: ScoredDrive) -> DriveComfort | None:
    """
    Return the extremes of a drive; None for fewer than `LEAST_STEPS` steps.

    A Savitzky-Golay filter of order 2 over 0.5 s smooths and differentiates the rear axle's speed
    v and the yaw. With yaw rate w, the centre, r ahead of the rear axle, has the longitudinal
    acceleration v' - r w^2 and the lateral one v w + r w'. Jerk is the derivative of the
    acceleration's magnitude, longitudinal jerk that of the longitudinal one, over 1.5 s.
    """
    if len(drive.poses) < LEAST_STEPS:
        return None
    yaw = np.unwrap(drive.poses[:, 2])
    speed = _filtered(drive.speeds, drive.dt_s, _SHORT, 0)
    rate = _filtered(yaw, drive.dt_s, _SHORT, 1)
    bend = _filtered(yaw, drive.dt_s, _SHORT, 2)
    along = _filtered(drive.speeds, drive.dt_s, _SHORT, 1) - drive.rear_to_center * rate ** 2
    across = speed * rate + drive.rear_to_center * bend
    values = {
        'longitudinal_acceleration': along, 'lateral_acceleration': across,
        'jerk': _filtered(np.hypot(along, across), drive.dt_s, _LONG, 1),
        'longitudinal_jerk': _filtered(along, drive.dt_s, _LONG, 1),
        'yaw_rate': rate, 'yaw_acceleration': bend}
    return DriveComfort({name: float(values[name].min()) for name in BOUNDS},
                        {name: float(values[name].max()) for name in BOUNDS})


def _filtered(values: FloatArray, dt_s: float, samples: int, order: int) -> FloatArray:
    """Return values smoothed over a window of samples of 0.1 s, differentiated `order` times."""
    window = max(LEAST_STEPS, round(samples * _SAMPLE_S / dt_s))
    window = min(window, len(values))
    window -= window % 2 == 0
    return smoothed(values, window, 2, order) / dt_s ** order


class SpeedCompliance(NamedTuple):
    """
    The compliance of a drive with speed limits.

    :param score: 1 - mean excess / `TOO_FAST`, 0 at least.
    :param mean_excess: mean over the whole time, 0 below the limit [m/s]
    :param worst_excess: greatest excess [m/s]
    :param limited: share of the steps at which a limit is known.
    """

    score: float
    mean_excess: float
    worst_excess: float
    limited: float


def measure_speed(roads: RoadNetwork, drive: ScoredDrive, lanes: LanesDriven) -> SpeedCompliance:
    """
    Compare the speed with the limit of the lanelet at each step.

    Off the lanes, and in lanelets without a sign, there is no limit.
    """
    limits = np.full(len(drive.poses), np.inf)
    for lanelet in np.unique(lanes.lanelets[lanes.lanelets >= 0]).tolist():
        limit = roads.speed_limit(lanelet)
        if limit is not None:
            limits[lanes.lanelets == lanelet] = limit
    excess = np.maximum(np.abs(drive.speeds) - limits, 0.0)
    # nuPlan's sum: each step counts as one interval, which is one more than there are.
    mean = float(excess.sum() * drive.dt_s / drive.duration_s) if len(excess) > 1 else 0.0
    return SpeedCompliance(max(0.0, 1.0 - mean / TOO_FAST), mean, float(excess.max()),
                           float(np.isfinite(limits).mean()))


def driven_against(roads: RoadNetwork, drive: ScoredDrive, lanes: LanesDriven) -> float:
    """
    Return the longest distance driven against the lane within any window of 1 s, 0 or more [m].

    The distance of a step is that of the centre along the lanelet in which the step ends. Off the
    lanes, and where cars may drive in both directions, there is no direction. nuPlan leaves out
    the steps at which the lane changes, and would miss a drive over short lanelets.
    """
    network = roads.lanelet_network
    ways = np.zeros(len(drive.poses))
    points = drive.poses[:, :2]
    for lanelet in np.unique(lanes.lanelets[lanes.lanelets >= 0]).tolist():
        if network.find_lanelet_by_id(lanelet).user_bidirectional & _CARS:
            continue
        ends = np.flatnonzero(lanes.lanelets[1:] == lanelet) + 1
        line = roads.line(lanelet)
        ways[ends] = line.project(points[ends])[0] - line.project(points[ends - 1])[0]
    # As in nuPlan, the window has the steps of the last second and the present one.
    window = int(WINDOW_S / drive.dt_s + 1e-9) + 1
    total: NDArray[np.float64] = np.concatenate(([0.0], np.cumsum(ways)))
    first = np.maximum(np.arange(1, len(total)) - window, 0)
    return max(0.0, -float((total[1:] - total[first]).min()))


# nuplan-devkit, metric_aggregator/closed_loop_nonreactive_agents_weighted_average.yaml.
WEIGHTS = {'progress': 5.0, 'time_to_collision': 5.0, 'speed_limit': 4.0, 'comfort': 2.0}
# The footprint may leave the drivable area by less than the first [m]. A progress up to the second
# [share] counts as none. A time to collision up to the third [s] is out of bounds.
OVERHANG, LEAST_PROGRESS, LEAST_TTC_S = 0.3, 0.2, 0.95
# Numbers of collisions at fault, by kind, that give a multiplier of 0.
FATAL: dict[TrackKind, int] = {'vulnerable': 1, 'vehicle': 1, 'object': 2}
# Greatest speed of the free drive [m/s].
FASTEST = 100.0
# An expert that starts farther away may have driven another scenario [m].
ELSEWHERE = 5.0


class Expert(NamedTuple):
    """
    The expert with whose progress that of a drive is compared.

    :param name: name, for people.
    :param poses: (K, 3) poses of its centre, at the same steps as the drive; NaN: absent.
    """

    name: str
    poses: FloatArray


@dataclass(frozen=True)
class NuplanScore:
    """
    The score of a drive and its parts.

    :param multipliers: each 0 to 1, by name.
    :param weighted: likewise, to be weighted with `WEIGHTS`.
    :param collisions: first contact with each of the others.
    :param overhang: greatest distance by which the footprint left the road [m]
    :param against: longest distance driven against the lane within a second [m]
    :param own_progress: progress along the expert's route [m]
    :param expert_progress: progress of the expert [m]
    :param least_ttc_s: smallest time to collision within the horizon; inf without one [s]
    :param remarks: notes that matter for comparisons, one line each.
    """

    multipliers: dict[str, float]
    weighted: dict[str, float]
    collisions: tuple[JudgedCollision, ...]
    overhang: float
    against: float
    own_progress: float
    expert_progress: float
    expert: str
    least_ttc_s: float
    speed: SpeedCompliance
    comfort: DriveComfort
    remarks: tuple[str, ...]

    @property
    def score(self) -> float:
        """Return the product of the multipliers times the weighted mean, 0 to 1."""
        mean = sum(WEIGHTS[name] * value for name, value in self.weighted.items())
        return math.prod(self.multipliers.values()) * mean / sum(WEIGHTS.values())

    def as_dict(self) -> dict[str, object]:
        """Return the fields as a JSON-compatible dictionary."""
        return {
            'score': self.score, 'multipliers': self.multipliers,
            'weighted': {name: {'value': value, 'weight': WEIGHTS[name]}
                         for name, value in self.weighted.items()},
            'collisions': [each.as_dict() for each in self.collisions],
            'overhang_m': self.overhang, 'against_lane_m': self.against,
            'progress_m': self.own_progress, 'expert_progress_m': self.expert_progress,
            'expert': self.expert,
            'least_ttc_s': self.least_ttc_s if math.isfinite(self.least_ttc_s) else None,
            'speed_limit': self.speed._asdict(), 'comfort': self.comfort.as_dict(),
            'remarks': list(self.remarks)}


class NuplanScorer:
    """Scores drives on the roads of a scenario."""

    def __init__(self, loaded: LoadedScenario) -> None:
        self._roads = RoadNetwork(loaded.scenario.lanelet_network)
        self._boundary = RoadBoundary(loaded.scenario.lanelet_network)

    def score(self, drive: ScoredDrive, expert: Expert | None,
              problem: PlanningProblem | None) -> NuplanScore:
        """
        Score a drive.

        :param expert: None to compare the progress with a free drive at the speed limit.
        :param problem: planning problem with the free drive's goal; None: it follows the lane.
        :raises InputError: if the drive is too short.
        """
        comfort = measure_comfort(drive)
        if comfort is None:
            raise InputError(f'has {len(drive.poses)} time steps', drive.vehicle_id,
                             f"nuPlan's score needs {LEAST_STEPS}")
        lanes = find_lanes(self._roads, drive)
        collisions = find_collisions(drive, lanes)
        times = times_to_contact(drive, lanes, collisions)
        speed = measure_speed(self._roads, drive, lanes)
        against = driven_against(self._roads, drive, lanes)
        overhang = self._overhang(drive)
        remarks: list[str] = []
        if speed.limited == 0.0:
            remarks.append('no speed limit is known where it drove')
        own, theirs = self._progress(drive, expert, problem, remarks)
        ratio = 1.0 if theirs is None else progress_ratio(own, theirs)
        return NuplanScore(
            {'no_collision_at_fault': collision_score(collisions),
             'drivable_area': float(overhang < OVERHANG),
             'driving_direction': 1.0 if against < TOLERATED else 0.5 if against < VIOLATED
             else 0.0,
             'making_progress': float(ratio > LEAST_PROGRESS)},
            {'progress': ratio, 'time_to_collision': float((times > LEAST_TTC_S).all()),
             'speed_limit': speed.score, 'comfort': float(not comfort.exceeded)},
            collisions, overhang, against, own, 0.0 if theirs is None else theirs,
            'free drive at the speed limit' if expert is None else expert.name,
            float(times.min()), speed, comfort, tuple(remarks))

    def _overhang(self, drive: ScoredDrive) -> float:
        """Return the greatest distance of a corner off the road [m]."""
        off = drive.poses[self._boundary.are_off_road(drive.poses, drive.shape)]
        return max((self._boundary.overhang(x, y, yaw, drive.shape)
                    for x, y, yaw in off.tolist()), default=0.0)

    def _progress(self, drive: ScoredDrive, expert: Expert | None, problem: PlanningProblem | None,
                  remarks: list[str]) -> tuple[float, float | None]:
        """Return the progress of a drive and of its expert [m]; None for one without a route."""
        if expert is None:
            return self._free_progress(drive, problem)
        steps = min(len(drive.poses), len(expert.poses))
        if steps < len(drive.poses):
            remarks.append(f'{expert.name} drove for {(steps - 1) * drive.dt_s:.1f} s: progress '
                           'is compared as long')
        present = np.isfinite(expert.poses[:steps]).all(axis=1)
        theirs = expert.poses[:steps][present]
        route = route_of(self._roads, theirs)
        if not len(route):
            remarks.append(f'{expert.name} has no route: progress counts as 1')
            return 0.0, None
        if (away := math.dist(theirs[0, :2], drive.poses[0, :2])) > ELSEWHERE:
            remarks.append(f'{expert.name} starts {away:.1f} m away')
        return (route.progress(drive.poses[:steps][present][:, :2]),
                route.progress(theirs[:, :2]))

    def _free_progress(self, drive: ScoredDrive, problem: PlanningProblem | None
                       ) -> tuple[float, float | None]:
        if not self._roads.lanelet_ids:
            return 0.0, None
        start, start_s = start_lanelet(self._roads, *drive.poses[0].tolist())
        goals = frozenset[int]() if problem is None else goal_lanelets(self._roads, problem)
        # Without a goal the free drive continues along the route driven.
        driven = [] if goals else route_of(self._roads, drive.poses).lanelets
        start = driven[-1] if driven else start
        found = find_route(self._roads, start, start_s, goals, FASTEST * drive.duration_s)
        route = ComparedRoute(self._roads, [
            *driven, *(lanelet for leg in found.legs for lanelet in leg)])
        ends = [] if problem is None or found.goal is None else [
            way for point in _goal_points(problem) if (way := route.way_to(point)) is not None]
        begin = route.way_to(drive.poses[0, :2]) or 0.0
        return route.progress(drive.poses[:, :2]), route.free_way(
            begin, max(float(drive.speeds[0]), 0.0), drive.duration_s, max(ends, default=1e9))


def collision_score(collisions: Sequence[JudgedCollision]) -> float:
    """Return the multiplier for collisions at fault: 0.5 with an object, 0 for any other."""
    counts = {kind: sum(each.at_fault and each.other_kind == kind for each in collisions)
              for kind in FATAL}
    return math.prod(max(0.0, 1.0 - counts[kind] / fatal) for kind, fatal in FATAL.items())


def _goal_points(problem: PlanningProblem) -> list[FloatArray]:
    return [exact_position(state.position) for state in problem.goal.state_list
            if getattr(state, 'position', None) is not None]
