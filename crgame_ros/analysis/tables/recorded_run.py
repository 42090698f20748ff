# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recording as a run to tabulate."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
import re

from crgame_ros.analysis.tables.tabulated_run import TabulatedRun
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.recording.recorded_plans import read_plans
from crgame_ros.recording.run_folder import recording_in
from crgame_ros.recording.run_record import read_run_record
from crgame_ros.recording.timing_report import timing_report

_PART_OF_SESSION = re.compile(r'run_[1-9][0-9]*')
_BAG = re.compile(r'bag(_[0-9]+|_part[0-9]+)*')


def run_name(path: Path) -> str:
    """
    Name a run by its folder, whether that is given or the recording in it.

    A later run of a session, in its `run_2`, has the session's name: its epoch is another.
    """
    path = path.resolve()
    if path.is_file():
        # What a recording without a folder of its own is called.
        path = path.with_suffix('') if not _BAG.fullmatch(path.stem) else path.parent
    if _BAG.fullmatch(path.name) and path.parent.name:
        path = path.parent
    return path.parent.name if _PART_OF_SESSION.fullmatch(path.name) else path.name


def tabulated_runs(paths: Sequence[Path], epoch: int | None,
                   progress: Callable[[str, float], object],
                   scored: bool = True) -> Iterator[TabulatedRun]:
    """
    Read runs one after the other.

    :param paths: folders of runs, or recordings.
    :param epoch: which run of each, where a recording holds several; None for the last.
    :param scored: whether vehicles are scored, which takes most of the time.
    :raises InputError: if one cannot be read, or is given twice.
    """
    ids: dict[str, Path] = {}
    taken: set[tuple[Path, int]] = set()
    for path in paths:
        bag = recording_in(path)
        run = _read(path, bag, epoch, progress)
        place = bag.resolve(), run.record.log.game.epoch
        if place in taken:
            raise InputError('this run is given twice', str(path), 'give each run once')
        taken.add(place)
        run.id, run.scored = own_id(run.id, ids), scored
        ids[run.id] = path
        yield run


def own_id(name: str, taken: Iterable[str]) -> str:
    """
    Return a run an id that no other has: folders in different places may be named alike.

    :param taken: ids of the others.
    """
    found, number = name, 1
    while found in taken:
        number += 1
        found = f'{name}~{number}'
    return found


def _read(path: Path, bag: Path, epoch: int | None,
          progress: Callable[[str, float], object]) -> TabulatedRun:
    record = read_run_record(bag, epoch, partial(progress, f'reading {path}'))
    game = record.log.game
    try:
        timing = timing_report(bag, game.epoch, record.log,
                               partial(progress, f'reading the timing of {path}'))
    except CrgameError as error:
        if record.log.cycles is not None and len(record.log.cycles.rows) > 1:
            raise
        # Of a recording without cycles there is motion, but no timing.
        timing = None
        progress(f'no timing of {path}: {error}', 1.0)
    return TabulatedRun(
        f'{run_name(path)}:{game.epoch}', record, timing,
        partial(read_plans, bag, game.epoch, partial(progress, f'reading the plans of {path}')))
