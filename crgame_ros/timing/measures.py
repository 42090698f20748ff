# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the numbers on the clock in `timing.json` are, for tables, reports and studies."""

from collections.abc import Mapping
from typing import Any

from crgame_ros.measures import Measure


def _of(unit: str, label: str, definition: str, better: int = -1,
        is_count: bool = False) -> Measure:
    return Measure(unit, definition, 'as docs/timing.md defines it', label=label, better=better,
                   is_count=is_count)


# By their keys; `real_time_ratio` has three.
TIMING_MEASURES = {
    'final_error_ms': _of('ms', 'Final error', 'final timing error E_f'),
    'mean_step_error_ms': _of('ms', 'Mean step error', 'mean of |e_n|, the error of a step'),
    'max_cumulative_error_ms': _of(
        'ms', 'Greatest cumulative error', 'greatest cumulative error E_max'),
    'timeout_ratio': _of(
        '1', 'Cycles that took longer than a step', 'share of cycles busier than a step'),
    'time_efficiency': _of('1', 'Time efficiency', 'time efficiency eta_t, as a fraction', 1),
    'precision_ratio': _of('1', 'Precision ratio', 'precision ratio P_r'),
    'duration_s': _of('s', 'Duration', 'measured duration, without pauses and scaled by the '
                      'real-time factor', 0),
    'rate_hz': _of('Hz', 'Rate', 'simulation steps per second', 0),
    'dropped_ms': _of('ms', 'Dropped by drift resets',
                      'time by which drift resets moved the schedule'),
    'worst_lag_ms': _of('ms', 'Worst lag', 'greatest lag behind the schedule in force'),
    'step_error_p99_ms': _of('ms', 'Step error, 99th percentile', '99th percentile of |e_n|'),
    'busy_p50_ms': _of('ms', 'Busy time, median', 'median busy time of a cycle'),
    'busy_p99_ms': _of('ms', 'Busy time, 99th percentile', '99th percentile of the busy time'),
    'real_time_ratio_final': _of(
        '1', 'Real-time ratio', 'simulated over wall time, over the whole run', 1),
    'real_time_ratio_mean': _of(
        '1', 'Real-time ratio, mean', 'simulated over wall time, mean over all steps', 1),
    'real_time_ratio_min': _of(
        '1', 'Real-time ratio, least', 'simulated over wall time, least of a step', 1),
    'cycles': _of('1', 'Cycles', 'cycles that were recorded', 0, True),
    'gaps': _of('1', 'Cycles not recorded', 'cycles that were lost', is_count=True),
    'resets': _of('1', 'Drift resets', 'drift resets', is_count=True),
    'catch_up_steps': _of(
        '1', 'Steps that were caught up', 'cycles more than a step late', is_count=True)}


def in_seconds(key: str) -> tuple[str, float]:
    """Return the name of a number in SI units, as in tables, and the factor to it."""
    return (f'{key.removesuffix("_ms")}_s', 1e-3) if key.endswith('_ms') else (key, 1)


def timing_values(report: Mapping[str, Any]) -> dict[str, float]:
    """Return the value of each measure in the content of `timing.json`."""
    values = {**report, **{f'real_time_ratio_{key}': ratio
                           for key, ratio in report['real_time_ratio'].items()}}
    return {key: values[key] for key in TIMING_MEASURES}
