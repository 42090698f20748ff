# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Units as people write them."""


def unit_symbol(unit: str) -> str:
    """Return a unit of a table for people: m/s² for m/s^2."""
    return unit.replace('^2', '²').replace('^3', '³')
