# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Questions of a study, and checks of their answers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
import math
import sys
from typing import Annotated, Any, ClassVar, TypeGuard

from crgame_ros.errors import InputError, short
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Advice, Keyed, Listed, Within
from crgame_ros.study.answer_condition import AnswerCondition, holds_for, is_one_of
from crgame_ros.study.local_text import ColumnName, LocalText, MOST_CHARACTERS, Text

# A limit that is not set is that far away.
_UNLIMITED = 1e9
Answer = float | str | list[str] | None


@dataclass(frozen=True)
class LikertQuestion:
    """
    A question with a row of points, 1 at the left.

    :param points: number of points.
    :param left: label of the first.
    :param right: label of the last.
    :param labels: label of each, instead of `left` and `right`.
    """

    points: Annotated[int, Within(2, 11)] = 7
    left: Text = LocalText()
    right: Text = LocalText()
    labels: Annotated[tuple[Text, ...], Listed(0, 11, 'label')] = ()

    @property
    def bounds(self) -> tuple[float, float]:
        """Return the least and the greatest answer."""
        return 1.0, float(self.points)

    def check(self) -> None:
        """Refuse labels of unknown points."""
        if self.labels and len(self.labels) != self.points:
            raise InputError(f'has {len(self.labels)} labels for {self.points} points', '',
                             'give one for each point')

    def refusal(self, answer: object) -> str:
        """Return why an answer is invalid, empty if it is valid."""
        fits = _finite(answer) and answer == int(answer) and 1 <= answer <= self.points
        return '' if fits else f'give 1 to {self.points}'


@dataclass(frozen=True)
class SliderQuestion:
    """
    A question with a position on a line, unmarked at first.

    :param low: at the left end.
    :param high: at the right end.
    :param step: between neighbouring positions.
    :param left: label of the left end.
    :param right: label of the right end.
    """

    low: float = 0.0
    high: float = 100.0
    step: Annotated[float, Within(0.0, above=True)] = 1.0
    left: Text = LocalText()
    right: Text = LocalText()

    @property
    def bounds(self) -> tuple[float, float]:
        """Return the least and the greatest answer."""
        return self.low, self.high

    def check(self) -> None:
        """Refuse a line of zero length."""
        if not self.high > self.low:
            raise InputError(f'"high" is not above "low", {self.low:g}', '', 'give a higher one')

    def refusal(self, answer: object) -> str:
        """Return why an answer is invalid, empty if it is valid."""
        fits = _finite(answer) and self.low <= answer <= self.high
        return '' if fits else f'give {self.low:g} to {self.high:g}'


@dataclass(frozen=True)
class VasQuestion:
    """
    A question with a visual analogue scale: a bare line, unmarked at first, from 0 to 100.

    :param left: label of the left end, 0.
    :param right: label of the right end, 100.
    """

    left: Text = LocalText()
    right: Text = LocalText()

    @property
    def bounds(self) -> tuple[float, float]:
        """Return the least and the greatest answer."""
        return 0.0, 100.0

    def refusal(self, answer: object) -> str:
        """Return why an answer is invalid, empty if it is valid."""
        return '' if _finite(answer) and 0.0 <= answer <= 100.0 else 'give 0 to 100'


@dataclass(frozen=True)
class ChoiceQuestion:
    """
    A question with one choice, or several choices.

    :param choices: names of the answers, with the displayed texts.
    :param several: whether more than one, or none, may be chosen.
    """

    choices: dict[str, object]
    several: bool = False

    def check(self) -> None:
        """Refuse a question with too few choices."""
        if len(self.choices) < 2:
            raise InputError(f'has {len(self.choices)} choices', '', 'give two or more')
        for name, text in self.choices.items():
            LocalText.from_value(text, f'choices: {name}')

    @property
    def texts(self) -> dict[str, LocalText]:
        """Return the displayed texts, by the answer's name."""
        return {str(name): LocalText.from_value(text) for name, text in self.choices.items()}

    def refusal(self, answer: object) -> str:
        """Return why an answer is invalid, empty if it is valid."""
        known = set(map(str, self.choices))
        if self.several:
            fits = isinstance(answer, list) and all(isinstance(item, str) for item in answer) \
                and len(set(answer)) == len(answer) and set(answer) <= known
        else:
            fits = isinstance(answer, str) and answer in known
        return '' if fits else f'give {", ".join(sorted(known))}'


@dataclass(frozen=True)
class NumberQuestion:
    """
    A question with a typed number.

    :param low: smallest allowed value.
    :param high: largest allowed value.
    :param whole: whether only integers are allowed.
    :param unit: displayed after it.
    """

    low: float = -_UNLIMITED
    high: float = _UNLIMITED
    whole: bool = False
    unit: Text = LocalText()

    @property
    def bounds(self) -> tuple[float, float]:
        """Return the least and the greatest answer; infinite where there is no limit."""
        return (self.low if self.low > -_UNLIMITED else -math.inf,
                self.high if self.high < _UNLIMITED else math.inf)

    def refusal(self, answer: object) -> str:
        """Return why an answer is invalid, empty if it is valid."""
        fits = _finite(answer) and self.low <= answer <= self.high \
            and (not self.whole or answer == int(answer))
        kind = 'a whole number' if self.whole else 'a number'
        limits = {(True, True): f' from {self.low:g} to {self.high:g}',
                  (True, False): f' of at least {self.low:g}',
                  (False, True): f' of at most {self.high:g}', (False, False): ''}
        return '' if fits else f'give {kind}' + limits[self.low > -_UNLIMITED,
                                                       self.high < _UNLIMITED]


@dataclass(frozen=True)
class TextQuestion:
    """
    A question with free text.

    :param longest: maximum number of characters.
    """

    longest: Annotated[int, Within(1, MOST_CHARACTERS)] = 10_000

    def refusal(self, answer: object) -> str:
        """Return why an answer is invalid, empty if it is valid."""
        fits = isinstance(answer, str) and len(answer) <= self.longest
        return '' if fits else f'give {self.longest} characters at most'


QuestionKind = (LikertQuestion | SliderQuestion | VasQuestion | ChoiceQuestion | NumberQuestion
                | TextQuestion)
KINDS: dict[str, type[QuestionKind]] = {
    'likert': LikertQuestion, 'slider': SliderQuestion, 'vas': VasQuestion,
    'choice': ChoiceQuestion, 'number': NumberQuestion, 'text': TextQuestion}


@dataclass(frozen=True)
class Question:
    """
    One question.

    :param name: of its column in the tables.
    :param kind: the kind of answer.
    :param ask: the displayed text.
    :param required: whether it has to be answered before the participant can continue.
    :param when: it is asked only if this holds, of an earlier question or of a field.
    :param expect: the answer of people who attend: it is an attention check.
    """

    FORM: ClassVar[Form] = Form(first=('name', 'ask'))

    name: ColumnName
    kind: Annotated[QuestionKind, Keyed(KINDS, 'kind of answer')]
    ask: Annotated[Text, Advice('say what is asked')] = LocalText()
    required: bool = True
    when: AnswerCondition | None = None
    expect: object = None

    def check(self) -> None:
        """Refuse an expected answer that the question does not take."""
        if self.expect is None:
            return
        if isinstance(self.kind, TextQuestion) or getattr(self.kind, 'several', False):
            raise InputError('expects an answer that is compared with no other', 'expect',
                             'let it be a number, or a choice of one')
        expected = str(self.expect) if isinstance(self.kind, ChoiceQuestion) else self.expect
        if refusal := self.kind.refusal(expected):
            raise InputError(f'expects {short(self.expect)}', 'expect', refusal)

    def failed(self, answer: Answer) -> bool:
        """Return whether it is an attention check that an answer, or None, does not pass."""
        return self.expect is not None and not is_one_of(answer, (self.expect,))

    @property
    def bounds(self) -> tuple[float, float]:
        """Return the least and the greatest number; infinite where there is no limit."""
        return getattr(self.kind, 'bounds', (-math.inf, math.inf))

    @property
    def texts(self) -> tuple[LocalText, ...]:
        """Return all texts that a participant reads in it."""
        found = [self.ask]
        for field in fields(self.kind):
            value = getattr(self.kind, field.name)
            found += [each for each in (value if isinstance(value, tuple) else (value,))
                      if isinstance(each, LocalText)]
        if isinstance(self.kind, ChoiceQuestion):
            found += self.kind.texts.values()
        return tuple(found)

    def refusal(self, answer: object) -> str:
        """Return why an answer is refused, empty if it is accepted; None means no answer."""
        if answer is None:
            return 'give an answer' if self.required else ''
        if self.required and answer in ('', []):
            return 'give an answer'
        return self.kind.refusal(answer)


def asked_of(questions: Sequence[Question], answers: Mapping[str, Answer],
             fields: Mapping[str, Answer] | None = None) -> tuple[Question, ...]:
    """
    Return the questions whose conditions hold: those that the participant sees.

    :param questions: in an order in which a condition is of an earlier one.
    :param answers: by the question's name.
    :param fields: of the participant; by default the questions are the fields themselves.
    """
    asked: list[Question] = []
    taken: dict[str, Answer] = {}
    for question in questions:
        if holds_for(question.when, taken, taken if fields is None else fields):
            asked.append(question)
            taken[question.name] = answers.get(question.name)
    return tuple(asked)


def check_answers(questions: Sequence[Question], answers: Mapping[str, Any], where: str,
                  fields: Mapping[str, Answer] | None = None) -> dict[str, Answer]:
    """
    Check the answers to some questions, and return them.

    :param answers: by the question's name; a missing one counts as None, and so does one to a
        question whose condition does not hold.
    :param fields: of the participant; by default the questions are the fields themselves.
    :return: an answer, or None, for each question in its order.
    :raises InputError: about the first answer that is refused.
    """
    known = {question.name for question in questions}
    for name in answers:
        if name not in known:
            raise InputError(f'{short(name)} is no question', where, 'answer what is asked')
    taken: dict[str, Answer] = dict.fromkeys((question.name for question in questions), None)
    for question in asked_of(questions, answers, fields):
        answer = answers.get(question.name)
        if refusal := question.refusal(answer):
            raise InputError(f'is answered by {short(answer)}', f'{where}: {question.name}',
                             refusal)
        taken[question.name] = answer
    return taken


def check_conditions(questions: Sequence[Question], *, are_fields: bool) -> None:
    """
    Refuse a condition that is not of an earlier question.

    :param are_fields: whether the questions are the fields of the participant.
    :raises InputError: naming the question.
    """
    earlier: list[str] = []
    for question in questions:
        when = question.when
        name = None if when is None else when.question or (when.field if are_fields else None)
        if name is not None and name not in earlier:
            raise InputError(f'is asked by an answer to "{name}", which is no earlier question',
                             f'{question.name}: when', f'name {", ".join(earlier) or "none"}')
        if when is not None and when.questionnaire is not None:
            raise InputError('has "questionnaire"', f'{question.name}: when',
                             'leave it out: it is the same one')
        earlier.append(question.name)


def _finite(value: object) -> TypeGuard[float]:
    # A long integer has no float.
    return isinstance(value, int | float) and not isinstance(value, bool) \
        and abs(value) <= sys.float_info.max
