# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the files of each run of a session are."""

from pathlib import Path
import re

# In a folder in which there is nothing more to come, whether or not all could be written.
FINISHED_MARK = '.finished'
_LATER = re.compile(r'run_([1-9][0-9]*)')


def run_folder(session: Path, epoch: int) -> Path:
    """
    Give the folder of a run: that of the session for the first one, run_2, run_3, … in it later.

    :param epoch: counts resets.
    """
    return session if epoch == 0 else session / f'run_{epoch + 1}'


def run_folders(session: Path) -> list[Path]:
    """Find the folders of all runs of a session, in the order in which they were run."""
    later = [(int(found[1]), path) for path in session.iterdir()
             if (found := _LATER.fullmatch(path.name)) and path.is_dir()]
    return [session, *(path for _, path in sorted(later))]


def bags_of(folder: Path) -> list[Path]:
    """Find a run's recordings in their order: several where the recorder was started again."""
    return sorted(path for path in folder.glob('bag*') if path.is_dir())
