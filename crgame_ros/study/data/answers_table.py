# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""The table of answers: a row is a question that somebody answered."""

from collections.abc import Iterator
from typing import Any

from crgame_ros.analysis.tables.column import Column, INTEGER, NUMBER, TableDeclaration, TEXT
from crgame_ros.study.data.asked_questions import AskedQuestions, plain_answer
from crgame_ros.study.data.participant_record import ParticipantRecord
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
        Column('answered_s', NUMBER, 's', 'when', variant=WALL)))


def answer_rows(record: ParticipantRecord, asked: AskedQuestions) -> Iterator[dict[str, Any]]:
    """Give the rows of a participant: each item's last answers."""
    for answered in record.answered:
        scale = asked.of(answered.item)
        for question, answer in answered.answers.items():
            value = plain_answer(answer)
            yield {'participant': record.id, 'item': answered.item.id,
                   'trial': answered.item.trial, 'attempt': answered.attempt,
                   'questionnaire': None if scale is None else scale.scale.name,
                   'question': question,
                   'number' if isinstance(value, int | float) else 'text': value,
                   'answered': utc(answered.at), 'answered_s': answered.at}
