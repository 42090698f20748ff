# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The past runs that a page may show, and the files of each."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
import hashlib
import json
import os
from pathlib import Path
import re

from crgame_ros.cockpit.page_messages import clean_text
from crgame_ros.errors import InputError
from crgame_ros.game.game import load_game
from crgame_ros.recording.metadata import METADATA_FILE
from crgame_ros.recording.run_folder import (
    BAG,
    bags_of,
    CLAIM,
    FINISHED_MARK,
    GAME_FILE,
    is_closed,
    run_folder,
    run_folders,
)

MAX_RUNS = 500
MAX_TITLE = 80
PICTURE = '.picture.svg'
_TIMES = re.compile(r'nanoseconds(?:_since_epoch)?: (\d{1,19})')
# Patterns of a run's files: its game, its recordings and the files made from them.
RUN_FILES = (GAME_FILE, 'bag*', '*.xml', 'timing*.json', 'report*.html')


@dataclass(frozen=True)
class PastRun:
    """
    A run that was recorded by this program.

    :param id: its id on pages, which does not reveal its path.
    :param session: folder of its session.
    """

    id: str  # noqa: A003
    folder: Path
    session: Path

    @property
    def name(self) -> str:
        """Return its readable name: its session, and for a later run of it also its own folder."""
        return self.folder.relative_to(self.session.parent).as_posix()

    @property
    def bag(self) -> Path:
        """Return the path of its first recording."""
        return self.folder / BAG

    @property
    def is_closed(self) -> bool:
        """Return whether its last recording has been closed, so that it can be read whole."""
        return is_closed(self.folder)

    @property
    def is_finished(self) -> bool:
        """Return whether it is no longer written: its session is over or has finished it."""
        return not (self.session / CLAIM).exists() or (self.folder / FINISHED_MARK).exists()

    def files(self) -> dict[str, Path]:
        """Return its files by their names on pages."""
        return {path.relative_to(self.folder).as_posix(): path
                for kind in RUN_FILES for found in sorted(self.folder.glob(kind))
                for path in _plain_files(found)}


class RunArchive:
    """
    The archive of runs, which finds and deletes them.

    :param session: folder of the current session.
    :param root: folder of other sessions; None for none.
    """

    def __init__(self, session: Path, root: Path | None = None) -> None:
        self.session = session.resolve()
        self._root = None if root is None else root.resolve()
        # As found last: it takes long to list hundreds of runs for each chunk of a replay.
        self._known: dict[str, PastRun] = {}
        self._told: dict[tuple[Path, int], Mapping[str, object]] = {}

    def runs(self) -> dict[str, PastRun]:
        """Return the runs that exist now by their ids, the latest first."""
        sessions = [self.session]
        if self._root is not None and self._root.is_dir():
            others = (path for path in self._root.iterdir()
                      if path.is_dir() and not path.is_symlink() and path != self.session)
            sessions += sorted(others, key=lambda path: path.name, reverse=True)
        found: dict[str, PastRun] = {}
        for session in sessions:
            for folder in reversed(run_folders(session)):
                if len(found) < MAX_RUNS and _is_run(folder):
                    found[run_id(folder)] = PastRun(run_id(folder), folder, session)
        self._known = found
        return found

    def run(self, key: str) -> PastRun:
        """
        Return a run by its id.

        :raises InputError: if there is none.
        """
        run = self._known.get(key)
        if run is None or not _is_run(run.folder):
            run = self.runs().get(key)
        if run is None:
            raise InputError('there is no such run', 'id', 'load the page again')
        return run

    def listing(self) -> dict[str, object]:
        """Return the answer of /api/runs."""
        return {'runs': [self._entry(run) for run in self.runs().values()]}

    def delete(self, key: str) -> str:
        """
        Delete the files of a run, and its folder where nothing else is in it.

        :return: readable text of what was done.
        :raises InputError: if there is no such run, it is still being written, or its files cannot
            be removed.
        """
        run = self.run(key)
        if not run.is_finished:
            raise InputError('is being recorded, or its files are being written', run.name,
                             'delete it when its run is over')
        try:
            _remove(run)
        except OSError as error:
            raise InputError(f'cannot be deleted ({error.strerror})', run.name,
                             'see whose files they are') from error
        return f'{run.name} is deleted'

    def _entry(self, run: PastRun) -> dict[str, object]:
        files = run.files()
        return {'id': run.id, 'name': run.name, **self._facts(run),
                'finished': run.is_finished, 'closed': run.is_closed,
                'bytes': sum(_size(path) for path in files.values()),
                'files': [{'name': name, 'bytes': _size(path)} for name, path in files.items()]}

    def _facts(self, run: PastRun) -> Mapping[str, object]:
        """Return the facts that do not change once a run is over; read them once."""
        timing = run.folder / 'timing.json'
        metadata = run.bag / METADATA_FILE
        changed = max((path.stat().st_mtime_ns for path in (timing, metadata) if path.is_file()),
                      default=0)
        key = (run.folder, changed)
        if key not in self._told:
            contacts = _contacts(timing)
            self._told[key] = {**_game_facts(run.folder / GAME_FILE), **_bag_facts(metadata),
                               'contacts': None if contacts is None else len(contacts)}
        return self._told[key]


def _is_run(folder: Path) -> bool:
    """Return whether a folder holds a run that this program has recorded."""
    return (folder / GAME_FILE).is_file() and (folder / BAG).is_dir() and not folder.is_symlink()


def _plain_files(path: Path) -> Iterator[Path]:
    """Yield a file, or the files of a recording, without symbolic links."""
    if path.is_symlink():
        return
    if path.is_file():
        yield path
    elif path.is_dir():
        yield from (item for item in sorted(path.iterdir())
                    if item.is_file() and not item.is_symlink())


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0


def _game_facts(path: Path) -> dict[str, object]:
    try:
        game = load_game(path)
    except InputError:
        # A file of another version or a changed one can still be downloaded and deleted.
        return {'title': '', 'scenario': ''}
    return {'title': clean_text(game.title or '', MAX_TITLE),
            'scenario': clean_text(game.scenario.stem, MAX_TITLE)}


def _bag_facts(path: Path) -> dict[str, object]:
    """Read the start and duration of a recording, without its topics."""
    try:
        with path.open(encoding='utf-8', errors='replace') as stream:
            found = _TIMES.findall(stream.read(1000))
    except OSError:
        found = []
    lasted_ns, began_ns = (*map(int, found[:2]),) if len(found) >= 2 else (None, None)
    return {'began_ms': None if began_ns is None else began_ns // 10**6,
            'duration_s': None if lasted_ns is None else lasted_ns / 1e9}


def _contacts(path: Path) -> list[dict[str, object]] | None:
    """Return the contacts in a timing report; None if there is none, or it was changed."""
    try:
        return list(json.loads(path.read_text(encoding='utf-8')).get('contacts') or ())
    except (OSError, ValueError, AttributeError, TypeError):
        return None


def _remove(run: PastRun) -> None:
    """Remove a run's files; until the last is gone, the run is listed and can be deleted again."""
    game = run.folder / GAME_FILE
    own = [path for path in run.files().values() if path != game]
    for path in (*own, run.folder / PICTURE, run.folder / FINISHED_MARK, game):
        path.unlink(missing_ok=True)
    for folder in (*bags_of(run.folder), run.folder):
        # The folder may hold something else: another run of the session, or a foreign file.
        with suppress(OSError):
            folder.rmdir()


def run_id(folder: Path) -> str:
    """Return the id of a run on pages, which does not reveal its path."""
    return hashlib.sha256(os.fsencode(folder.resolve())).hexdigest()[:16]


def files_document(session: Path, epoch: int) -> dict[str, object]:
    """Return the files document."""
    folder = run_folder(session, epoch)
    names = [path.name for kind in RUN_FILES for path in sorted(folder.glob(kind))]
    # Only the terminal of this machine shows the path.
    name = folder.relative_to(session.parent).as_posix()
    complete = (folder / FINISHED_MARK).exists()
    # The page reports a contact without details if its file was moved or changed.
    contacts = [contact for path in sorted(folder.glob('timing*.json'))
                for contact in _contacts(path) or ()] if complete else []
    return {'epoch': epoch, 'run': run_id(folder), 'folder': name, 'names': names,
            'complete': complete, 'contacts': contacts}
