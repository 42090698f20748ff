# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Deletes the data of a participant who withdraws, wherever a study's folder holds them."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from datetime import date
import fcntl
from functools import cached_property
import json
import os
from pathlib import Path
import shutil

from crgame_ros.analysis.report.command import REPORT_FILE
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.evaluation.file_names import GRID_FILE
from crgame_ros.recording.run_folder import PACKAGE_FILE, PARTICIPANTS, STUDY_FILE
from crgame_ros.study.data.conducted_study import ConductedStudy, DATA
from crgame_ros.study.data.preregistration import PREREGISTRATION
from crgame_ros.study.data.study_data import KEPT, read_study_data, TABLE_NAMES
from crgame_ros.study.data.study_data_folder import (
    BIDS,
    LOCK,
    only_writer,
    PROVENANCE,
    R_SCRIPT,
    RUNS,
    write_study_data,
)
from crgame_ros.study.data.study_report import write_study_report
from crgame_ros.study.data.study_rerun import RERUN
from crgame_ros.study.elsewhere import PRIVATE
from crgame_ros.study.folder import MADE, WITHDRAWALS, WITHDRAWING
from crgame_ros.study.groups import read_enrolment
from crgame_ros.study.session_journal import JOURNAL, read_journal, SessionEvent
from crgame_ros.whole_file import sync_folder, write_text
import pyarrow as pa
import pyarrow.parquet as pq

# What is made of the data of several participants, in the folder of data.
_MADE_OF_PEOPLE = (*(f'{table}.{kind}' for table in TABLE_NAMES for kind in ('csv', 'parquet')),
                   PACKAGE_FILE, PROVENANCE, REPORT_FILE, R_SCRIPT, RUNS, BIDS)
# In the folder of a withdrawal that is under way: its state, and what was the participant's.
_STATE, _MOVED = 'withdrawal.json', 'participant'
_TOLD = 'the data of a participant were deleted'


def told_of(path: Path) -> str:
    """Return one line about a file or folder: number and size of its files."""
    files = [path] if path.is_file() else [each for each in path.rglob('*') if each.is_file()]
    size = sum(each.stat().st_size for each in files)
    return f'{path}: {len(files)} file{"s" * (len(files) != 1)}, {size} bytes'


@dataclass(frozen=True)
class _State:
    """
    What a withdrawal that is under way has to remember.

    :param anew: what had been made of the data, and is written anew without the participant.
    :param line: of the list of withdrawals.
    :param number: of that line, from 0 on.
    """

    anew: list[str]
    line: str
    number: int


class Withdrawal:
    """
    The withdrawal of one participant: one that begins, or one that was interrupted.

    :param root: folder of the study.
    :param participant: id.
    :raises InputError: if there is no such study, or nothing of the participant in it.
    """

    def __init__(self, root: Path, participant: str) -> None:
        self.root, self.participant = root, participant
        self._folder = root / PARTICIPANTS / participant
        self._pending = root / WITHDRAWING / participant
        if not (root / STUDY_FILE).is_file():
            raise InputError('holds no study' if root.exists() else 'there is no such folder',
                             str(root), 'name the folder that `crgame study run` has made')
        if not self._folder.is_dir() and not self._pending.is_dir():
            raise InputError('is no participant of this study', participant,
                             f'name a folder in {root / PARTICIPANTS}')

    def held(self) -> list[Path]:
        """
        Return what is deleted: what was made of the participant's data, then the own folder.

        Recordings of those who drove together have the data of all of them, wherever they are.
        The journal, which says who they are, is deleted last.
        """
        own = [path for path in (self._folder, self._pending / _MOVED) if path.exists()]
        return [*self._shared(own), *self._derived(), *own]

    def _shared(self, own: Sequence[Path]) -> Iterator[Path]:
        """Yield recordings of the participant's drives in the folder of another one."""
        first = self._together[0]
        if first == self.participant:
            return
        # A later run of a program is in the folder of its first one.
        names = {Path(*Path(entry['run']).parts[:2]) for folder in own
                 for entry in read_journal(folder) if entry.get('run')}
        for name in sorted(names):
            run = self.root / PARTICIPANTS / first / name
            if '..' not in name.parts and run.is_dir():
                yield run

    @cached_property
    def _together(self) -> list[str]:
        """Return the ids of those who drove together, the owner of the recordings first."""
        for folder in (self._folder, self._pending / _MOVED):
            for entry in read_journal(folder):
                if entry['entry'] == SessionEvent.BEGUN and entry.get('members'):
                    return list(map(str, entry['members']))
        return [self.participant]

    def carry_out(self, today: date, say: Callable[[str], object]) -> list[Path]:
        """
        Delete the participant's data, then write anew what was there of the others.

        Every step may be repeated: if it was interrupted, the next call finishes it.

        :param today: is noted.
        :param say: prints one line.
        :return: files and folders in the study's folder that are not the program's own, which it
            neither reads nor deletes.
        :raises InputError: if the participant's session is open, something cannot be deleted, or
            the data of the others cannot be written anew; nothing of the participant is left then.
        """
        with only_writer(self.root / DATA), self._closed_session():
            state = self._begin(today)
            for path, told in [(path, told_of(path)) for path in self.held()]:
                _delete(path)
                say(f'deleted {told}')
            try:
                self._write_anew(state.anew, say)
            except CrgameError as error:
                raise InputError(
                    f'all data of {self.participant} are deleted, but the tables of the others '
                    'cannot be written anew', str(self.root), f'mend this, then give the same '
                    f'command again: {error}') from error
            _delete(self._pending)
            if not any(self._pending.parent.iterdir()):
                self._pending.parent.rmdir()
        return self._foreign()

    @contextmanager
    def _closed_session(self) -> Iterator[None]:
        """Hold the lock of the participant's journal, so that no session begins."""
        journal = self._folder / JOURNAL
        if not journal.is_file():
            yield
            return
        with journal.open('r+b') as stream:
            try:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise InputError('takes part at the moment', self.participant,
                                 'end the session first') from error
            yield

    def _begin(self, today: date) -> _State:
        """Take the participant's folder from its place, and note the withdrawal, both once."""
        file, log = self._pending / _STATE, self.root / WITHDRAWALS
        lines = log.read_text('utf-8').splitlines() if log.exists() else []
        if not file.exists():
            self._pending.mkdir(parents=True, exist_ok=True)
            enrolment = read_enrolment(self._folder)
            group = None if enrolment is None or enrolment.allocation is None \
                else enrolment.allocation.group
            line = json.dumps({'date': today.isoformat(),
                               'place': None if enrolment is None else enrolment.place + 1,
                               **({} if group is None else {'group': group}), 'what': _TOLD})
            written = [name for name in (PACKAGE_FILE, BIDS, REPORT_FILE)
                       if (self.root / DATA / name).exists()]
            write_text(json.dumps(asdict(_State(written, line, len(lines)))) + '\n', file)
        state = _State(**json.loads(file.read_text('utf-8')))
        if self._folder.is_dir():
            # From here on, no reader finds the participant.
            self._folder.rename(self._pending / _MOVED)
            sync_folder(self._folder.parent)
        lines[state.number:state.number + 1] = [state.line]
        write_text(''.join(f'{line}\n' for line in lines), log)
        return state

    def _derived(self) -> Iterator[Path]:
        """Yield what was made of the data of several participants, this one among them."""
        data = self.root / DATA
        yield from (data / name for name in _MADE_OF_PEOPLE if (data / name).exists())
        for entry in sorted((data / KEPT).iterdir()) if (data / KEPT).is_dir() else ():
            if not _is_of_others(entry, self._together):
                yield entry
        rerun = data / RERUN
        if rerun.is_dir() and (not any(rerun.rglob(GRID_FILE)) or any(map(
                self._names_participant, rerun.rglob(GRID_FILE)))):
            yield rerun
        yield from (grid.parent for grid in self._grids() if self._names_participant(grid))

    def _grids(self) -> Iterator[Path]:
        """Yield the plans of evaluations elsewhere in the study's folder."""
        for folder, names, files in os.walk(self.root):
            apart = {PARTICIPANTS, WITHDRAWING} if Path(folder) == self.root else {RERUN} \
                if Path(folder) == self.root / DATA else set()
            names[:] = sorted(set(names) - apart)
            if GRID_FILE in files:
                yield Path(folder) / GRID_FILE

    def _names_participant(self, grid: Path) -> bool:
        text = grid.read_text('utf-8', 'replace')
        return any(f'/{PARTICIPANTS}/{name}/' in text for name in self._together)

    def _write_anew(self, what: list[str], say: Callable[[str], object]) -> None:
        if not what:
            return
        folder = ConductedStudy(self.root)
        data = read_study_data(folder, say)
        if PACKAGE_FILE in what:
            write_study_data(data)
            say(f'written anew: the tables in {folder.data}')
        if BIDS in what:
            from crgame_ros.study.data.bids_folder import write_bids
            write_bids(data, folder.data / BIDS)
            say(f'written anew: {folder.data / BIDS}')
        if REPORT_FILE in what:
            write_study_report(data, folder.data / REPORT_FILE)
            say(f'written anew: {folder.data / REPORT_FILE}')

    def _foreign(self) -> list[Path]:
        """Return what somebody else has put into the folders of the study and its data."""
        data = self.root / DATA
        known = {STUDY_FILE.parts[0], PARTICIPANTS, DATA, WITHDRAWALS, WITHDRAWING, MADE,
                 PREREGISTRATION, PRIVATE}
        names = {*_MADE_OF_PEOPLE, RERUN, KEPT, LOCK}
        return [*(path for path in sorted(self.root.iterdir()) if path.name not in known),
                *(path for path in sorted(data.iterdir()) if path.name not in names)]


def _is_of_others(entry: Path, participants: Iterable[str]) -> bool:
    """Return whether kept measures are surely those of other participants' runs."""
    try:
        runs = pq.read_table(entry / 'vehicles.parquet', columns=['run'])['run'].to_pylist()
    except (OSError, KeyError, pa.ArrowInvalid):
        return False
    return bool(runs) and not any(run.startswith(f'{participant}/') for run in runs
                                  for participant in participants)


def _delete(path: Path) -> None:
    """
    Delete a file or folder.

    :raises InputError: if it cannot be deleted.
    """
    try:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f'cannot be deleted ({error.strerror})', str(error.filename or path),
                         'make the folder writable, then give the same command again') from error
