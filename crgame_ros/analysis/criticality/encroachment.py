# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Post-encroachment time (PET): from when one leaves a conflict area to when another enters."""

from collections import deque
from itertools import pairwise
import math
from typing import NamedTuple

from crgame_ros.analysis.criticality.footprint_approach import time_to_contact
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]

# Earlier positions are forgotten: PETs beyond this are not measured [s].
MEMORY_S = 10.0
# Paths cross at an angle between this and pi less this; else one follows or meets the other [rad].
LEAST_ANGLE = math.radians(20.0)
# The second one's path through the conflict area is extended straight ahead by this [m].
AHEAD = 15.0
# A shorter movement in a step has no direction [m].
STANDING = 1e-3
ROUNDING_S = 1e-9


class WayCrossed(NamedTuple):
    """
    A crossing of two paths.

    :param first: number of the one that was in the conflict area first.
    :param second: number of the other.
    :param entered_s: time at which the second entered the area [s]
    :param pet_s: time since the first had left it [s]; 0 if it had not
    """

    first: int
    second: int
    entered_s: float
    pet_s: float


class _Moment(NamedTuple):
    """All positions and footprints at a time; NaN where absent."""

    time_s: float
    outlines: FloatArray
    centers: FloatArray


class EncroachmentDetector:
    """
    Detector of crossing paths, from footprints at successive ticks.

    The conflict area is the intersection of the areas that both footprints sweep. Between two
    ticks they move evenly. Only crossing paths count, not those of followers or oncoming traffic:
    the table of definitions leaves a measure without crossing undefined.

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

    def observe(self, time_s: float, outlines: FloatArray,
                centers: FloatArray) -> list[WayCrossed]:
        """
        Add the positions of a tick, and return the crossings that it completes.

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
        way = now.centers[second] - before.centers[second]
        lapse = now.time_s - before.time_s
        begins, ends = (np.stack([self._past[step + late].outlines[first] for step in segments])
                        for late in (0, 1))
        contact = float(time_to_contact(_hulls(begins, ends), before.outlines[second],
                                        np.zeros(2), way / lapse).min())
        pair = (first, second)
        # A contact exactly at a tick belongs to the step that ends there.
        if contact > lapse + ROUNDING_S:
            self._inside.discard(pair)
            return None
        known = pair in self._inside or (second, first) in self._inside
        self._inside.add(pair)
        if known or contact == 0.0:
            return None
        entered_s = before.time_s + contact
        left_s = self._left(first, before.outlines[second] + way * contact / lapse, way, now)
        return WayCrossed(first, second, entered_s, max(entered_s - left_s, 0.0))

    def _left(self, first: int, outline: FloatArray, way: FloatArray, now: _Moment) -> float:
        """Return when the first one left the area that the second one is about to cross [s]."""
        through = _hulls(outline[None], outline[None] + AHEAD * way / np.hypot(*way))[0]
        latest = -math.inf
        for begin, end in pairwise((*self._past, now)):
            if not np.isfinite(begin.centers[first] + end.centers[first]).all():
                continue
            lapse = end.time_s - begin.time_s
            back = (begin.centers[first] - end.centers[first]) / lapse
            # Backwards in time, it enters the area at the moment at which it left it.
            contact = float(time_to_contact(through, end.outlines[first], np.zeros(2), back))
            if contact <= lapse + ROUNDING_S:
                latest = max(latest, end.time_s - contact)
        return latest


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
