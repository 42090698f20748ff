# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is said of a measure, from which texts, tables, reports and pages follow; its unit."""

from dataclasses import dataclass

FOOTPRINTS = 'footprints, bumper to bumper'


def unit_symbol(unit: str) -> str:
    """Return a unit of a table for people: m/s² for m/s^2, nothing for 1."""
    return '' if unit == '1' else unit.replace('^2', '²').replace('^3', '³')


def with_unit(label: str, symbol: str) -> str:
    """Return a label, text or HTML, with the unit behind it, if there is one."""
    return f'{label} [{symbol}]' if symbol else label


@dataclass(frozen=True)
class Measure:
    """
    A measure.

    :param unit: as tables write it; 1 for a bare number, empty for a truth value.
    :param definition: one sentence, without its unit.
    :param variant: which of several usual definitions is used, with its thresholds.
    :param reference_point: the point or the signal that it is measured at.
    :param label: for people.
    :param better: whether greater (1) or smaller (-1) values are better; 0 for neither.
    :param empty: when it has no value; empty for a measure that always has one.
    :param is_count: whether it counts events.
    """

    unit: str
    definition: str
    variant: str = ''
    reference_point: str = ''
    label: str = ''
    better: int = 0
    empty: str = ''
    is_count: bool = False

    @property
    def symbol(self) -> str:
        """Return the unit as people write it; empty for a bare number."""
        return unit_symbol(self.unit)

    @property
    def explanation(self) -> str:
        """Return the definition with variant and reference point."""
        point = self.reference_point and f'at: {self.reference_point}'
        return '; '.join(filter(None, (self.definition, self.variant, point)))
