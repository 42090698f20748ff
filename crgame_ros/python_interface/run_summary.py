# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What came of an offline run, as `crgame offline` prints it."""

from typing import Any

from crgame_ros.simulation.contacts import contacts_of
from crgame_ros.simulation.offline import OfflineResult


def run_summary(result: OfflineResult, wall_s: float) -> dict[str, Any]:
    """
    Return what came of a run, as JSON has it.

    :param wall_s: how long it took [s]
    """
    simulated_s = (len(result.vehicle_states) - 1) * result.setup.scheduler.dt_s
    return {
        'scenario': result.setup.loaded.benchmark_id, 'simulated_s': round(simulated_s, 6),
        'wall_s': round(wall_s, 3), 'state_hash': result.state_hash,
        'planners': {
            av_id: {'accepted_ratio': round(record.accepted_ratio, 4),
                    'requests': record.counters.requests, 'accepted': record.counters.accepted,
                    'refused': record.counters.refused,
                    'fallbacks': record.statistics.fallbacks,
                    'reasons': dict(record.statistics.reasons),
                    **({} if record.tracking is None else {'worst_tracking_errors': {
                        key: round(value, 4) for key, value in {
                            'lane': record.lane_error or 0.0,
                            **record.tracking._asdict()}.items()}})}
            for av_id, record in result.planners.items()},
        'events': [{'name': event.name, 'n': event.n, 'k': event.k, 'by': event.by}
                   for event in result.fired],
        'violations': [{'vehicle': item.vehicle_id, 'n': item.n, 'hit': list(item.hit),
                        'off_road': item.off_road}
                       for item in result.violations if not item.is_valid],
        'stop': None if result.stop is None else {
            'vehicle': result.stop.vehicle_id, 'violation_n': result.stop.n,
            'stop_n': len(result.vehicle_states) - 1},
        'contacts': [item.as_dict() for item in contacts_of(result)]}
