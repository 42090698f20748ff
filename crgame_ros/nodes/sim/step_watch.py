# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measuring the loop: the causes of each late step."""

from collections.abc import Callable, Sequence
import gc
from itertools import pairwise
import signal
import time
from types import FrameType

from crgame_ros.timing.late_step import (
    Causes,
    causes_of,
    LATE_S,
    longest_phase,
    NO_CAUSES,
    Phase,
    PhaseUse,
    StepConditions,
)
from crgame_ros.timing.thread_counters import (
    counts_of,
    fault_time_ns,
    RawCounts,
    stolen_between,
    ThreadCounters,
    ThreadCounts,
)

NS_PER_S = 1_000_000_000
ON_TIME: tuple[Causes, Phase | None] = (NO_CAUSES, None)


class StepWatch:
    """
    The kernel's counters of the loop's thread, read whenever a phase of its cycle begins.

    It belongs to the thread that creates it, which must be the main thread, because that gets the
    signals. The readings are evaluated only if the step turns out late.
    """

    def __init__(self) -> None:
        self._counters = ThreadCounters()
        self._fault_ns = fault_time_ns()
        self._phases: list[Phase] = []
        self._counts: list[RawCounts] = []
        self._collected_ns: list[int] = []
        self._collecting_since_ns = 0
        self._collected_so_far_ns = 0
        self._continued = False
        self._stolen = self._counters.stolen()
        # The previous handler of the signal.
        self._before: Callable[[int, FrameType | None], object] | int | None = None

    def __enter__(self) -> 'StepWatch':
        """Start observing garbage collections and the signal that ends a stop."""
        gc.callbacks.append(self._on_collection)
        self._before = signal.signal(signal.SIGCONT, self._on_continued)
        self.begin()
        return self

    def __exit__(self, *_: object) -> None:
        """Restore the process's handlers."""
        gc.callbacks.remove(self._on_collection)
        signal.signal(signal.SIGCONT, self._before)

    def close(self) -> None:
        """Stop reading the counters."""
        self._counters.close()

    @property
    def tells_waiting(self) -> bool:
        """Return whether this kernel counts how long a thread waits for a processor."""
        return self._counters.tells_waiting

    def begin(self) -> None:
        """Start afresh: the time until now, such as a pause, belongs to no step."""
        self._phases.clear()
        self._counts.clear()
        self._collected_ns.clear()
        self._continued = False
        self._stolen = self._counters.stolen()
        self.mark(Phase.INPUTS)

    def mark(self, phase: Phase) -> None:
        """Note that a phase begins, and the one before it ends."""
        self._phases.append(phase)
        self._counts.append(self._counters.read())
        self._collected_ns.append(self._collected_so_far_ns)
        if phase is Phase.SERVICES:
            self._stolen = self._counters.stolen()

    def explain(self, due_ns: int, late_s: float, factor: float) -> tuple[Causes, Phase | None]:
        """
        Return why the cycle whose first phase was marked last is late, and discard the one before.

        :param due_ns: when it should have begun, on the monotonic clock [ns]
        :param late_s: its step error e_n, on the run's time line [s]
        :param factor: that time line's seconds to one of the clock.
        :return: the causes, on the run's time line [s], and in which phase most time was lost;
            `ON_TIME` if it is not late
        """
        found = self._explained(due_ns, late_s, factor) if late_s > LATE_S else ON_TIME
        for values in (self._phases, self._counts, self._collected_ns):
            del values[:-1]
        self._continued = False
        return found

    def _explained(self, due_ns: int, late_s: float, factor: float) -> tuple[Causes, Phase]:
        uses = self._uses(due_ns)
        stolen = self._counters.stolen()
        causes = causes_of(uses, late_s / factor * NS_PER_S, StepConditions(
            stolen_between(self._stolen, stolen), self._continued, self._fault_ns))
        self._stolen = stolen
        return Causes(*(time_ns / NS_PER_S * factor for time_ns in causes)), longest_phase(uses)

    def _uses(self, due_ns: int) -> list[PhaseUse]:
        """Return the phases of the cycle before."""
        counts = [counts_of(raw) for raw in self._counts]
        asleep_ns = self._asleep_ns(counts)
        uses = []
        for phase, before, after, collected in zip(
                self._phases, counts, counts[1:], pairwise(self._collected_ns), strict=False):
            lasted_ns = after.wall_ns - before.wall_ns
            waited_ns = None if before.waited_ns is None or after.waited_ns is None \
                else after.waited_ns - before.waited_ns
            computed_ns = after.computed_ns - before.computed_ns
            if phase is Phase.WAIT:
                lasted_ns = max(0, after.wall_ns - max(due_ns, before.wall_ns))
            elif waited_ns is not None:
                # The kernel may count late in one phase, but not in all of them.
                slept_ns = min(asleep_ns, max(0, lasted_ns - waited_ns - computed_ns))
                computed_ns = lasted_ns - waited_ns - slept_ns
                asleep_ns -= slept_ns
            uses.append(PhaseUse(
                phase, lasted_ns, computed_ns, waited_ns, collected[1] - collected[0],
                after.minor_faults - before.minor_faults,
                after.major_faults - before.major_faults))
        return uses

    def _asleep_ns(self, counts: Sequence[ThreadCounts]) -> int:
        """
        Return how long the thread slept outside its wait [ns].

        Its processor time is exact when it was put on a processor: after the wait before this
        cycle, and after the wait in it, unless there was no time for one.
        """
        last = len(counts) - 1
        while last and self._phases[last - 1] is not Phase.WAIT:
            last -= 1
        if last and counts[last].runs > counts[last - 1].runs:
            end, last = counts[last].computed_ns, last - 1
        else:
            end, last = time.thread_time_ns(), len(counts) - 1
        first = counts[0]
        waited_ns = (counts[last].waited_ns or 0) - (first.waited_ns or 0)
        return max(0, counts[last].wall_ns - first.wall_ns - waited_ns - (end - first.computed_ns))

    def _on_collection(self, phase: str, _info: dict[str, int]) -> None:
        now_ns = time.monotonic_ns()
        if phase == 'start':
            self._collecting_since_ns = now_ns
        else:
            self._collected_so_far_ns += now_ns - self._collecting_since_ns

    def _on_continued(self, number: int, frame: FrameType | None) -> None:
        self._continued = True
        if callable(self._before):
            self._before(number, frame)
