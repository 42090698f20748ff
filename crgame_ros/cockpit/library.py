# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scenarios and games that the page offers: folders of this machine and uploads."""

import asyncio
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import hashlib
import json
import os
from pathlib import Path
import secrets
from typing import Literal

from crgame_ros.cockpit.job_process import JobProcess
from crgame_ros.cockpit.page_messages import clean_text
from crgame_ros.errors import CrgameError, InputError, short
from crgame_ros.library.stored_index import id_in_file
from crgame_ros.planner.registry import planner_names
from crgame_ros.scenario import guard
from crgame_ros.whole_file import write_whole
from crgame_ros.yaml_text import read_yaml

DRIVERS = ('auto', 'cockpit', 'idle')
UPLOADS = 'Uploads'
READER = 'crgame_ros.cockpit.preview'
MAX_ENTRIES = 1000
MAX_UPLOADS = 64
MAX_UPLOADS_BYTES = 512 * 2 ** 20
MAX_TITLE = 80

_TIMELINES = ('.keys.yaml', '.joy.yaml')


@dataclass(frozen=True)
class Entry:
    """
    A game or scenario that can be chosen.

    :param id: its id on the page, which does not reveal its path.
    :param kind: a game file, a scenario of a folder, or an upload.
    :param path: never shown.
    """

    id: str  # noqa: A003
    kind: Literal['game', 'scenario', 'upload']
    name: str
    title: str
    path: Path


@dataclass(frozen=True)
class Choice:
    """
    The game that a client wants to run.

    :param drivers: driver source by human vehicle.
    :param planners: planner by AV.
    :param options: options of planners by AV, as typed; AVs that are left out keep the game's.
    """

    id: str  # noqa: A003
    drivers: Mapping[str, str]
    planners: Mapping[str, str]
    options: Mapping[str, Mapping[str, str]]


class Library:
    """
    The games and scenarios of some folders, and the uploads.

    :param folders: (name, path) of each; subfolders are left out.
    :param uploads: folder of uploads; created at the first one.
    :param games: folder to which loaded games are written.
    """

    def __init__(self, folders: Sequence[tuple[str, Path]], uploads: Path, games: Path, *,
                 reader: JobProcess | None = None,
                 max_upload_bytes: int = guard.MAX_BYTES) -> None:
        self.max_upload_bytes = max_upload_bytes
        # A folder that is given twice is shown once, under its first name.
        names: dict[Path, str] = {}
        for name, path in folders:
            names.setdefault(path.resolve(), name)
        self._folders = tuple((name, path) for path, name in names.items())
        self._uploads = uploads.resolve()
        self._games = games.resolve()
        self._reader = reader if reader is not None else JobProcess(READER, 'scenario')
        self._entries: dict[str, Entry] = {}
        self._titles: dict[str, str] = {}
        self._uploading = asyncio.Lock()
        # The game that was started last: a reset reads its file again.
        self._loaded = ''

    async def listing(self) -> dict[str, object]:
        """Return the answer of /api/scenarios, read anew from the folders."""
        folders = await asyncio.to_thread(self._list)
        self._entries = {entry.id: entry for _, entries in folders for entry in entries}
        return {
            'folders': [
                {'name': name, 'entries': [
                    {'id': entry.id, 'kind': entry.kind, 'name': entry.name,
                     'title': entry.title} for entry in entries]}
                for name, entries in folders],
            'planners': list(planner_names()), 'drivers': list(DRIVERS)}

    async def preview(self, entry_id: str,
                      unwanted: Callable[[], bool] = lambda: False) -> bytes:
        """
        Return the preview of an entry.

        :param unwanted: returns True once no client waits for it.
        :return: the answer of /api/preview as JSON.
        :raises CrgameError: if there is no such entry, or it cannot be used.
        """
        entry = await self._entry(entry_id)
        return await self._reader.run('preview', path=str(entry.path), kind=entry.kind,
                                      unwanted=unwanted)

    async def planner_options(self, planner: str) -> bytes:
        """
        Return the options that a planner declares.

        :return: the answer of /api/planner as JSON.
        :raises CrgameError: if it cannot be chosen, or its package is not installed.
        """
        if planner not in planner_names():
            raise InputError('cannot be chosen here', short(planner))
        return await self._reader.run('planner_options', planner=planner)

    async def upload(self, data: bytes, title: str) -> str:
        """
        Store an uploaded file if it is a scenario.

        :param title: the sender's title; empty uses the benchmark id.
        :return: its id.
        :raises CrgameError: if it cannot be used, or too many are stored.
        """
        name = hashlib.sha256(data).hexdigest()[:16]
        path = self._uploads / f'{name}.xml'
        async with self._uploading:
            part = await asyncio.to_thread(self._store_part, data, path)
            try:
                checked = json.loads(await self._reader.run('check', path=str(part)))
                part.replace(path)
            finally:
                part.unlink(missing_ok=True)
        title = clean_text(title, MAX_TITLE) or checked['title']
        entry = Entry(_entry_id(path), 'upload', path.name, title, path)
        self._titles[entry.id] = title
        self._entries[entry.id] = entry
        return entry.id

    async def delete_upload(self, entry_id: str) -> str:
        """
        Delete an upload.

        :return: readable text of what was done.
        :raises CrgameError: if it is not an upload, is in use, or cannot be removed.
        """
        entry = await self._entry(entry_id)
        if entry.kind != 'upload':
            raise InputError('is no upload', entry.name, 'only uploads are deleted here')
        if entry.id == self._loaded:
            raise InputError('is the scenario of the present run', entry.title,
                             'start another one first')
        try:
            await asyncio.to_thread(entry.path.unlink, missing_ok=True)
        except OSError as error:
            raise CrgameError(f'{entry.title}: cannot be deleted ({error.strerror})') from error
        self._entries.pop(entry.id, None)
        self._titles.pop(entry.id, None)
        return f'{entry.title} is deleted'

    async def write_game(self, choice: Choice) -> Path:
        """
        Write the game file of a choice.

        :raises CrgameError: if it is not allowed, or the game cannot be used.
        """
        entry = await self._entry(choice.id)
        answer = await self._reader.run(
            'compose', path=str(entry.path), kind=entry.kind, drivers=dict(choice.drivers),
            planners=dict(choice.planners),
            options={av: dict(given) for av, given in choice.options.items()},
            allowed_drivers=list(DRIVERS),
            allowed_planners=list(planner_names()))
        text = json.loads(answer)['text'].encode()
        return await asyncio.to_thread(self._store_game, text)

    def note_loaded(self, entry_id: str) -> None:
        """Record that an entry is the scenario of the present run."""
        self._loaded = entry_id

    def is_upload(self, entry_id: str) -> bool:
        """Return whether an entry is an upload."""
        entry = self._entries.get(entry_id)
        return entry is not None and entry.kind == 'upload'

    async def close(self) -> None:
        """Stop the running job."""
        await self._reader.close()

    async def _entry(self, entry_id: str) -> Entry:
        if entry_id not in self._entries:
            await self.listing()
        try:
            return self._entries[entry_id]
        except KeyError:
            raise InputError('there is no such scenario', 'id', 'load the page again') from None

    def _list(self) -> list[tuple[str, list[Entry]]]:
        folders = [(name, self._entries_in(path, 'scenario')) for name, path in self._folders]
        return [*folders, (UPLOADS, self._entries_in(self._uploads, 'upload'))]

    def _entries_in(self, folder: Path, kind: Literal['scenario', 'upload']) -> list[Entry]:
        try:
            paths = sorted(path for path in folder.iterdir() if path.is_file())[:MAX_ENTRIES]
        except OSError:
            # The folder is not created yet or was removed: it offers nothing.
            return []
        entries = []
        for path in paths:
            entry_id = _entry_id(path)
            if path.suffix == '.xml':
                title = self._titles.get(entry_id) or _scenario_title(path)
                entries.append(Entry(entry_id, kind, path.name, title, path))
            elif kind == 'scenario' and path.suffix == '.yaml':
                title = '' if path.name.endswith(_TIMELINES) else _game_title(path)
                if title:
                    entries.append(Entry(entry_id, 'game', path.name, title, path))
        return entries

    def _store_part(self, data: bytes, path: Path) -> Path:
        try:
            self._uploads.mkdir(parents=True, exist_ok=True)
            kept = [other.stat().st_size for other in self._uploads.glob('*.xml')
                    if other != path]
            if len(kept) >= MAX_UPLOADS or sum(kept) + len(data) > MAX_UPLOADS_BYTES:
                raise CrgameError(f'{len(kept)} uploads are kept already; delete some')
            part = path.with_name(f'{path.stem}.{secrets.token_hex(4)}.part')
            part.write_bytes(data)
        except OSError as error:
            raise CrgameError(f'the upload cannot be kept ({error.strerror})') from error
        return part

    def _store_game(self, text: bytes) -> Path:
        path = self._games / f'{hashlib.sha256(text).hexdigest()[:16]}.yaml'
        try:
            self._games.mkdir(parents=True, exist_ok=True)
            write_whole(text, path)
        except OSError as error:
            raise CrgameError(f'the game cannot be written ({error.strerror})') from error
        return path


def _entry_id(path: Path) -> str:
    return hashlib.sha256(os.fsencode(path)).hexdigest()[:16]


def _game_title(path: Path) -> str:
    """Return the title of a game file; empty if the file is not a game."""
    try:
        values = read_yaml(path, 'game file')
    except InputError:
        return ''
    if not isinstance(values, dict) or not isinstance(values.get('scenario'), str):
        return ''
    title = values.get('title')
    return clean_text(title, MAX_TITLE) if isinstance(title, str) and title else path.stem


def _scenario_title(path: Path) -> str:
    """Return the benchmark id from the beginning of the file."""
    try:
        found = id_in_file(path)
    except OSError:
        found = None
    return clean_text(found or '', MAX_TITLE) or path.stem
