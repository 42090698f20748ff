# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CommonRoad's cost functions: the formula of each in the checker's code, without the checker."""

from typing import NamedTuple


class CostDefinition(NamedTuple):
    """A cost function as the checker's code has it: a sentence, and where the site differs."""

    definition: str
    variant: str


_PATH_LENGTH = 'the code takes the path length L where the site has the offset from the lane'
COSTS = {
    'JB1': CostDefinition('T', 'the same on the site'),
    'SA1': CostDefinition('0.1 SA + 0.1 SR + 1e5 D', 'weights differ from the site; the code '
                          'does not see obstacles turned by exactly 0 rad in D'),
    'WX1': CostDefinition('10 T + V + 0.1 A + 0.1 J + 0.1 D + 10 L', _PATH_LENGTH),
    'SM1': CostDefinition('50 A + 50 SA + 50 SR + L + 20 V + 50 O', _PATH_LENGTH),
    'SM2': CostDefinition('50 A + 50 SA + 50 SR + L + 50 O', _PATH_LENGTH),
    'SM3': CostDefinition('50 A + 50 SA + 50 SR + 20 V + 50 O', 'weights differ from the site'),
    'MW1': CostDefinition('5 Jlat + 0.5 Jlon + 0.2 Vlon + ID',
                          'in the code Jlat is of the lateral speed, Vlon is 0, and ID is 10'),
    'TR1': CostDefinition('0.01 Jlon + 22 SR + 8 D + 0.5 LC', 'not on the site'),
}
