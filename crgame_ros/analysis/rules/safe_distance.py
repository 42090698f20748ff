# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The safe distance to the leader (Vienna Convention on Road Traffic, article 13).

It is that of Rizaldi et al., "Formalising and Monitoring Traffic Rules for Autonomous Vehicles in
Isabelle/HOL" (2017), with the exception after cut-ins of rule R_G1 of Maierhofer et al.,
"Formalization of Interstate Traffic Rules in Temporal Logic" (2020).
"""

from collections.abc import Sequence
from typing import NamedTuple

from crgame_ros.analysis.criticality.headways import Following, Headways
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

# Reaction time [s], and hardest braking of the vehicle and of its leader [m/s^2]: the values of
# commonroad-stl-monitor, with which the authors of R_G1 monitor recorded traffic.
REACTION_S, BRAKING, LEADER_BRAKING = 0.3, 10.0, 10.5
# A vehicle has this long to restore the distance to one that cut in, t_c in R_G1 [s].
RECOVERY_S = 3.0
# One that cuts in moves across the road at least this fast [m/s]; slower motion is weaving.
SIDEWAYS = 0.1


class UnsafeDistance(NamedTuple):
    """
    How a vehicle kept the safe distance over a run.

    :param share: of the steps with a leader at which the gap was too small, 0 to 1.
    :param longest_s: longest time without a pause with such gaps [s]
    """

    share: float
    longest_s: float


def safe_distance(speed: FloatArray, leader_speed: FloatArray) -> FloatArray:
    """
    Return v_f t + v_f^2 / (2 a_f) - v_l^2 / (2 a_l), 0 at least [m].

    At this distance, both stop without contact if the leader brakes as hard as it can and the
    vehicle does so a reaction time later. The leader brakes at least as hard as the vehicle, so
    that both are nearest to each other at the beginning or when they stand; the other cases of
    Rizaldi et al. do not occur.

    :param speed: of the vehicle along its path [m/s]; backwards it counts as standing.
    :param leader_speed: of its leader [m/s]; one that comes towards it counts as standing.
    """
    own, other = np.maximum(speed, 0.0), np.maximum(leader_speed, 0.0)
    needed = own * REACTION_S + own**2 / (2.0 * BRAKING) - other**2 / (2.0 * LEADER_BRAKING)
    return np.asarray(np.maximum(needed, 0.0))


def unsafe_distance(headways: Headways, time_step_s: float) -> UnsafeDistance | None:
    """
    Return how a vehicle kept the safe distance; None if it never had a leader.

    :param headways: its leaders, at all ticks.
    :param time_step_s: between two ticks [s]
    """
    following = headways.following
    if not following:
        return None
    gap, speed, leader_speed = np.array([
        (each.gap, each.speed, each.leader_speed) for each in following]).T
    ticks = np.array(headways.following_ticks)
    unsafe = (gap < safe_distance(speed, leader_speed)) & ~_recovers(
        headways.following_ticks, following, round(RECOVERY_S / time_step_s))
    at = ticks[unsafe]
    # Successive ticks are one stretch.
    longest = max(map(len, np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)))
    # A bound such as 0.3 s holds for three steps of 0.1 s.
    return UnsafeDistance(float(unsafe.mean()), round(longest * time_step_s, 9))


def _recovers(ticks: Sequence[int], following: Sequence[Following], recovery: int) -> BoolArray:
    """
    Return at which ticks the vehicle still restores the distance to one that cut in.

    Who cuts in has not led within the recovery time, is nearer than the leader before, and moves
    across the road towards the vehicle: neither the vehicle's own lane change nor that of a leader
    that makes way is a cut-in.

    :param recovery: number of ticks that it has for it.
    """
    led: dict[int, int] = {}
    cut_in: dict[int, int] = {}
    result = np.zeros(len(ticks), dtype=bool)
    for row, (tick, now) in enumerate(zip(ticks, following, strict=True)):
        comes = tick - led.get(now.leader, -recovery - 1) > recovery
        beyond = row > 0 and ticks[row - 1] == tick - 1 and now.gap >= following[row - 1].gap
        # At the first tick of a run nobody has come yet.
        if comes and not beyond and tick > 0 and now.comes_aside > SIDEWAYS:
            cut_in[now.leader] = tick
        led[now.leader] = tick
        result[row] = tick - cut_in.get(now.leader, -recovery - 1) <= recovery
    return result
