# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Watching the loop: where the time of each late step went."""

import gc
import signal
import time
from types import FrameType
from typing import Any

from crgame_ros.timing.late_step import (
    Causes,
    causes_of,
    LATE_S,
    longest_phase,
    NO_CAUSES,
    Phase,
    PhaseUse,
    Surroundings,
)
from crgame_ros.timing.thread_counters import (
    fault_time_ns,
    stolen_between,
    ThreadCounters,
    ThreadCounts,
)

NS_PER_S = 1_000_000_000
ON_TIME: tuple[Causes, Phase | None] = (NO_CAUSES, None)


class StepWatch:
    """
    Reads what the kernel counts of the loop's thread whenever a phase of its cycle begins.

    It belongs to the thread that makes it, which must be the main one: signals come to it. What
    was read is looked at only if the step turns out late.
    """

    def __init__(self) -> None:
        self._counters = ThreadCounters()
        self._fault_ns = fault_time_ns()
        self._phases: list[Phase] = []
        self._counts: list[ThreadCounts] = []
        self._collected_ns: list[int] = []
        self._collecting_since_ns = 0
        self._collected_so_far_ns = 0
        self._continued = False
        self._stolen = self._counters.stolen()
        # Who else wants to know of the signal.
        self._before: Any = None

    def __enter__(self) -> 'StepWatch':
        """Begin to listen to collections, and to the signal that ends a stop."""
        gc.callbacks.append(self._on_collection)
        self._before = signal.signal(signal.SIGCONT, self._on_continued)
        self.begin()
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the process as it was."""
        gc.callbacks.remove(self._on_collection)
        signal.signal(signal.SIGCONT, self._before)

    def close(self) -> None:
        """Read nothing any more."""
        self._counters.close()

    @property
    def tells_waiting(self) -> bool:
        """Whether this kernel tells how long a thread waited for a processor."""
        return self._counters.tells_waiting

    def begin(self) -> None:
        """Begin anew: what has been until now, such as a pause, belongs to no step."""
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

    def explain(self, due_ns: int, late_s: float, factor: float
                ) -> tuple[Causes, Phase | None]:
        """
        Tell why a cycle is late whose first phase was marked last, and forget the one before.

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
        uses = [self._use(index, due_ns) for index in range(len(self._phases) - 1)]
        stolen = self._counters.stolen()
        causes = causes_of(uses, late_s / factor * NS_PER_S, Surroundings(
            stolen_between(self._stolen, stolen), self._continued, self._fault_ns))
        self._stolen = stolen
        return Causes(*(time_ns / NS_PER_S * factor for time_ns in causes)), longest_phase(uses)

    def _use(self, index: int, due_ns: int) -> PhaseUse:
        phase = self._phases[index]
        before, after = self._counts[index:index + 2]
        waited = (before.waited_ns, after.waited_ns)
        lasted_ns = after.wall_ns - before.wall_ns
        if phase is Phase.WAIT:
            lasted_ns = max(0, after.wall_ns - max(due_ns, before.wall_ns))
        return PhaseUse(
            phase, lasted_ns, after.computed_ns - before.computed_ns,
            None if waited[0] is None or waited[1] is None else waited[1] - waited[0],
            self._collected_ns[index + 1] - self._collected_ns[index],
            after.minor_faults - before.minor_faults, after.major_faults - before.major_faults)

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
