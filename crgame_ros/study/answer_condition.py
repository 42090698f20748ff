# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Conditions on answers: which questions are asked, who is excluded, which trials are good."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar

from crgame_ros.errors import InputError
from crgame_ros.schema.marks import Listed, Within, Wording
from crgame_ros.study.local_text import ColumnName, MarkdownFile


@dataclass(frozen=True)
class AnswerTest:
    """
    Tests of an answer, or of another value; they do not hold without one.

    :param equals: the answer; of several choices, one that is chosen.
    :param one_of: answers, of which it is one.
    :param at_least: least number.
    :param below: the number is less than this.
    """

    equals: object = None
    one_of: Annotated[tuple[object, ...], Listed(noun='answer')] = ()
    at_least: float | None = None
    below: float | None = None

    def check(self) -> None:
        """Refuse what tests nothing, and two lists of answers."""
        if self.equals is None and not self.one_of and self.at_least is None \
                and self.below is None:
            raise InputError('tests nothing', '', 'give equals, one_of, at_least or below')
        if self.equals is not None and self.one_of:
            raise InputError('has "equals" and "one_of"', '', 'give one of them')

    @property
    def values(self) -> tuple[object, ...]:
        """Return the answers, of which it has to be one; empty if every answer is."""
        return self.one_of if self.equals is None else (self.equals,)

    def holds(self, answer: object) -> bool:
        """Return whether an answer meets all tests that are given."""
        if answer is None or answer == []:
            return False
        if self.at_least is not None or self.below is not None:
            if not isinstance(answer, int | float):
                return False
            if self.at_least is not None and answer < self.at_least \
                    or self.below is not None and answer >= self.below:
                return False
        return not self.values or is_one_of(answer, self.values)

    def text_of(self, what: str) -> str:
        """Return the tests of something in words."""
        tests = [f'is {self.equals}'] if self.equals is not None else []
        tests += [f'is one of {", ".join(map(str, self.one_of))}'] if self.one_of else []
        tests += [f'is at least {self.at_least:g}'] if self.at_least is not None else []
        tests += [f'is below {self.below:g}'] if self.below is not None else []
        return f'{what} {" and ".join(tests)}'


@dataclass(frozen=True)
class QuestionTest(AnswerTest):
    """
    Tests of the answer to a question, or of something else.

    :param question: name of the question.
    :param questionnaire: name of its questionnaire.
    """

    # The key of what can be tested instead of a question.
    ELSE: ClassVar[str]

    question: ColumnName | None = None
    questionnaire: ColumnName | None = None

    def check(self) -> None:
        """Refuse tests of nothing, of two things, or none."""
        if (self.question is None) == (getattr(self, self.ELSE) is None):
            raise InputError(f'has not one of "question" and "{self.ELSE}"', '',
                             'give exactly one')
        if self.questionnaire is not None and self.question is None:
            raise InputError('has "questionnaire" without "question"', '', 'give both')
        super().check()

    @property
    def question_told(self) -> str:
        """Return the question in words."""
        return (f'{self.questionnaire}.' if self.questionnaire else '') + str(self.question)


@dataclass(frozen=True)
class AnswerCondition(QuestionTest):
    """
    A condition on an answer; it does not hold without an answer.

    :param question: name of the question.
    :param questionnaire: name of its questionnaire, for `exclude`; otherwise it is the same one.
    :param field: name of a field of the participant, instead of a question.
    """

    ELSE: ClassVar[str] = 'field'

    field: ColumnName | None = None

    def text(self) -> str:
        """Return the condition in words."""
        return self.text_of(self.field or self.question_told)


def is_one_of(answer: object, values: tuple[object, ...]) -> bool:
    """
    Return whether an answer, or one of several that are chosen, is one of some values.

    Choices are compared by their names, as YAML may read `yes` as a truth value.
    """
    if isinstance(answer, list):
        return any(is_one_of(each, values) for each in answer)
    if isinstance(answer, str):
        return answer in map(str, values)
    return any(not isinstance(value, bool) and answer == value for value in values)


def holds_for(condition: AnswerCondition | None, answers: Mapping[str, object],
              fields: Mapping[str, object]) -> bool:
    """
    Return whether a condition holds; None always does.

    :param answers: by question, of the questionnaire.
    :param fields: of the participant.
    """
    if condition is None:
        return True
    return condition.holds(fields.get(condition.field) if condition.field is not None
                           else answers.get(condition.question or ''))


@dataclass(frozen=True)
class Exclusion:
    """
    A rule that ends the session of a participant, who is kept as excluded.

    :param when: a condition on an answer.
    :param attention_failed: number of failed attention checks, instead of a condition.
    :param reason: for the tables and the report; by default the rule itself.
    :param page: Markdown that the participant reads at the end; `NAME.de.md` is the German
        version.
    """

    when: AnswerCondition | None = None
    attention_failed: Annotated[int, Within(1, 1000)] | None = None
    reason: Annotated[str, Wording(r'[^\x00-\x1f]{0,200}', 'give 200 characters at most')] = ''
    page: MarkdownFile | None = None

    def check(self) -> None:
        """Refuse a rule about nothing, or about two things."""
        if (self.when is None) == (self.attention_failed is None):
            raise InputError('has not one of "when" and "attention_failed"', '',
                             'give exactly one')
        if self.when is not None and self.when.question and not self.when.questionnaire:
            raise InputError('has a question of no questionnaire', 'when',
                             'give "questionnaire" too')

    @property
    def told(self) -> str:
        """Return the reason, or the rule in words."""
        if self.reason:
            return self.reason
        if self.when is not None:
            return self.when.text()
        count = self.attention_failed or 0
        return f'{count} attention check{"s" * (count != 1)} failed'
