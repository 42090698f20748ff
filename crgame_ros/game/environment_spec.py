# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a game file says about light and air."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Within

Light = Literal['day', 'dusk']
# On a clear day [m].
CLEAR_M = 30_000.0


@dataclass(frozen=True)
class EnvironmentSpec:
    """
    Light and air, as people see the world; no sensor of an AV knows of them.

    :param light: day or dusk; None takes what the scenario says, else day.
    :param visibility: meteorological visibility, at which 5 % of a contrast is left (Koschmieder)
        [m]; None takes what the scenario says, else 30 km.
    """

    FORM: ClassVar[Form] = Form('see docs/games.md for the keys')

    light: Light | None = None
    visibility: Annotated[float, Within(10.0, 100_000.0)] | None = None
