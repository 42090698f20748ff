# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the files of each run of a session are."""

from pathlib import Path
import re

from crgame_ros.recording.metadata import METADATA_FILE

# In a folder in which there is nothing more to come, whether or not all could be written.
FINISHED_MARK = '.finished'
# How a recorder that was started again names its folder.
_PART = re.compile(r'_part([1-9][0-9]*)$')
_LATER = re.compile(r'run_([1-9][0-9]*)')


def run_folder(session: Path, epoch: int) -> Path:
    """
    Return the folder of a run: that of the session for the first one, run_2, run_3, … in it later.

    :param epoch: counts resets.
    """
    return session if epoch == 0 else session / f'run_{epoch + 1}'


def run_folders(session: Path) -> list[Path]:
    """Find the folders of all runs of a session, in the order in which they were run."""
    later = [(int(found[1]), path) for path in session.iterdir()
             if (found := _LATER.fullmatch(path.name)) and path.is_dir()]
    return [session, *(path for _, path in sorted(later))]


def recording_in(path: Path) -> Path:
    """Choose the recording in the folder of a run; a recording is given as it is."""
    inside = path / 'bag'
    return inside if inside.is_dir() and not (path / METADATA_FILE).exists() else path


def folder_name(path: Path) -> str:
    """Name a run by its folder; a recording in one is named by that."""
    whole = path.resolve()
    return whole.parent.name if whole.name.startswith('bag') and whole.parent.name else whole.name


def bags_of(folder: Path) -> list[Path]:
    """Find a run's recordings in their order: several where the recorder was started again."""
    return sorted((path for path in folder.glob('bag*') if path.is_dir()), key=_order)


def parts_of(bag: Path) -> list[Path]:
    """
    Return a recording and those in which it was continued: `bag`, `bag_part2` and so on.

    :param bag: the first of them; any other is given alone.
    """
    stem = _PART.sub('', bag.name)
    family = sorted((path for path in bag.parent.glob(f'{stem}*')
                     if path.is_dir() and _PART.sub('', path.name) == stem), key=_order)
    return family if family[:1] == [bag] else [bag]


def _order(path: Path) -> tuple[str, int]:
    part = _PART.search(path.name)
    return _PART.sub('', path.name), int(part[1]) if part else 1
