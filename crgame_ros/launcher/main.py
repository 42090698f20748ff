# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command behind `run.sh`; it can be interrupted at any moment, even while it loads."""

from collections.abc import Sequence
import os
import signal
import sys
from types import FrameType

ENDED_EARLY = 'ended before the run began'


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Run a game from the command line.

    :return: exit code: 0 at a good end, 2 for bad input, 3 where a planner drove none of its
        plans, 1 for other failures, 130 where a second signal left files unwritten.
    """
    before = signal.getsignal(signal.SIGINT)
    # A shell that starts this in the background may have set SIGINT to be ignored.
    if before is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave)
    # run.sh blocks it while Python itself starts.
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    words = sys.argv[1:] if arguments is None else arguments
    if {'--help', '-h'} & set(words):
        # Imported first, so that help and errors work in an environment without packages.
        from crgame_ros.launcher.arguments import parse_arguments
        parse_arguments(['--help'])
    from crgame_ros.launcher.interruption import print_now
    from crgame_ros.launcher.launch import launch
    from crgame_ros.processes import end_with_parent
    end_with_parent()
    signal.signal(signal.SIGINT, before)
    try:
        return launch(arguments)
    except KeyboardInterrupt:
        print_now(ENDED_EARLY)
        return 0


def _leave(_number: int, _frame: FrameType | None) -> None:
    """End at once: nothing has been created yet, and an import cannot be interrupted cleanly."""
    print(ENDED_EARLY, flush=True)
    os._exit(0)


if __name__ == '__main__':
    sys.exit(main())
