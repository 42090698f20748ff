# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shows the progress of a search: its parts, and how long the rest takes."""

from crgame_ros.evaluation.progress import duration_text, ProgressDisplay
from crgame_ros.search.trials import Outcome

# The time that a search takes is stated after so many runs; to choose variants takes longer, the
# more is known.
_STATED_AFTER, _MORE = 24, 1.25


class SearchProgress(ProgressDisplay):
    """
    The display of a search's progress.

    :param budget: number of runs.
    """

    def __init__(self, budget: int) -> None:
        super().__init__()
        self._budget = budget
        self._done = self._new = self._failures = self._excused = self._unknown = 0
        self._stated = False

    def began(self, part: str, runs: int) -> None:
        """Tell that a part of the search begins."""
        self._print(f'{part}: {runs} runs')

    def ended(self, outcome: Outcome, is_new: bool) -> None:
        """Count an outcome."""
        now_s = self._clock()
        if self._begin_s is None and is_new:
            # The first run waited for the workers.
            self._begin_s = now_s
        self._done += 1
        self._new += is_new
        self._failures += outcome.is_failure
        self._excused += bool(outcome.excused)
        if not outcome.is_known:
            self._unknown += 1
            if self._unknown <= 5:
                self._print(f'{outcome.status}: {dict(outcome.variant)}: {outcome.reason}')
        if not self._stated and self._new == _STATED_AFTER and self._left_s(now_s) > 0.0:
            self._stated = True
            stated = duration_text(_MORE * self._left_s(now_s))
            self._print(f'{self._budget} runs: about {stated} to go')
        if self._is_due(now_s):
            self._told_s = now_s
            self._write(self._line(now_s), last=False)

    def close(self) -> None:
        """Write the last line."""
        self._write(self._line(self._clock()), last=True)

    def _left_s(self, now_s: float) -> float:
        passed_s = now_s - (now_s if self._begin_s is None else self._begin_s)
        return passed_s / max(1, self._new - 1) * (self._budget - self._done)

    def _line(self, now_s: float) -> str:
        left_s = self._left_s(now_s)
        left = f', {duration_text(left_s)} left' if left_s > 0.0 else ''
        excused = f', {self._excused} more not to blame' if self._excused else ''
        return (f'{self._done} of {self._budget} runs, {self._failures} failures{excused}'
                f'{left}')
