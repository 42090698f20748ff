# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shows an evaluation's progress: a bar on a terminal, periodic lines elsewhere."""

from collections.abc import Callable
import sys
import time

from crgame_ros.evaluation.cell import Cell
from crgame_ros.evaluation.evaluation import EvaluationTally

BAR = 24
# Period of lines without a terminal, and of the bar on a terminal [s].
PERIOD_S, BAR_PERIOD_S = 10.0, 0.2
# Beyond this number of failures, only their count is shown; the tables have them all.
TOLD_FAILURES = 20


class ProgressDisplay:
    """
    A line of progress on stderr, which is written over on a terminal, and other lines between.

    :param clock: returns the time [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._stream, self._clock = sys.stderr, clock
        self._bar = self._stream.isatty()
        self._begin_s: float | None = None
        self._told_s = clock()

    def _is_due(self, now_s: float) -> bool:
        """Return whether the line was written long enough ago."""
        return now_s - self._told_s >= (BAR_PERIOD_S if self._bar else PERIOD_S)

    def _print(self, text: str) -> None:
        clear = '\r\033[K' if self._bar else ''
        print(f'{clear}{text}', file=self._stream, flush=True)

    def _write(self, text: str, last: bool) -> None:
        """Write the line of progress."""
        if self._bar:
            print(f'\r\033[K{text}', end='\n' if last else '', file=self._stream, flush=True)
        else:
            print(text, file=self._stream, flush=True)


class EvaluationProgress(ProgressDisplay):
    """The display of an evaluation's progress."""

    _failures = 0

    def __call__(self, tally: EvaluationTally, cell: Cell | None,
                 row: dict[str, object] | None) -> None:
        """Update the display; a cell and its row are given when one has ended."""
        now_s = self._clock()
        if self._begin_s is None:
            self._begin_s = self._told_s = now_s
            self._print(f'{tally.total} cells' + (f', {tally.before} of them finished before'
                                                  if tally.before else ''))
            if not tally.threads:
                self._print('no worker is connected: waiting for one')
            if tally.dashboard:
                self._print(f'Dask shows its work at {tally.dashboard}')
        if cell is not None and row is not None and row['status'] != 'ok':
            self._fail(cell, row)
        last = tally.before + tally.done == tally.total
        if last or self._is_due(now_s):
            self._told_s = now_s
            self._write(_line(tally, now_s - self._begin_s, self._bar), last)

    def _fail(self, cell: Cell, row: dict[str, object]) -> None:
        self._failures += 1
        if self._failures <= TOLD_FAILURES:
            self._print(f'{row["status"]}: {cell.label} ({cell.key[:8]}): {row["reason"]}')
        elif self._failures == TOLD_FAILURES + 1:
            self._print('further failures are in the tables only')


def _line(tally: EvaluationTally, passed_s: float, bar: bool) -> str:
    ended = tally.before + tally.done
    share = ended / max(1, tally.total)
    filled = round(share * BAR)
    drawn = f'[{"#" * filled}{"." * (BAR - filled)}] ' if bar else ''
    speed = tally.done / passed_s if passed_s > 0.0 else 0.0
    left = ''
    if speed and ended < tally.total:
        left = f', {duration_text((tally.total - ended) / speed)} left'
    failed = f', {tally.failed} failed' if tally.failed else ''
    return f'{drawn}{ended} of {tally.total} cells, {speed:.2f} cells/s{left}{failed}'


def duration_text(time_s: float) -> str:
    """Return a time in words for people."""
    if time_s < 90.0:
        return f'{time_s:.0f} s'
    return f'{time_s / 60.0:.0f} min' if time_s < 5400.0 else f'{time_s / 3600.0:.1f} h'
