# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How the driven vehicles of a run kept traffic rules: lines and the safe distance.

It is that of Rizaldi et al., "Formalising and Monitoring Traffic Rules for Autonomous Vehicles in
Isabelle/HOL" (2017), with the exception after cut-ins of rule R_G1 of Maierhofer et al.,
"Formalization of Interstate Traffic Rules in Temporal Logic" (2020).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from crgame_ros.analysis.criticality.criticality import Criticality
from crgame_ros.analysis.criticality.headways import Following, Headways
from crgame_ros.analysis.rules.passed_lines import DrivenTrack, LineRules, PassedLine
from crgame_ros.measures import FOOTPRINTS, Measure
from crgame_ros.recording.run_record import RunRecord
from crgame_ros.roads.signs import SIGN_REACH
from crgame_ros.vehicle.state import STANDING
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

# Reaction time [s], and hardest braking of the vehicle and of its leader [m/s^2]: the values of
# commonroad-stl-monitor, with which the authors of R_G1 monitor recorded traffic.
REACTION_S, BRAKING, LEADER_BRAKING = 0.3, 10.0, 10.5
# A vehicle has this long to restore the distance to one that cut in, t_c in R_G1 [s].
RECOVERY_S = 3.0
# One that cuts in moves across the road at least this fast [m/s]; slower motion is weaving.
SIDEWAYS = 0.1


@dataclass(frozen=True)
class VehicleRules:
    """
    How a vehicle kept traffic rules.

    :param values: by the names of `RULE_MEASURES`; None where undefined.
    :param passed: lines that it passed at red, or without the halt of a stop sign, in order.
    """

    vehicle_id: str
    values: Mapping[str, float | None]
    passed: tuple[PassedLine, ...]

    def as_dict(self) -> dict[str, object]:
        """Return the values by their names, and the lines that it passed."""
        return {**self.values, 'passed': [each._asdict() for each in self.passed]}


def measure_rules(record: RunRecord, criticality: Criticality) -> tuple[VehicleRules, ...]:
    """
    Measure how each driven vehicle of a run kept traffic rules, in the log's order.

    :param record: record of a recording (`read_run_record`) or an offline run (`run_record_of`).
    :param criticality: that of all scenario steps of the same run (`measure_log`).
    """
    log = record.log
    rules = LineRules(criticality.loaded.scenario, criticality.roads)
    step_s = log.game.scheduler.time_step_s
    found = []
    for column, (item, critical) in enumerate(zip(
            log.vehicles, criticality.report(), strict=True)):
        passed = rules.passed(DrivenTrack(
            log.states_on_road(column), log.ks, item.rear_to_center,
            item.rear_to_center + 0.5 * item.shape.length,
            record.jumps(column)))
        unsafe = unsafe_distance(critical.headways, step_s)
        kinds = [each.kind for each in passed]
        found.append(VehicleRules(item.id, {
            'red_lights_run': kinds.count('red light'),
            'stop_lines_run': kinds.count('stop sign'),
            'unsafe_distance_share': None if unsafe is None else unsafe.share,
            'unsafe_distance_s': None if unsafe is None else unsafe.longest_s}, passed))
    return tuple(found)


_FRONT = 'middle of the front bumper'
_SAFE = (f'Maierhofer et al. 2020, R_G1: reaction {REACTION_S:g} s, braking {BRAKING:g} m/s^2, of '
         f'the leader {LEADER_BRAKING:g} m/s^2; up to {RECOVERY_S:g} s after a cut-in do not '
         'count; each step that it is below counts in full')
_NO_LEADER = 'it followed no leader'
RULE_MEASURES = {
    'red_lights_run': Measure(
        '1', 'times that it drove over the line of a light that was red',
        'the stop line, or else the end of the lanelet; red and red-yellow, not yellow', _FRONT,
        'Red lights run', better=-1, is_count=True),
    'stop_lines_run': Measure(
        '1', 'times that it drove over the line of a stop sign without a halt',
        f'a halt is a speed below {STANDING:g} m/s at most {SIGN_REACH:g} m before the stop line, '
        'or else the end of the lanelet; a light that is on overrules the sign', _FRONT,
        'Stop signs run', better=-1, is_count=True),
    'unsafe_distance_share': Measure(
        '1', 'share of the steps with a leader at which the gap to it was below the safe distance',
        _SAFE, FOOTPRINTS, 'Share of the time with a leader below the safe distance', better=-1,
        empty=_NO_LEADER),
    'unsafe_distance_s': Measure(
        's',
        'longest time without a pause in which the gap to its leader was below the safe distance',
        _SAFE, FOOTPRINTS, 'Longest time below the safe distance', better=-1, empty=_NO_LEADER),
}


class UnsafeDistance(NamedTuple):
    """
    How a vehicle kept the safe distance over a run.

    :param share: of the steps with a leader at which the gap was too small, 0 to 1.
    :param longest_s: longest time without a pause with such gaps [s]
    """

    share: float
    longest_s: float


def safe_distance(speed: FloatArray, leader_speed: FloatArray) -> FloatArray:
    """
    Return v_f t + v_f^2 / (2 a_f) - v_l^2 / (2 a_l), 0 at least [m].

    At this distance, both stop without contact if the leader brakes as hard as it can and the
    vehicle does so a reaction time later. The leader brakes at least as hard as the vehicle, so
    that both are nearest to each other at the beginning or when they stand; the other cases of
    Rizaldi et al. do not occur.

    :param speed: of the vehicle along its path [m/s]; backwards it counts as standing.
    :param leader_speed: of its leader [m/s]; one that comes towards it counts as standing.
    """
    own, other = np.maximum(speed, 0.0), np.maximum(leader_speed, 0.0)
    needed = own * REACTION_S + own**2 / (2.0 * BRAKING) - other**2 / (2.0 * LEADER_BRAKING)
    return np.asarray(np.maximum(needed, 0.0))


def unsafe_distance(headways: Headways, time_step_s: float) -> UnsafeDistance | None:
    """
    Return how a vehicle kept the safe distance; None if it never had a leader.

    :param headways: its leaders, at all ticks.
    :param time_step_s: between two ticks [s]
    """
    following = headways.following
    if not following:
        return None
    gap, speed, leader_speed = np.array([
        (each.gap, each.speed, each.leader_speed) for each in following]).T
    ticks = np.array(headways.following_ticks)
    unsafe = (gap < safe_distance(speed, leader_speed)) & ~_recovers(
        headways.following_ticks, following, round(RECOVERY_S / time_step_s))
    at = ticks[unsafe]
    # Successive ticks are one stretch.
    longest = max(map(len, np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)))
    # A bound such as 0.3 s holds for three steps of 0.1 s.
    return UnsafeDistance(float(unsafe.mean()), round(longest * time_step_s, 9))


def _recovers(ticks: Sequence[int], following: Sequence[Following], recovery: int) -> BoolArray:
    """
    Return at which ticks the vehicle still restores the distance to one that cut in.

    Who cuts in has not led within the recovery time, is nearer than the leader before, and moves
    across the road towards the vehicle: neither the vehicle's own lane change nor that of a leader
    that makes way is a cut-in.

    :param recovery: number of ticks that it has for it.
    """
    led: dict[int, int] = {}
    cut_in: dict[int, int] = {}
    result = np.zeros(len(ticks), dtype=bool)
    for row, (tick, now) in enumerate(zip(ticks, following, strict=True)):
        comes = tick - led.get(now.leader, -recovery - 1) > recovery
        beyond = row > 0 and ticks[row - 1] == tick - 1 and now.gap >= following[row - 1].gap
        # At the first tick of a run nobody has come yet.
        if comes and not beyond and tick > 0 and now.comes_aside > SIDEWAYS:
            cut_in[now.leader] = tick
        led[now.leader] = tick
        result[row] = tick - cut_in.get(now.leader, -recovery - 1) <= recovery
    return result
