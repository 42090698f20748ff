# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The games of a study's drives, with every file that they are made of, as its first start had."""

from collections.abc import Mapping
import json
from pathlib import Path
import tempfile
from typing import Any

from crgame_ros.driver.source import COCKPIT
from crgame_ros.errors import InputError
from crgame_ros.evaluation.cell_scene import values_of_game
from crgame_ros.evaluation.content import ContentStore, digests_in
from crgame_ros.study.session_script import drives_of
from crgame_ros.study.study_file import StudyFile
from crgame_ros.study.trial_game import trial_game
from crgame_ros.whole_file import write_whole

DRIVES, FILES = 'drives.json', 'files'


def keep_drives(study: StudyFile, folder: Path) -> None:
    """
    Keep what people drive in, or make sure that it still is what was kept.

    `drives.json` has the game of each practice and condition; what they name (scenarios, scripts,
    maps, code of planners with what stands beside it) lies in `files/`, by digest.

    :param folder: of the study's files; is there.
    :raises InputError: if a game cannot be used, or has changed since.
    :raises OSError: if something cannot be written.
    """
    kept = folder / DRIVES
    with tempfile.TemporaryDirectory(dir=folder, prefix='.part-') as part:
        store = ContentStore(Path(part) / FILES)
        games = {name: values_of_game(trial_game(settings, COCKPIT), store)
                 for name, settings in drives_of(study)}
        now = json.loads(json.dumps(games, default=str))
        if not kept.exists():
            # Only the name of the list makes the files count.
            _replace(store.folder, folder / FILES)
            write_whole((json.dumps(now, indent=1) + '\n').encode(), kept)
            return
    before = json.loads(kept.read_text('utf-8'))
    for name, game in now.items():
        if game != before.get(name):
            raise InputError(f'{_difference(before.get(name, {}), game)} has changed since the '
                             'first participant', name, f'put it back as {kept} has it, or begin '
                             'a new study with another --out')


def _replace(new: Path, old: Path) -> None:
    """Put new files in the place of those that a start has left that did not come to its end."""
    if old.is_dir():
        for each in old.iterdir():
            each.rename(new.parent / f'old-{each.name}')
        old.rmdir()
    new.rename(old)


def _difference(before: Any, now: Any, where: str = '') -> str:
    """Name the first thing in which two games differ: a file by its name, others by their key."""
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        for key in (*now, *before):
            if before.get(key) != now.get(key):
                return _difference(before.get(key), now.get(key), f'{where}: {key}'.strip(': '))
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        return next(_difference(old, new, where)
                    for old, new in zip(before, now, strict=True) if old != new)
    if isinstance(now, str) and digests_in(now):
        return f'{where}: {now.rpartition("/")[2]}'
    return where or 'the game'
