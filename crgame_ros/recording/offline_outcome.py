# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Computes an offline run's entries of `timing.json`: plans, violations and contacts."""

from crgame_ros.recording.plan_outcome import plans_of_result
from crgame_ros.simulation.contacts import contacts_of
from crgame_ros.simulation.offline import OfflineResult


def offline_outcome(result: OfflineResult) -> dict[str, object]:
    """Return the entries `planners`, `drivability` and `contacts`, as `timing_report` does."""
    violations = _violations(result)
    return {'planners': {av: each.as_dict() for av, each in plans_of_result(result).items()},
            'drivability': {'violations': len(violations), 'list': violations},
            'contacts': [item.as_dict() for item in contacts_of(result)],
            'notices': list(result.setup.notices)}


def _violations(result: OfflineResult) -> list[dict[str, object]]:
    """Return the violations by their beginnings, in order."""
    found: list[dict[str, object]] = []
    lasting: dict[str, set[str]] = {}
    for verdict in result.violations:
        violated = set(verdict.faults)
        found += [{'n': verdict.n, 'vehicle': verdict.vehicle_id, 'what': what}
                  for what in sorted(violated - lasting.get(verdict.vehicle_id, set()))]
        lasting[verdict.vehicle_id] = violated
    return found
