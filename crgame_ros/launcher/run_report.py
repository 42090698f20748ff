# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The report of a run that has just ended."""

from collections.abc import Callable
import time
from typing import TYPE_CHECKING

from crgame_ros.errors import CrgameError
from crgame_ros.recording.progress import Progress

if TYPE_CHECKING:  # It takes a second to import.
    from crgame_ros.analysis.runs.run import Run
    from crgame_ros.recording.finish import FinishedRecording


def write_run_report(finished: 'FinishedRecording', say: Callable[[str], object],
                     progress: bool = True) -> 'Run | None':
    """
    Write the report of a run beside its recording, and return the run with its measures.

    A failure is only reported, because it must not harm the run.

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
