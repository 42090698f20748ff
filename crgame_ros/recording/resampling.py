# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Computes a run's motion at the times of its stamps.

State n is stamped n dt, but vehicles driven by hand are integrated over measured intervals
(CRG 13). Around a stall such a state is ahead of its stamp by up to the stall, and differences
of positions disagree with speeds. All exports and measures of motion use this module.
"""

from collections.abc import Collection, Sequence

from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.timing.cycle_rows import CycleTable
from crgame_ros.vehicle.state import pose_rates
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def resample(states: FloatArray, ns: IntArray, intervals_s: FloatArray, dt_s: float,
             wanted_ns: IntArray) -> FloatArray:
    """
    Return the states of vehicles at time n dt of their motion, the sum of its intervals.

    If that sum is exactly n dt, as without measured intervals, the result is state n itself.
    Between two states, positions and heading are cubic by their rates at both ends, all else is
    linear; up to dt before the first and after the last, a vehicle keeps its speed and yaw rate.

    :param states: (S, V, 8) rear-axle states, columns as in `StateColumn`, S >= 1
    :param ns: (S) their simulation steps, increasing
    :param intervals_s: (n + 1, V) interval over which each vehicle was moved in the step that led
        to state n [s]; row 0 is not used
    :param dt_s: nominal step [s]
    :param wanted_ns: (K) simulation steps n
    :return: (K, V, 8) states at n dt; NaN before a vehicle was recorded, and beyond the end of its
        motion, which the clip of CRG 13 may shorten.
    """
    # Summed as differences, nominal intervals add up to exactly zero.
    leads_s = np.cumsum(intervals_s - dt_s, axis=0)
    leads_s -= leads_s[:1]
    wanted_s = np.multiply(wanted_ns, dt_s, dtype=np.float64)
    found = np.empty((len(wanted_ns), states.shape[1], states.shape[2]))
    for column in range(states.shape[1]):
        times_s = ns * dt_s + leads_s[ns, column]
        found[:, column] = states_at(states[:, column], times_s, wanted_s)
        unknown = (wanted_s > times_s[-1] + 1.5 * dt_s) | (wanted_s < times_s[0] - 1.5 * dt_s)
        found[unknown, column] = np.nan
    return found


def moved_intervals(table: CycleTable, vehicles: Sequence[str], humans: Collection[str],
                    dt_s: float, last_n: int, lost_s: FloatArray | None = None) -> FloatArray:
    """
    Return the intervals over which each vehicle was moved in each step, for `resample`.

    A human is moved over Delta t_eff, as is an AV while a driver has it; an AV on its plan is
    moved over the nominal step.

    :param table: the recorded cycles.
    :param vehicles: (V) ids.
    :param humans: which of them are humans.
    :param dt_s: nominal step [s]
    :param lost_s: (last_n + 1) Delta t_eff of the steps that were not recorded [s], nominal if
        None; an AV counts as driven there if it was driven in the cycle before.
    :return: (last_n + 1, V) intervals [s]
    """
    ns = table.column('n').astype(np.int64)
    known = (ns >= 0) & (ns <= last_n)
    effective_s = np.full(last_n + 1, dt_s) if lost_s is None else lost_s.copy()
    effective_s[ns[known]] = table.column('dt_eff_s')[known]
    intervals_s = np.full((last_n + 1, len(vehicles)), dt_s)
    # The cycle that gives the driver of step n: the last recorded one.
    latest = np.searchsorted(ns, np.arange(last_n + 1), side='right') - 1
    for column, vehicle in enumerate(vehicles):
        driven = np.ones(last_n + 1, dtype=bool)
        if vehicle not in humans:
            driven = (latest >= 0) & table.drove(vehicle)[latest]
        intervals_s[driven, column] = effective_s[driven]
    return intervals_s


def states_at(states: FloatArray, times_s: FloatArray, wanted_s: FloatArray) -> FloatArray:
    """Interpolate one vehicle's states (S, 8) at increasing times, as `resample`: (K, 8)."""
    after = np.clip(np.searchsorted(times_s, wanted_s), 0, len(states) - 1)
    before = np.maximum(after - 1, 0)
    first, second = states[before], states[after]
    length = (times_s[after] - times_s[before])[:, np.newaxis]
    inside = (length[:, 0] > 0.0) & (wanted_s <= times_s[after])
    share = np.zeros_like(length)
    share[inside] = (wanted_s - times_s[before])[inside, np.newaxis] / length[inside]
    found = first + share * (second - first)
    turn = wrap_pi_array(second[:, 2] - first[:, 2])
    displacement = np.column_stack((second[:, :2] - first[:, :2], turn))
    found[:, :3] = first[:, :3] + cubic(share, length, displacement, pose_rates(first),
                                        pose_rates(second))
    # Outside the recorded times the vehicle keeps its motion.
    beyond_s = (wanted_s - times_s[after])[:, np.newaxis]
    found = np.where(inside[:, np.newaxis], found, second)
    found[:, :3] += np.where(inside[:, np.newaxis], 0.0, beyond_s * pose_rates(second))
    found[:, 2] = wrap_pi_array(found[:, 2])
    # A state recorded for exactly this time is kept bit for bit.
    exact = times_s[after] == wanted_s
    found[exact] = second[exact]
    return found


def cubic(share: FloatArray, length: FloatArray, displacement: FloatArray,
          start_rates: FloatArray, end_rates: FloatArray) -> FloatArray:
    """
    Evaluate Hermite polynomials that start at 0: displacements (K, C).

    :param share: (K, 1) of the way from start to end, 0 to 1
    :param length: (K, 1) from start to end [s]
    :param displacement: (K, C) or (C) from start to end
    :param start_rates: (K, C) or (C) derivatives at the start, `end_rates` those at the end
    """
    rest = 1.0 - share
    return (share * share * (3.0 - 2.0 * share) * displacement
            + share * rest * length * (rest * start_rates - share * end_rates))
