# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rules that exclude participants, by their answers and by failed attention checks."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from crgame_ros.errors import InputError
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Within, Wording
from crgame_ros.study.answer_condition import AnswerCondition

_SEE = 'see docs/studies.md for the keys'


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

    FORM: ClassVar[Form] = Form(_SEE)

    when: AnswerCondition | None = None
    attention_failed: Annotated[int, Within(1, 1000)] | None = None
    reason: Annotated[str, Wording(r'[^\x00-\x1f]{0,200}', 'give 200 characters at most')] = ''
    page: Annotated[str, Wording(r'[^/\0][^\0]*\.md',
                                 'name a Markdown file beside this one')] | None = None

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
