# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What may vary in a game file, for `crgame evaluate` and `crgame search`."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from crgame_ros.errors import InputError
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Advice, Called, LeftOut, Listed, Within, Wording

_FORM = Form('see docs/search.md for the keys')
KeyPath = Annotated[str, Wording(r'[^\s.]+(\.[^\s.]+)*', 'name a key of the game with its '
                                 'sections, such as humans.hv0.spawn.speed')]
# Keys of a game that tell what to do with it, not what it is.
VARY, EXPECT = 'vary', 'expect'
Sampling = Literal['sobol', 'lhs', 'random', 'grid']
MOST_VARIANTS = 1_000_000
Distribution = Literal['uniform', 'loguniform', 'normal', 'lognormal']


@dataclass(frozen=True)
class Dimension:
    """
    A quantity that varies: within a range, by a distribution, or among listed values.

    :param name: its name in tables, expressions and results.
    :param key: key of the game that it sets, with its sections: `humans.hv0.spawn.speed`. Entries
        of lists are named by their id or name, or by their index from 0. Without a key, it is only
        used in the expressions of other entries.
    :param start: least value.
    :param end: greatest value.
    :param values: all possible values, instead of a range.
    :param distribution: of the values in the range; all listed values are equally likely.
    :param mean: of a normal distribution; of a lognormal one, its median.
    :param deviation: standard deviation; of a lognormal one, that of the logarithm.
    :param whole: whether only whole numbers are possible.
    :param nominal: its value in the game as it is; by default the key's, or the median.
    :param levels: number of its values in a grid.
    """

    FORM: ClassVar[Form] = _FORM

    name: Annotated[str, Wording('[a-z][a-z0-9_]{0,39}',
                                 'begin with a-z and use a-z, 0-9 and _ only, 40 at most')]
    key: KeyPath | None = None
    start: Annotated[float | None, Called('from')] = None
    end: Annotated[float | None, Called('to')] = None
    values: Annotated[tuple[object, ...], Listed(0, 1000, 'value'), LeftOut()] = ()
    distribution: Distribution = 'uniform'
    mean: float | None = None
    deviation: Annotated[float, Within(0.0, above=True)] | None = None
    whole: bool = False
    nominal: object = None
    levels: Annotated[int, Within(1, 1000)] = 5

    def check(self) -> None:
        """Refuse a dimension without values, or with contradicting ones."""
        bell = self.distribution in ('normal', 'lognormal')
        if self.values:
            if any(value is not None for value in (self.start, self.end, self.mean)) \
                    or self.distribution != 'uniform':
                raise InputError('has "values" and a range or distribution', '', 'leave one out')
        elif bell and (self.mean is None or self.deviation is None):
            raise InputError(f'is {self.distribution} without mean or deviation', '', 'give both')
        elif not bell and (self.start is None or self.end is None):
            raise InputError('has no range', '', 'give from and to, or values')
        if not bell and (self.mean is not None or self.deviation is not None):
            raise InputError('has a mean or a deviation', '',
                             'give distribution: normal or lognormal, or leave them out')
        if self.start is not None and self.end is not None and self.start >= self.end:
            raise InputError(f'is from {self.start:g} to {self.end:g}', '',
                             'let "from" be less than "to"')
        positive = self.distribution in ('loguniform', 'lognormal')
        if positive and min((value for value in (self.start, self.end, self.mean)
                             if value is not None), default=1.0) <= 0.0:
            raise InputError(f'is {self.distribution}, but not above 0', '',
                             'give numbers above 0')


@dataclass(frozen=True)
class Derived:
    """
    A key that follows from what varies.

    :param value: expression with the names of the dimensions: `gap + 0.5 * speed`; + - * / % **,
        comparisons, and, or, not, x if c else y, abs, min, max, sqrt, round.
    :param key: key of the game that it sets, as for a dimension.
    """

    FORM: ClassVar[Form] = _FORM

    value: Annotated[str, Advice('give an expression with the names of what varies')]
    key: KeyPath


@dataclass(frozen=True)
class Constraint:
    """
    A condition that variants keep; others are not run.

    :param where: expression that is true for them: `gap > 2 * speed`.
    """

    FORM: ClassVar[Form] = _FORM

    where: Annotated[str, Advice('give a condition with the names of what varies')]


def named_uniquely(entries: tuple[Dimension | Derived | Constraint, ...]) -> None:
    """
    Refuse two dimensions of one name, and two entries that set one key.

    :raises InputError: about the first of them.
    """
    for field in ('name', 'key'):
        seen: set[str] = set()
        for number, entry in enumerate(entries):
            value = getattr(entry, field, None)
            if value in seen:
                raise InputError(f'{field} "{value}" is there already', f'vary[{number}]',
                                 'leave one out')
            if value is not None:
                seen.add(value)


VariationList = Annotated[tuple[Dimension | Derived | Constraint, ...],
                          Listed(0, 100, 'entry')]
