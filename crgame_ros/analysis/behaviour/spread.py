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
"""Mean, standard deviation and extremes of what was measured evenly over time."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Spread(NamedTuple):
    """
    How values spread; NaN where there is none.

    :param mean: arithmetic.
    :param sd: standard deviation with N - 1; NaN of fewer than two.
    :param least: the smallest.
    :param most: the greatest.
    """

    mean: float
    sd: float
    least: float
    most: float


def spread_of(values: NDArray[np.float64]) -> Spread:
    """Give the spread of those values that are finite."""
    known = values[np.isfinite(values)]
    if not len(known):
        return Spread(math.nan, math.nan, math.nan, math.nan)
    return Spread(float(known.mean()), float(known.std(ddof=1)) if len(known) > 1 else math.nan,
                  float(known.min()), float(known.max()))
