# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Computes a run's motion at the times of its stamps, over the gaps of a busy recorder.

State n is stamped n dt, but vehicles driven by hand are integrated over measured intervals
(CRG 13). Around a stall such a state is ahead of its stamp by up to the stall, and differences
of positions disagree with speeds. All exports and measures of motion use this module.

Short gaps are filled from the states around them and reported; longer ones cut the run.
"""

from collections.abc import Collection, Mapping, Sequence

from crgame_ros.game.game import TimingSpec
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.timing.cycle_rows import CycleTable
from crgame_ros.vehicle.state import pose_rates
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
# After longer gaps, positions are too uncertain: at 8 m/s^2 a vehicle is 1 m from its expected
# position, and a lane is left after 1.5 s.
LONGEST_GAP_S = 1.0
# Largest acceleration of an object between two joined states [m/s^2]; a larger one means another
# object with the same name.
_MAX_ACCELERATION = 10.0
_TOLD = 3
# Tolerance for the rounding of sums of dt_eff from the rows [s].
_ROUNDING_S = 1e-6


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


def longest_stretch(recorded: Mapping[str, IntArray], scheduler: ScenarioScheduler,
                    notices: list[str]) -> IntArray:
    """
    Return the scenario steps of a run: the longest piece without a gap that cannot be filled.

    :param recorded: by topic the increasing steps n that it holds; for objects only the ticks.
    :param notices: receives the missing parts of the run and the reasons, one line each.
    :return: (K) their steps n; none if the topics have none in common.
    """
    per_tick, k0 = scheduler.steps_per_tick, scheduler.k0
    pieces: list[tuple[int, int]] = [(0, int(max(ns[-1] for ns in recorded.values())))]
    gaps: list[tuple[int, str]] = []
    for topic, ns in recorded.items():
        ends = _ends(ns, scheduler)
        gaps += [(int(ns[end]), f'{topic} for {(ns[end + 1] - ns[end]) * scheduler.dt_s:.1f} s '
                  f'after scenario step {scheduler.k(int(ns[end]))}') for end in ends]
        whole = [(int(part[0]), int(part[-1])) for part in np.split(ns, ends + 1)]
        pieces = [(max(a, c), min(b, d)) for a, b in pieces for c, d in whole
                  if max(a, c) <= min(b, d)]
    spans = [(-(-a // per_tick), b // per_tick + 1) for a, b in pieces]
    first, end = max(spans, key=lambda span: span[1] - span[0], default=(0, 0))
    if end <= first:
        return np.empty(0, dtype=np.int64)
    last_seen = max(int(ns[-1]) for ns in recorded.values()) // per_tick
    notices += _describe_gaps(gaps, k0 + first, k0 + end - 1, k0 + last_seen, k0)
    return per_tick * np.arange(first, end)


def farthest(scheduler: ScenarioScheduler) -> int:
    """Return the largest distance in steps n between two states that are joined."""
    return scheduler.steps_for(LONGEST_GAP_S) + scheduler.steps_per_tick


def _ends(ns: IntArray, scheduler: ScenarioScheduler) -> IntArray:
    """Find the indices in increasing steps after which a gap is too long to fill."""
    return np.flatnonzero(np.diff(ns) > farthest(scheduler))


def piece_around(ns: IntArray, n: int, scheduler: ScenarioScheduler) -> IntArray:
    """Return the steps of the piece that contains step n, without a gap."""
    pieces = np.split(ns, _ends(ns, scheduler) + 1)
    return next(piece for piece in pieces if n <= piece[-1])


def _describe_gaps(gaps: Sequence[tuple[int, str]], first: int, last: int, last_seen: int,
                   k0: int) -> list[str]:
    """Return notices on the scenario steps of a stretch, if some are missing."""
    if gaps:
        texts = [text for _, text in sorted(gaps)]
        more = f' and {len(texts) - _TOLD} times more' if len(texts) > _TOLD else ''
        return [f'nothing was recorded of {", of ".join(texts[:_TOLD])}{more}, and up to '
                f'{LONGEST_GAP_S:g} s are bridged: the run is its longest piece, scenario steps '
                f'{first} to {last} of {k0} to {last_seen}']
    told = []
    if first > k0:
        told.append(f'the recording begins at scenario step {first} of a run that began at {k0}')
    if last_seen > last + 1:
        told.append(f'scenario step {last + 1} was not recorded: the run is taken up to {last} '
                    f'of {last_seen}')
    return told


def bridge_objects(ticks: IntArray, points: Mapping[int, FloatArray], dt_s: float,
                   joints: int) -> FloatArray:
    """
    Return the points of all objects at ticks; fill missing ones from those around them.

    Poses are cubic by the velocities at both ends, velocities linear. An object that is absent at
    one end, or differs between the ends, is absent in between.

    :param ticks: (K) steps n, none of them before the first recorded one or after the last.
    :param points: recorded points (3, joints) by step n.
    :return: (K, 2, joints) poses and velocities.
    """
    found = np.empty((len(ticks), 2, joints))
    known = np.isin(ticks, list(points))
    for row in np.flatnonzero(known):
        found[row] = points[int(ticks[row])][:2]
    recorded = np.array(sorted(points))
    for row in np.flatnonzero(~known):
        after = int(np.searchsorted(recorded, ticks[row]))
        first, second = int(recorded[after - 1]), int(recorded[after])
        found[row] = _between(points[first], points[second],
                              float(ticks[row] - first) * dt_s, float(second - first) * dt_s)
    return found


def _between(first: FloatArray, second: FloatArray, time_s: float,
             length_s: float) -> FloatArray:
    """Interpolate between two points (3, joints): poses and velocities (2, joints)."""
    share, length = np.array([[time_s / length_s]]), np.array([[length_s]])
    ahead = second[0] - first[0]
    ahead[2::3] = wrap_pi_array(ahead[2::3])
    poses = first[0] + cubic(share, length, ahead, first[1], second[1])[0]
    poses[2::3] = wrap_pi_array(poses[2::3])
    found = np.stack((poses, first[1] + share[0] * (second[1] - first[1])))
    fastest = np.maximum(*(np.hypot(row[0::3], row[1::3]) for row in (first[1], second[1])))
    reach = (fastest + 0.5 * _MAX_ACCELERATION * length_s) * length_s
    # NaN counts as another object too.
    other = ~(np.hypot(ahead[0::3], ahead[1::3]) <= reach)
    found[:, np.repeat(other, 3)] = np.nan
    return found


def bridged_notice(topic: str, ticks: IntArray, recorded: IntArray,
                   scheduler: ScenarioScheduler) -> tuple[str, ...]:
    """
    Return at most one line that names the scenario steps missing in a topic.

    :param ticks: (K) the run's steps n.
    :param recorded: increasing steps n that the topic holds.
    """
    missing = ticks[~np.isin(ticks, recorded)]
    if not len(missing):
        return ()
    after = np.searchsorted(recorded, missing)
    longest_s = float(np.max(recorded[after] - recorded[after - 1])) * scheduler.dt_s
    ks = ', '.join(str(scheduler.k(int(n))) for n in missing[:_TOLD])
    return (f'{len(missing)} scenario steps of {topic} were not recorded ({ks}'
            f'{", …" if len(missing) > _TOLD else ""}): interpolated between states that are at '
            f'most {longest_s:.2f} s apart',)


def lost_intervals(table: CycleTable, timing: TimingSpec, dt_s: float,
                   last_n: int) -> FloatArray | None:
    """
    Compute the intervals of the cycles that were not recorded, from the lag of the others.

    The sum of the intervals is ahead of n dt by the lag E_n (CRG 12), less the part that the clip
    has cut off and not yet returned. That part is zero after every interval that was not clipped.
    So the sum of the missing intervals between two such cycles is known; each gets an equal share.

    :return: (last_n + 1) intervals [s], nominal after the last cycle; None where intervals do not
        follow the lag, as in a run that was repeated from a recording.
    """
    if timing.clip != 'carry' or not timing.measured_interval:
        return None
    # Rows of other programs may have any n: no array is longer than the run.
    table = CycleTable(table.columns, table.rows[table.column('n') >= 0.0])
    # The run begins without a lag.
    ns = np.concatenate(([0], table.column('n').astype(np.int64)))
    lags_s = np.concatenate(([0.0], table.column('cumulative_error_s')))
    moved_s = np.concatenate(([dt_s], table.column('dt_eff_s')))
    free = (moved_s > min(timing.dt_min, 0.5 * dt_s)) \
        & (moved_s < max(timing.dt_max, 2.0 * dt_s))
    pairs = free[1:] & free[:-1] & (np.diff(ns) == 1)
    misfits_s = np.abs(moved_s[1:] - dt_s - np.diff(lags_s))[pairs]
    if not len(misfits_s) or np.median(misfits_s) > _ROUNDING_S:
        return None
    found = np.full(last_n + 1, dt_s)
    recorded = np.zeros(last_n + 1, dtype=bool)
    recorded[ns[ns <= last_n]] = True
    sums_s = np.cumsum(moved_s)
    anchors = np.flatnonzero(free)
    lost = np.diff(ns[anchors]) - np.diff(anchors)
    for gap in np.flatnonzero(lost):
        left, right = anchors[gap], anchors[gap + 1]
        total_s = (ns[right] - ns[left]) * dt_s + lags_s[right] - lags_s[left]
        place = np.arange(ns[left] + 1, min(ns[right], last_n + 1))
        place = place[~recorded[place]]
        found[place] = max(0.0, (total_s - (sums_s[right] - sums_s[left])) / lost[gap])
    return found
