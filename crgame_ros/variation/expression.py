# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Arithmetic in game files: expressions over named numbers, and nothing else."""

from collections.abc import Mapping
import math

from crgame_ros.errors import InputError, short
from simpleeval import InvalidExpression, SimpleEval

_FUNCTIONS = {'abs': abs, 'min': min, 'max': max, 'sqrt': math.sqrt, 'round': round}
_LONGEST = 500


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
