# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The files of a run: their places, their list, and the contacts that they report."""

import hashlib
import json
import os
from pathlib import Path

from crgame_ros.recording.run_folder import FINISHED_MARK, run_folder

# Patterns of a run's files: its game, its recordings and the files made from them.
RUN_FILES = ('game.yaml', 'bag*', '*.xml', 'timing*.json', 'report*.html')


def run_id(folder: Path) -> str:
    """Return the id of a run on pages, which does not reveal its path."""
    return hashlib.sha256(os.fsencode(folder.resolve())).hexdigest()[:16]


def files_document(session: Path, epoch: int) -> dict[str, object]:
    """
    Return the files document.

    :param session: folder of the session.
    :param epoch: epoch of the run.
    """
    folder = run_folder(session, epoch)
    names = [path.name for kind in RUN_FILES for path in sorted(folder.glob(kind))]
    # Only the terminal of this machine shows the path.
    name = folder.relative_to(session.parent).as_posix()
    complete = (folder / FINISHED_MARK).exists()
    return {'epoch': epoch, 'run': run_id(folder), 'folder': name, 'names': names,
            'complete': complete, 'contacts': _contacts(folder) if complete else []}


def _contacts(folder: Path) -> list[dict[str, object]]:
    """Return the contacts in the timing reports of a run."""
    found: list[dict[str, object]] = []
    for path in sorted(folder.glob('timing*.json')):
        try:
            found.extend(json.loads(path.read_text()).get('contacts') or [])
        except (OSError, ValueError, AttributeError):
            # The file was moved or changed: the page then reports the contact without details.
            continue
    return found
