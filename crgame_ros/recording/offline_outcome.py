# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Computes an offline run's entries of `timing.json`: plans, violations and contacts."""

from typing import Any

from crgame_ros.recording.timing_report import PLAN_COUNTS, spread_of
from crgame_ros.simulation.contacts import contacts_of
from crgame_ros.simulation.offline import OfflineResult, PlannerRecord


def offline_outcome(result: OfflineResult) -> dict[str, Any]:
    """Return the entries `planners`, `drivability` and `contacts`, as `timing_report` does."""
    violations = _violations(result)
    return {'planners': planner_entries(result),
            'drivability': {'violations': len(violations), 'list': violations},
            'contacts': [item.as_dict() for item in contacts_of(result)],
            'notices': list(result.setup.notices)}


def planner_entries(result: OfflineResult) -> dict[str, dict[str, Any]]:
    """
    Return the entry of each AV's planner.

    A planner answers after a stated number of steps, so there is no latency to measure.
    """
    return {av: _entry(record) for av, record in result.planners.items()}


def _entry(record: PlannerRecord) -> dict[str, Any]:
    counters, statistics = record.counters, record.statistics
    tracking = None
    if record.tracking is not None:
        tracking = dict(record.tracking._asdict())
        if record.lane_error is not None:
            tracking['lane'] = record.lane_error
    return {
        **{name: getattr(counters, name) for name in PLAN_COUNTS},
        'plans': statistics.plans, 'fallback': statistics.fallbacks,
        'fallback_reasons': dict(statistics.reasons) or None,
        'last_refusal': counters.last_refusal or None,
        'plan_time_ms': spread_of([1e3 * each for each in statistics.durations_s]),
        'latency_ms': None, 'first_latency_ms': None, 'age_ms': None,
        'worst_tracking_errors': tracking}


def _violations(result: OfflineResult) -> list[dict[str, Any]]:
    """Return the violations by their beginnings, in order."""
    found: list[dict[str, Any]] = []
    lasting: dict[str, set[str]] = {}
    for verdict in result.violations:
        violated = set(verdict.faults)
        found += [{'n': verdict.n, 'vehicle': verdict.vehicle_id, 'what': what}
                  for what in sorted(violated - lasting.get(verdict.vehicle_id, set()))]
        lasting[verdict.vehicle_id] = violated
    return found
