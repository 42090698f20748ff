# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names and finds the folders of the runs of a session, and of a study's participants."""

from itertools import count
from pathlib import Path
import re

from crgame_ros.recording.metadata import METADATA_FILE

# Marks a folder in which nothing more will be written, even if some files failed.
FINISHED_MARK = '.finished'
# The file that exists while the processes of a session are alive or after they were killed.
CLAIM = '.started'
# The recording and the game in the folder of a run.
BAG, GAME_FILE = 'bag', 'game.yaml'
# Suffix of the folder of a restarted recorder.
_PART = re.compile(r'_part([1-9][0-9]*)$')
_LATER = re.compile(r'run_([1-9][0-9]*)')
_BAG = re.compile(r'bag(_[0-9]+|_part[0-9]+)*')
# In the folder of a study: its file, and the folder with those of its participants.
STUDY_FILE, PARTICIPANTS = Path('study', 'study.yaml'), 'participants'
# Describes the tables of a folder.
PACKAGE_FILE = 'datapackage.json'


def run_folder(session: Path, epoch: int) -> Path:
    """
    Return the folder of a run: the session's for the first run, then run_2, run_3, … in it.

    :param epoch: counts resets.
    """
    return session if epoch == 0 else session / f'run_{epoch + 1}'


def run_folders(session: Path) -> list[Path]:
    """Find the folders of all runs of a session, in the order of the runs; none if it is gone."""
    if not session.is_dir():
        return []
    later = [(int(found[1]), path) for path in session.iterdir()
             if (found := _LATER.fullmatch(path.name)) and path.is_dir()]
    return [session, *(path for _, path in sorted(later))]


def participant_folder(run: Path) -> Path | None:
    """Return the folder of the study's participant who drove a run; None outside a study."""
    return next((folder for folder in run.resolve().parents if folder.parent.name == PARTICIPANTS
                 and (folder.parents[1] / STUDY_FILE).is_file()), None)


def recording_in(path: Path) -> Path:
    """Return the recording in the folder of a run; a recording itself is returned unchanged."""
    inside = path / BAG
    return inside if inside.is_dir() and not (path / METADATA_FILE).exists() else path


def folder_name(path: Path) -> str:
    """Return the name of a run's folder, also for a recording in it."""
    whole = path.resolve()
    return whole.parent.name if whole.name.startswith('bag') and whole.parent.name else whole.name


def run_name(path: Path) -> str:
    """
    Return a run's name: that of its folder, given either the folder or the recording in it.

    A later run of a session, in its `run_2`, has the session's name and another epoch.
    """
    path = path.resolve()
    if path.is_file():
        # The name of a recording without a folder of its own.
        path = path.with_suffix('') if not _BAG.fullmatch(path.stem) else path.parent
    if _BAG.fullmatch(path.name) and path.parent.name:
        path = path.parent
    return path.parent.name if _LATER.fullmatch(path.name) else path.name


def bags_of(folder: Path) -> list[Path]:
    """Find a run's recordings in order: several if the recorder was restarted."""
    return sorted((path for path in folder.glob('bag*') if path.is_dir()), key=_order)


def is_closed(run: Path) -> bool:
    """Return whether a run's last recording has been closed, so that it can be read whole."""
    bags = bags_of(run)
    return bool(bags) and (bags[-1] / METADATA_FILE).is_file()


def parts_of(bag: Path) -> list[Path]:
    """
    Return a recording and its continuations: `bag`, `bag_part2` and so on.

    :param bag: the first of them; any other is returned alone.
    """
    stem = _PART.sub('', bag.name)
    family = sorted((path for path in bag.parent.glob(f'{stem}*')
                     if path.is_dir() and _PART.sub('', path.name) == stem), key=_order)
    return family if family[:1] == [bag] else [bag]


def next_part(bag: Path) -> Path:
    """Return the first name for a continuation of a recording that is free."""
    return next(path for number in count(2)
                if not (path := bag.with_name(f'{bag.name}_part{number}')).exists())


def _order(path: Path) -> tuple[str, int]:
    part = _PART.search(path.name)
    return _PART.sub('', path.name), int(part[1]) if part else 1
