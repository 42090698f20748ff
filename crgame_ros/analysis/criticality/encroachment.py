# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Post-encroachment time (PET): from when one leaves a conflict area to when another enters."""

from collections import deque
from collections.abc import Sequence
from itertools import pairwise
import math
from typing import NamedTuple

from crgame_ros.analysis.criticality.nearby_footprints import time_to_contact
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]

# Earlier positions are forgotten: PETs beyond this are not measured [s].
MEMORY_S = 10.0
# Paths cross at an angle between this and pi less this; else one follows or meets the other [rad].
LEAST_ANGLE = math.radians(20.0)
# As long as the second is in the conflict area, the rest of its path is taken as this far straight
# ahead [m].
AHEAD = 15.0
# A shorter movement in a step has no direction [m].
STANDING = 1e-3
# The shares of a step at which a first contact is looked for, before it is bisected. The last is
# a rounding error later, for a contact exactly at a tick belongs to the step that ends there.
_SHARES = np.linspace(0.0, 1.0, 9) * (1.0 + 1e-9)
_BISECTIONS = 30
_STILL = np.zeros(2)


class WayCrossed(NamedTuple):
    """
    A crossing of two paths.

    :param first: number of the one that was in the conflict area first.
    :param second: number of the other.
    :param entered_s: time at which the second entered the area [s]
    :param pet_s: time since the first had left it [s]; 0 if it had not
    :param is_estimate: whether the second has not left it yet: the rest of its path is taken as
        straight ahead.
    """

    first: int
    second: int
    entered_s: float
    pet_s: float
    is_estimate: bool


class _Moment(NamedTuple):
    """All positions and footprints at a time; NaN where absent."""

    time_s: float
    outlines: FloatArray
    centers: FloatArray


class _Passage(NamedTuple):
    """
    The way of a second one through the conflict area, until it has left it.

    :param number: of the crossing.
    :param before: the moments at which the first one may have been in the area.
    :param swept: outlines of the second since it entered.
    """

    number: int
    before: tuple[_Moment, ...]
    swept: list[FloatArray]


class EncroachmentDetector:
    """
    Detector of crossing paths, from footprints at successive ticks.

    The conflict area is the intersection of the areas that both footprints sweep. Between two
    ticks their corners move evenly. Only crossing paths count, not those of followers or oncoming
    traffic: the table of definitions leaves a measure without crossing undefined.

    :param watched: number of vehicles, from the first on, that are checked against all; pairs
        among the others are not checked.
    :param radii: (N) radii of circles around the centres that contain the footprints [m]
    """

    def __init__(self, watched: int, radii: FloatArray) -> None:
        self._watched = watched
        self._radii = radii
        self._past: deque[_Moment] = deque()
        # Movements from each moment to the next (T, N, 2), their lengths (T, N), and their starts.
        count = len(radii)
        self._moves, self._lengths = np.empty((0, count, 2)), np.empty((0, count))
        self._begins = np.empty((0, count, 2))
        everybody = np.arange(count)
        self._unwatched = everybody[watched:]
        self._others = [np.delete(everybody, i) for i in range(watched)]
        self._inside: set[tuple[int, int]] = set()
        self._passages: dict[tuple[int, int], _Passage] = {}
        self.crossings: list[WayCrossed] = []

    def observe(self, time_s: float, outlines: FloatArray,
                centers: FloatArray) -> list[WayCrossed]:
        """
        Add the positions of a tick, and return the crossings in which the second enters in it.

        They are estimates, which `crossings` replaces as soon as the second has left.

        :param time_s: time of this tick, later than the previous one [s]
        :param outlines: (N, C, 2) corners of convex footprints [m]; NaN where absent
        :param centers: (N, 2) [m]
        """
        now = _Moment(time_s, outlines, centers)
        found = []
        if self._past:
            before = self._past[-1].centers
            ways = centers - before
            lengths = np.hypot(ways[:, 0], ways[:, 1])
            if len(self._past) > 1:
                entering = self._candidates(before, ways, lengths)
                # One that has left an area may enter it again.
                self._inside &= entering.keys()
                for pair, segments in entering.items():
                    crossing = self._enters(*pair, segments, now)
                    if crossing is not None:
                        found.append(crossing)
                self._follow_passages(outlines)
            self._begins = np.concatenate((self._begins, before[None]))
            self._moves = np.concatenate((self._moves, ways[None]))
            self._lengths = np.concatenate((self._lengths, lengths[None]))
        self._past.append(now)
        while self._past[0].time_s < time_s - MEMORY_S:
            self._past.popleft()
            self._begins, self._moves, self._lengths = (
                each[1:] for each in (self._begins, self._moves, self._lengths))
        return found

    def _candidates(self, here: FloatArray, ways: FloatArray,
                    lengths: FloatArray) -> dict[tuple[int, int], list[int]]:
        """
        Find by (first, second) the steps of the first that the second's movement may cross now.

        :param here: (N, 2) positions before this step [m]
        :param ways: (N, 2) movements in this step [m]
        :param lengths: (N) their lengths [m]
        """
        pairs: dict[tuple[int, int], list[int]] = {}
        unwatched = self._unwatched
        for i, others in enumerate(self._others):
            near = _within(here[i] - self._begins[:, others], self._radii[i]
                           + self._radii[others] + self._lengths[:, others] + lengths[i])
            rows, columns = np.nonzero(near)
            self._add(pairs, rows, others[columns], np.full(len(rows), i), ways)
            # Watched ones are the second in the pairs above; here they are the first.
            if len(unwatched):
                near = _within(here[unwatched] - self._begins[:, None, i], self._radii[i]
                               + self._radii[unwatched] + self._lengths[:, i, None]
                               + lengths[unwatched])
                rows, columns = np.nonzero(near)
                self._add(pairs, rows, np.full(len(rows), i), unwatched[columns], ways)
        return pairs

    def _add(self, pairs: dict[tuple[int, int], list[int]], steps: NDArray[np.int64],
             firsts: NDArray[np.int64], seconds: NDArray[np.int64], ways: FloatArray) -> None:
        """Add the pairs whose movements cross, judged by their angle."""
        if not len(steps):
            return
        (ax, ay), (bx, by) = self._moves[steps, firsts].T, ways[seconds].T
        lengths, others = np.hypot(ax, ay), np.hypot(bx, by)
        crosses = (lengths > STANDING) & (others > STANDING) & (
            np.abs(ax * by - ay * bx) > math.sin(LEAST_ANGLE) * lengths * others)
        for step, first, second in zip(steps[crosses].tolist(), firsts[crosses].tolist(),
                                       seconds[crosses].tolist(), strict=True):
            pairs.setdefault((first, second), []).append(step)

    def _enters(self, first: int, second: int, segments: list[int],
                now: _Moment) -> WayCrossed | None:
        """Return the crossing if the second enters in this step the area swept by the first."""
        before = self._past[-1]
        begins, ends = (np.stack([self._past[step + late].outlines[first] for step in segments])
                        for late in (0, 1))
        begin, end = before.outlines[second], now.outlines[second]
        share = _first_contact(_hulls(begins, ends), begin, end)
        pair = (first, second)
        if share is None:
            self._inside.discard(pair)
            return None
        known = pair in self._inside or (second, first) in self._inside
        self._inside.add(pair)
        if known:
            return None
        if share == 0.0:
            # Both entered within the step before, if their footprints met in it.
            if not _overlap(before, *pair) or _overlap(self._past[-2], *pair) is not False:
                return None
            crossing = WayCrossed(first, second, before.time_s, 0.0, False)
            self.crossings.append(crossing)
            return crossing
        entered_s = before.time_s + share * (now.time_s - before.time_s)
        passage = _Passage(len(self.crossings), (*self._past, now),
                           [begin + share * (end - begin)])
        way = now.centers[second] - before.centers[second]
        ahead = AHEAD * (way / np.hypot(*way))
        left_s = _time_left(first, passage.before, _hulls(
            passage.swept[0][None], passage.swept[0][None] + ahead))
        crossing = WayCrossed(first, second, entered_s, max(entered_s - left_s, 0.0), True)
        self.crossings.append(crossing)
        self._passages[pair] = passage
        return crossing

    def _follow_passages(self, outlines: FloatArray) -> None:
        """Follow the second ones through their areas; measure the crossings that are complete."""
        for pair, passage in list(self._passages.items()):
            if pair in self._inside:
                passage.swept.append(outlines[pair[1]])
                continue
            del self._passages[pair]
            swept = np.stack(passage.swept)
            estimate = self.crossings[passage.number]
            left_s = _time_left(pair[0], passage.before, _hulls(swept[:-1], swept[1:]))
            self.crossings[passage.number] = estimate._replace(
                pet_s=max(estimate.entered_s - left_s, 0.0), is_estimate=False)


def _overlap(moment: _Moment, first: int, second: int) -> bool | None:
    """Return whether two footprints touch at a moment; None if one is absent."""
    if not np.isfinite(moment.centers[[first, second]]).all():
        return None
    return bool(time_to_contact(moment.outlines[first, None], moment.outlines[second, None],
                                _STILL, _STILL)[0] == 0.0)


def _first_contact(area: FloatArray, begin: FloatArray, end: FloatArray) -> float | None:
    """
    Return at which share of its movement a footprint first touches an area.

    :param area: (S, K, 2) corners of the convex parts of the area [m]
    :param begin: (C, 2) corners of the footprint at the begin of its movement [m]
    :param end: (C, 2) the same corners at its end.
    """
    def touches(shares: FloatArray) -> NDArray[np.bool_]:
        outlines = begin + shares[:, None, None] * (end - begin)
        times = time_to_contact(parts[:, None], outlines[None], _STILL, _STILL)
        return np.asarray((times == 0.0).any(axis=0))

    # Most parts are far away from the movement.
    way = _hulls(begin[None], end[None])
    parts = area[time_to_contact(area, way, _STILL, _STILL) == 0.0]
    if not len(parts):
        return None
    touching = np.flatnonzero(touches(_SHARES))
    if not len(touching):
        return None
    first = int(touching[0])
    if first == 0:
        return 0.0
    low, high = _SHARES[first - 1], _SHARES[first]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if touches(np.array([middle]))[0] else (middle, high)
    return min(float(high), 1.0)


def _time_left(first: int, moments: Sequence[_Moment], area: FloatArray) -> float:
    """Return when the first one was in an area (S, K, 2) for the last time [s]; else -inf."""
    for begin, end in reversed(list(pairwise(moments))):
        if not np.isfinite(begin.centers[first] + end.centers[first]).all():
            continue
        # Backwards in time, it enters the area at the moment at which it left it.
        share = _first_contact(area, end.outlines[first], begin.outlines[first])
        if share is not None:
            return end.time_s - share * (end.time_s - begin.time_s)
    return -math.inf


def _within(offsets: FloatArray, reach: FloatArray) -> NDArray[np.bool_]:
    x, y = offsets[..., 0], offsets[..., 1]
    return np.asarray(x * x + y * y < reach * reach)


def _hulls(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the corners (S, K, 2) of the smallest convex areas around pairs of footprints."""
    points = np.concatenate((first, second), axis=1)
    count, each = points.shape[:2]
    hulls = shapely.convex_hull(shapely.multipoints(
        points.reshape(-1, 2), indices=np.repeat(np.arange(count), each)))
    corners, owner = shapely.get_coordinates(hulls, return_index=True)
    lengths = np.bincount(owner, minlength=count)
    starts = np.cumsum(lengths) - lengths
    # Hulls with fewer corners repeat their last one, which equals the first.
    rows = np.minimum(np.arange(lengths.max()), lengths[:, None] - 1)
    return np.asarray(corners[starts[:, None] + rows])
