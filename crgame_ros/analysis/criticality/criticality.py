# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Measures the criticality of a run: of each driven vehicle to each one near it, at every tick.

The same code observes offline runs and measures recordings. All definitions are in
`docs/criticality.md`. Distances are bumper to bumper, along the subject's own path.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
import math
from typing import NamedTuple

from crgame_ros.analysis.criticality.car_following_measures import (
    Ahead,
    Corner,
    deceleration_to_avoid_crash,
    find_leader,
    NO_LEADER,
    Pursuit,
    required_acceleration,
    time_gap,
    time_to_collision,
    time_to_collision_accelerating,
)
from crgame_ros.analysis.criticality.encroachment import EncroachmentDetector, WayCrossed
from crgame_ros.analysis.criticality.headways import Following, Headways
from crgame_ros.analysis.criticality.nearby_footprints import NearbyFootprints, Scene
from crgame_ros.analysis.criticality.own_path import OwnPaths
from crgame_ros.analysis.criticality.thresholds import Thresholds, USUAL
from crgame_ros.finite_json import finite
from crgame_ros.game.objects import ObjectStates
from crgame_ros.geometry.curve import Curve
from crgame_ros.geometry.reference_point import (
    shifted,
    shifted_velocities,
    zero_for_nan,
)
from crgame_ros.measures import FOOTPRINTS, Measure, with_unit
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.route import goal_lanelets
from crgame_ros.simulation.observer import ObservedRun
from crgame_ros.vehicle.state import pose_rates, StateColumn
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
# Times above this say nothing [s].
LONGEST_S = 100.0


@dataclass(frozen=True, kw_only=True)
class PairMeasure(Measure):
    """
    A criticality measure of a pair.

    :param undefined: the value where there is nothing to measure.
    :param short: for people who know it, of the few that are plotted, compared and averaged.
    :param most: greater values count as this one in means: they result from speeds that are almost
        equal or gaps that are almost closed.
    :param of_leader: how it follows from the pursuit of the leader; None where it is measured to
        everybody near, from the footprints (`NearbyFootprints.approach`).
    """

    reference_point: str = FOOTPRINTS
    undefined: float
    short: str = ''
    most: float = math.inf
    of_leader: Callable[[Pursuit], float] | None = None

    @property
    def extreme(self) -> str:
        """Return the name of its most critical value."""
        return f'{"least" if self.better > 0 else "greatest"} {self.short}'

    @property
    def head(self) -> str:
        """Return the name of its most critical value, with the unit, as the head of a table."""
        return with_unit(self.extreme, self.symbol)

    def matters(self, value: float) -> bool:
        """Return whether a value is worth telling: longer times come from equal speeds."""
        return self.unit != 's' or value < LONGEST_S


# In the order of the columns of `TickMeasures.values`: those of the leader come first.
MEASURES = {
    'gap': PairMeasure(
        'm', "from the subject's front to the leader's rear along its own path",
        label='Gap to the leader', short='gap', better=1, undefined=math.nan,
        of_leader=lambda of: of.gap),
    'time_gap': PairMeasure(
        's', "gap divided by the subject's speed", label='Time gap', better=1, undefined=math.inf,
        of_leader=lambda of: time_gap(of.gap, of.speed)),
    'thw': PairMeasure(
        's', "time until the subject's front is where the leader's rear is now",
        label='Time headway (THW)', short='THW', better=1, undefined=math.inf, most=20.0,
        of_leader=lambda of: time_gap(of.gap, of.speed)),
    'ttc': PairMeasure(
        's', 'gap divided by the closing speed along the path',
        label='Time to collision (TTC)', short='TTC', better=1, undefined=math.inf, most=20.0,
        of_leader=lambda of: time_to_collision(of.gap, of.speed, of.leader_speed)),
    'ttc_a': PairMeasure(
        's', 'the same where each keeps its acceleration until it stands',
        label='TTC with accelerations', better=1, undefined=math.inf,
        of_leader=lambda of: time_to_collision_accelerating(*of)),
    'drac': PairMeasure(
        'm/s^2', 'half the squared closing speed divided by the gap',
        label='Deceleration to avoid a crash (DRAC)', short='DRAC', better=-1, undefined=0.0,
        most=20.0,
        of_leader=lambda of: deceleration_to_avoid_crash(of.gap, of.speed, of.leader_speed)),
    'a_req': PairMeasure(
        'm/s^2', 'constant acceleration that just avoids contact',
        label='Required acceleration', better=1, undefined=0.0,
        of_leader=lambda of: required_acceleration(
            of.gap, of.speed, of.leader_speed, of.leader_acceleration)),
    'ttc_2d': PairMeasure(
        's', 'time until footprints touch that keep velocity and yaw',
        label='TTC in the plane', better=1, undefined=math.inf),
    'min_distance': PairMeasure(
        'm', 'distance of the footprints', label='Distance', short='distance', better=1,
        undefined=math.nan),
}
_OF_LEADER = [measure.of_leader for measure in MEASURES.values() if measure.of_leader]
# Those that are plotted, compared and averaged.
CHIEF = {name: measure for name, measure in MEASURES.items() if measure.short}
COLUMN = {name: column for column, name in enumerate(MEASURES)}
UNDEFINED = np.array([measure.undefined for measure in MEASURES.values()])
_SENSES = np.array([float(-measure.better) for measure in MEASURES.values()])


@dataclass(frozen=True, kw_only=True)
class Exposure(Measure):
    """
    A measure of a vehicle over a whole run: the integral over time of a measure's excess.

    Label and definition may name thresholds: {ttc_s}.

    :param rate: of the most critical values of a tick, in the order of `MEASURES`, and the
        thresholds: by how much it grows in a second.
    """

    reference_point: str = FOOTPRINTS
    better: int = -1
    rate: Callable[[Sequence[float], Thresholds], float]

    def told(self, limits: Thresholds) -> 'Exposure':
        """Return it with the thresholds in its texts."""
        numbers = {name: f'{value:g}' for name, value in limits._asdict().items()}
        return replace(self, label=self.label.format(**numbers),
                       definition=self.definition.format(**numbers))


_IN_FULL = 'each step that it is below counts in full'
# By the name of their column.
EXPOSURES = {
    'tet_s': Exposure(
        's', 'time with a ttc below {ttc_s} s', _IN_FULL,
        label='Time with a TTC below {ttc_s} s (TET)',
        rate=lambda values, limits: float(values[COLUMN['ttc']] < limits.ttc_s)),
    'tit': Exposure(
        's^2', 'integral of what the ttc is below {ttc_s} s', 'rectangles of a scenario step',
        label='Integral of the TTC below {ttc_s} s (TIT)',
        rate=lambda values, limits: max(0.0, limits.ttc_s - values[COLUMN['ttc']])),
    'short_time_gap_s': Exposure(
        's', 'time with a time gap below {time_gap_s} s', _IN_FULL,
        label='Time with a time gap below {time_gap_s} s',
        rate=lambda values, limits: float(values[COLUMN['time_gap']] < limits.time_gap_s)),
}


def most_critical(values: FloatArray, others: NDArray[np.int64]
                  ) -> tuple[FloatArray, NDArray[np.int64]]:
    """
    Choose the most critical value of each measure.

    :param values: (P, measures) columns as in `MEASURES`.
    :param others: (P) number of the other of each row.
    :return: (measures) values, the undefined value where there is none, and (measures) the
        numbers of the others, -1 there.
    """
    if not len(others):
        return UNDEFINED.copy(), np.full(len(UNDEFINED), -1)
    ranks = values * _SENSES
    ranks[(values == UNDEFINED) | np.isnan(values)] = -np.inf
    rows = ranks.argmax(axis=0)
    columns = np.arange(len(rows))
    there = ranks[rows, columns] > -np.inf
    return (np.where(there, values[rows, columns], UNDEFINED),
            np.where(there, others[rows], -1))


class TickMeasures(NamedTuple):
    """
    The measures of a subject at a tick.

    :param subject: its number among the driven vehicles.
    :param others: (P) numbers of those near: driven vehicles, then objects.
    :param values: (P, measures) columns as in `MEASURES`; measures of car following have values
        for the leader only, and are undefined for all others.
    :param following: how it follows its leader; None without one.
    """

    subject: int
    others: NDArray[np.int64]
    values: FloatArray
    following: Following | None

    def worst(self) -> tuple[FloatArray, NDArray[np.int64]]:
        """Return the most critical values and the others' numbers (`most_critical`)."""
        return most_critical(self.values, self.others)


@dataclass
class Worst:
    """The most critical value of a measure, with the other's id and the time [s]."""

    value: float
    other: str
    time_s: float


@dataclass
class VehicleCriticality:
    """
    The criticality of a run for one vehicle.

    :param worst: by measure; measures that were never defined are missing.
    :param exposures: by the names of `EXPOSURES`.
    :param headways: gaps and headways to its leaders, at all ticks.
    :param crossings: crossings with other paths, with their PET.
    """

    vehicle_id: str
    worst: dict[str, Worst]
    exposures: dict[str, float]
    headways: Headways
    crossings: list[WayCrossed]


class Criticality:
    """
    Measures every scenario tick of a run (`RunObserver`).

    :param run: description of the run; a vehicle without a planning problem follows its lane.
    :param thresholds: thresholds of critical values.
    :ivar loaded: the scenario of the run.
    :ivar roads: its roads.
    :ivar vehicles: number of driven vehicles.
    :ivar ids: ids of driven vehicles, then of objects.
    :ivar n: simulation step that was measured last; -1 before the first.
    :ivar latest: measures of each vehicle at that step.
    :ivar new_crossings: estimates of the crossings in which the second entered at that step.
    """

    def __init__(self, run: ObservedRun, thresholds: Thresholds = USUAL) -> None:
        self.loaded = run.loaded
        self.vehicles = len(run.vehicles)
        everybody = (*run.vehicles, *run.others)
        self.ids = tuple(item.id for item in everybody)
        self.thresholds = thresholds
        self._scheduler = run.scheduler
        self._transforms = run.road_transforms
        self._rear_to_center = np.array([item.rear_to_center for item in run.vehicles])
        self._footprints = NearbyFootprints(everybody)
        self.roads = RoadNetwork(run.loaded.scenario.lanelet_network)
        self._paths = OwnPaths(self.roads, [
            frozenset() if problem is None else goal_lanelets(self.roads, problem)
            for problem in run.problems or (None,) * self.vehicles])
        self._crossings = EncroachmentDetector(self.vehicles, self._footprints.radii)
        self._before: tuple[float, FloatArray] | None = None
        self._found = [VehicleCriticality(item.id, {}, dict.fromkeys(EXPOSURES, 0.0), Headways(),
                                          [])
                       for item in run.vehicles]
        self.n = -1
        self.latest: tuple[TickMeasures, ...] = ()
        self.new_crossings: tuple[WayCrossed, ...] = ()

    @property
    def crossings(self) -> tuple[WayCrossed, ...]:
        """Return all crossings so far; those whose second is still inside are estimates."""
        return tuple(self._crossings.crossings)

    def observe(self, n: int, since_tick_s: float, vehicle_states: FloatArray,
                objects: ObjectStates | None) -> None:
        """Measure a published state, if it belongs to a tick (`RunObserver`)."""
        # A state that is published again, such as that of step 0 before a run starts, counts once.
        if objects is None or since_tick_s != 0.0 or n == self.n:
            return
        self.n, time_s = n, n * self._scheduler.dt_s
        centers = shifted(vehicle_states[:, :3], self._rear_to_center)
        velocities = shifted_velocities(centers[:, 2], pose_rates(vehicle_states),
                                        self._rear_to_center)
        poses = np.concatenate((centers, objects.poses))
        rates = np.concatenate((velocities, objects.velocities))
        accelerations = self._accelerations(time_s, vehicle_states, poses, rates[:, :2])
        scene = self._footprints.scene(poses, rates, accelerations)
        self.latest = self._measure(scene)
        self.new_crossings = tuple(self._crossings.observe(
            time_s, scene.outlines, poses[:, :2]))
        self._sum_up(time_s)

    def report(self) -> tuple[VehicleCriticality, ...]:
        """Return the criticality of each vehicle over all ticks so far."""
        crossings = self._crossings.crossings
        return tuple(
            replace(vehicle, crossings=[each for each in crossings
                                        if number in (each.first, each.second)])
            for number, vehicle in enumerate(self._found))

    def as_dict(self) -> dict[str, object]:
        """
        Return the results as a JSON-compatible dictionary: SI units, times since the start.

        A value that is infinite, as DRAC is after a contact, is None.
        """
        return {
            'thresholds': self.thresholds._asdict(),
            'vehicles': {
                vehicle.vehicle_id: {
                    'worst': {name: {'value': finite(worst.value), 'unit': measure.unit,
                                     'of': worst.other, 'time_s': worst.time_s}
                              for name, measure in MEASURES.items()
                              if (worst := vehicle.worst.get(name))},
                    'exposures': {name: {'value': value, 'unit': EXPOSURES[name].unit}
                                  for name, value in vehicle.exposures.items()},
                    'crossings': [{'first': self.ids[each.first],
                                   'second': self.ids[each.second],
                                   'entered_s': each.entered_s, 'pet_s': each.pet_s,
                                   'is_estimate': each.is_estimate}
                                  for each in vehicle.crossings]}
                for vehicle in self.report()}}

    def _accelerations(self, time_s: float, states: FloatArray, poses: FloatArray,
                       moves: FloatArray) -> FloatArray:
        """Return all accelerations (N, 2): from states for vehicles, by differences for others."""
        result = np.zeros_like(moves)
        if self._before is not None and time_s > self._before[0]:
            lapse = time_s - self._before[0]
            result = zero_for_nan((moves - self._before[1]) / lapse)
        own, yaw = states[:, StateColumn.ACCELERATION], poses[:self.vehicles, 2]
        result[:self.vehicles] = own[:, None] * np.column_stack((np.cos(yaw), np.sin(yaw)))
        self._before = (time_s, moves)
        return result

    def _measure(self, scene: Scene) -> tuple[TickMeasures, ...]:
        """Return the measures of each present vehicle to all near it."""
        footprints = self._footprints
        subjects = [subject for subject in range(self.vehicles)
                    if math.isfinite(scene.poses[subject, 0])]
        if not subjects:
            return ()
        scenes = [footprints.on_road(scene, self._transforms[subject]) for subject in subjects]
        near = [footprints.near(*place) for place in zip(subjects, scenes, strict=True)]
        found = []
        for subject, others, place, pairs in zip(
                subjects, near, scenes, footprints.approach(subjects, near, scenes), strict=True):
            values = np.empty((len(others), len(MEASURES)))
            values[:, :len(_OF_LEADER)], values[:, len(_OF_LEADER):] = _WITHOUT_LEADER, pairs
            following = self._follow(subject, others, place, values)
            found.append(TickMeasures(subject, others, values, following))
        return tuple(found)

    def _follow(self, subject: int, others: NDArray[np.int64], scene: Scene,
                values: FloatArray) -> Following | None:
        """Fill in the measures of car following for the leader of the vehicle, if there is one."""
        if not len(others):
            return None
        poses, outlines = scene.poses, scene.outlines
        seen = self._paths.at(subject, float(poses[subject, 2]), np.concatenate((
            poses[subject, None, :2], outlines[subject], poses[others, :2])))
        leader = find_leader(seen, outlines[others], self._footprints.radii[others],
                             values[:, COLUMN['min_distance']] == 0.0)
        if leader is None:
            return None
        (speed, acceleration), (leader_speed, leader_acceleration) = (
            _rates_along(seen.path.line, corner, scene, number) for corner, number in (
                (leader.front, subject), (leader.rear, int(others[leader.number]))))
        pursuit = Pursuit(leader.gap, speed, leader_speed, acceleration, leader_acceleration)
        values[leader.number, :len(_OF_LEADER)] = [measure(pursuit) for measure in _OF_LEADER]
        number = int(others[leader.number])
        return Following(leader.gap, leader.headway, speed, number, leader_speed,
                         _comes_aside(seen.path.line, leader, scene, number))

    def _sum_up(self, time_s: float) -> None:
        step_s = self._scheduler.time_step_s
        for tick in self.latest:
            found = self._found[tick.subject]
            values, others = (each.tolist() for each in tick.worst())
            for (name, measure), value, other in zip(
                    MEASURES.items(), values, others, strict=True):
                if other < 0:
                    continue
                known = found.worst.get(name)
                if known is None or measure.better * (value - known.value) < 0.0:
                    found.worst[name] = Worst(value, self.ids[other], time_s)
            found.headways.add(tick.following, values[COLUMN['ttc']])
            for name, exposure in EXPOSURES.items():
                found.exposures[name] += step_s * exposure.rate(values, self.thresholds)


def _rates_along(path: Curve, corner: Corner, scene: Scene, number: int) -> list[float]:
    """Return how fast the s of a footprint's corner grows [m/s], and its acceleration [m/s^2]."""
    x, y = (scene.outlines[number, corner.number] - scene.poses[number, :2]).tolist()
    vx, vy, yaw_rate = scene.rates[number].tolist()
    return path.rates(corner.s, corner.d, (vx - yaw_rate * y, vy + yaw_rate * x),
                      scene.accelerations[number].tolist())


def _comes_aside(path: Curve, leader: Ahead, scene: Scene, number: int) -> float:
    """Return how fast a leader moves across the path to the side on which the subject is [m/s]."""
    heading = path.place(leader.rear.s)[3]
    vx, vy, _ = scene.rates[number].tolist()
    return math.copysign(1.0, -leader.aside) * (
        vy * math.cos(heading) - vx * math.sin(heading))


# The measures of car following to one that is not the leader.
_WITHOUT_LEADER = [measure(NO_LEADER) for measure in _OF_LEADER]
