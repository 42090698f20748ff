# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of a study's data, with a folder for each participant."""

from collections.abc import Iterable, Mapping
from datetime import date, datetime, UTC
import json
from pathlib import Path
import re
import tempfile

from crgame_ros.driver.source import COCKPIT
from crgame_ros.errors import InputError, refusing
from crgame_ros.evaluation.cell_scene import values_of_game
from crgame_ros.evaluation.content import ContentStore, digests_in
from crgame_ros.recording.run_folder import PARTICIPANTS, STUDY_FILE
from crgame_ros.study.file import Page, Questions, StudyFile
from crgame_ros.study.groups import enrolled, read_enrolment
from crgame_ros.study.questionnaire import steps_of
from crgame_ros.study.session_journal import read_journal
from crgame_ros.study.session_script import drives_of
from crgame_ros.study.trial_game import trial_game
from crgame_ros.whole_file import write_whole

DRIVES, FILES = 'drives.json', 'files'
# In the folder of a study: a line for each withdrawal, and those that have not finished.
WITHDRAWALS, WITHDRAWING = 'withdrawals.jsonl', '.withdrawing'
# Says that a study's data have been made: nobody took part.
MADE = 'made.json'


def keep_drives(study: StudyFile, folder: Path) -> None:
    """
    Store the games of a study, or check that they still equal the stored ones.

    `drives.json` has the game of each practice and condition. The files that they name (scenarios,
    scripts, maps, code of planners with the files beside it) are in `files/`, by digest.

    :param folder: of the study's files; must exist.
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
            # The files count only once the list exists.
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
    """Replace the files that an interrupted start has left by new ones."""
    if old.is_dir():
        for each in old.iterdir():
            each.rename(new.parent / f'old-{each.name}')
        old.rmdir()
    new.rename(old)


def _difference(before: object, now: object, where: str = '') -> str:
    """Return the first difference of two games: the name of a file, or the key of a value."""
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


_ID = re.compile(r'[A-Za-z0-9][A-Za-z0-9_-]{0,31}')
# What R, pandas, YAML or a spreadsheet reads as a missing value, a truth value or infinity.
_WORDS = frozenset(('na', 'nan', 'null', 'nil', 'none', 'nat', 'inf', 'infinity', 'true', 'false',
                    't', 'f', 'yes', 'no', 'y', 'n', 'on', 'off'))
# A spreadsheet makes a date of MAR1, SEPT2 and Dec-5.
_MONTH = re.compile(r'(jan|feb|mar|apr|may|jun|jul|aug|sept?|oct|nov|dec|january|february|march|'
                    r'april|june|july|august|september|october|november|december)-?[0-9]{1,4}',
                    re.IGNORECASE)


def check_participant(name: str) -> str:
    """
    Check the form of an anonymous id.

    :raises InputError: if it is not valid.
    """
    if _ID.fullmatch(name) is None:
        raise InputError('is no id of a participant', name[:40] or '--participant',
                         'give 1 to 32 letters, digits, - and _, such as P07')
    return name


def check_new_participant(name: str) -> str:
    """
    Check the id of a participant who has not begun: every reader of tables has to leave it as is.

    :raises InputError: if it is not valid, or some reader takes it for a number, a date, a truth
        value or a missing value.
    """
    check_participant(name)
    if name[0].isdigit() or name.lower() in _WORDS or _MONTH.fullmatch(name) is not None:
        kind = 'number or a date' if name[0].isdigit() else 'missing or a truth value' \
            if name.lower() in _WORDS else 'date'
        raise InputError(f'is an id that some programs read as a {kind}', name,
                         f'put a letter before it, such as P{name}')
    return name


class StudyFolder:
    """
    The folder of a study.

    :param root: its path.
    """

    def __init__(self, root: Path) -> None:
        self.root = root

    @property
    def participants(self) -> list[str]:
        """Return the participants who have begun, in the order of their places."""
        return [each.participant for each in enrolled(self.root / PARTICIPANTS)]

    def participant(self, name: str) -> Path:
        """Return the folder of a participant, which may not exist yet."""
        return self.root / PARTICIPANTS / name

    def begin(self, name: str) -> None:
        """
        Check that a participant can begin, or go on.

        :raises InputError: if the id is not valid, or its participant withdraws.
        """
        if read_enrolment(self.participant(name)) is None:
            check_new_participant(name)
        self.check_withdrawals()

    def overdue(self, study: StudyFile, today: date) -> list[tuple[str, date]]:
        """
        Return the participants whose data are kept for too long, each with the last day.

        :param today: by UTC.
        """
        if study.retention is None:
            return []
        found = []
        for name in self.participants:
            last = datetime.fromtimestamp(
                read_journal(self.participant(name))[-1]['at'], UTC).date()
            if (day := study.retention.last_day(last)) < today:
                found.append((name, day))
        return found

    def check_withdrawals(self) -> None:
        """
        Check that every withdrawal has been finished.

        :raises InputError: if one was interrupted.
        """
        left = self.root / WITHDRAWING
        for folder in sorted(left.iterdir()) if left.is_dir() else ():
            raise InputError('a withdrawal was interrupted', str(folder),
                             f'finish it: crgame study withdraw {self.root} --participant '
                             f'{folder.name}')

    def keep_study(self, study: StudyFile, file: Path, pictures: Iterable[str] = ()) -> None:
        """
        Store the study's files, or check that they still equal the stored ones.

        :param pictures: of its pages, relative to its folder.
        :raises InputError: if one has changed since, or cannot be written, or the folder has
            made data.
        """
        if (self.root / MADE).exists():
            raise InputError('has made data, which people must not be mixed with', str(self.root),
                             'choose another folder with --out')
        folder = (self.root / STUDY_FILE).parent
        files = {STUDY_FILE.name: file,
                 **{name: study.base / name for name in (*_beside(study), *pictures)}}
        with refusing('cannot be kept', folder, 'choose another folder with --out'):
            for name, path in files.items():
                kept = folder / name
                content = path.read_bytes()
                if not kept.exists():
                    kept.parent.mkdir(parents=True, exist_ok=True)
                    write_whole(content, kept)
                elif kept.read_bytes() != content:
                    raise InputError('has changed since the first participant', str(path),
                                     f'put it back as {kept} has it, or begin a new study with '
                                     'another --out')
            keep_drives(study, folder)


def _beside(study: StudyFile) -> list[str]:
    """Return pages, questionnaires and words beside a study file, in every language."""
    names: dict[str, None] = dict.fromkeys(
        path.name for path in sorted(study.base.glob('words.*.yaml')))
    for step in steps_of(study):
        if isinstance(step, Page):
            page = Path(step.file)
            for name in (step.file, *(str(page.with_suffix(f'.{language}.md'))
                                      for language in (study.language, *study.languages))):
                if (study.base / name).is_file():
                    names[name] = None
        elif isinstance(step, Questions) and step.is_file:
            names[step.name] = None
    return list(names)
