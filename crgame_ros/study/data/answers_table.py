# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of answers: one row for each answered question."""

from collections.abc import Iterator
from typing import Any

from crgame_ros.analysis.tables.column import Column, INTEGER, NUMBER, TableDeclaration, TEXT
from crgame_ros.study.data.asked_questions import AskedQuestions, plain_answer
from crgame_ros.study.data.participant_record import AnsweredItem, ParticipantRecord
from crgame_ros.study.data.trials_table import PARTICIPANT, utc, WALL

ANSWERS = TableDeclaration('answers', 'a question that was put', (
    'participant', 'item', 'question'), (
        PARTICIPANT, Column('item', TEXT, '', 'of the session, in which it was asked'),
        Column('trial', INTEGER, '1', 'after which it was asked', empty='it was after none'),
        Column('attempt', INTEGER, '1', 'at the trial, after which it was answered',
               empty='it was after none'),
        Column('questionnaire', TEXT, '', 'name of its questionnaire',
               empty='it is a field of the participant'),
        Column('question', TEXT, '', 'name of the question'),
        Column('number', NUMBER, '1', 'the answer, where it is a number',
               empty='it is a text, or none was given'),
        Column('text', TEXT, '', 'the answer, where it is a text: to the last character',
               variant='several choices as a JSON array',
               empty='it is a number, or none was given'),
        Column('answered', TEXT, '', 'when, ISO 8601, UTC'),
        Column('answered_s', NUMBER, 's', 'when', variant=WALL),
        Column('shown_s', NUMBER, 's', 'when its page was shown', variant=f'{WALL}; '
               "by the page's clock, compared with the server's", empty='no page told it'),
        Column('taken_s', NUMBER, 's', 'from when its page was shown to when all of it was told',
               empty='no page told it'),
        Column('after_s', NUMBER, 's', 'from when its page was shown to the last change of this '
               'answer', empty='it was left as it was, or no page told it'),
        Column('recording', TEXT, '', 'folder of the run after which it was asked, from the '
               "participant's on", empty='it was after none'),
        Column('run_end_s', NUMBER, 's', "end of that run, on the run's clock",
               empty='it was after none, or nothing told it'),
        Column('run_ended_s', NUMBER, 's', 'when that run was recorded to its end', variant=WALL,
               empty='it was after none')))


def answer_rows(record: ParticipantRecord, asked: AskedQuestions) -> Iterator[dict[str, Any]]:
    """Yield the rows of a participant: each item's last answers."""
    for answered in record.answered:
        scale = asked.find(answered.item)
        times = _times(record, answered)
        after_s = answered.told.get('after_s')
        for question, answer in answered.answers.items():
            value = plain_answer(answer)
            yield {'participant': record.id, 'item': answered.item.id,
                   'trial': answered.item.trial, 'attempt': answered.attempt,
                   'questionnaire': None if scale is None else scale.scale.name,
                   'question': question,
                   'number' if isinstance(value, int | float) else 'text': value,
                   'answered': utc(answered.at), 'answered_s': answered.at, **times,
                   'after_s': after_s.get(question) if isinstance(after_s, dict) else None}


def _times(record: ParticipantRecord, answered: AnsweredItem) -> dict[str, Any]:
    """Return when an item was shown, and values of the run before it."""
    run = answered.after
    folder = None if run is None else run.folder
    return {'shown_s': answered.told.get('shown_at'), 'taken_s': answered.told.get('taken_s'),
            'recording': None if folder is None
            else folder.relative_to(record.folder).as_posix(),
            'run_end_s': None if run is None else run.says('end_time_s'),
            'run_ended_s': None if run is None else run.ended_at}
