# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
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
