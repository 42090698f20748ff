# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The global time controller: simulation time against the wall clock (CRG III-A2a)."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from crgame_ros.errors import InputError

if TYPE_CHECKING:
    from crgame_ros.game.game import TimingSpec

NS = 1e-9
# Bounds of a run's real-time factor, in simulated seconds per second.
MIN_REAL_TIME_FACTOR = 0.1
MAX_REAL_TIME_FACTOR = 10.0


@dataclass(frozen=True, slots=True)
class Cycle:
    """
    The controller's measurements at the start of one cycle; all times on the run's own time line.

    The time line starts with the run, leaves pauses out and is scaled by the real-time factor.

    :param n: simulation step.
    :param ideal_s: scheduled start, tau*_n (CRG 11), on the present anchor [s]
    :param actual_s: measured start, tau_n [s]
    :param step_error_s: e_n (CRG 12) [s]
    :param cumulative_error_s: E_n (CRG 12), zeroed by a reset [s]
    :param dt_eff_s: Delta t_eff (CRG 13) [s]
    :param resets: drift resets so far.
    :param dropped_s: wall time by which resets moved the anchor so far [s]
    """

    n: int
    ideal_s: float
    actual_s: float
    step_error_s: float
    cumulative_error_s: float
    dt_eff_s: float
    resets: int
    dropped_s: float


class TimeController:
    """
    The schedule of cycles on the wall clock, and the errors measured against it (CRG 11-13).

    The clock is passed in: every method takes the present time of a monotonic clock [ns].

    :param spec: thresholds and switches of the mechanisms.
    :param dt_s: nominal step Delta t [s]
    :ivar real_time_factor: simulated seconds per wall second.
    """

    def __init__(self, spec: 'TimingSpec', dt_s: float) -> None:
        self._spec = spec
        self._dt_s = dt_s
        self.real_time_factor = 1.0
        self._anchor_ns = 0.0
        self._start_ns = 0
        self._error_s = 0.0
        self._carry_s = 0.0
        self.n = 0
        self.resets = 0
        self.dropped_s = 0.0

    def start(self, now_ns: int) -> None:
        """Start the schedule: t0 is now, and step 0 has begun."""
        self._anchor_ns = float(now_ns)
        self._start_ns = now_ns

    def resume(self, now_ns: int, real_time_factor: float | None = None) -> None:
        """
        Continue after a pause, or at another rate; the wall time in between doesn't count.

        Cycle n counts as begun now, with its previous lag.

        :raises InputError: if the real-time factor is out of its bounds.
        """
        if real_time_factor is not None:
            if not MIN_REAL_TIME_FACTOR <= real_time_factor <= MAX_REAL_TIME_FACTOR:
                raise InputError(
                    f'is {real_time_factor}', 'real_time_factor',
                    f'give {MIN_REAL_TIME_FACTOR} to {MAX_REAL_TIME_FACTOR}')
            self.real_time_factor = real_time_factor
        elapsed_s = self.n * self._dt_s + self._error_s
        self._anchor_ns = now_ns - elapsed_s / self.real_time_factor / NS
        self._start_ns = now_ns

    def deadline_ns(self) -> int:
        """Return the wall time at which the next cycle is due (CRG 11) [ns]."""
        step_ns = self._dt_s / self.real_time_factor / NS
        if not self._spec.pacing:
            # The naive loop waits for the length of a step and ignores the schedule.
            return int(self._start_ns + step_ns)
        return int(self._anchor_ns + (self.n + 1) * step_ns)

    def begin_cycle(self, now_ns: int, interval_s: float | None = None) -> Cycle:
        """
        Begin the next cycle: measure its interval and determine the interval to integrate.

        :param interval_s: integrate this instead, as a recorded run did [s]. The difference is
            carried over like the clipped time, until intervals are measured again.
        """
        self.n += 1
        measured_s = (now_ns - self._start_ns) * NS * self.real_time_factor
        self._start_ns = now_ns
        ideal_s = self.n * self._dt_s
        self._error_s = (now_ns - self._anchor_ns) * NS * self.real_time_factor - ideal_s
        moved_s = self._reset_if_due()
        effective_s = self._effective(measured_s - moved_s, interval_s)
        return Cycle(self.n, ideal_s + self.dropped_s, ideal_s + self.dropped_s + self._error_s,
                     measured_s - self._dt_s, self._error_s, effective_s, self.resets,
                     self.dropped_s)

    def _reset_if_due(self) -> float:
        """Move the anchor only if the lag is too large; return the time dropped [s]."""
        spec = self._spec
        if not (spec.drift_reset and abs(self._error_s) > spec.reset_threshold
                and self.n > spec.warm_up_steps):
            return 0.0
        dropped = self._error_s
        self._anchor_ns += dropped / self.real_time_factor / NS
        self.dropped_s += dropped
        self.resets += 1
        self._error_s = 0.0
        return dropped

    def _effective(self, measured_s: float, given_s: float | None) -> float:
        """Return the clipped interval (CRG 13); the clipped time is added back in later steps."""
        spec = self._spec
        if not spec.measured_interval:
            return self._dt_s if given_s is None else given_s
        wanted = measured_s + self._carry_s
        # With a bound above the nominal step, the sum could never return to n dt.
        shortest = min(spec.dt_min, 0.5 * self._dt_s)
        effective = min(max(spec.dt_max, 2.0 * self._dt_s), max(shortest, wanted)) \
            if given_s is None else given_s
        if spec.clip == 'carry':
            self._carry_s = wanted - effective
        return effective
