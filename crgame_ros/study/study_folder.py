# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where a study's data lies: one folder for it, and one in it for each participant."""

from collections.abc import Iterable
from pathlib import Path
import re

from crgame_ros.errors import InputError
from crgame_ros.study.kept_drives import keep_drives
from crgame_ros.study.session_journal import read_journal
from crgame_ros.study.study_file import Page, Questions, StudyFile
from crgame_ros.study.study_pages import steps_of
from crgame_ros.whole_file import write_whole

_ID = re.compile(r'[A-Za-z0-9][A-Za-z0-9_-]{0,31}')


def check_participant(name: str) -> str:
    """
    Check an anonymous id.

    :raises InputError: if it is none.
    """
    if _ID.fullmatch(name) is None:
        raise InputError('is no id of a participant', name[:40] or '--participant',
                         'give 1 to 32 letters, digits, - and _, such as P07')
    return name


class StudyFolder:
    """
    The folder of a study.

    :param root: of it.
    """

    def __init__(self, root: Path) -> None:
        self.root = root

    @property
    def participants(self) -> list[str]:
        """Name those who have begun, in the order of their places."""
        folder = self.root / 'participants'
        found = [(places[0], path.name) for path in (folder.iterdir() if folder.is_dir() else ())
                 if (places := _places(path))]
        return [name for _, name in sorted(found)]

    def participant(self, name: str) -> Path:
        """Return the folder of a participant, which may not be there yet."""
        return self.root / 'participants' / name

    def place_of(self, name: str) -> int:
        """Return a participant's place among all: the one they began with, or the next free one."""
        own = _places(self.participant(name))
        if own:
            return own[0]
        taken = {place for other in self.participants
                 for place in _places(self.participant(other))}
        return next(place for place in range(len(taken) + 1) if place not in taken)

    def keep_study(self, study: StudyFile, file: Path, pictures: Iterable[str] = ()) -> None:
        """
        Keep the study's files as they are, or make sure that they still are what was kept.

        :param file: of the study.
        :param pictures: of its pages, relative to its folder.
        :raises InputError: if one has changed since, or cannot be written.
        """
        folder = self.root / 'study'
        files = {'study.yaml': file,
                 **{name: study.base / name for name in (*_beside(study), *pictures)}}
        try:
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
        except OSError as error:
            raise InputError(f'cannot be kept ({error.strerror})', str(folder),
                             'choose another folder with --out') from error


def _beside(study: StudyFile) -> list[str]:
    """Name pages, questionnaires and words beside a study file, in every language."""
    names: dict[str, None] = dict.fromkeys(
        path.name for path in sorted(study.base.glob('words.*.yaml')))
    for step in steps_of(study):
        if isinstance(step, Page):
            page = Path(step.file)
            for name in (step.file, *(str(page.with_suffix(f'.{language}.md'))
                                      for language in (study.language, *study.languages))):
                if (study.base / name).is_file():
                    names[name] = None
        elif isinstance(step, Questions) and step.name.endswith(('.yaml', '.yml')):
            names[step.name] = None
    return [name for name in names if '..' not in Path(name).parts]


def _places(folder: Path) -> list[int]:
    return [entry['place'] for entry in read_journal(folder) if entry['entry'] == 'begun']
