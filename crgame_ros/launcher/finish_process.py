# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A process that finishes a run beside a graph that goes on.

`python -m crgame_ros.launcher.finish_process FOLDER [--no-report]`
"""

from collections.abc import Callable
import os
from pathlib import Path
import sys
import time
from typing import TYPE_CHECKING

from crgame_ros.errors import CrgameError
from crgame_ros.recording.finish import finish_run, FinishedRecording
from crgame_ros.recording.progress import Progress

if TYPE_CHECKING:
    from crgame_ros.analysis.runs.run import Run

# The run that goes on has priority.
_NICE = 10
NO_REPORT = '--no-report'


def write_run_report(finished: 'FinishedRecording', say: Callable[[str], object],
                     progress: bool = True) -> 'Run | None':
    """
    Write the report of a run beside its recording, and return the run with its measures.

    A failure is only reported, because it must not harm the run.

    :param say: prints one line.
    :param progress: whether to report progress where it takes long.
    """
    folder = finished.bag.parent
    path = folder / f'report{finished.suffix}.html'
    say(f'writing {path} …')
    began_s = time.monotonic()
    # They take some time to import.
    from crgame_ros.analysis.report.file import write_report
    from crgame_ros.analysis.runs.run import Run
    watch = Progress(say).tell if progress else lambda _what, _share: None
    try:
        run = Run(folder.resolve().name, bag=finished.bag, log=finished.log,
                  timing=finished.timing, scoring='drives', progress=watch)
        write_report([run], path, driven_here=True)
    except (CrgameError, OSError) as error:
        say(f'error: no report: {error}')
        return None
    except Exception as error:
        say(f'error: no report: {type(error).__name__}: {error}')
        return None
    say(f'  {path} ({time.monotonic() - began_s:.1f} s)')
    return run


def main() -> int:
    """Finish the run in the folder that the command line names."""
    os.nice(_NICE)
    finished: list[FinishedRecording] = []
    # The output is read after the end of this process.
    code = finish_run(Path(sys.argv[1]), _print, progress=False, finished=finished.append)
    if NO_REPORT not in sys.argv[2:]:
        for each in finished:
            write_run_report(each, _print, progress=False)
    return code


def _print(line: str) -> None:
    print(line, flush=True)


if __name__ == '__main__':
    sys.exit(main())
