# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of participants: one row for each participant who has begun."""

from pathlib import Path
from typing import Any

from crgame_ros.analysis.tables.column import Column, INTEGER, NUMBER, TableDeclaration, TEXT
from crgame_ros.study.data.asked_questions import AskedQuestions, plain_answer
from crgame_ros.study.data.participant_record import ParticipantRecord
from crgame_ros.study.data.study_row_table import flag_column, question_column, unlike
from crgame_ros.study.data.trials_table import PARTICIPANT, utc, WALL
from crgame_ros.study.file import StudyFile
from crgame_ros.study.participant_session import SessionEvent
from crgame_ros.study.session_script import Fields

_FIXED = (
    PARTICIPANT, Column('place', INTEGER, '1', 'among all participants, from 1 on'),
    Column('language', TEXT, '', 'that was chosen', empty='not reported'),
    Column('begun', TEXT, '', 'when the session began, ISO 8601, UTC'),
    Column('begun_s', NUMBER, 's', 'when the session began', variant=WALL),
    Column('ended', TEXT, '', 'when its last entry was made, ISO 8601, UTC'),
    Column('ended_s', NUMBER, 's', 'when its last entry was made', variant=WALL),
    Column('sessions', INTEGER, '1', 'how often the simulator was started for the participant'),
    Column('trials', INTEGER, '1', 'trials that count'),
    Column('trials_planned', INTEGER, '1', 'trials of the session'),
    flag_column('complete', 'whether everything of the session is finished or left out'),
    Column('end_reason', TEXT, '', 'why the session was ended early', empty='it was not'))


class ParticipantsTable:
    """
    The declaration of the table, and its rows.

    :param study: the study.
    :param asked: its questionnaires.
    """

    def __init__(self, study: StudyFile, asked: AskedQuestions) -> None:
        self._asked = asked
        answers = [column for scale in asked.else_where.values()
                   for column in scale.columns(study.language)]
        taken = {column.name for column in (*_FIXED, *answers)}
        self._fields: dict[str, Column] = {}
        for question in study.fields:
            name = unlike(question.name, taken, '_field')
            taken.add(name)
            self._fields[question.name] = question_column(question, name, study.language)
        self.declaration = TableDeclaration(
            'participants', 'a participant who has begun', ('participant',),
            (*_FIXED, *self._fields.values(), *answers))

    @property
    def fields(self) -> list[Column]:
        """Return the columns of the questions to each participant at the start."""
        return list(self._fields.values())

    def row(self, record: ParticipantRecord, trials_planned: int) -> dict[str, Any]:
        """Return a participant's row."""
        runs = {Path(entry['run']).parts[:2] for entry in record.entries
                if isinstance(entry.get('run'), str) and entry['run']}
        row = {'participant': record.id, 'place': record.place + 1, 'language': record.language,
               'begun': utc(record.begun_at), 'begun_s': record.begun_at,
               'ended': utc(record.ended_at), 'ended_s': record.ended_at, 'sessions': len(runs),
               'trials': len(record.counted), 'trials_planned': trials_planned,
               'complete': record.complete,
               'end_reason': next((entry.get('reason') for entry in record.entries
                                   if entry['entry'] == SessionEvent.ENDED), None)}
        for answered in record.answered:
            scale = self._asked.find(answered.item)
            if isinstance(answered.item.what, Fields):
                row |= {self._fields[name].name: plain_answer(answer)
                        for name, answer in answered.answers.items() if name in self._fields}
            elif answered.item.trial is None and scale is not None:
                row |= scale.values(answered.answers)
        return row
