# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The equation of the Intelligent Driver Model (CRG reference 10), for numbers and for arrays."""

from collections.abc import Callable
import math
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

# One call takes numbers only or arrays only.
Number = TypeVar('Number', float, NDArray[np.float64])

EXPONENT = 4
CLOSEST = 0.1


class IdmParameters(NamedTuple):
    """
    Parameters of the model, in the notation of CRG reference 10.

    :param time_headway: T [s]
    :param s0: gap at standstill [m]
    :param a: maximum acceleration [m/s^2]
    :param b: comfortable deceleration [m/s^2]
    :param b_max: hardest deceleration [m/s^2]
    """

    time_headway: float
    s0: float
    a: float
    b: float
    b_max: float


def free_acceleration(speed: Number, desired: Number, model: IdmParameters,
                      larger: Callable[..., Number] = max) -> Number:
    """
    Return the free-road acceleration a (1 - (v / v0)^4); not below -b where v exceeds v0 [m/s^2].

    :param desired: v0, above 0 [m/s]
    :param larger: `max` for numbers, `numpy.maximum` for arrays
    """
    return larger(model.a * (1.0 - (speed / desired) ** EXPONENT), -model.b)


def interaction(speed: Number, gap: Number, leader_speed: Number, model: IdmParameters,
                larger: Callable[..., Number] = max) -> Number:
    """
    Return the interaction term -a (s* / s)^2 of the IDM (CRG reference 10) [m/s^2].

    The desired gap is s* = s0 + max(0, v T + v dv / (2 sqrt(a b))) with dv = v - v_leader.

    :param gap: s, bumper to bumper [m]
    :param larger: `max` for numbers, `numpy.maximum` for arrays
    """
    closing = speed * (speed - leader_speed) / (2.0 * math.sqrt(model.a * model.b))
    wanted = model.s0 + larger(0.0, speed * model.time_headway + closing)
    return -model.a * (wanted / larger(gap, CLOSEST)) ** 2
