# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Every metric of CRG table I, computed cycle by cycle; `docs/timing.md` defines each of them.

The table of the paper contradicts itself, so the definitions are the project's own. All errors
refer to the original anchor t_0: the time dropped by drift resets is added back.
"""

from bisect import bisect_left
from dataclasses import dataclass
from itertools import accumulate
import math

from crgame_ros.errors import CrgameError, InputError
import numpy as np
from numpy.typing import NDArray

LOWEST_S = 1e-8
HIGHEST_S = 1e3
BINS_PER_DECADE = 100
# A run below this real-time ratio is too slow for people and planners.
SLOW = 0.95


def slowness(ratio: float) -> str | None:
    """Return what is said of a run with this real-time ratio; None if it is fast enough."""
    return None if ratio >= SLOW else (
        f'slower than real time (ratio {ratio:.2f}): the machine is too busy or too slow for it')


class LogHistogram:
    """
    Counts of durations in bins of equal ratio, 100 per decade from 10 ns to 1000 s.

    A quantile is off by at most half a bin, 1.2 %; shorter or longer durations count in the first
    or last bin. The extremes are kept exactly.
    """

    _decades = round(math.log10(HIGHEST_S / LOWEST_S))
    _edges = np.geomspace(LOWEST_S, HIGHEST_S, _decades * BINS_PER_DECADE + 1)

    def __init__(self) -> None:
        self._counts = [0] * (len(self._edges) + 1)
        self._total = 0
        self._least = math.inf
        self._greatest = -math.inf

    def add_all(self, values_s: NDArray[np.float64]) -> None:
        """Count many durations (R) [s]."""
        if not len(values_s):
            return
        bins = np.searchsorted(self._edges, values_s, side='right')
        for index, count in zip(*np.unique(bins, return_counts=True), strict=True):
            self._counts[index] += int(count)
        self._total += len(values_s)
        self._least = min(self._least, float(values_s.min()))
        self._greatest = max(self._greatest, float(values_s.max()))

    def quantile(self, fraction: float) -> float:
        """
        Find the smallest duration that a share of all durations does not exceed.

        :param fraction: the share in (0, 1].
        :return: the duration [s], within 1.2 % of the exact one; 0 if none was counted.
        """
        if not self._total:
            return 0.0
        wanted = math.ceil(fraction * self._total)
        index = bisect_left(list(accumulate(self._counts)), wanted)
        return min(max(self._middle(index), self._least), self._greatest)

    def _middle(self, index: int) -> float:
        if index == 0:
            return self._least
        if index == len(self._edges):
            return self._greatest
        return math.sqrt(self._edges[index - 1] * self._edges[index])


ROW_COLUMNS = ('ideal_s', 'actual_s', 'busy_s', 'dropped_s')


@dataclass(frozen=True)
class RealTimeRatio:
    """
    Simulated over wall-clock time (R_RT of CRG table I) [-].

    :param final: over the whole run.
    :param mean: mean over all steps of the ratio since the start of the run.
    :param min: smallest ratio of a single step.
    """

    final: float
    mean: float
    min: float  # noqa: A003


@dataclass(frozen=True)
class TimingSummary:
    """
    The metrics of CRG table I and further ones that explain them; symbols as in `docs/timing.md`.

    :param final_error_ms: E_f [ms]
    :param mean_step_error_ms: mean of |e_n| [ms]
    :param max_cumulative_error_ms: E_max [ms]
    :param timeout_ratio: share of cycles whose busy time exceeds the step [0..1]
    :param real_time_ratio: R_RT [-]
    :param time_efficiency: eta_t as a fraction (the paper gives it in percent) [-]
    :param precision_ratio: P_r [-]
    :param cycles: cycles seen
    :param duration_s: tau_K - tau_0 [s]
    :param rate_hz: steps per second over the run [Hz]
    :param resets: drift resets
    :param dropped_ms: time by which all resets moved the schedule [ms]
    :param catch_up_steps: cycles that began more than one step behind the schedule in force
    :param worst_lag_ms: largest lag behind the schedule in force when the cycle began [ms]
    :param step_error_p50_ms: median of |e_n| [ms]
    :param step_error_p99_ms: 99th percentile of |e_n| [ms]
    :param busy_p50_ms: median busy time [ms]
    :param busy_p99_ms: 99th percentile of the busy time [ms]
    """

    final_error_ms: float
    mean_step_error_ms: float
    max_cumulative_error_ms: float
    timeout_ratio: float
    real_time_ratio: RealTimeRatio
    time_efficiency: float
    precision_ratio: float
    cycles: int
    duration_s: float
    rate_hz: float
    resets: int
    dropped_ms: float
    catch_up_steps: int
    worst_lag_ms: float
    step_error_p50_ms: float
    step_error_p99_ms: float
    busy_p50_ms: float
    busy_p99_ms: float

    def as_dict(self) -> dict[str, object]:
        """Return the keys of `timing.json`: those of table I first, in its order."""
        values: dict[str, object] = dict(vars(self))
        values['real_time_ratio'] = dict(vars(self.real_time_ratio))
        return values


class TimingMetrics:
    """
    The metrics of one run (one epoch), accumulated in constant memory.

    All times of a cycle, `busy_s` among them, are seconds on the run's own time line: it starts
    with the run, leaves pauses out and is scaled by the real-time factor.

    :param dt_s: nominal step, which is also the budget of a cycle [s].
    :ivar cycles: number of cycles so far.
    :raises InputError: if `dt_s` is no positive number.
    """

    def __init__(self, dt_s: float) -> None:
        if not (math.isfinite(dt_s) and dt_s > 0.0):
            raise InputError(f'the step {dt_s} is no positive number', 'timing metrics',
                             'give the simulation step in seconds')
        self.dt_s = dt_s
        self.cycles = 0
        self._timeouts = 0
        self._resets = 0
        self._first = (0.0, 0.0)
        self._last = (0.0, 0.0, 0.0)
        self._step_error_sum = 0.0
        self._ratio_sum = 0.0
        self._ratio_count = 0
        self._ratio_min = math.inf
        self._max_error = 0.0
        self._worst_lag = 0.0
        self._late = 0
        self._step_errors = LogHistogram()
        self._busy = LogHistogram()

    def add_rows(self, rows: NDArray[np.float64]) -> None:
        """
        Add cycles; the result is the same however they are divided into calls.

        :param rows: (R, 4) columns as in `ROW_COLUMNS` [s], in the order of time.
        :raises InputError: if the array has another shape, a value is no number or time runs
            backwards.
        """
        if rows.ndim != 2 or rows.shape[1] != len(ROW_COLUMNS):
            raise InputError(f'timing rows have shape {rows.shape}', 'timing metrics',
                             f'give the columns {", ".join(ROW_COLUMNS)}')
        if not len(rows):
            return
        if not np.isfinite(rows).all():
            raise InputError('a time is no finite number', 'timing cycle', 'drop the row')
        ideal, actual, busy, dropped = rows.T
        scheduled = ideal - dropped
        if self.cycles:
            before = np.array(self._last)[:, np.newaxis]
        else:
            self._first = (float(scheduled[0]), float(actual[0]))
            self._worst_lag = max(0.0, float(actual[0] - ideal[0]))
            self._late = int(self._worst_lag > self.dt_s)
            before = np.empty((3, 0))
        self._add_steps(np.hstack((before, np.stack((scheduled, actual, dropped)))))
        self.cycles += len(rows)
        self._timeouts += int(np.count_nonzero(busy > self.dt_s))
        self._max_error = max(self._max_error, float(np.abs(actual - scheduled).max()))
        self._busy.add_all(busy)
        self._last = (float(scheduled[-1]), float(actual[-1]), float(dropped[-1]))

    def _add_steps(self, columns: NDArray[np.float64]) -> None:
        if columns.shape[1] < 2:
            return
        steps, intervals, drops = np.diff(columns)
        if (intervals < 0.0).any():
            raise InputError('time runs backwards between two rows', 'timing cycle',
                             'begin new metrics at each reset of the simulation')
        errors = np.abs(intervals - steps)
        self._resets += int(np.count_nonzero(drops))
        lags = columns[1, 1:] - columns[0, 1:] - columns[2, :-1]
        self._worst_lag = max(self._worst_lag, float(lags.max()))
        self._late += int(np.count_nonzero(lags > self.dt_s))
        self._step_error_sum = _running_sum(self._step_error_sum, errors)
        self._step_errors.add_all(errors)
        moved = intervals > 0.0
        if moved.any():
            self._ratio_min = min(self._ratio_min, float((steps[moved] / intervals[moved]).min()))
        elapsed = columns[1, 1:] - self._first[1]
        started = elapsed > 0.0
        ratios = (columns[0, 1:] - self._first[0])[started] / elapsed[started]
        self._ratio_sum = _running_sum(self._ratio_sum, ratios)
        self._ratio_count += len(ratios)

    def summary(self) -> TimingSummary:
        """
        Compute the metrics over all cycles so far.

        :raises CrgameError: while there are fewer than two cycles, so no step to measure.
        """
        steps = self.cycles - 1
        duration = self._last[1] - self._first[1]
        if steps < 1 or duration <= 0.0:
            raise CrgameError(f'timing metrics: {self.cycles} cycles over {duration} s are too '
                              'few to measure; let the run take two steps or more')
        scheduled = self._last[0] - self._first[0]
        final_error = abs(self._last[1] - self._last[0])
        efficiency = scheduled / duration
        return TimingSummary(
            final_error_ms=1e3 * final_error,
            mean_step_error_ms=1e3 * self._step_error_sum / steps,
            max_cumulative_error_ms=1e3 * self._max_error,
            timeout_ratio=self._timeouts / self.cycles,
            real_time_ratio=RealTimeRatio(efficiency, self._ratio_sum / self._ratio_count,
                                          self._ratio_min),
            time_efficiency=efficiency,
            precision_ratio=final_error / duration,
            cycles=self.cycles,
            duration_s=duration,
            rate_hz=steps / duration,
            resets=self._resets,
            dropped_ms=1e3 * self._last[2],
            catch_up_steps=self._late,
            worst_lag_ms=1e3 * self._worst_lag,
            step_error_p50_ms=1e3 * self._step_errors.quantile(0.5),
            step_error_p99_ms=1e3 * self._step_errors.quantile(0.99),
            busy_p50_ms=1e3 * self._busy.quantile(0.5),
            busy_p99_ms=1e3 * self._busy.quantile(0.99))


def _running_sum(start: float, values: NDArray[np.float64]) -> float:
    # Summed in order: numpy's own sum groups the values, and its last bits then differ from those
    # of other blocks.
    return float(np.cumsum(np.concatenate(([start], values)))[-1])
