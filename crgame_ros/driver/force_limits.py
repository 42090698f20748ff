# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The limits of a wheel's motor: strength, cap and slew, from its device map."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Within


@dataclass(frozen=True, kw_only=True)
class ForceLimits:
    """
    The motor of a wheel.

    :param max_torque: torque at full level [N m]
    :param strength: factor on the torque of the simulated steering; 0 switches it off [-]
    :param cap: share of `max_torque` that is never exceeded [-]
    :param slew: fastest change of the torque [N m/s]
    :param inverted: whether a positive level turns the wheel to the right.
    """

    FORM: ClassVar[Form] = Form('see docs/driving.md, section "Force feedback"')

    max_torque: Annotated[float, Within(0.05, 50.0)]
    strength: Annotated[float, Within(0.0, 5.0)] = 1.0
    cap: Annotated[float, Within(0.0, 1.0)] = 0.8
    slew: Annotated[float, Within(1.0, 1000.0)] = 60.0
    inverted: bool = False


class TorqueLimiter:
    """
    A limiter that keeps a torque within cap and slew.

    :param limits: of the motor.
    """

    def __init__(self, limits: ForceLimits) -> None:
        self.limits = limits
        self.torque = 0.0

    def step(self, wanted: float, dt_s: float) -> float:
        """
        Move towards a torque.

        :param wanted: of the simulated steering [N m]; NaN counts as 0.
        :param dt_s: since the last step [s]
        :return: torque of the motor, positive to the left [N m]
        """
        limits = self.limits
        most = limits.cap * limits.max_torque
        wanted = 0.0 if wanted != wanted else wanted * limits.strength
        goal = min(most, max(-most, wanted))
        change = limits.slew * max(0.0, dt_s)
        self.torque = min(self.torque + change, max(self.torque - change, goal))
        return self.torque
