# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Completes a run's recording, and derives the scenario and the timing report from it."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple, TypeVar

from crgame_ros.errors import CrgameError
from crgame_ros.recording.conversion import convert_log, read_last_run
from crgame_ros.recording.exceptions import RunTooShortError
from crgame_ros.recording.progress import Progress
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.recorded_plans import RunReport
from crgame_ros.recording.recover import recover
from crgame_ros.recording.run_folder import bags_of, FINISHED_MARK, parts_of
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.recording.timing_report import write_timing_report
from crgame_ros.timing.cycle_rows import CYCLE_TOPIC

T = TypeVar('T')
# Exit codes.
OK, FAILED, EMPTY = 0, 1, 3
_NOTHING = 'nothing was recorded: the run ended before its first step'


class FinishedRecording(NamedTuple):
    """
    A recording whose scenario and timing report have been written.

    :param bag: its folder.
    :param suffix: of the names of derived files, empty for the first recording of a run.
    :param log: the run in it.
    :param timing: its timing report; None without one.
    """

    bag: Path
    suffix: str
    log: RunTrajectories
    timing: RunReport | None


def finish_run(folder: Path, say: Callable[[str], object], progress: bool = True,
               finished: Callable[[FinishedRecording], object] = lambda _: None) -> int:
    """
    Complete the recordings of a run, and write the files derived from them.

    :param folder: of the run.
    :param say: prints one line.
    :param progress: whether to report the progress of long work.
    :param finished: called with each readable recording once its files are written.
    :return: OK, FAILED if something could not be written, EMPTY if nothing was recorded.
    """
    code = OK
    tell: Callable[[str], object] = say if progress else lambda _: None
    bags = bags_of(folder)
    # A restarted recorder continued in another folder.
    runs = [bag for bag in bags if not any(bag in parts_of(other)[1:] for other in bags)]
    for bag in bags:
        report = _attempt(partial(recover, bag, Progress(tell, f'finishing {bag}')), say)
        # A recorder killed right after its start leaves nothing; the rest is reported below.
        if report is None and len(parts_of(bag)) == 1 and bag in runs:
            code = FAILED
    results = []
    for bag in runs:
        # The first recording's files are named after the run, later ones get a suffix.
        suffix = bag.name.removeprefix(runs[0].name)
        code_of, done = _derive(bag, suffix, say, tell)
        results.append(code_of)
        if done is not None:
            finished(done)
    if not runs:
        say(f'{folder}: {_NOTHING}')
    if set(results) <= {EMPTY}:
        code = code or EMPTY
    code |= FAILED if FAILED in results else OK
    for path in sorted(path for path in folder.iterdir() if not path.name.startswith('.')):
        say(f'  {path}')
    (folder / FINISHED_MARK).touch()
    return code


def _derive(bag: Path, suffix: str, say: Callable[[str], object],
            tell: Callable[[str], object]) -> tuple[int, FinishedRecording | None]:
    """Write one recording's timing report and scenario, which agree on its steps."""
    folder = bag.parent
    if not _has_cycles(bag):
        say(f'{folder}: {_NOTHING}')
        return EMPTY, None
    try:
        log = _attempt(partial(read_last_run, bag, Progress(tell, f'reading {bag}')), say)
    except RunTooShortError as error:
        say(f'{folder}: {error.what}')
        return EMPTY, None
    # A run that cannot become a scenario still has its timing report.
    timing = _attempt(partial(
        write_timing_report, bag, folder / f'timing{suffix}.json', log=log,
        progress=Progress(tell, f'reading the timing of {bag}')), say)
    if log is None:
        return FAILED, None
    scenario = folder / f'{bag.name}.xml' if suffix else folder
    converted = _attempt(partial(convert_log, log, bag, scenario), say)
    code = FAILED if timing is None or converted is None else OK
    return code, FinishedRecording(bag, suffix, log, timing)


def _has_cycles(bag: Path) -> bool:
    try:
        with BagReader(bag, parts=True) as reader:
            return reader.holds(CYCLE_TOPIC)
    except CrgameError:
        # The conversion reports this error.
        return True


def _attempt(step: Callable[[], T], say: Callable[[str], object]) -> T | None:
    """Return the result of a step; None if it fails, with a line about it."""
    try:
        return step()
    except RunTooShortError:
        raise
    except (CrgameError, OSError) as error:
        say(f'error: {error}')
    except Exception as error:
        # One file that cannot be written must not prevent the others.
        say(f'error: {type(error).__name__}: {error}')
    return None
