# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Results by name; a wrong name is answered with those that there are."""

from collections.abc import Iterable, Mapping
from typing import NoReturn, TypeVar

_Value = TypeVar('_Value')


class Named(dict[str, _Value]):
    """
    A dictionary whose `KeyError` tells the keys.

    :param what: one of its values, as in "no vehicle 'av9'".
    """

    def __init__(self, what: str, values: Mapping[str, _Value] | Iterable[tuple[str, _Value]] = (),
                 ) -> None:
        super().__init__(values)
        self._what = what

    def __missing__(self, name: object) -> NoReturn:
        raise KeyError(f'no {self._what} {name!r}; there are: {", ".join(self) or "none"}')
