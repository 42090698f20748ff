# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Marks on the time line of a recorded run; a flood of one kind becomes one mark."""

from dataclasses import dataclass, replace

from crgame_ros.game.scenario_scheduler import ScenarioScheduler

# Of one kind and subject, what comes so soon after the one before is counted with it [s].
MERGED_WITHIN_S = 1.0


@dataclass(frozen=True)
class Mark:
    """
    Something that happened.

    :param n: simulation step of the first of its kind.
    :param last_n: of the last that is counted with it.
    :param kind: collision, off_road, stale_plan, refused_plan, fallback, lost_device, reset,
        trigger, stop, late, recording or gap.
    :param subject: vehicle or event of the game, empty where it concerns the run.
    :param text: for people.
    :param count: how many are counted together.
    """

    n: int
    last_n: int
    kind: str
    subject: str
    text: str
    count: int = 1


class MarkList:
    """Collects marks as a recording brings them; of one kind and subject in the order of n."""

    def __init__(self, scheduler: ScenarioScheduler) -> None:
        self._within = round(MERGED_WITHIN_S / scheduler.dt_s)
        self._marks: list[Mark] = []
        self._newest: dict[tuple[str, str], int] = {}

    def add(self, n: int, kind: str, subject: str, text: str) -> None:
        """Add a mark, or count it with the one before of its kind and subject."""
        place = self._newest.get((kind, subject))
        if place is not None and 0 <= n - self._marks[place].last_n <= self._within:
            known = self._marks[place]
            self._marks[place] = replace(known, last_n=n, count=known.count + 1)
            return
        self._newest[kind, subject] = len(self._marks)
        self._marks.append(Mark(n, n, kind, subject, text))

    def marks(self) -> tuple[Mark, ...]:
        """Return all marks in the order of n."""
        return tuple(sorted(self._marks, key=lambda mark: mark.n))
