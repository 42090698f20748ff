# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Questions of a study, and whether an answer is one of theirs."""

from collections.abc import Mapping
from dataclasses import dataclass
import math
from typing import Annotated, Any, ClassVar

from crgame_ros.errors import InputError, short
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Advice, Keyed, Listed, Within, Wording
from crgame_ros.study.local_text import LocalText, Text
from crgame_ros.study.names import ColumnName

_SEE = 'see docs/studies.md for the keys'
MOST_CHARACTERS = 20_000
Answer = float | str | list[str] | None


@dataclass(frozen=True)
class LikertQuestion:
    """
    One of some points in a row, 1 at the left.

    :param points: how many.
    :param left: what the first means.
    :param right: what the last means.
    :param labels: what each means, instead of `left` and `right`.
    """

    FORM: ClassVar[Form] = Form(_SEE)

    points: Annotated[int, Within(2, 11)] = 7
    left: Text = LocalText()
    right: Text = LocalText()
    labels: Annotated[tuple[Text, ...], Listed(0, 11, 'label')] = ()

    def check(self) -> None:
        """Refuse labels for other points."""
        if self.labels and len(self.labels) != self.points:
            raise InputError(f'has {len(self.labels)} labels for {self.points} points', '',
                             'give one for each point')

    def refusal(self, answer: Any) -> str:
        """Return why an answer is none of this question, empty if it is one."""
        whole = isinstance(answer, int | float) and not isinstance(answer, bool) \
            and answer == int(answer) if _finite(answer) else False
        return '' if whole and 1 <= answer <= self.points else f'give 1 to {self.points}'


@dataclass(frozen=True)
class SliderQuestion:
    """
    A place on a line, which is not marked before somebody does.

    :param low: at the left end.
    :param high: at the right end.
    :param step: between neighbouring places.
    :param left: what the left end means.
    :param right: what the right end means.
    """

    FORM: ClassVar[Form] = Form(_SEE)

    low: float = 0.0
    high: float = 100.0
    step: Annotated[float, Within(0.0, above=True)] = 1.0
    left: Text = LocalText()
    right: Text = LocalText()

    def check(self) -> None:
        """Refuse a line without length."""
        if not self.high > self.low:
            raise InputError(f'"high" is not above "low", {self.low:g}', '', 'give a higher one')

    def refusal(self, answer: Any) -> str:
        """Return why an answer is none of this question, empty if it is one."""
        fits = _finite(answer) and self.low <= answer <= self.high
        return '' if fits else f'give {self.low:g} to {self.high:g}'


@dataclass(frozen=True)
class ChoiceQuestion:
    """
    One of some choices, or several of them.

    :param choices: the answer's name, and what people read.
    :param several: whether more than one, or none, may be chosen.
    """

    FORM: ClassVar[Form] = Form(_SEE)

    choices: dict[str, Any]
    several: bool = False

    def check(self) -> None:
        """Refuse what leaves nothing to choose."""
        if len(self.choices) < 2:
            raise InputError(f'has {len(self.choices)} choices', '', 'give two or more')
        for name, text in self.choices.items():
            LocalText.from_value(text, f'choices: {name}')

    @property
    def texts(self) -> dict[str, LocalText]:
        """Return what people read, by the answer's name."""
        return {str(name): LocalText.from_value(text) for name, text in self.choices.items()}

    def refusal(self, answer: Any) -> str:
        """Return why an answer is none of this question, empty if it is one."""
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
    A number that somebody types.

    :param low: least that is taken.
    :param high: greatest that is taken.
    :param whole: whether only whole numbers are taken.
    :param unit: that stands behind it.
    """

    FORM: ClassVar[Form] = Form(_SEE)

    low: float = -1e9
    high: float = 1e9
    whole: bool = False
    unit: Annotated[str, Wording(r'[\s\S]{0,20}', 'give 20 characters at most')] = ''

    def refusal(self, answer: Any) -> str:
        """Return why an answer is none of this question, empty if it is one."""
        fits = _finite(answer) and self.low <= answer <= self.high \
            and (not self.whole or answer == int(answer))
        kind = 'a whole number' if self.whole else 'a number'
        return '' if fits else f'give {kind} from {self.low:g} to {self.high:g}'


@dataclass(frozen=True)
class TextQuestion:
    """
    Whatever somebody writes.

    :param longest: number of characters that are taken.
    """

    FORM: ClassVar[Form] = Form(_SEE)

    longest: Annotated[int, Within(1, MOST_CHARACTERS)] = 10_000

    def refusal(self, answer: Any) -> str:
        """Return why an answer is none of this question, empty if it is one."""
        fits = isinstance(answer, str) and len(answer) <= self.longest
        return '' if fits else f'give {self.longest} characters at most'


QuestionKind = LikertQuestion | SliderQuestion | ChoiceQuestion | NumberQuestion | TextQuestion
KINDS: dict[str, type[QuestionKind]] = {
    'likert': LikertQuestion, 'slider': SliderQuestion, 'choice': ChoiceQuestion,
    'number': NumberQuestion, 'text': TextQuestion}


@dataclass(frozen=True)
class Question:
    """
    One question.

    :param name: of its column in the tables.
    :param kind: what can be answered.
    :param ask: what people read.
    :param required: whether it has to be answered before anybody goes on.
    """

    FORM: ClassVar[Form] = Form(_SEE, first=('name', 'ask'))

    name: ColumnName
    kind: Annotated[QuestionKind, Keyed(KINDS, 'kind of answer')]
    ask: Annotated[Text, Advice('say what is asked')] = LocalText()
    required: bool = True

    def refusal(self, answer: Any) -> str:
        """Return why an answer cannot be taken, empty if it can; None is no answer."""
        if answer is None:
            return 'give an answer' if self.required else ''
        if self.required and answer in ('', []):
            return 'give an answer'
        return self.kind.refusal(answer)


def check_answers(questions: tuple[Question, ...], answers: Mapping[str, Any],
                  where: str) -> dict[str, Answer]:
    """
    Take the answers to some questions.

    :param answers: by the question's name; one that is left out is None.
    :return: an answer, or None, for each question in its order.
    :raises InputError: about the first that cannot be taken.
    """
    known = {question.name for question in questions}
    for name in answers:
        if name not in known:
            raise InputError(f'{short(name)} is no question', where, 'answer what is asked')
    taken: dict[str, Answer] = {}
    for question in questions:
        answer = answers.get(question.name)
        refusal = question.refusal(answer)
        if refusal:
            raise InputError(f'is answered by {short(answer)}', f'{where}: {question.name}',
                             refusal)
        taken[question.name] = answer
    return taken


def _finite(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
