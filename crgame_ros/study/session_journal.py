# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The journal of a participant's session, line by line, safe against crashes."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from enum import StrEnum
import fcntl
import json
import os
from pathlib import Path
from types import TracebackType
from typing import get_origin, get_type_hints, IO, Literal, Self, TypedDict

from crgame_ros.errors import InputError, refusing, short
from crgame_ros.study.question import Answer
from crgame_ros.whole_file import sync_folder

JOURNAL = 'journal.jsonl'
_ELSEWHERE = 'choose a folder that can be written, on a disk with room'
# The reason for ending a session without consent.
DECLINED = 'consent was not given'


class SessionEvent(StrEnum):
    """The kinds of journal entries."""

    BEGUN = 'begun'
    OPENED = 'opened'
    STARTED = 'started'
    FINISHED = 'finished'
    ABORTED = 'aborted'
    SKIPPED = 'skipped'
    REPEATED = 'repeated'
    PRACTISED = 'practised'
    NOTE = 'note'
    MARKER = 'marker'
    LANGUAGE = 'language'
    HELD = 'held'
    ENDED = 'ended'
    ALLOCATED = 'allocated'
    EXCLUDED = 'excluded'


# Values that entries of a kind need.
_NEEDED: dict[str, tuple[str, ...]] = {
    SessionEvent.BEGUN: ('participant', 'place', 'items'), SessionEvent.LANGUAGE: ('language',),
    SessionEvent.HELD: ('held', 'item'), SessionEvent.OPENED: ('software',),
    SessionEvent.ALLOCATED: ('group', 'place', 'items'), SessionEvent.EXCLUDED: ('reason', 'item'),
    **dict.fromkeys((SessionEvent.STARTED, SessionEvent.FINISHED, SessionEvent.ABORTED,
                     SessionEvent.SKIPPED, SessionEvent.REPEATED, SessionEvent.PRACTISED),
                    ('item',))}

# Values that are not there may be None as well; a float is any number.
JournalEntry = TypedDict('JournalEntry', {  # noqa: UP013
    'at': float, 'entry': str, 'item': str, 'participant': str, 'language': str, 'run': str,
    'name': str, 'text': str, 'reason': str, 'outcome': str, 'group': str, 'page': str,
    'condition': str, 'attempt': int, 'place': int, 'contacts': int, 'departures': int,
    'drives': int, 'slot': int, 'time_s': float, 'end_time_s': float, 'start_at': float,
    'asked_at': float, 'shown_at': float, 'answered_at': float, 'taken_s': float,
    'clean_s': float, 'held': bool, 'good': bool, 'items': list[str], 'doubts': list[str],
    'asked': list[str], 'members': list[str], 'answers': dict[str, Answer],
    'software': dict[str, object], 'after_s': dict[str, object], 'quality': dict[str, object],
    'consent': dict[str, object], 'strata': dict[str, object]}, total=False)
_TYPES = {name: get_origin(kind) or kind for name, kind in get_type_hints(JournalEntry).items()}
# Times of the wall clock are the largest numbers; until the year 5138 [s since 1970].
_LARGEST = 1e11


def read_entry(line: str | bytes) -> JournalEntry:
    """
    Read a line of a journal.

    :raises ValueError: if it lacks what entries of its kind need, or a value has another type.
    """
    try:
        entry: JournalEntry = json.loads(line)
    except RecursionError as error:
        raise ValueError('is no entry') from error
    if not isinstance(entry, dict):
        raise ValueError('is no entry')
    for name, value in entry.items():
        numbers = value.values() if name == 'after_s' and isinstance(value, dict) else ()
        if value is not None and not _fits(value, _TYPES.get(name)) \
                or not all(_fits(each, float) for each in numbers if each is not None):
            raise ValueError(f'{name} is {short(value)}')
    needed = ('entry', 'at', *_NEEDED.get(entry.get('entry', ''), ()))
    if missing := [name for name in needed if entry.get(name) is None]:
        raise ValueError(f'has no {missing[0]}')
    return entry


def _fits(value: object, kind: type | None) -> bool:
    if kind in (int, float):
        return (isinstance(value, int | kind) and not isinstance(value, bool)
                and 0 <= value <= _LARGEST)
    return kind is None or isinstance(value, kind)


class SessionJournal:
    """
    An append-only file of entries; each is on the disk when `add` returns.

    However the process ends, all lines are complete, except perhaps the last one, which is dropped
    when the file is opened again.

    :param folder: of the participant; created if missing.
    :raises InputError: if it cannot be written, or another process writes there.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / JOURNAL
        with refusing('cannot be written', self.path, _ELSEWHERE):
            folder.mkdir(parents=True, exist_ok=True)
            self._file: IO[bytes] = self.path.open('a+b', buffering=0)
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                self._file.close()
                raise InputError('this participant takes part already, in another process',
                                 str(folder), 'end that one first, or name another participant'
                                 ) from error
            sync_folder(folder)
            sync_folder(folder.parent)
        self.entries = list(self._recovered())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def add(self, entry: dict[str, object]) -> None:
        """
        Add an entry.

        :raises InputError: if it cannot be written.
        """
        line = json.dumps(entry, ensure_ascii=False, allow_nan=False) + '\n'
        size = os.fstat(self._file.fileno()).st_size
        with refusing('cannot be written', self.path, _ELSEWHERE):
            try:
                left = line.encode('utf-8', 'surrogatepass')
                while left:
                    left = left[self._file.write(left):]
                os.fsync(self._file.fileno())
            except OSError:
                # Nothing of a refused entry stays.
                with suppress(OSError):
                    self._file.truncate(size)
                raise
        self.entries.append(json.loads(line))

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _recovered(self) -> Iterator[JournalEntry]:
        """Read the present entries, and remove a line that was cut off."""
        self._file.seek(0)
        content = self._file.read()
        whole = content[:content.rfind(b'\n') + 1]
        if len(whole) < len(content):
            self._file.truncate(len(whole))
            os.fsync(self._file.fileno())
        for line in whole.splitlines():
            with suppress(ValueError):
                yield read_entry(line)


def read_journal(folder: Path) -> list[JournalEntry]:
    """
    Read a participant's entries, also while a process adds some.

    :raises InputError: if the file cannot be read.
    """
    try:
        lines = (folder / JOURNAL).read_bytes().splitlines(keepends=True)
    except FileNotFoundError:
        return []
    except OSError as error:
        raise InputError(f'cannot be read ({error.strerror})', str(folder / JOURNAL),
                         'put back the file, or leave out its participant') from error
    entries = []
    for line in lines:
        with suppress(ValueError):
            if line.endswith(b'\n'):
                entries.append(read_entry(line))
    return entries


def done_items(entries: Iterable[JournalEntry]) -> dict[str, JournalEntry]:
    """
    Return the entries by which items are finished or skipped, by their ids.

    An item that is to be repeated is not among them.
    """
    found: dict[str, JournalEntry] = {}
    for entry in entries:
        if entry['entry'] in (SessionEvent.FINISHED, SessionEvent.SKIPPED):
            found[entry['item']] = entry
        elif entry['entry'] == SessionEvent.REPEATED:
            found.pop(entry['item'], None)
    return found


def first_of(entries: Iterable[JournalEntry], *kinds: SessionEvent,
             item: str | None = None) -> JournalEntry | None:
    """
    Return the first entry of some kinds; None without one. Of reversed entries it is the last.

    :param item: that it is about; None for any.
    """
    return next((entry for entry in entries if entry['entry'] in kinds
                 and item in (None, entry.get('item'))), None)


def how_ended(entries: Iterable[JournalEntry]) -> JournalEntry | None:
    """Return the entry by which a session ended before its last item; None without one."""
    return first_of(entries, SessionEvent.ENDED, SessionEvent.EXCLUDED)


def way_of_end(
        entries: Iterable[JournalEntry]) -> Literal['excluded', 'declined', 'ended'] | None:
    """Return the way in which a session ended before its last item; None without such an end."""
    ended = how_ended(entries)
    if ended is None:
        return None
    if ended['entry'] == SessionEvent.EXCLUDED:
        return 'excluded'
    return 'declined' if ended.get('reason') == DECLINED else 'ended'


def chosen_language(entries: Sequence[JournalEntry]) -> str | None:
    """Return the language that a participant chose last; None before a choice."""
    chosen = first_of(reversed(entries), SessionEvent.LANGUAGE)
    return None if chosen is None else chosen['language']
