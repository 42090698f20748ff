# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the files of a run are, and which are there."""

from pathlib import Path
from typing import Any

from crgame_ros.recording.run_folder import FINISHED_MARK, run_folder

# Of a run: its game and recordings, and what is made from them.
_KINDS = ('game.yaml', 'bag*', '*.xml', 'timing*.json')


def files_document(session: Path, epoch: int) -> dict[str, Any]:
    """
    Give the files document.

    :param session: folder of the session.
    :param epoch: of the run.
    """
    folder = run_folder(session, epoch)
    names = [path.name for kind in _KINDS for path in sorted(folder.glob(kind))]
    here = Path.cwd()
    shown = folder.relative_to(here) if folder.is_relative_to(here) else folder
    return {'epoch': epoch, 'folder': str(shown), 'names': names,
            'complete': (folder / FINISHED_MARK).exists()}
