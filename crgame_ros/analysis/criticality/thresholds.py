# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Thresholds beyond which measures are critical."""

import math
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.schema.declaration import sentences_of


class Thresholds(NamedTuple):
    """
    Thresholds of critical values, as in the SSM device of SUMO, and of short time gaps.

    :param ttc_s: smaller times to collision are critical [s]
    :param drac: greater decelerations to avoid a crash are critical [m/s^2]
    :param pet_s: smaller post-encroachment times are critical [s]
    :param time_gap_s: smaller time gaps are short, but not critical [s]
    """

    ttc_s: float = 3.0
    drac: float = 3.0
    pet_s: float = 2.0
    time_gap_s: float = 1.0

    def exceeded(self, measure: str, value: float) -> bool:
        """Return whether a value is critical; False for measures without a threshold."""
        return self.excess(measure, value) > 1.0

    def of(self, measure: str) -> float | None:
        """Return the threshold of a measure; None if it has none."""
        return {'ttc': self.ttc_s, 'drac': self.drac, 'pet': self.pet_s, 'gap': 0.0,
                'min_distance': 0.0}.get(measure)

    def excess(self, measure: str, value: float) -> float:
        """
        Return how far a value is towards its threshold (0 to 1) or beyond (above 1).

        Without a threshold, and for NaN, it is 0; where two vehicles touch it is infinite.
        """
        limit = self.of(measure)
        if limit is None or math.isnan(value):
            return 0.0
        if measure == 'drac':
            return value / limit
        return limit / value if value > 0.0 else math.inf

    def check(self, prefix: str = '') -> None:
        """
        Check the thresholds.

        :param prefix: prefix of the option names, for the message.
        :raises InputError: if one is not positive.
        """
        for name, value in self._asdict().items():
            if not 0.0 < value < math.inf:
                option = OPTIONS[name][0].replace('_', '-') if prefix else OPTIONS[name][0]
                raise InputError(f'is {value}', prefix + option,
                                 'give a positive number')


USUAL = Thresholds()
_SENTENCES = sentences_of(Thresholds)
# By field: the name of an option or parameter, and what the threshold is.
OPTIONS = {field: (field.removesuffix('_s'), _SENTENCES.get(field, ''))
           for field in Thresholds._fields}
