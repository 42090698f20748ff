# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One reference per lane that swerves around standing obstacles, for all agents (FS M1)."""

import math
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.traffic.motion.passage import Obstacles, Passage, PassageRules
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpbtrf, dpbtrs
from scipy.optimize import nnls

Array = NDArray[np.float64]

# Stiffness of an obstacle. The band's own stiffness at a node is 4 m / step, about 80, where it
# swerves once, and up to 6 (m / step)^4 where it is squeezed between obstacles on both sides.
REPULSION = 1e8
ITERATIONS = 100
# Less intrusion than this counts as none [m].
ENOUGH = 5e-4
# A band that intrudes further than this could not be bent as wanted [m].
TOLERANCE = 0.02
# Influence of an obstacle in band lengths: (1 + 7) exp(-7) is 0.7 %.
REACH = 7.0


class Band(NamedTuple):
    """
    The reference of a lane on a grid of S nodes.

    :param d: (S,) offset of a vehicle's centre to the left of the centre line [m]
    :param curvature: (S,) d'', to be added to the lane's own [1/m]
    :param blocked: arc lengths, in order, of the near edges of what blocks the lane [m]
    """

    d: Array
    curvature: Array
    blocked: list[float]


class ElasticBand:
    """
    A planner of the lanes' references around standing obstacles (FS M1).

    An elastic band in the sense of Quinlan and Khatib (1993) and Gu et al. (2015): internal
    forces contract it to the centre line and keep it smooth, obstacles repel it. In the lane's
    frame, where the centre line is straight, it minimises

        1/2 integral (d - m^2 d'')^2 ds + 1/2 rho sum (intrusion)^2

    whose first term is contraction d^2, tension 2 m^2 d'^2 and bending m^4 d''^2 of a band that
    just doesn't swing over; rho is so great that the band touches the wanted clearance. Around
    one narrow obstacle that needs an offset D the solution is D (1 + x / m) exp(-x / m) at the
    distance x, with the greatest curvature D / m^2. With m = t v the swerve takes D / t^2 of
    lateral acceleration at the lane's speed v. Where obstacles follow each other too closely for
    that, the band bends more sharply, and agents slow down for its curvature. The reference of a
    lane is kept until something changes, so that standing obstacles cost time only once.

    :param step: distance between nodes [m]
    :param clearance: wanted between the sides of a vehicle and an obstacle (ours) [m]
    :param min_clearance: with less the lane is blocked (ours) [m]
    :param half_width: of the vehicles; with mirrors a car's is 1 m [m]
    :param half_length: of the vehicles [m]
    :param band_time: t; 1.2 s swerves by 2 m with 1.4 m/s^2 (ours) [s]
    :param min_band_length: shortest m (ours) [m]
    :param max_curvature: a band that needs more is blocked: about that of a car's turning circle
        of 12 m [1/m]
    :param wide_half_width: of the widest vehicles: the band suits them too wherever there is room
        for them with the least clearance; None without such vehicles [m]
    :param keeps_left: whether traffic does; between equal sides the band takes the one towards the
        middle of the road
    """

    def __init__(self, step: float = 1.0, clearance: float = 0.5, min_clearance: float = 0.2,
                 half_width: float = 1.0, half_length: float = 2.5, band_time: float = 1.2,
                 min_band_length: float = 4.0, max_curvature: float = 0.15,
                 wide_half_width: float | None = None, keeps_left: bool = False) -> None:
        for name, value in (('step', step), ('half_width', half_width),
                            ('half_length', half_length), ('band_time', band_time),
                            ('min_band_length', min_band_length),
                            ('max_curvature', max_curvature)):
            if not 0.0 < value < math.inf:
                raise InputError(f'"{name}" is {value:g}', 'elastic band',
                                 'give a number above 0')
        if not 0.0 <= min_clearance <= clearance < math.inf:
            raise InputError(f'"min_clearance" {min_clearance:g} and "clearance" {clearance:g} '
                             'do not fit', 'elastic band', 'give 0 <= min_clearance <= clearance')
        self.step = step
        self._rules = PassageRules(clearance, min_clearance, half_width, half_length,
                                   max(half_width, wide_half_width or 0.0), not keeps_left)
        self._band_time = band_time
        self._min_band_length = min_band_length
        self._max_curvature = max_curvature
        self._known: dict[bytes, Band] = {}
        self._before: dict[bytes, Band] = {}

    def begin_plan(self) -> None:
        """Begin to ask for the bands of all lanes: those not asked for since are forgotten."""
        self._before, self._known = self._known, {}

    def relax(self, left: Array, right: Array, speed: float, obstacles: Obstacles) -> Band:
        """
        Find the reference of a lane; one of the present or the last plan costs no time.

        Just outside both ends the offset is 0, so that it continues into the next lane: obstacles
        nearer to an end than a swerve is long need a chain of lanes as one.

        :param left: (S,) room to the left of the centre line at s = 0, step, ...: half the
            lane and what may be borrowed of its neighbour [m]
        :param right: (S,) to the right [m]
        :param speed: at which swerves are comfortable [m/s]
        :param obstacles: all that stand in the lane.
        """
        key = np.concatenate(([len(left), speed], left, right, *obstacles)).tobytes()
        band = self._known.get(key) or self._before.get(key)
        if band is None:
            d, blocked = np.zeros(len(left)), list[float]()
            if self._rules.in_the_way(obstacles).any():
                d, blocked = self._relax(left, right, speed, obstacles)
            wide = np.pad(d, 1)
            band = Band(d, (wide[2:] - 2.0 * d + wide[:-2]) / self.step ** 2, blocked)
        self._known[key] = band
        return band

    def _relax(self, left: Array, right: Array, speed: float, obstacles: Obstacles,
               for_wide: bool = True) -> tuple[Array, list[float]]:
        """Return the offsets of a lane and where it is blocked."""
        passages: list[Passage] = []
        blocked: list[float] = []
        end = self.step * (len(left) - 1)
        reach = obstacles.half_length + self._rules.half_length
        on_grid = (obstacles.s + reach >= 0.0) & (obstacles.s - reach <= end)
        for group in self._rules.groups(obstacles.select(on_grid), self.step):
            passage = self._rules.choose(group, self.step, left, right, for_wide)
            if passage is not None:
                passages.append(passage)
            else:
                blocked.append(float((group.s - group.half_length).min()))
        length = max(self._band_time * speed, self._min_band_length)
        while True:
            d, worst = self._solve(left, right, length, passages)
            if worst is None:
                return d, sorted(blocked)
            if for_wide and self._rules.wide_half_width > self._rules.half_width:
                # A band that is too sharp for the widest vehicles may suit the others.
                return self._relax(left, right, speed, obstacles, False)
            nearest = min(passages, key=lambda passage: max(
                passage.first - worst, worst - passage.first - len(passage.low), 0))
            passages.remove(nearest)
            blocked.append(nearest.near_s)

    def _solve(self, left: Array, right: Array, length: float,
               passages: list[Passage]) -> tuple[Array, int | None]:
        """Return the offsets, and the node where the band cannot be bent as wanted, if any."""
        d = np.zeros(len(left))
        high = np.maximum(left - self._rules.half_width, 0.0)
        low = -np.maximum(right - self._rules.half_width, 0.0)
        for passage in passages:
            part = slice(passage.first, passage.first + len(passage.low))
            low[part], high[part] = passage.low, passage.high
        nodes = np.flatnonzero((low > 0.0) | (high < 0.0))
        if not len(nodes):
            return d, None
        reach = math.ceil(REACH * length / self.step)
        window = slice(max(int(nodes[0]) - reach, 0), int(nodes[-1]) + reach + 1)
        d[window] = _band(low[window], high[window], (length / self.step) ** 2)
        excess = np.maximum(np.maximum(low - d, d - high) / TOLERANCE,
                            np.abs(np.diff(np.pad(d, 1), 2))
                            / (self.step ** 2 * self._max_curvature))
        worst = int(np.argmax(excess))
        return d, worst if excess[worst] > 1.0 else None


def _band(low: Array, high: Array, stiffness: float) -> Array:
    """
    Minimise 1/2 |(1 - r D) d|^2 + 1/2 rho |intrusion|^2 with second differences D; d = 0 outside.

    The dual problem has one unknown per node that is held, the force f >= 0 that repels the band
    there: minimise 1/2 f' (M + 1 / rho) f - wall' f, where M is the band's answer to forces. It is
    solved as non-negative least squares (Lawson and Hanson 1974, chapter 23). A band touches at
    few nodes, mostly edges: those are added where it intrudes most until it does so nowhere.

    :param low: (n,) least offset [m]
    :param high: (n,) greatest offset [m]
    :param stiffness: r, the squared band length in steps
    """
    matrix = np.empty((3, len(low)))
    matrix[0] = stiffness ** 2
    matrix[1] = -2.0 * stiffness * (1.0 + 2.0 * stiffness)
    matrix[2] = (1.0 + 2.0 * stiffness) ** 2 + 2.0 * stiffness ** 2
    factor, _ = dpbtrf(matrix)
    d = np.zeros(len(low))
    held = np.empty((0, 2), dtype=np.intp)
    answer = np.empty((len(low), 0))
    while True:
        more = np.concatenate((_peaks(low - d, 1), _peaks(d - high, -1)))
        known = (more[:, None] == held).all(axis=2).any(axis=1)
        if known.all():
            return d
        more = more[~known]
        unit = np.zeros((len(low), len(more)), order='F')
        unit[more[:, 0], np.arange(len(more))] = more[:, 1]
        held = np.concatenate((held, more))
        answer = np.concatenate((answer, dpbtrs(factor, unit, overwrite_b=1)[0]), axis=1)
        nodes, sign = held.T
        wall = np.where(sign > 0, low[nodes], -high[nodes])
        root = np.linalg.cholesky(
            sign[:, None] * answer[nodes] + np.eye(len(nodes)) / REPULSION)
        force, _ = nnls(root.T, solve_triangular(root, wall, lower=True),
                        maxiter=ITERATIONS * len(nodes))
        d = np.asarray(answer @ force)


def _peaks(intrusion: Array, sign: int) -> NDArray[np.intp]:
    """
    Find where a band intrudes most: the ends and the worst node of each stretch of intrusion.

    :return: (k, 2) nodes, and the sign of the force that pushes the band out
    """
    nodes = np.flatnonzero(intrusion > ENOUGH)
    if not len(nodes):
        return np.empty((0, 2), dtype=np.intp)
    found: set[int] = set()
    for run in np.split(nodes, np.flatnonzero(np.diff(nodes) > 1) + 1):
        found.update((int(run[0]), int(run[-1]), int(run[np.argmax(intrusion[run])])))
    return np.array([(node, sign) for node in sorted(found)], dtype=np.intp)
