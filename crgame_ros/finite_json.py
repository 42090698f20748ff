# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Values as JSON can hold them."""

from collections.abc import Iterable, Mapping
import math
from typing import overload


@overload
def finite(value: float) -> float | None: ...
@overload
def finite(value: Mapping[str, object]) -> dict[str, object]: ...
@overload
def finite(value: object) -> object: ...


def finite(value: object) -> object:
    """Replace NaN and infinities, which JSON does not have, by null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): finite(entry) for key, entry in value.items()}
    if isinstance(value, Iterable) and not isinstance(value, str):
        return [finite(entry) for entry in value]
    return value
