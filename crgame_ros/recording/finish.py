# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Completing a run's recording, and deriving the scenario and the timing report from it.

`python -m crgame_ros.recording.finish FOLDER` does it beside a graph that goes on.
"""

from collections.abc import Callable
from functools import partial
import os
from pathlib import Path
import sys

from crgame_ros.errors import CrgameError
from crgame_ros.recording.conversion import convert
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.recover import recover
from crgame_ros.recording.run_folder import bags_of, FINISHED_MARK
from crgame_ros.recording.run_log import CYCLE_TOPIC
from crgame_ros.recording.timing_report import write_timing_report

# Exit codes.
OK, FAILED, EMPTY = 0, 1, 3
# The run that goes on comes first.
_NICE = 10


def finish_run(folder: Path, say: Callable[[str], object]) -> int:
    """
    Complete the recordings of a run, and write the files that are made from them.

    :param folder: of the run.
    :param say: takes one line for people.
    :return: OK, FAILED if something could not be written, EMPTY if nothing was recorded.
    """
    code = OK
    bags = bags_of(folder)
    for bag in bags:
        code |= _attempt(partial(recover, bag), say)
    driven = [bag for bag in bags if _has_cycles(bag)]
    for bag in driven:
        # The first bag gives the run's files their names, later ones their own.
        suffix = bag.name.removeprefix(bags[0].name)
        scenario = folder / f'{bag.name}.xml' if suffix else folder
        code |= _attempt(partial(write_timing_report, bag, folder / f'timing{suffix}.json'), say)
        code |= _attempt(partial(convert, bag, scenario), say)
    if not driven:
        say(f'{folder}: nothing was recorded: the run ended before its first step')
        code = code or EMPTY
    for path in sorted(path for path in folder.iterdir() if not path.name.startswith('.')):
        say(f'  {path}')
    (folder / FINISHED_MARK).touch()
    return code


def _attempt(step: Callable[[], object], say: Callable[[str], object]) -> int:
    try:
        step()
    except (CrgameError, OSError) as error:
        say(f'error: {error}')
        return FAILED
    return OK


def _has_cycles(bag: Path) -> bool:
    try:
        with BagReader(bag) as reader:
            cycles = reader.topics.get(CYCLE_TOPIC)
            return cycles is not None and cycles.message_count > 0
    except CrgameError:
        # It is said when it is converted.
        return True


def main() -> int:
    """Finish the run in the folder that the command line names."""
    os.nice(_NICE)
    return finish_run(Path(sys.argv[1]), lambda line: print(line, flush=True))


if __name__ == '__main__':
    sys.exit(main())
