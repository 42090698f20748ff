# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cooperative lane changes: how followers make room, and how the gap reopens after (FS M3)."""

from dataclasses import dataclass

from crgame_ros.traffic.compiling.compiled import compiled
from crgame_ros.traffic.fleet.agents import AgentTable
from crgame_ros.traffic.lanes.lane_table import IntArray
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CourtesyRules:
    """
    The courtesy of a driver towards another that wants to change into the driver's lane.

    After Hidas (2005): the follower in the target lane slows down by Dv with the deceleration b
    during D_t = Dv / b, so that the gap is wide enough then. The limit of b depends on how urgent
    the change is and how aggressive the follower is. A follower that would have to brake harder
    does not yield. The numbers are ours.

    :param deceleration: hardest braking of a driver without aggressivity for a change without
        urgency [m/s^2]
    :param urgent_deceleration: the same at urgency 1 [m/s^2]
    :param max_speed_drop: greatest Dv [m/s]
    :param time: D_t [s]
    :param patience: time that an agent stands at the end of a lane until another stops for it [s]
    :param patient_deceleration: hardest braking of the one that stops [m/s^2]
    """

    deceleration: float = 1.0
    urgent_deceleration: float = 2.5
    max_speed_drop: float = 5.0
    time: float = 4.0
    patience: float = 3.0
    patient_deceleration: float = 2.0

    def deceleration_limit(self, urgency: Array | float,
                           aggressivity: Array | float) -> Array | float:
        """
        Return the hardest braking that a driver does for another.

        :param urgency: (A,) of the other, 0 to 1
        :param aggressivity: (A,) of the driver, 0 to 1; 1 never yields
        :return: (A,) [m/s^2]
        """
        eager = self.deceleration + urgency * (self.urgent_deceleration - self.deceleration)
        return (1.0 - aggressivity) * eager

    def courtesy_deceleration(self, follow_speed: Array, follow_gap: Array, speed: Array,
                              needed_gap: Array, urgency: Array | float = 0.0,
                              aggressivity: Array | float = 0.5,
                              ) -> tuple[Array, NDArray[np.bool_]]:
        """
        Return the constant deceleration b that opens a gap within D_t.

        gap(D_t) = gap - (v_f D_t - b D_t^2 / 2) + v D_t, solved for b. It holds for the follower
        in the target lane, which lets an agent in, and for that agent, which falls back behind
        its new leader. Computed at every decision, the missing gap obeys
        x'' + 2 x' / D_t + 2 x / D_t^2 = 0 until b is 0. Then it closes at the difference of
        speeds reached: a vehicle that yields doesn't accelerate before the gap is open.

        :param follow_speed: v_f, (A,) of the vehicle behind [m/s]
        :param follow_gap: (A,) to the vehicle ahead as if both were in one lane, bumper to
            bumper; negative while they are side by side [m]
        :param speed: v, (A,) of the vehicle ahead [m/s]
        :param needed_gap: (A,) from `GapAcceptance.minimum_gap` [m]
        :param urgency: (A,) of the driver that changes lanes, 0 to 1
        :param aggressivity: (A,) of the driver that slows down, 0 to 1
        :return: b (A,), 0 or above [m/s^2], and whether a driver yields (A,): then it accelerates
            by -b at most. The others would have to brake too hard or leave enough room already.
        """
        missing = needed_gap - follow_gap + (follow_speed - speed) * self.time
        wanted = np.maximum(2.0 * missing / self.time ** 2, 0.0)
        yields = ((wanted <= self.deceleration_limit(urgency, aggressivity))
                  & (wanted * self.time <= np.minimum(self.max_speed_drop, follow_speed))
                  & ((wanted > 0.0) | (follow_gap < needed_gap)))
        return np.where(yields, wanted, 0.0), yields


@compiled
def relief_at_change(gap: float, desired_gap: float) -> float:
    """
    Return how much shorter than usual a gap may be right after a lane change.

    Hidas (2005) asks that this gap opens gradually. The method is ours, with Keane and Gao (2021):
    it fits any car-following model.

    A driver that agreed to a short gap doesn't brake for it. Without relief a controller of the
    gap (FS 3) would brake and send a wave of braking backwards. The relief is added to the gap
    that the controller sees.

    :param gap: to the new leader, bumper to bumper [m]
    :param desired_gap: of the car-following model [m]
    :return: [m]
    """
    return max(desired_gap - gap, 0.0)


def fading(dt_s: float, opening_time: float = 10.0) -> float:
    """
    Return the share of a relief that is left after some time.

    :param opening_time: time constant of the relaxation of Laval and Leclercq (2008); the value
        is ours [s]
    """
    return float(np.exp(-dt_s / opening_time))


@compiled
def fade_relief(relief: float, gap: float, desired_gap: float, left: float) -> float:
    """
    Return the relief after it has decayed, so that the gap opens gradually to the usual one.

    The relief decays with a time constant, and is never more than the missing gap: once the gap
    has opened the relief is 0, and a vehicle that stops keeps none.

    :param relief: previous relief [m]
    :param gap: to the leader; inf where there is none [m]
    :param desired_gap: of the car-following model at the present speed [m]
    :param left: from `fading`, for the time since the last call.
    :return: [m]
    """
    return min(relief * left, max(desired_gap - gap, 0.0))


@compiled
def note_leaders(agents: AgentTable, slots: IntArray, gap: Array, leader: IntArray,
                 desired_gap: Array, left: float, cooperative: bool) -> None:
    """
    Update the leaders of agents (A), and by how much their gaps may be shorter for now.

    :param gap: (A) inf without a leader [m]
    :param leader: (A) as `AgentTable.leader`.
    :param desired_gap: (A) of the car-following model [m]
    :param left: from `fading`.
    :param cooperative: whether the gap to a vehicle that has cut in opens gradually, as after an
        agreed lane change.
    """
    for i, slot in enumerate(slots):
        relief = 0.0
        if abs(gap[i]) < np.inf:
            relief = fade_relief(agents.relief[slot], gap[i], desired_gap[i], left)
            if cooperative and leader[i] != agents.leader[slot]:
                relief = max(relief, relief_at_change(gap[i], desired_gap[i]))
        agents.relief[slot], agents.leader[slot] = relief, leader[i]
