# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""nuPlan's closed-loop score of one drive: four multipliers times a weighted mean of four."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any, NamedTuple

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.analysis.scores.collisions_by_kind import find_collisions, JudgedCollision
from crgame_ros.analysis.scores.drive_comfort import DriveComfort, LEAST_STEPS, measure_comfort
from crgame_ros.analysis.scores.driving_direction import direction_score, driven_against
from crgame_ros.analysis.scores.lanes_driven import find_lanes
from crgame_ros.analysis.scores.projected_contact import times_to_contact
from crgame_ros.analysis.scores.route_progress import ComparedRoute, progress_ratio, route_of
from crgame_ros.analysis.scores.scored_drive import ScoredDrive, TrackKind
from crgame_ros.analysis.scores.speed_compliance import measure_speed, SpeedCompliance
from crgame_ros.errors import InputError
from crgame_ros.roads.road_boundary import RoadBoundary
from crgame_ros.roads.road_network import RoadNetwork
from crgame_ros.roads.route import find_route, goal_lanelets, start_lanelet
from crgame_ros.scenario.loading import exact_position, LoadedScenario
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# nuplan-devkit, metric_aggregator/closed_loop_nonreactive_agents_weighted_average.yaml.
WEIGHTS = {'progress': 5.0, 'time_to_collision': 5.0, 'speed_limit': 4.0, 'comfort': 2.0}
# By less than the first the drivable area may be left [m]; up to the second share nothing is
# progress, and up to the third [s] a time to collision is out of bounds.
OVERHANG, LEAST_PROGRESS, LEAST_TTC_S = 0.3, 0.2, 0.95
# So many collisions at fault with each kind give nothing.
FATAL: dict[TrackKind, int] = {'vulnerable': 1, 'vehicle': 1, 'object': 2}
# No free drive comes farther than with this speed [m/s].
FASTEST = 100.0
# An expert who starts farther away drove another scenario, perhaps [m].
ELSEWHERE = 5.0


class Expert(NamedTuple):
    """
    With whose progress that of a drive is compared.

    :param name: who it was, for people.
    :param poses: (K, 3) of its centre, from the same time on and at the same steps; NaN: absent.
    """

    name: str
    poses: FloatArray


@dataclass(frozen=True)
class NuplanScore:
    """
    The score of a drive and what it is made of.

    :param multipliers: each 0 to 1, by name.
    :param weighted: likewise, to be weighted with `WEIGHTS`.
    :param collisions: first touches.
    :param overhang: by which the footprint left the road at worst [m]
    :param against: longest way against the lane within a second [m]
    :param own_progress: along the expert's route [m]
    :param expert_progress: the expert's [m]
    :param expert: who that was.
    :param least_ttc_s: smallest time to collision within the horizon; inf without one [s]
    :param speed: the limits kept.
    :param comfort: extremes.
    :param remarks: what is to be known when it is compared, one line each.
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

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON has it."""
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
    """
    Scores drives on one road network.

    :param loaded: the scenario.
    """

    def __init__(self, loaded: LoadedScenario) -> None:
        self._roads = RoadNetwork(loaded.scenario.lanelet_network)
        self._boundary = RoadBoundary(loaded.scenario.lanelet_network)

    def score(self, drive: ScoredDrive, expert: Expert | None,
              problem: PlanningProblem | None) -> NuplanScore:
        """
        Score a drive.

        :param expert: None: the progress is that of a free drive at the speed limit.
        :param problem: whose goal the free drive leads to; None: it follows the lane.
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
             'driving_direction': direction_score(against),
             'making_progress': float(ratio > LEAST_PROGRESS)},
            {'progress': ratio, 'time_to_collision': float((times > LEAST_TTC_S).all()),
             'speed_limit': speed.score, 'comfort': float(not comfort.exceeded)},
            collisions, overhang, against, own, 0.0 if theirs is None else theirs,
            'free drive at the speed limit' if expert is None else expert.name,
            float(times.min()), speed, comfort, tuple(remarks))

    def _overhang(self, drive: ScoredDrive) -> float:
        """Return how far the farthest corner was off the road [m]."""
        off = drive.poses[self._boundary.are_off_road(drive.poses, drive.shape)]
        return max((self._boundary.overhang(x, y, yaw, drive.shape)
                    for x, y, yaw in off.tolist()), default=0.0)

    def _progress(self, drive: ScoredDrive, expert: Expert | None, problem: PlanningProblem | None,
                  remarks: list[str]) -> tuple[float, float | None]:
        """Return the progress of a drive and of its expert [m]; None of one without a route."""
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
        # Who has no goal goes on from where it came to.
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
    """Return the multiplier of collisions at fault: 0.5 for one with an object, 0 for any other."""
    counts = {kind: sum(each.at_fault and each.other_kind == kind for each in collisions)
              for kind in FATAL}
    return math.prod(max(0.0, 1.0 - counts[kind] / fatal) for kind, fatal in FATAL.items())


def _goal_points(problem: PlanningProblem) -> list[FloatArray]:
    return [exact_position(state.position) for state in problem.goal.state_list
            if getattr(state, 'position', None) is not None]
