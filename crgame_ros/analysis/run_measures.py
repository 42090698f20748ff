# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The measures of `crgame measure`: how critical a run was, rules, and how people drove."""

from collections.abc import Callable, Collection
from typing import NamedTuple

from crgame_ros.analysis.behaviour.driver import DriverBehaviour, measure_behaviour
from crgame_ros.analysis.behaviour.task_events import detection_scores, DetectionScore, task_events
from crgame_ros.analysis.criticality.criticality import Criticality
from crgame_ros.analysis.criticality.recorded import measure_log
from crgame_ros.analysis.criticality.thresholds import Thresholds, USUAL
from crgame_ros.analysis.rules.vehicle_rules import measure_rules, VehicleRules
from crgame_ros.errors import InputError, short
from crgame_ros.recording.run_record import RunRecord


class RunMeasures(NamedTuple):
    """
    The measures of a run.

    :param criticality: criticality of all driven vehicles.
    :param rules: how each driven vehicle kept traffic rules, in the log's order.
    :param behaviour: how each was driven, likewise.
    :param detection: scores of each detection response task.
    """

    criticality: Criticality
    rules: tuple[VehicleRules, ...]
    behaviour: tuple[DriverBehaviour, ...]
    detection: tuple[DetectionScore, ...] = ()

    def as_dict(self) -> dict[str, object]:
        """Return the dictionary that `crgame measure --json` writes."""
        return {**self.criticality.as_dict(),
                'rules': {each.vehicle_id: each.as_dict() for each in self.rules},
                'behaviour': {each.vehicle_id: each.as_dict() for each in self.behaviour},
                **({'detection_response': [each.as_dict() for each in self.detection]}
                   if self.detection else {})}


def measure_run(record: RunRecord, thresholds: Thresholds = USUAL,
                requests: Collection[str] = (),
                critical: Callable[[float], object] = lambda _: None,
                driven: Callable[[float], object] = lambda _: None) -> RunMeasures:
    """
    Measure a run.

    :param thresholds: beyond which a value is critical.
    :param requests: names of the events that count as requests to take over an AV, as orders of
        its seat do.
    :param critical: called with the share of the criticality measured so far, 0 to 1.
    :param driven: called likewise for how people drove.
    :raises InputError: if a threshold is not positive, as `check_requests`, or if the run's
        scenario cannot be used.
    """
    thresholds.check()
    check_requests(record, requests)
    criticality = measure_log(record.log, thresholds, critical)
    return RunMeasures(criticality, measure_rules(record, criticality),
                       measure_behaviour(record, requests=requests, progress=driven),
                       tuple(detection_scores(task_events(record))))


def check_requests(record: RunRecord, requests: Collection[str], where: str = 'requests') -> None:
    """
    Refuse events that a run does not have.

    :param where: name of the option or key, for the message.
    :raises InputError: naming the events that it has.
    """
    known = [event.name for event in record.log.game.events]
    for name in requests:
        if name not in known:
            raise InputError(f'the run has no event {short(name)}', where,
                             'it has ' + (', '.join(known) or 'none'))
