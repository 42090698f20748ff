# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The questions of a study at each point, and the columns of their answers."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
import json

from crgame_ros.analysis.tables.column import Column
from crgame_ros.study.data.study_row_table import (
    plain_name,
    question_column,
    score_columns,
)
from crgame_ros.study.file import Questions, StudyFile
from crgame_ros.study.question import Answer
from crgame_ros.study.questionnaire import Questionnaire, scale_of
from crgame_ros.study.session_script import session_of, SessionItem


@dataclass(frozen=True)
class AskedScale:
    """
    A questionnaire at one point of a study.

    :param prefix: of its columns.
    :param scale: the questionnaire.
    """

    prefix: str
    scale: Questionnaire

    def columns(self, language: str) -> list[Column]:
        """Return its columns: answers, then scores."""
        return [*(question_column(question, f'{self.prefix}{question.name}', language)
                  for question in self.scale.questions),
                *score_columns(self.scale, self.prefix)]

    def values(self, answers: Mapping[str, Answer]) -> dict[str, object]:
        """Return the values of its columns."""
        return {**{f'{self.prefix}{question.name}': plain_answer(answers.get(question.name))
                   for question in self.scale.questions},
                **{f'{self.prefix}{name}': value
                   for name, value in self.scale.score(answers).items()}}


class AskedQuestions:
    """
    All questionnaires of a study, with the points at which they are asked.

    :ivar after_trials: by the columns' prefix, those that come after trials.
    :ivar else_where: all others, likewise.
    :raises InputError: if a questionnaire cannot be read.
    """

    def __init__(self, study: StudyFile) -> None:
        self.study = study
        self.after_trials: dict[str, AskedScale] = {}
        self.else_where: dict[str, AskedScale] = {}
        self._by_item: dict[str, AskedScale] = {}
        # All participants answer the same questions, independent of the order of their trials.
        for item, step, before in _questions(study):
            scale = scale_of(study, step)
            place = '' if item.trial is not None else f'{plain_name(_place(item.id))}_'
            known = self.after_trials if item.trial is not None else self.else_where
            prefix = f'{place}{scale.name}_'
            if before:
                prefix = f'{place}{scale.name}_{before + 1}_'
            number = 2
            while prefix in known and known[prefix].scale != scale:
                prefix = f'{place}{scale.name}_{number}_'
                number += 1
            self._by_item[item.id] = known.setdefault(prefix, AskedScale(prefix, scale))

    def find(self, item: SessionItem) -> AskedScale | None:
        """Return the questionnaire of an item; None without one."""
        return self._by_item.get(item.id)

    def scales(self) -> list[Questionnaire]:
        """Return each questionnaire once."""
        return list({asked.scale.name: asked.scale for asked in self._by_item.values()}.values())


def plain_answer(answer: object) -> object:
    """Return an answer as a table's cell: several choices as a JSON array."""
    return json.dumps(answer, ensure_ascii=False) if isinstance(answer, list) else answer


def _place(item: str) -> str:
    """Return the position of an item, without its number there."""
    return item.rpartition('/')[0]


def _questions(study: StudyFile) -> Iterator[tuple[SessionItem, Questions, int]]:
    """Yield the items with questionnaires, and how often each was asked before at that point."""
    seen: dict[tuple[str, str], int] = {}
    # A step may be only for some groups; equal ids are the same step.
    items = {item.id: item for group in study.group_names for item in session_of(study, 0, group)}
    for item in items.values():
        if isinstance(item.what, Questions):
            place = _place(item.id), item.what.name
            yield item, item.what, seen.get(place, 0)
            seen[place] = seen.get(place, 0) + 1
