# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The space of a game's variants, and samples of it: a grid, Latin hypercube, Sobol or chance.

A variant is a value for each dimension. A point of the unit cube stands for it: its coordinates
are the values of the distribution functions, so that the stated distributions are uniform there.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import product
import math
from pathlib import Path
from statistics import NormalDist
from typing import Any

from crgame_ros.errors import InputError, short
from crgame_ros.game.game import Game, parse_game
from crgame_ros.game.variation_spec import (
    Constraint,
    Derived,
    Dimension,
    EXPECT,
    MOST_VARIANTS,
    named_uniquely,
    Sampling,
    VARY,
)
from crgame_ros.schema.reading import read
from crgame_ros.schema.writing import write
import numpy as np
from numpy.typing import NDArray
from simpleeval import InvalidExpression, SimpleEval

Variant = Mapping[str, object]
Point = NDArray[np.float64]
Points = NDArray[np.float64]
# Values have so many digits: a variant is read and written by people.
DIGITS = 6
# Share of the probability of a distribution that is cut off at an open end.
_OPEN = 1e-9
_NAMES = ('id', 'name')
_FUNCTIONS = {'abs': abs, 'min': min, 'max': max, 'sqrt': math.sqrt, 'round': round}
_LONGEST = 500
# Points are drawn until enough keep the constraints, but no more than this many for each.
_DRAWN = 1000


class Axis:
    """A dimension with its distribution."""

    def __init__(self, spec: Dimension) -> None:
        self.spec, self.name = spec, spec.name
        if spec.values:
            return
        # Of a logarithmic distribution, the numbers are logarithms.
        logarithmic = spec.distribution in ('loguniform', 'lognormal')
        self._to: Callable[[float], float] = math.log if logarithmic else float
        self._from: Callable[[float], float] = math.exp if logarithmic else float
        low, high = ((None if end is None else self._to(end)) for end in (spec.start, spec.end))
        self._bell: NormalDist | None = None
        if spec.mean is not None and spec.deviation is not None:
            self._bell = NormalDist(self._to(spec.mean), spec.deviation)
            self._low = _OPEN if low is None else self._bell.cdf(low)
            self._high = 1.0 - _OPEN if high is None else self._bell.cdf(high)
            if self._high - self._low < _OPEN:
                raise InputError('no value of the distribution is within the range', '',
                                 'choose another mean, deviation, from or to')
        else:
            assert low is not None and high is not None
            # Whole numbers are equally likely, the ends included.
            half = 0.5 if spec.whole and not logarithmic else 0.0
            self._low, self._high = low - half, high + half

    @property
    def is_numeric(self) -> bool:
        """Return whether all its values are numbers."""
        return not self.spec.values or all(
            isinstance(value, int | float) and not isinstance(value, bool)
            for value in self.spec.values)

    @property
    def levels(self) -> list[object]:
        """Return its values in a grid: listed ones, or equally probable steps with the ends."""
        if self.spec.values:
            return list(self.spec.values)
        count = self.spec.levels
        least, most = self.value(0.0), self.value(1.0)
        if isinstance(least, int) and isinstance(most, int) and most - least < count:
            return list(range(least, most + 1))
        shares = [0.5] if count == 1 else [index / (count - 1) for index in range(count)]
        return list(dict.fromkeys(self.value(share) for share in shares))

    def value(self, share: float) -> object:
        """
        Return a value by its place in the distribution.

        :param share: of the probability below it, 0 to 1.
        """
        spec = self.spec
        if spec.values:
            return spec.values[min(int(share * len(spec.values)), len(spec.values) - 1)]
        inner = self._low + min(max(share, 0.0), 1.0) * (self._high - self._low)
        if self._bell is not None:
            inner = self._bell.inv_cdf(min(max(inner, _OPEN), 1.0 - _OPEN))
        number = self._from(inner)
        low = -math.inf if spec.start is None else spec.start
        high = math.inf if spec.end is None else spec.end
        if spec.whole:
            return int(min(max(math.floor(number + 0.5), math.ceil(low)), math.floor(high)))
        return min(max(float(f'{number:.{DIGITS}g}'), low), high)

    def share(self, value: object) -> float:
        """Return the place of a value in the distribution, 0 to 1; of a listed one, its middle."""
        if self.spec.values:
            count = len(self.spec.values)
            place = self.spec.values.index(value) if value in self.spec.values else count // 2
            return (place + 0.5) / count
        if not isinstance(value, int | float):
            return 0.5
        if self._from is math.exp and value <= 0:
            return 0.0
        inner = self._to(value)
        if self._bell is not None:
            inner = self._bell.cdf(inner)
        return min(max((inner - self._low) / (self._high - self._low), 0.0), 1.0)

    def distance(self, first: object, second: object) -> float:
        """Return how far two values are apart: in ranges or deviations; of names, 0 or 1."""
        if not (self.is_numeric and isinstance(first, int | float)
                and isinstance(second, int | float)):
            return float(first != second)
        spec = self.spec
        if spec.values:
            numbers = [value for value in spec.values if isinstance(value, int | float)]
            size = max(numbers) - min(numbers)
        elif spec.deviation is not None:
            if spec.distribution == 'lognormal':
                return abs(math.log(first / second)) / spec.deviation
            size = spec.deviation
        else:
            assert spec.start is not None and spec.end is not None
            size = spec.end - spec.start
        return abs(first - second) / (size or 1.0)


class VariantSpace:
    """
    The space of a game's variants.

    :param entries: what varies.
    :param values: values of the game, as its file has them.
    :param where: file, for messages.
    :raises InputError: if nothing varies, an expression is wrong, or a key cannot be set.
    """

    def __init__(self, entries: Sequence[Dimension | Derived | Constraint],
                 values: Mapping[str, object], where: str) -> None:
        named_uniquely(tuple(entries))
        self.axes: list[Axis] = []
        self._set: list[tuple[str, Expression | str, str]] = []
        self._constraints: list[Expression] = []
        for number, entry in enumerate(entries):
            place = f'{where}: {VARY}[{number}]'
            if isinstance(entry, Dimension):
                try:
                    self.axes.append(Axis(entry))
                except InputError as error:
                    raise InputError(error.what, place, error.remedy) from error
                if entry.key is not None:
                    self._set.append((entry.key, entry.name, place))
            elif isinstance(entry, Derived):
                self._set.append((entry.key, Expression(entry.value, place), place))
            else:
                self._constraints.append(Expression(entry.where, place))
        if not self.axes:
            raise InputError('nothing varies', where, 'add an entry with a name and a range to '
                             f'`{VARY}:` (docs/search.md)')
        self.values = {key: value for key, value in values.items() if key not in (VARY, EXPECT)}
        self.nominal: dict[str, object] = {
            axis.name: self._nominal(axis, where) for axis in self.axes}
        # Unknown names and keys are refused here, not in the middle of an evaluation.
        self.is_allowed(self.nominal)
        self.game_values(self.nominal)

    @property
    def names(self) -> list[str]:
        """Return the names of its dimensions."""
        return [axis.name for axis in self.axes]

    def _nominal(self, axis: Axis, where: str) -> object:
        spec = axis.spec
        given = spec.nominal
        if given is None and spec.key is not None:
            given = _value_at(self.values, spec.key)
        if given is None:
            return axis.value(0.5)
        if spec.distribution == 'lognormal' and isinstance(given, int | float) and given <= 0:
            raise InputError(f'"{spec.name}" is {given} in the game as it is', f'{where}: {VARY}',
                             'give a `nominal` above 0, or another distribution than lognormal')
        return given

    def variant(self, point: Sequence[float] | Point) -> dict[str, object]:
        """Return the variant at a point (D) of the unit cube."""
        return {axis.name: axis.value(float(share))
                for axis, share in zip(self.axes, point, strict=True)}

    def point(self, variant: Variant) -> Point:
        """Return where in the unit cube a variant lies, (D)."""
        return np.array([axis.share(variant[axis.name]) for axis in self.axes])

    def is_allowed(self, variant: Variant) -> bool:
        """Return whether a variant keeps all constraints."""
        return all(bool(each.value(variant)) for each in self._constraints)

    def distance(self, variant: Variant, other: Variant) -> float:
        """Return the distance of two variants, in ranges or standard deviations of each."""
        return math.sqrt(sum(axis.distance(variant[axis.name], other[axis.name]) ** 2
                             for axis in self.axes))

    def game_values(self, variant: Variant) -> dict[str, object]:
        """
        Return the values of the game that a variant stands for.

        :raises InputError: if a key of it cannot be set.
        """
        values = dict(self.values)
        for path, source, place in self._set:
            value = source.value(variant) if isinstance(source, Expression) else variant[source]
            values = with_value(values, path, value, place)
        return values

    def check(self, base: Path, where: str) -> None:
        """
        Check that the game can be read with each value at the ends of its range.

        :param base: directory against which file names of the game are resolved.
        :raises InputError: naming the value.
        """
        for axis in self.axes:
            for value in axis.spec.values or (axis.value(0.0), axis.value(1.0)):
                variant = self.nominal | {axis.name: value}
                if not self.is_allowed(variant):
                    continue
                try:
                    parse_game(self.game_values(variant), where, base)
                except InputError as error:
                    raise InputError(error.what, f'{error.where}, with {axis.name} = {value}',
                                     error.remedy) from error


def space_of(values: Mapping[str, object], where: str) -> VariantSpace:
    """
    Build the space from the values of a game.

    :param values: as `write` returns them, with `vary`.
    :param where: file, for messages.
    :raises InputError: if nothing varies, or an entry cannot be used.
    """
    entries = read(tuple[Dimension | Derived | Constraint, ...], values.get(VARY, []),
                   f'{where}: {VARY}')
    return VariantSpace(entries, values, where)


def game_of(game: Game, variant: Variant, where: str) -> Game:
    """
    Return the game that a variant of a game stands for.

    :raises InputError: if it cannot be read.
    """
    space = VariantSpace(game.vary, write(game, game.base), where)
    return parse_game(space.game_values(variant), where, game.base)


def _value_at(values: object, path: str) -> object:
    """
    Return the value of a key; None where it is not given.

    :param values: mappings and lists, as `write` returns them.
    :param path: names of keys, and ids, names or indices of entries, with dots between.
    """
    for name in path.split('.'):
        if isinstance(values, dict):
            values = values.get(name)
        elif isinstance(values, list):
            place = _place(values, name)
            values = None if place is None else values[place]
        else:
            return None
    return values


def with_value(values: object, path: str, value: object, where: str = '') -> Any:
    """
    Return values with a key changed or added; what is not on its path is shared.

    :param where: for messages.
    :raises InputError: if an entry or a section of the path does not exist.
    """
    name, _, rest = path.partition('.')
    if isinstance(values, list):
        place = _place(values, name)
        if place is None:
            raise InputError(f'there is no entry {short(name)}', where,
                             f'there are {", ".join(_names_of(values)) or "none"}')
        inner = with_value(values[place], rest, value, where) if rest else value
        return [*values[:place], inner, *values[place + 1:]]
    if values is None:
        values = {}
    if not isinstance(values, dict):
        raise InputError(f'{short(name)} is in no section', where, 'name a key of the game')
    return values | {name: with_value(values.get(name), rest, value, where) if rest else value}


def _place(entries: list[object], name: str) -> int | None:
    for index, entry in enumerate(entries):
        if isinstance(entry, dict) and name in (entry.get(key) for key in _NAMES):
            return index
    return int(name) if name.isdecimal() and int(name) < len(entries) else None


def _names_of(entries: list[object]) -> list[str]:
    return [next((str(entry[key]) for key in _NAMES if isinstance(entry, dict) and key in entry),
                 str(index)) for index, entry in enumerate(entries)]


class Expression:
    """
    An expression.

    :param text: such as `gap + 0.5 * speed`.
    :param where: file and key, for messages.
    :raises InputError: if it is no expression.
    """

    def __init__(self, text: str, where: str) -> None:
        self._text, self._where = text, where
        try:
            if len(text) > _LONGEST:
                raise SyntaxError(f'longer than {_LONGEST} characters')
            self._parsed = SimpleEval.parse(text)
        except (SyntaxError, InvalidExpression, ValueError, RecursionError) as error:
            raise InputError(f'{short(text)} is no expression', where,
                             f'write it like gap > 0.5 * speed ({error})'[:200]) from error

    def value(self, names: Mapping[str, object]) -> object:
        """
        Return its value.

        :param names: values of the names that it may contain.
        :raises InputError: if it has none.
        """
        try:
            return SimpleEval(names=dict(names), functions=_FUNCTIONS).eval(
                self._text, previously_parsed=self._parsed)
        except (InvalidExpression, ArithmeticError, ValueError, TypeError, KeyError,
                RecursionError) as error:
            raise InputError(f'{short(self._text)} has no value ({error})'[:200], self._where,
                             f'there are {", ".join(names) or "no names"}') from error


def sample(space: VariantSpace, sampling: Sampling, number: int, seed: int,
           where: str) -> list[dict[str, object]]:
    """
    Return variants that keep the constraints of a space.

    :param number: of variants; a grid has as many as its levels give.
    :param seed: of the points; a grid needs none.
    :param where: file, for messages.
    :raises InputError: if too few points keep the constraints, or a grid is too large.
    """
    if sampling == 'grid':
        levels = [axis.levels for axis in space.axes]
        size = math.prod(map(len, levels))
        if size > MOST_VARIANTS:
            raise InputError(f'its grid has {size} variants', where, 'give fewer levels')
        grid = (dict(zip(space.names, values, strict=True)) for values in product(*levels))
        found = [variant for variant in grid if space.is_allowed(variant)]
        if not found:
            raise InputError('no variant of the grid keeps the constraints', where,
                             'loosen them, or give more levels')
        return found
    draw = _points(sampling, len(space.axes), seed)
    found, drawn = [], 0
    while len(found) < number:
        # A Sobol sequence is balanced in whole powers of two.
        count = 1 << max(number - 1, 1).bit_length() if sampling == 'sobol' and not drawn \
            else number
        found += [variant for variant in map(space.variant, draw(count))
                  if space.is_allowed(variant)]
        drawn += count
        if drawn > _DRAWN * number + 10_000:
            raise InputError(f'only {len(found)} of {drawn} variants keep the constraints', where,
                             'loosen them')
    return found[:number]


def _points(sampling: Sampling, dimensions: int, seed: int) -> Callable[[int], Points]:
    """Return a source of points: called with their number, it returns (N, dimensions)."""
    # It takes a second to load, and not everyone who reads games draws points.
    from scipy.stats import qmc
    if sampling == 'random':
        rng = np.random.default_rng(seed)
        return lambda number: rng.random((number, dimensions))
    engine = {'sobol': qmc.Sobol, 'lhs': qmc.LatinHypercube}[sampling](dimensions, rng=seed)
    return engine.random
