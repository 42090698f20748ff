# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The expectations of a game file: what a run of it has to keep."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from crgame_ros.errors import InputError
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Listed, Within


@dataclass(frozen=True)
class Expectation:
    """
    A bound of a measure, for `crgame test`.

    :param measure: a measure of docs/testing.md, or a numeric column of the table `vehicles`.
    :param vehicle: id of a human or an AV; without it, every AV.
    :param at_least: least value that is good, in the unit of the measure.
    :param at_most: greatest value that is good.
    :param share: of the runs with different seeds in which it has to hold.
    """

    FORM: ClassVar[Form] = Form('see docs/testing.md for the keys')

    measure: str
    vehicle: str | None = None
    at_least: float | None = None
    at_most: float | None = None
    share: Annotated[float, Within(0.0, 1.0, above=True)] = 1.0

    def check(self) -> None:
        """Refuse an expectation without a bound, or with bounds that nothing is between."""
        if self.at_least is None and self.at_most is None:
            raise InputError('it has no bound', '', 'give at_least or at_most')
        if self.at_least is not None and self.at_most is not None \
                and self.at_least > self.at_most:
            raise InputError(f'at_least {self.at_least:g} is greater than at_most '
                             f'{self.at_most:g}', '', 'exchange them')

    def told(self) -> str:
        """Return it in words."""
        bounds = [f'{name.replace("_", " ")} {value:g}' for name, value in (
            ('at_least', self.at_least), ('at_most', self.at_most)) if value is not None]
        share = '' if self.share == 1.0 else f' in {100 * self.share:g} % of the runs'
        return f'{self.vehicle or "AVs"}: {self.measure} {" and ".join(bounds)}{share}'

    def is_kept(self, value: float) -> bool:
        """Return whether a value is good."""
        return (self.at_least is None or value >= self.at_least) \
            and (self.at_most is None or value <= self.at_most)


ExpectationList = Annotated[tuple[Expectation, ...], Listed(0, 100, 'expectation')]
