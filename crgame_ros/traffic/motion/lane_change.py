# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Lane changes (FS M3): the path of a change, its incentives and the gaps that allow it."""

from dataclasses import dataclass
import math

from crgame_ros.traffic.compiling.compiled import compiled, inlined
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Greatest |f''| of f(u) = 10 u^3 - 15 u^4 + 6 u^5, at u = 1/2 -+ sqrt(3) / 6.
PEAK = 10.0 / math.sqrt(3.0)
# Least length of a change [m].
SHORTEST_CHANGE = 12.0
# Least advantage for a free change (Kesting, Treiber and Helbing 2007: 0.1) [m/s^2].
CHANGE_THRESHOLD = 0.2


@compiled
def lane_change_length(speed: float, shift: float = 3.5, duration: float = 4.0,
                       shortest: float = SHORTEST_CHANGE,
                       max_lateral_acceleration: float = 2.0) -> float:
    """
    Return the length of a lane change, FS's empirical function of the speed.

    L = max(L_min, v t, v sqrt(10 / sqrt(3) W / a_max)): drivers take about the same time at every
    speed, and no more lateral acceleration than is comfortable.

    :param speed: [m/s]
    :param shift: W, distance between the lanes [m]
    :param duration: t; drivers take 3 to 6 s (ours) [s]
    :param shortest: L_min, about two and a half lengths of a car (ours) [m]
    :param max_lateral_acceleration: comfortable (ours) [m/s^2]
    :return: [m]
    """
    fastest = math.sqrt(PEAK * abs(shift) / max_lateral_acceleration)
    return max(shortest, speed * max(duration, fastest))


def quintic(offset: Array, slope: Array, curvature: Array, target: Array,
            length: Array) -> Array:
    """
    Return the coefficients p_i of y = sum p_i x^i (FS 4) from now to the centre of a lane.

    The six conditions are y, y', y'' at x = 0 and y = target, y' = y'' = 0 at x = L; solved in
    u = x / L, where they do not depend on L.

    :param offset: (A,) y at x = 0 [m]
    :param slope: (A,) y'
    :param curvature: (A,) y'' [1/m]
    :param target: (A,) y at x = L [m]
    :param length: (A,) L, above 0 [m]
    :return: (A, 6) p_0 ... p_5 [m^(1 - i)]
    """
    rise = target - offset
    first = slope * length
    second = 0.5 * curvature * length ** 2
    scaled = np.stack((offset, first, second,
                       10.0 * rise - 6.0 * first - 3.0 * second,
                       -15.0 * rise + 8.0 * first + 3.0 * second,
                       6.0 * rise - 3.0 * first - second), axis=-1)
    return scaled / length[:, None] ** np.arange(6)


@inlined
def offset_at(curve: Array, x: float, length: float) -> float:
    """
    Return the lateral offset on the path of a lane change (FS 4).

    :param curve: (6,) from `quintic`
    :param x: distance since the start of the change; clipped to [0, L], so that behind its end the
        path stays in the centre of the lane [m]
    :param length: L [m]
    :return: y [m]
    """
    x = min(max(x, 0.0), length)
    return curve[0] + x * (curve[1] + x * (curve[2] + x * (
        curve[3] + x * (curve[4] + x * curve[5]))))


@dataclass(frozen=True)
class GapAcceptance:
    """
    The gaps that a driver accepts ahead of and behind its place in the target lane.

    After Hidas (2005): a gap has a least length, and a greater one where the vehicle behind is
    faster. A forced change accepts less. The headway share and the numbers are ours. The limits
    of braking are MOBIL's safety criterion (Kesting et al. 2007).

    :param standstill_gap: least gap at any speed [m]
    :param closing_time: increase of the gap per speed difference [s]
    :param headway: increase of the gap per speed of the vehicle behind, at urgency 0 [s]
    :param forced_headway: the same at urgency 1 [s]
    :param deceleration: hardest braking that a change may cause, at urgency 0 [m/s^2]
    :param forced_deceleration: the same at urgency 1, b_safe of Kesting et al. [m/s^2]
    """

    standstill_gap: float = 2.0
    closing_time: float = 0.9
    headway: float = 0.5
    forced_headway: float = 0.2
    deceleration: float = 2.0
    forced_deceleration: float = 4.0

    def minimum_gap(self, behind_speed: Array, ahead_speed: Array,
                    urgency: Array | float = 0.0) -> Array:
        """
        Return the least gap between two vehicles after a change.

        :param behind_speed: (A,) of the vehicle behind [m/s]
        :param ahead_speed: (A,) of the vehicle ahead [m/s]
        :param urgency: (A,) 0 to 1
        :return: (A,) bumper to bumper [m]
        """
        headway = self.headway + urgency * (self.forced_headway - self.headway)
        return (self.standstill_gap + headway * behind_speed
                + self.closing_time * np.maximum(behind_speed - ahead_speed, 0.0))

    def accepts(self, speed: Array, lead_gap: Array, lead_speed: Array, follow_gap: Array,
                follow_speed: Array, own_acceleration: Array, follow_acceleration: Array,
                urgency: Array | float = 0.0) -> NDArray[np.bool_]:
        """
        Return whether each vehicle may change now; all arguments are (A,).

        :param speed: of the vehicle that wants to change [m/s]
        :param lead_gap: to the vehicle that would be ahead; inf where there is none [m]
        :param lead_speed: its speed; any value where there is none [m/s]
        :param follow_gap: from the vehicle that would be behind; inf where there is none [m]
        :param follow_speed: its speed; any value where there is none [m/s]
        :param own_acceleration: of the car-following model behind the new leader [m/s^2]
        :param follow_acceleration: of the new follower's model behind the vehicle [m/s^2]
        :param urgency: 0 for a free change, up to 1 for a forced one
        """
        hardest = self.deceleration + urgency * (self.forced_deceleration - self.deceleration)
        lead, follow = np.isposinf(lead_gap), np.isposinf(follow_gap)
        ahead = lead | ((lead_gap >= self.minimum_gap(speed, lead_speed, urgency))
                        & (own_acceleration >= -hardest))
        behind = follow | ((follow_gap >= self.minimum_gap(follow_speed, speed, urgency))
                           & (follow_acceleration >= -hardest))
        return np.asarray(ahead & behind)


def incentive(here: Array, there: Array, others: Array | float = 0.0,
              politeness: Array | float = 0.2) -> Array:
    """
    Return the advantage of a free change: MOBIL (Kesting, Treiber and Helbing 2007).

    :param here: (A,) acceleration in the present lane, behind its slow leader [m/s^2]
    :param there: (A,) acceleration in the target lane [m/s^2]
    :param others: (A,) sum of the changes of acceleration of the old and the new follower [m/s^2]
    :param politeness: (A,) their weight
    :return: (A,) [m/s^2]; a change pays above `CHANGE_THRESHOLD`.
    """
    return there - here + politeness * others


@compiled
def urgency(distance: float, speed: float, changes: float = 1.0, horizon: float = 15.0,
            shortest: float = 100.0) -> float:
    """
    Return the urgency of a change for the route, which grows towards the last place for it.

    It is 0 until the time horizon, then rises linearly to 1 where just the length of a lane change
    is left. Every further lane to cross moves both places back by as much (ours).

    :param distance: to the last place for the change, inf where none is needed [m]
    :param speed: [m/s]
    :param changes: lanes to cross
    :param horizon: time before that place at which the urgency begins [s]
    :param shortest: least distance at which it begins [m]
    :return: from 0 to 1
    """
    last = lane_change_length(speed) * changes
    first = max(shortest, horizon * speed) * changes
    return min(max((first - distance) / max(first - last, 1.0), 0.0), 1.0)
