# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The late steps of a run: how many, by which cause, and the worst of them in words."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
import heapq

from crgame_ros.timing.cycle_rows import CycleTable
from crgame_ros.timing.late_step import (
    CAUSE_WORDS,
    Causes,
    FROM_OUTSIDE,
    LATE_S,
    Phase,
    PHASE_WORDS,
    UNEXPLAINED,
)
import numpy as np

# Number of worst steps kept. A cause below this share of a step's lateness is not mentioned.
WORST = 10
_WORTH_A_WORD = 0.02
_MS = 1e3
_PHASES = frozenset(map(int, Phase))


@dataclass(frozen=True)
class LateStep:
    """
    A step that began late.

    :param n: simulation step.
    :param at_s: its start, on the run's time line [s]
    :param late_s: its step error e_n [s]
    :param causes: the error split by cause [s]
    :param during: phase in which most time was lost; None where it is unknown.
    :param reset: whether it moved the schedule.
    """

    n: int
    at_s: float
    late_s: float
    causes: Causes
    during: Phase | None
    reset: bool

    @property
    def split_s(self) -> Mapping[str, float]:
        """Return the time by cause, and the unexplained time; their sum is the lateness [s]."""
        return {**self.causes._asdict(), UNEXPLAINED: max(0.0, self.late_s - sum(self.causes))}

    @property
    def main_cause(self) -> str:
        """Return the greatest cause."""
        split = self.split_s
        return max(split, key=lambda cause: split[cause])

    @property
    def why(self) -> str:
        """Return the causes in words, the greatest first."""
        parts = sorted(self.split_s.items(), key=lambda item: -item[1])
        return ', '.join(f'{_MS * time_s:.1f} ms {CAUSE_WORDS[cause]}' for cause, time_s in parts
                         if time_s > _WORTH_A_WORD * self.late_s)

    def __str__(self) -> str:
        """Return a description in one line."""
        during = '' if self.during is None else f' while {PHASE_WORDS[self.during]}'
        moved = '; the schedule was moved' if self.reset else ''
        return (f'{_MS * self.late_s:.1f} ms late at {self.at_s:.2f} s (n = {self.n}){during}: '
                f'{self.why}{moved}')

    def as_dict(self) -> dict[str, object]:
        """Return an entry of `timing.json`."""
        return {'n': self.n, 'at_s': self.at_s, 'late_ms': _MS * self.late_s,
                'cause': self.main_cause,
                'during': None if self.during is None else self.during.name.lower(),
                'reset': self.reset,
                'causes_ms': {cause: _MS * time_s for cause, time_s in self.split_s.items()},
                'text': str(self)}


class LateSteps:
    """The late steps of one run, collected in constant memory from its cycles as they come."""

    def __init__(self) -> None:
        self.count = 0
        self.late_s = 0.0
        self.by_cause_s = dict.fromkeys((*Causes._fields, UNEXPLAINED), 0.0)
        self._steps_by_cause: Counter[str] = Counter()
        self._resets_by_cause: Counter[str] = Counter()
        self._resets: float | None = None
        self._told = True
        # Steps of equal lateness keep the order in which they came.
        self._worst: list[tuple[float, int, LateStep]] = []

    @property
    def worst(self) -> list[LateStep]:
        """Return the worst steps, the greatest lateness first."""
        return [step for _, _, step in sorted(self._worst, reverse=True)]

    def add_table(self, table: CycleTable) -> None:
        """Add cycles, in the order of time."""
        late_rows = table.late_rows()
        if late_rows is None or not len(table.rows):
            self._told &= late_rows is not None
            return
        errors, resets = table.column('step_error_s'), table.column('resets')
        moved = np.diff(resets, prepend=resets[0] if self._resets is None else self._resets) > 0
        self._resets = float(resets[-1])
        starts = table.column('actual_s')
        # Messages of other senders may hold values that are no numbers.
        told = np.isfinite(errors) & np.isfinite(starts) & np.isfinite(late_rows).all(axis=1)
        for row in np.flatnonzero(told & (errors > LATE_S)).tolist():
            *causes, phase = late_rows[row].tolist()
            self._add(LateStep(
                int(table.column('n')[row]), float(starts[row]), float(errors[row]),
                Causes(*causes), Phase(int(phase)) if phase in _PHASES else None,
                bool(moved[row])))

    def _add(self, step: LateStep) -> None:
        self.count += 1
        self.late_s += step.late_s
        for cause, time_s in step.split_s.items():
            self.by_cause_s[cause] += time_s
        self._steps_by_cause[step.main_cause] += 1
        self._resets_by_cause[step.main_cause] += step.reset
        heapq.heappush(self._worst, (step.late_s, -self.count, step))
        if len(self._worst) > WORST:
            heapq.heappop(self._worst)

    def as_dict(self) -> dict[str, object] | None:
        """Return `late_steps` of `timing.json`; None where the cycles have no causes."""
        if not self._told:
            return None
        resets = self._resets_by_cause
        return {
            'threshold_ms': _MS * LATE_S, 'count': self.count, 'late_ms': _MS * self.late_s,
            'by_cause': {cause: {'ms': _MS * time_s, 'steps': self._steps_by_cause[cause],
                                 'resets': resets[cause]}
                         for cause, time_s in self.by_cause_s.items()},
            'resets_from_outside': sum(resets[cause] for cause in FROM_OUTSIDE),
            'resets_of_ours': sum(count for cause, count in resets.items()
                                  if cause not in FROM_OUTSIDE),
            'worst': [step.as_dict() for step in self.worst]}


# Keys of `late_steps` in `timing.json`.
LATE_KEYS = frozenset(LateSteps().as_dict() or ())
