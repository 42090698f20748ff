# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the driven vehicles of a run kept traffic rules."""

from collections.abc import Mapping
from dataclasses import dataclass

from crgame_ros.analysis.criticality.criticality import Criticality
from crgame_ros.analysis.rules.passed_lines import DrivenTrack, LineRules, PassedLine
from crgame_ros.analysis.rules.safe_distance import unsafe_distance
from crgame_ros.recording.run_record import RunRecord
import numpy as np


@dataclass(frozen=True)
class VehicleRules:
    """
    How a vehicle kept traffic rules.

    :param vehicle_id: id of the vehicle.
    :param values: by the names of `MEASURES`; None where undefined.
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
