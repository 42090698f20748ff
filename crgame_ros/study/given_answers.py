# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a participant has answered so far, and what follows: failed checks and exclusion."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from crgame_ros.study.file import StudyFile
from crgame_ros.study.pages import questionnaire_of, questions_of
from crgame_ros.study.question import asked_of, Question
from crgame_ros.study.screening import Exclusion
from crgame_ros.study.session_journal import SessionEvent
from crgame_ros.study.session_script import Fields, SessionItem

Answers = Mapping[str, Any]


def last_answers(entries: Iterable[Mapping[str, Any]]) -> dict[str, Answers]:
    """
    Return the last answers of each item, by its id; none of an item that is to be repeated.

    :param entries: of a journal.
    """
    found: dict[str, Answers] = {}
    for entry in entries:
        if entry['entry'] == SessionEvent.FINISHED:
            found[entry['item']] = entry.get('answers') or {}
        elif entry['entry'] in (SessionEvent.REPEATED, SessionEvent.SKIPPED):
            found.pop(entry['item'], None)
    return found


def field_answers(items: Iterable[SessionItem], answers: Mapping[str, Answers]) -> Answers:
    """Return the answers to the fields of the participant."""
    return next((answers.get(item.id, {}) for item in items if isinstance(item.what, Fields)), {})


def asked_in(study: StudyFile, item: SessionItem, given: Answers,
             fields: Answers) -> tuple[Question, ...]:
    """Return the questions of an item that were asked, by the answers to it and to the fields."""
    return asked_of(questions_of(study, item), given,
                    None if isinstance(item.what, Fields) else fields)


def failed_checks(study: StudyFile, items: Iterable[SessionItem],
                  answers: Mapping[str, Answers]) -> list[str]:
    """Return the attention checks that failed, as item and question."""
    items = tuple(items)
    fields = field_answers(items, answers)
    return [f'{item.id}: {question.name}' for item in items if item.id in answers
            for question in asked_in(study, item, answers[item.id], fields)
            if question.failed(answers[item.id].get(question.name))]


def exclusion_of(study: StudyFile, items: Iterable[SessionItem],
                 answers: Mapping[str, Answers]) -> Exclusion | None:
    """Return the first rule that excludes a participant; None without one."""
    items = tuple(items)
    if not study.exclude:
        return None
    failed = len(failed_checks(study, items, answers))
    for rule in study.exclude:
        if rule.when is None:
            holds = failed >= (rule.attention_failed or 0)
        else:
            holds = any(map(rule.when.holds, _tested(study, rule, items, answers)))
        if holds:
            return rule
    return None


def _tested(study: StudyFile, rule: Exclusion, items: Iterable[SessionItem],
            answers: Mapping[str, Answers]) -> Iterator[Any]:
    """Yield the answers that the condition of a rule is about."""
    when = rule.when
    assert when is not None
    if when.field is not None:
        yield field_answers(items, answers).get(when.field)
        return
    for item in items:
        scale = questionnaire_of(study, item) if item.id in answers else None
        if scale is not None and scale.name == when.questionnaire:
            yield answers[item.id].get(when.question or '')
