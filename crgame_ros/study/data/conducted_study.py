# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of a started or finished study: its file, participants and data."""

from collections.abc import Iterator
import json
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.recording.run_folder import PARTICIPANTS, STUDY_FILE
from crgame_ros.study.data.participant_record import ParticipantRecord, read_participant
from crgame_ros.study.file import load_study, StudyFile
from crgame_ros.study.folder import WITHDRAWALS

DATA = 'data'


class ConductedStudy:
    """
    A study's folder, as created by `crgame study run`.

    :param path: of the folder.
    :ivar study_path: of the copied study file.
    :raises InputError: if it holds no study.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.study_path = path / STUDY_FILE
        if not self.study_path.is_file():
            raise InputError('holds no study' if path.exists() else 'there is no such folder',
                             str(path), 'name the folder that `crgame study run` has made')
        self.study: StudyFile = load_study(self.study_path)

    @property
    def data(self) -> Path:
        """Return the folder of the study's data."""
        return self.path / DATA

    @property
    def withdrawals(self) -> int:
        """Return the number of participants whose data were deleted."""
        return len(self.withdrawn_groups)

    @property
    def withdrawn_groups(self) -> list[str]:
        """Return the group of each withdrawn participant; an empty name for none."""
        log = self.path / WITHDRAWALS
        lines = log.read_text('utf-8').splitlines() if log.is_file() else ()
        return [json.loads(line).get('group', '') for line in lines]

    def participants(self) -> list[ParticipantRecord]:
        """
        Read the journals of all started participants, in the order of their names.

        :raises InputError: if a participant began another study.
        """
        return list(self._participants())

    def relative(self, path: Path) -> str:
        """Return a file's path relative to the study's folder, as in the tables."""
        return path.relative_to(self.path).as_posix()

    def _participants(self) -> Iterator[ParticipantRecord]:
        folder = self.path / PARTICIPANTS
        for path in sorted(folder.iterdir()) if folder.is_dir() else ():
            if path.is_dir() and (found := read_participant(self.study, path)) is not None:
                yield found
