# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the files of a run are, which are there, and what they say of its contacts."""

import hashlib
import json
import os
from pathlib import Path
from typing import Any

from crgame_ros.recording.run_folder import FINISHED_MARK, run_folder

# Of a run: its game and recordings, and what is made from them.
RUN_FILES = ('game.yaml', 'bag*', '*.xml', 'timing*.json', 'report*.html')


def run_id(folder: Path) -> str:
    """Return the name by which pages know a run; it says nothing of where it is."""
    return hashlib.sha256(os.fsencode(folder.resolve())).hexdigest()[:16]


def files_document(session: Path, epoch: int) -> dict[str, Any]:
    """
    Return the files document.

    :param session: folder of the session.
    :param epoch: of the run.
    """
    folder = run_folder(session, epoch)
    names = [path.name for kind in RUN_FILES for path in sorted(folder.glob(kind))]
    # Where it lies on this machine is for those at its terminal.
    name = folder.relative_to(session.parent).as_posix()
    complete = (folder / FINISHED_MARK).exists()
    return {'epoch': epoch, 'run': run_id(folder), 'folder': name, 'names': names,
            'complete': complete, 'contacts': _contacts(folder) if complete else []}


def _contacts(folder: Path) -> list[dict[str, Any]]:
    """Return the contacts as the timing reports of a run name them."""
    found: list[dict[str, Any]] = []
    for path in sorted(folder.glob('timing*.json')):
        try:
            found.extend(json.loads(path.read_text()).get('contacts') or [])
        except (OSError, ValueError, AttributeError):
            # Somebody has moved or changed it: the page then says that they touched, and no more.
            continue
    return found
