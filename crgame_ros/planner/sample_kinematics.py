# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Kinematic checks of all samples of commonroad-reactive-planner 2025.1 at once.

The package goes through samples and steps one by one, in Python, which takes half of the time of a
plan. These functions do the same for arrays of them: a test compares both. Equations (A.n) are of
Werling, "Ein neues Konzept für die Trajektoriengenerierung und -stabilisierung in zeitkritischen
Verkehrsszenarien", 2011, appendix A.1.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math

from crgame_ros.postponed import postponed, UNUSED
import numpy as np
from numpy.typing import NDArray

with postponed(*UNUSED, 'scipy.spatial.kdtree'):
    from commonroad_clcs.pycrccosy import (
        CurvilinearProjectionDomainLateralError,
        CurvilinearProjectionDomainLongitudinalError,
    )
    from commonroad_rp.reactive_planner import ReactivePlanner
    from commonroad_rp.trajectories import (
        CartesianSample,
        CurviLinearSample,
        FeasibilityStatus,
        TrajectorySample,
    )

Array = NDArray[np.float64]

# Speeds below count as none, and a vehicle slower than this keeps its heading [m/s].
NO_SPEED, SLOWEST = 1e-5, 0.001
TURN = 2.0 * math.pi


@dataclass(frozen=True)
class _Samples:
    """
    Samples (M) at the steps of the horizon (N), 0 beyond the end of a sample.

    :param s: positions along the path with derivatives by time, each (M, N).
    :param d: offsets with derivatives, by time or, at low speed, by the path, each (M, N).
    :param there: (M, N) whether a sample goes so far.
    """

    s: tuple[Array, Array, Array]
    d: tuple[Array, Array, Array]
    there: NDArray[np.bool_]

    def rows(self, rows: NDArray[np.intp]) -> '_Samples':
        """Return some of the samples."""
        return _Samples((self.s[0][rows], self.s[1][rows], self.s[2][rows]),
                        (self.d[0][rows], self.d[1][rows], self.d[2][rows]), self.there[rows])


def feasible(planner: ReactivePlanner,
             samples: Sequence[TrajectorySample]) -> list[TrajectorySample]:
    """
    Return the samples that a vehicle can drive, with their states in both frames.

    Positions are left out: costs do not depend on them, and few samples are checked further.
    """
    if not samples:
        return []
    taken = _evaluated(planner, samples)
    quick = ((np.abs(taken.s[2]) <= planner.vehicle_params.a_max)
             & (taken.s[1] >= -NO_SPEED)).all(axis=1)
    rows = np.flatnonzero(quick)
    if not len(rows):
        return []
    taken = taken.rows(rows)
    theta, theta_cl, kappa, v, a, fits = _driven(planner, taken)
    fits &= _within_limits(planner, theta, kappa, v, a) | ~taken.there
    found = []
    for row, number in enumerate(rows.tolist()):
        sample, steps = samples[number], int(taken.there[row].sum())
        if not fits[row].all():
            sample.feasibility_label = FeasibilityStatus.INFEASIBLE_KINEMATIC
            continue
        sample.feasibility_label = FeasibilityStatus.FEASIBLE
        sample.cartesian = CartesianSample(
            np.zeros(len(theta[row])), np.zeros(len(theta[row])), theta[row], v[row], a[row],
            kappa[row], kappa_dot=np.append([0], np.diff(kappa[row])), current_time_step=steps)
        sample.curvilinear = CurviLinearSample(
            taken.s[0][row], taken.d[0][row], theta_cl[row], ss=taken.s[1][row],
            sss=taken.s[2][row], dd=taken.d[1][row], ddd=taken.d[2][row],
            current_time_step=steps)
        if steps < len(theta[row]):
            sample.enlarge(planner.dt)
        found.append(sample)
    return found


def _evaluated(planner: ReactivePlanner, samples: Sequence[TrajectorySample]) -> _Samples:
    """Evaluate the polynomials of samples."""
    count, dt = planner.N + 1, planner.dt
    steps = np.array([_steps(planner, sample) for sample in samples])
    there = np.arange(count) < steps[:, None]
    s = _polynomials(np.array([x.trajectory_long.coeffs for x in samples]),
                     np.arange(count) * dt)
    along = s[0] - s[0][:, :1] if planner._low_vel_mode else np.arange(count) * dt
    d = _polynomials(np.array([x.trajectory_lat.coeffs for x in samples]), along)
    for values in (*s, *d):
        values[~there] = 0.0
    for values in (s[1], d[1]):
        values[np.abs(values) < NO_SPEED] = 0.0
    return _Samples(s, d, there)


def _polynomials(coefficients: Array, t: Array) -> tuple[Array, Array, Array]:
    """Return polynomials (M, 6) at t (N or M, N), with two derivatives, each (M, N)."""
    c = [column[:, None] for column in coefficients.T]
    t2 = np.square(t)
    t3, t4 = t2 * t, np.square(t2)
    return (c[0] + c[1] * t + c[2] * t2 + c[3] * t3 + c[4] * t4 + c[5] * (t4 * t),
            c[1] + 2.0 * c[2] * t + 3.0 * c[3] * t2 + 4.0 * c[4] * t3 + 5.0 * c[5] * t4,
            2 * c[2] + 6 * c[3] * t + 12 * c[4] * t2 + 20 * c[5] * t3)


def _driven(planner: ReactivePlanner, samples: _Samples,
            ) -> tuple[Array, Array, Array, Array, Array, NDArray[np.bool_]]:
    """
    Return how a vehicle drives along samples, each (M, N), 0 beyond their ends.

    :return: heading, the same from the path's [rad], curvature [1/m], speed, acceleration, and
        whether the path goes so far.
    """
    s, s_dot, s_ddot = samples.s
    d, d_dot, d_ddot = samples.d
    moves = s_dot > SLOWEST
    if planner._low_vel_mode:
        dp, dpp = d_dot, d_ddot
    else:
        speed = np.where(moves, s_dot, 1.0)
        dp = np.where(moves, d_dot / speed, 0.0)
        # (A.8)
        dpp = np.where(moves, (d_ddot - dp * s_ddot) / speed**2, 0.0)
    path = planner._co
    ahead = np.searchsorted(path.ref_pos, s, side='right') % len(path.ref_pos)
    here = ahead - 1
    share = (s - path.ref_pos[here]) / (path.ref_pos[ahead] - path.ref_pos[here])
    heading = _valid((path.ref_theta[ahead] - path.ref_theta[here]) * (s - path.ref_pos[here])
                     / (path.ref_pos[ahead] - path.ref_pos[here]) + path.ref_theta[here])
    theta_cl = np.arctan2(dp, 1.0)
    theta = theta_cl + heading
    if not planner._low_vel_mode:
        # At rest it keeps its heading.
        last = np.maximum.accumulate(np.where(moves, np.arange(s.shape[1]), -1), axis=1)
        kept = np.take_along_axis(theta, np.maximum(last, 0), axis=1)
        theta = np.where(last >= 0, kept, planner.x_0.orientation)
        theta_cl = np.where(moves, theta_cl, theta - heading)
    k_r = (path.ref_curv[ahead] - path.ref_curv[here]) * share + path.ref_curv[here]
    k_r_d = (path.ref_curv_d[ahead] - path.ref_curv_d[here]) * share + path.ref_curv_d[here]
    room, cos, tan = 1 - k_r * d, np.cos(theta_cl), np.tan(theta_cl)
    kappa = (dpp + (k_r * dp + k_r_d * d) * tan) * cos * (cos / room)**2 + (cos / room) * k_r
    v = s_dot * (room / cos)
    a = s_ddot * room / cos + (s_dot**2 / cos) * (
        room * tan * (kappa * room / cos - k_r) - (k_r_d * d + k_r * dp))
    for values in (theta, theta_cl, kappa, v, a):
        values[~samples.there] = 0.0
    return theta, theta_cl, kappa, v, a, (here >= 0) | ~samples.there


def _valid(angle: Array) -> Array:
    """Turn angles by whole turns into +-2 pi, as the package does."""
    turns = np.ceil((np.abs(angle) - TURN) / TURN)
    return angle - np.sign(angle) * np.maximum(turns, 0.0) * TURN


def _within_limits(planner: ReactivePlanner, theta: Array, kappa: Array, v: Array,
                   a: Array) -> NDArray[np.bool_]:
    """Return whether a vehicle keeps to the constraints that are to be checked (M, N)."""
    limits, dt = planner.vehicle_params, planner.dt
    names = planner.config.planning.constraints_to_check
    steepest = np.tan(limits.delta_max) / limits.wheelbase
    fits = np.ones(v.shape, dtype=bool)
    if 'velocity' in names:
        fits &= v >= -NO_SPEED
    if 'kappa' in names:
        fits &= np.abs(kappa) <= steepest
    if 'yaw_rate' in names:
        turned = np.diff(theta, axis=1, prepend=theta[:, :1]) / dt
        fits &= np.abs(np.round(turned, 5)) <= steepest * v
    if 'kappa_dot' in names:
        cos = np.cos(np.arctan2(limits.wheelbase * kappa, 1.0))
        fastest = limits.v_delta_max / (limits.wheelbase * cos**2)
        fits &= np.abs(np.diff(kappa, axis=1, prepend=kappa[:, :1]) / dt) <= fastest
    if 'acceleration' in names:
        most = limits.a_max * np.where(
            v > limits.v_switch, limits.v_switch / np.maximum(v, limits.v_switch), 1.0)
        fits &= (a >= -limits.a_max) & (a <= most)
    return fits


def place(planner: ReactivePlanner, sample: TrajectorySample) -> bool:
    """Compute the positions of a feasible sample; return False where the path's frame ends."""
    states, frame = sample.cartesian, sample.curvilinear
    steps = _steps(planner, sample)
    try:
        for i in range(steps):
            states.x[i], states.y[i] = planner._co.convert_to_cartesian_coords(
                frame.s[i], frame.d[i])
    except (CurvilinearProjectionDomainLateralError, CurvilinearProjectionDomainLongitudinalError):
        return False
    # Beyond its end a sample goes straight on, as `CartesianSample.enlarge` has it.
    for values, share in ((states.x, math.cos), (states.y, math.sin)):
        values[steps:] = values[steps - 1] + np.cumsum(
            planner.dt * states.v[steps:] * share(states.theta[steps - 1]))
    return True


def _steps(planner: ReactivePlanner, sample: TrajectorySample) -> int:
    """Return the number of steps for which a sample has been planned."""
    dt = planner.dt
    return len(np.arange(0, np.round(sample.trajectory_long.delta_tau + dt, 5), dt))
