# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How long the data of a study's participants may be kept."""

import calendar
from dataclasses import dataclass
from datetime import date
from typing import Annotated, ClassVar

from crgame_ros.errors import InputError
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Within, Wording


@dataclass(frozen=True)
class Retention:
    """
    The time for which a participant's data may be kept: one of two.

    :param until: a date, the last day.
    :param months: after the last entry of the participant's session.
    """

    FORM: ClassVar[Form] = Form('see docs/studies.md for the keys')

    until: Annotated[str, Wording('[0-9]{4}-[0-9]{2}-[0-9]{2}',
                                  'give a date such as 2030-12-31')] | None = None
    months: Annotated[int, Within(1, 1200)] | None = None

    def check(self) -> None:
        """Refuse none or both, and a day that no calendar has."""
        if (self.until is None) == (self.months is None):
            raise InputError('has not one of "until" and "months"', '', 'give one of them')
        try:
            self.last_day(date.min)
        except ValueError as error:
            raise InputError(f'is {self.until}, which is no date', 'until',
                             'give a date such as 2030-12-31') from error

    def last_day(self, session: date) -> date:
        """
        Return the last day on which the data of a session may be kept.

        :param session: day of its last entry.
        """
        if self.until is not None:
            return date.fromisoformat(self.until)
        months = session.year * 12 + session.month - 1 + (self.months or 0)
        year, month = months // 12, months % 12 + 1
        # A month after the 31st of January is the last of February.
        return date(year, month, min(session.day, calendar.monthrange(year, month)[1]))
