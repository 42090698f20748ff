# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What makes a trial a success, and the rule by which successes end a block."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from crgame_ros.errors import InputError
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Within
from crgame_ros.study.answer_condition import QuestionTest

_SEE = 'see docs/studies.md for the keys'
OUTCOMES = ('time', 'collision', 'off_road')


@dataclass(frozen=True)
class Success(QuestionTest):
    """
    What makes a trial a success: an answer after it, or a value of its drive.

    :param question: name of a question that follows every trial of the block.
    :param questionnaire: name of its questionnaire, if several that follow have this question.
    :param drive: instead of a question: how the drive ended, or a number of the vehicle's contacts
        or departures from the road.
    """

    FORM: ClassVar[Form] = Form(_SEE)
    ELSE: ClassVar[str] = 'drive'

    drive: Literal['outcome', 'contacts', 'departures'] | None = None

    def check(self) -> None:
        """Refuse a success of nothing, of two things, without a test, or that never comes."""
        super().check()
        if self.drive == 'outcome' and not (
                self.values and all(value in OUTCOMES for value in self.values)):
            raise InputError('tests no outcome of a drive', '',
                             f'give equals or one_of with {", ".join(OUTCOMES)}')
        if self.drive in ('contacts', 'departures') and not all(
                type(value) in (int, float) for value in self.values):
            raise InputError(f'tests {self.drive}, which are numbers, by something else', '',
                             'give numbers')

    @property
    def told(self) -> str:
        """Return it in words."""
        return self.text_of(self.question_told if self.drive is None
                            else f'{self.drive} of the drive')


@dataclass(frozen=True)
class StopRule:
    """
    When a block ends before its last trial: by successes one after the other.

    :param success: what makes a trial a success.
    :param in_a_row: number of successes.
    """

    FORM: ClassVar[Form] = Form(_SEE)

    success: Success
    in_a_row: Annotated[int, Within(1, 100)] = 3

    @property
    def told(self) -> str:
        """Return the rule in words."""
        row = 'a success' if self.in_a_row == 1 else f'{self.in_a_row} successes in a row'
        return f'ends after {row}; success: {self.success.told}'

    def ends_after(self, successes: Iterable[bool | None]) -> int | None:
        """
        Return after how many trials the block ends; None if it does not.

        :param successes: of its trials, in their order; None counts for nothing.
        """
        row = 0
        for number, success in enumerate(successes, 1):
            row = row if success is None else row + 1 if success else 0
            if row == self.in_a_row:
                return number
        return None
