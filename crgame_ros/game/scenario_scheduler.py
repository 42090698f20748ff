# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The link between simulation steps n and scenario time steps k (CRG III-A2b)."""

from dataclasses import dataclass

from crgame_ros.errors import InputError

NS_PER_S = 1_000_000_000


def replanning_period(time_step_s: float, dt_s: float) -> int:
    """
    Return the simulation steps per scenario step, N = max(1, round(Delta t_c / Delta t)) (CRG 14).

    :param time_step_s: scenario step Delta t_c [s]
    :param dt_s: requested simulation step [s]
    """
    return max(1, round(time_step_s / dt_s))


@dataclass(frozen=True)
class ScenarioScheduler:
    """
    Both time grids, as integers so that they never drift apart.

    The simulation step is Delta t_c / N exactly, even where the requested rate doesn't divide the
    scenario step; stamps are rounded down to nanoseconds from the exact quotient.

    :param time_step_ns: scenario step Delta t_c [ns]
    :param steps_per_tick: replanning period N
    :param k0: scenario time step at n = 0
    :param clock_offset_ns: simulation time at n = 0 [ns since the epoch of /clock]
    """

    time_step_ns: int
    steps_per_tick: int
    k0: int = 0
    clock_offset_ns: int = 0

    @classmethod
    def from_rate(
        cls, time_step_s: float, rate_hz: float, k0: int = 0, clock_offset_ns: int = 0,
    ) -> 'ScenarioScheduler':
        """Build the grids with N for a requested simulation rate [Hz]."""
        time_step_ns = round(time_step_s * NS_PER_S)
        if time_step_ns <= 0:
            raise InputError(f'scenario step {time_step_s} s is not positive', 'timeStepSize')
        return cls(time_step_ns, replanning_period(time_step_s, 1.0 / rate_hz), k0,
                   clock_offset_ns)

    @property
    def time_step_s(self) -> float:
        """Return the scenario step Delta t_c [s]."""
        return self.time_step_ns / NS_PER_S

    @property
    def dt_s(self) -> float:
        """Return the nominal simulation step Delta t [s]."""
        return self.time_step_ns / self.steps_per_tick / NS_PER_S

    def stamp_ns(self, n: int) -> int:
        """Return the simulation time of step n [ns]."""
        return self.clock_offset_ns + n * self.time_step_ns // self.steps_per_tick

    def k(self, n: int) -> int:
        """Return the scenario time step that step n belongs to."""
        return self.k0 + n // self.steps_per_tick

    def is_tick(self, n: int) -> bool:
        """Return whether the scenario time advances at step n."""
        return n % self.steps_per_tick == 0

    def since_tick_s(self, n: int) -> float:
        """Return the time since the scenario time last advanced [s]."""
        return (n % self.steps_per_tick) * self.dt_s

    def step_of_stamp(self, stamp_ns: int) -> int:
        """Find the simulation step nearest to a stamp [ns]; negative before the run."""
        elapsed = (stamp_ns - self.clock_offset_ns) * self.steps_per_tick
        return (2 * elapsed + self.time_step_ns) // (2 * self.time_step_ns)

    def tick_of_stamp(self, stamp_ns: int) -> int | None:
        """Find the step n of a tick from its stamp; None if the stamp is no tick's."""
        ticks, rest = divmod(stamp_ns - self.clock_offset_ns, self.time_step_ns)
        return ticks * self.steps_per_tick if rest == 0 and ticks >= 0 else None

    def steps_for(self, duration_s: float) -> int:
        """Return the number of simulation steps in a duration [s], rounded to the nearest."""
        return round(duration_s * NS_PER_S * self.steps_per_tick / self.time_step_ns)
