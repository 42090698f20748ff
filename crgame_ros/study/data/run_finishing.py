# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings that nobody finished: completed where nobody writes them any more."""

from collections.abc import Callable
import fcntl
from pathlib import Path

from crgame_ros.recording.finish import finish_run
from crgame_ros.recording.metadata import METADATA_FILE
from crgame_ros.recording.run_folder import bags_of, FINISHED_MARK
from crgame_ros.study.session_journal import JOURNAL


def session_goes_on(participant: Path) -> bool:
    """Return whether a process has a participant's session open."""
    try:
        with (participant / JOURNAL).open('rb') as stream:
            # Shared and let go of at once: who opens the session now is not refused.
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
            fcntl.flock(stream, fcntl.LOCK_UN)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def finished_recording(folder: Path, participant: Path, say: Callable[[str], object]) -> str:
    """
    See that the recording of a run is complete; finish it if whoever wrote it has been killed.

    :param folder: of the run.
    :param participant: folder of who drove.
    :param say: takes one line for people.
    :return: why it cannot be read; empty if it can.
    """
    if not folder.is_dir() or not bags_of(folder):
        return 'the recording is missing'
    closed = all((bag / METADATA_FILE).is_file() for bag in bags_of(folder))
    derived = any(folder.glob('*.xml')) and any(folder.glob('timing*.json'))
    if (folder / FINISHED_MARK).exists() or closed and derived:
        return ''
    if session_goes_on(participant):
        # What is derived from a closed recording is written later; measures need none of it.
        return '' if closed else 'the recording is not finished yet'
    say(f'{folder}: finishing what was left unfinished')
    finish_run(folder, lambda line: say(line) if line.startswith('error') else None)
    return ''
