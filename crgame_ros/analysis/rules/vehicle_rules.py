# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the driven vehicles of a run kept traffic rules, and the measures of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from crgame_ros.analysis.criticality.criticality import Criticality
from crgame_ros.analysis.rules.passed_lines import DrivenTrack, LineRules, PassedLine
from crgame_ros.analysis.rules.safe_distance import (
    BRAKING,
    LEADER_BRAKING,
    REACTION_S,
    RECOVERY_S,
    unsafe_distance,
)
from crgame_ros.recording.run_record import RunRecord
from crgame_ros.roads.signs import SIGN_REACH
from crgame_ros.vehicle.state import STANDING
import numpy as np


@dataclass(frozen=True)
class VehicleRules:
    """
    How a vehicle kept traffic rules.

    :param vehicle_id: id of the vehicle.
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
        av = log.game.av(item.id)
        states = log.vehicle_states[:, column]
        if av is not None:
            states = np.column_stack((av.transform.to_scenario(states[:, :3]), states[:, 3:]))
        passed = rules.passed(DrivenTrack(
            states, log.ks, item.rear_to_center, item.rear_to_center + 0.5 * item.shape.length,
            record.jumps(column)))
        unsafe = unsafe_distance(critical.headways, step_s)
        kinds = [each.kind for each in passed]
        found.append(VehicleRules(item.id, {
            'red_lights_run': kinds.count('red light'),
            'stop_lines_run': kinds.count('stop sign'),
            'unsafe_distance_share': None if unsafe is None else unsafe.share,
            'unsafe_distance_s': None if unsafe is None else unsafe.longest_s}, passed))
    return tuple(found)


class RuleMeasure(NamedTuple):
    """
    A measure of how a vehicle kept a traffic rule.

    :param unit: as tables write it.
    :param label: for people.
    :param definition: one sentence.
    :param variant: which of several usual definitions is used.
    :param reference: the point that it is measured at.
    :param is_count: whether it counts events.
    :param empty: when it has no value; empty for a measure that always has one.
    """

    unit: str
    label: str
    definition: str
    variant: str
    reference: str
    is_count: bool = False
    empty: str = ''


_FRONT = 'middle of the front bumper'
_SAFE = (f'Maierhofer et al. 2020, R_G1: reaction {REACTION_S:g} s, braking {BRAKING:g} m/s^2, of '
         f'the leader {LEADER_BRAKING:g} m/s^2; up to {RECOVERY_S:g} s after a cut-in do not '
         'count; each step that it is below counts in full')
_NO_LEADER = 'it followed no leader'
RULE_MEASURES = {
    'red_lights_run': RuleMeasure(
        '1', 'Red lights run', 'times that it drove over the line of a light that was red',
        'the stop line, or else the end of the lanelet; red and red-yellow, not yellow', _FRONT,
        is_count=True),
    'stop_lines_run': RuleMeasure(
        '1', 'Stop signs run', 'times that it drove over the line of a stop sign without a halt',
        f'a halt is a speed below {STANDING:g} m/s at most {SIGN_REACH:g} m before the stop line, '
        'or else the end of the lanelet; a light that is on overrules the sign', _FRONT,
        is_count=True),
    'unsafe_distance_share': RuleMeasure(
        '1', 'Share of the time with a leader below the safe distance',
        'share of the steps with a leader at which the gap to it was below the safe distance',
        _SAFE, 'footprints, bumper to bumper', empty=_NO_LEADER),
    'unsafe_distance_s': RuleMeasure(
        's', 'Longest time below the safe distance',
        'longest time without a pause in which the gap to its leader was below the safe distance',
        _SAFE, 'footprints, bumper to bumper', empty=_NO_LEADER),
}
