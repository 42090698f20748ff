# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A process that finishes a run beside a graph that goes on.

`python -m crgame_ros.launcher.finish_process FOLDER [--no-report]`
"""

import os
from pathlib import Path
import sys

from crgame_ros.launcher.run_report import write_run_report
from crgame_ros.recording.finish import finish_run, FinishedRecording

# The run that goes on has priority.
_NICE = 10
NO_REPORT = '--no-report'


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
