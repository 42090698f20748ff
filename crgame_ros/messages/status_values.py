# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writing and reading the values of a status, which ROS's diagnostics carry as text."""

from collections.abc import Mapping
import math
from typing import Any, NamedTuple, Self

import numpy as np

# Levels of a status.
OK, WARN, ERROR = 0, 1, 2
# Begins the text of a planner that has found no plan; the reason follows.
BRAKING = 'braking: '


def status_text(value: object) -> str:
    """Return a value as text; booleans as `true` and `false`, as in ROS's own tools."""
    if isinstance(value, bool | np.bool_):
        return 'true' if value else 'false'
    return str(value)


def printable(text: str) -> str:
    """Return a text fit for a message, without lone surrogates, which cannot be encoded."""
    return text.encode('utf-8', 'replace').decode('utf-8')


def status_truth(values: Mapping[str, str], key: str, default: bool = False) -> bool:
    """Return a boolean value; recordings of earlier versions have `True`."""
    return values[key].lower() == 'true' if key in values else default


def status_number(values: Mapping[str, str], key: str) -> float | None:
    """Return a finite number; None if there is none, whoever sent it."""
    try:
        number = float(values.get(key, ''))
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def status_amount(values: Mapping[str, str], key: str) -> float | None:
    """Return a number that is not negative; None if there is none, whoever sent it."""
    number = status_number(values, key)
    return None if number is None or number < 0.0 else number


class Status(NamedTuple):
    """A diagnostic_msgs/DiagnosticStatus: level 0 OK, 1 WARN, 2 ERROR, 3 STALE."""

    name: str
    level: int
    text: str
    values: dict[str, str]

    @classmethod
    def of(cls, name: str, level: int, text: str, values: Mapping[str, object]) -> Self:
        """
        Return a status as it is sent.

        :param name: node and subject, `<node>: <subject>`.
        """
        return cls(printable(name), level, printable(text),
                   {printable(key): printable(status_text(value))
                    for key, value in values.items()})


def read_status(message: Any) -> Status:
    """Read a status; any library may have decoded it."""
    level = message.level
    return Status(str(message.name), level[0] if isinstance(level, bytes) else int(level),
                  str(message.message),
                  {str(item.key): str(item.value) for item in message.values})
