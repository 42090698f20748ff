# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What drivers looked at on their screen, and their glances at areas of interest (ISO 15007).

A page tells ten times a second what was where. Between two pictures the edges of a box, its
distance and the eye move on straight lines.

The gaze dwells on an area as long as successive samples are on it. A glance is the transition
towards the area and the dwell on it. What is shorter than a fixation is no dwell, but part of a
transition; a blink does not end one.
"""

from collections.abc import Sequence
from typing import NamedTuple

from crgame_ros.game.instruments_spec import GazeSpec
from crgame_ros.recording.views import SeatPictures, ShownName
import numpy as np
from numpy.typing import NDArray
import shapely

# A sample farther from the nearest picture is on nothing that is known [s].
TOLERANCE_S = 0.2
# What a sample is on besides what pages tell: the last two tell nothing about where the gaze was.
ROAD, SURROUNDINGS, OFF_VIEW, LOST, UNKNOWN = (
    'road', 'surroundings', 'off_view', 'lost', 'unknown')
NOWHERE = (LOST, UNKNOWN)

FloatArray = NDArray[np.float64]
TextArray = NDArray[np.object_]
_X, _Y, _YAW, _HEIGHT, _PITCH, _ACROSS, _TALL = range(7)
# Things over the view come before all others, those within the margin after them.
_BEFORE, _AFTER = -1e9, 1e9
# The shortest dwell; the longest blink, or loss, that does not end one, which is the longest
# transition, too [s].
SHORTEST_S, LONGEST_GAP_S = 0.12, 0.3


class GazeSamples(NamedTuple):
    """
    Samples of a driver's gaze (R).

    :param steady_s: (R) when, on the steady clock; NaN where it is not known [s]
    :param x: (R) to the right, in the unit that the game names; NaN where it is lost.
    :param y: (R) downwards, likewise.
    :param confidence: (R) of the device; None if it tells none.
    """

    steady_s: FloatArray
    x: FloatArray
    y: FloatArray
    confidence: FloatArray | None = None


class LookedAt(NamedTuple):
    """
    What samples of gaze are on (R).

    :param x: (R) from the view's left, in shares of its width; NaN where it is lost or unknown.
    :param y: (R) from the view's top, in shares of its height.
    :param kind: (R) of thing; or road, surroundings, off_view, lost or unknown.
    :param object: (R) id of the thing; None where there is none.
    :param in_mirror: (R) id of what is seen in the mirror that the gaze is on; None without.
    :param distance_m: (R) from the eye; in a mirror to what is seen in it; NaN where there is
        none [m]
    :param between_s: (R) from the nearest picture; NaN without a time or a picture [s]
    """

    x: FloatArray
    y: FloatArray
    kind: TextArray
    object: TextArray  # noqa: A003
    in_mirror: TextArray
    distance_m: FloatArray
    between_s: FloatArray


def looked_at(samples: GazeSamples, pictures: SeatPictures | None, spec: GazeSpec,
              road: shapely.Geometry) -> LookedAt:
    """
    Return what each sample is on.

    A gaze is on the foremost thing whose box contains it: on what lies over the view, else on the
    nearest. Without any, it is on the thing within the margin whose box is the nearest to it.
    Without a thing it is on the road where its line meets the plane under the vehicle on a
    lanelet.

    :param pictures: of the same driver's view; None without any.
    :param road: all lanelets, in frame map.
    """
    count = len(samples.steady_s)
    unknown = np.full(count, np.nan)
    nothing = np.full(count, None, dtype=object)
    found = LookedAt(unknown, unknown.copy(), np.full(count, UNKNOWN, dtype=object), nothing,
                     nothing.copy(), unknown.copy(), unknown.copy())
    lost = ~np.isfinite(samples.x) | ~np.isfinite(samples.y)
    if samples.confidence is not None:
        lost |= ~(samples.confidence >= spec.least)
    found.kind[lost] = LOST
    if pictures is None:
        return found
    nearest, other, share = _neighbours(samples.steady_s, pictures.times_s)
    found.between_s[:] = np.abs(samples.steady_s - pictures.times_s[nearest])
    known = np.flatnonzero(~lost & (found.between_s <= TOLERANCE_S))
    place = pictures.places[nearest[known]]
    found.x[known], found.y[known] = _in_view(samples.x[known], samples.y[known], place, spec)
    inside = (found.x[known] >= 0.0) & (found.x[known] <= 1.0) \
        & (found.y[known] >= 0.0) & (found.y[known] <= 1.0)
    found.kind[known] = OFF_VIEW
    known = known[inside]
    found.kind[known] = SURROUNDINGS
    pairs = nearest * len(pictures.times_s) + other
    order = known[np.argsort(pairs[known], kind='stable')]
    for group in np.split(order, np.flatnonzero(np.diff(pairs[order])) + 1):
        if len(group):
            _find_things(found, group, share[group], pictures,
                         int(nearest[group[0]]), int(other[group[0]]), spec.margin)
    free = known[found.kind[known] == SURROUNDINGS]
    eyes = _eyes_between(pictures.eyes[nearest[free]], pictures.eyes[other[free]], share[free])
    _find_road(found, free, eyes, spec.margin, road)
    return found


def _neighbours(times_s: FloatArray, pictures_s: FloatArray,
                ) -> tuple[NDArray[np.int64], NDArray[np.int64], FloatArray]:
    """
    Return the nearest picture of each sample, that on its other side, and its share of the way.

    Where the other one is too far away, or there is none, it is the nearest itself.
    """
    last = len(pictures_s) - 1
    finite_s = np.where(np.isfinite(times_s), times_s, pictures_s[0])
    after = np.clip(np.searchsorted(pictures_s, finite_s), 0, last)
    before = np.maximum(after - 1, 0)
    nearer = np.abs(finite_s - pictures_s[before]) <= np.abs(finite_s - pictures_s[after])
    nearest, other = np.where(nearer, before, after), np.where(nearer, after, before)
    gaps_s = pictures_s[other] - pictures_s[nearest]
    outside = (finite_s < pictures_s[0]) | (finite_s > pictures_s[last])
    alone = outside | (np.abs(gaps_s) > 2.0 * TOLERANCE_S) | (gaps_s == 0.0)
    other = np.where(alone, nearest, other)
    share = np.where(alone, 0.0, (finite_s - pictures_s[nearest]) / np.where(alone, 1.0, gaps_s))
    return nearest, other, share


def _in_view(x: FloatArray, y: FloatArray, place: FloatArray, spec: GazeSpec,
             ) -> tuple[FloatArray, FloatArray]:
    """Return gaze in shares of the view's width and height."""
    left, top, width, height, screen_width, screen_height, ratio = place.T
    if spec.unit == 'view':
        return x, y
    x, y = (x * screen_width, y * screen_height) if spec.unit == 'screen' \
        else (x / ratio, y / ratio)
    # A view without an area has no inside.
    with np.errstate(divide='ignore', invalid='ignore'):
        return (x - left) / width, (y - top) / height


def _find_things(found: LookedAt, group: NDArray[np.int64], share: FloatArray,
                 pictures: SeatPictures, nearest: int, other: int, margin: float) -> None:
    """Find what samples (S) between the same two pictures are on, of T things in the nearer."""
    rows = np.arange(*pictures.starts[nearest:nearest + 2])
    if not len(rows):
        return
    rows_there = np.arange(*pictures.starts[other:other + 2])
    there = dict(zip(pictures.things[rows_there].tolist(), rows_there.tolist(), strict=True))
    # What is in one picture alone stays where it is.
    partners = np.array([there.get(thing, row) for thing, row in zip(
        pictures.things[rows].tolist(), rows.tolist(), strict=True)])
    boxes = _between(pictures.boxes[rows], pictures.boxes[partners], share[:, None])
    distances = _between(pictures.distances[rows, None], pictures.distances[partners, None],
                         share[:, None])[..., 0]
    names = [pictures.names[thing] for thing in pictures.things[rows].tolist()]
    beside = _beside_deg(found.x[group], found.y[group], boxes, pictures.eyes[nearest])
    ranks = np.where(np.isnan(distances), _BEFORE + np.arange(len(names)), distances)
    ranks = np.where(beside == 0.0, ranks, np.where(beside <= margin, _AFTER + beside, np.inf))
    in_mirror = np.array([name.mirror is not None for name in names])
    chosen = _least(np.where(in_mirror, np.inf, ranks))
    for sample, thing, row in zip(group.tolist(), chosen.tolist(), range(len(group)), strict=True):
        if thing < 0:
            continue
        name = names[thing]
        found.kind[sample], found.object[sample] = name.kind, name.id
        found.distance_m[sample] = distances[row, thing]
        seen = _seen_in(name, names, ranks[row])
        if seen >= 0:
            found.in_mirror[sample] = names[seen].id
            found.distance_m[sample] = distances[row, seen]


def _seen_in(mirror: ShownName, names: list[ShownName], ranks: FloatArray) -> int:
    """Return which thing is looked at in a mirror; -1 for none."""
    if mirror.kind != 'mirror':
        return -1
    others = np.array([name.mirror == mirror.id for name in names])
    return int(_least(np.where(others, ranks, np.inf)[None])[0])


def _least(ranks: FloatArray) -> NDArray[np.int64]:
    """Return the column with the least rank (S); -1 where all are infinite."""
    columns = np.argmin(ranks, axis=1)
    return np.where(np.isfinite(ranks[np.arange(len(ranks)), columns]), columns, -1)


def _beside_deg(x: FloatArray, y: FloatArray, boxes: FloatArray, eye: FloatArray) -> FloatArray:
    """
    Return how far beside boxes (S, T, 4) samples are (S, T), 0 within [deg].

    Angles are those in the middle of the picture; towards its edges they are smaller.
    """
    left, top, right, bottom = np.moveaxis(boxes, -1, 0)
    dx = np.maximum(np.maximum(left - x[:, None], x[:, None] - right), 0.0)
    dy = np.maximum(np.maximum(top - y[:, None], y[:, None] - bottom), 0.0)
    return np.degrees(np.arctan(np.hypot(2.0 * eye[_ACROSS] * dx, 2.0 * eye[_TALL] * dy)))


def _find_road(found: LookedAt, group: NDArray[np.int64], eyes: FloatArray, margin: float,
               road: shapely.Geometry) -> None:
    """Find the samples that meet the road: by their own line, or by one lower by the margin."""
    for lower_deg in (0.0, margin):
        free = found.kind[group] == SURROUNDINGS
        samples, eye = group[free], eyes[free]
        points, away_m = on_the_ground(found.x[samples], found.y[samples], eye, lower_deg)
        met = np.isfinite(away_m)
        met[met] = shapely.contains_xy(road, points[met])
        found.kind[samples[met]] = ROAD
        found.distance_m[samples[met]] = away_m[met]


def on_the_ground(x: FloatArray, y: FloatArray, eyes: FloatArray, lower_deg: float = 0.0,
                  ) -> tuple[FloatArray, FloatArray]:
    """
    Return where lines of sight meet the plane under the vehicle (R, 2) [m], and how far away.

    :param x: (R) shares of the view
    :param y: (R) likewise
    :param eyes: (R, 7) as in `ViewEye`
    :param lower_deg: by how much the lines are lowered [deg]
    :return: points and distances; NaN for lines that rise [m]
    """
    left = (1.0 - 2.0 * x) * eyes[:, _ACROSS]
    up = np.tan(np.arctan((1.0 - 2.0 * y) * eyes[:, _TALL]) - np.radians(lower_deg))
    cos, sin = np.cos(eyes[:, _PITCH]), np.sin(eyes[:, _PITCH])
    ahead, rise = cos - up * sin, sin + up * cos
    with np.errstate(divide='ignore', invalid='ignore'):
        reach = np.where(rise < 0.0, -eyes[:, _HEIGHT] / rise, np.nan)
    yaw = eyes[:, _YAW]
    points = eyes[:, [_X, _Y]] + reach[:, None] * np.column_stack((
        ahead * np.cos(yaw) - left * np.sin(yaw), ahead * np.sin(yaw) + left * np.cos(yaw)))
    return points, reach * np.sqrt(ahead ** 2 + rise ** 2 + left ** 2)


def _between(here: FloatArray, there: FloatArray, share: FloatArray) -> FloatArray:
    """Return rows on the straight lines from here to there."""
    return np.asarray(here + share[..., None] * (there - here))


def _eyes_between(here: FloatArray, there: FloatArray, share: FloatArray) -> FloatArray:
    """Return eyes on the way from here to there; they turn the short way."""
    there = there.copy()
    turn = there[:, _YAW] - here[:, _YAW]
    there[:, _YAW] = here[:, _YAW] + (turn + np.pi) % (2.0 * np.pi) - np.pi
    return _between(here, there, share)


class Area(NamedTuple):
    """
    An area of interest.

    :param kind: of thing, or road, surroundings or off_view.
    :param object: id of the thing; the kind where it has none.
    """

    kind: str
    object: str  # noqa: A003


class Glance(NamedTuple):
    """
    A glance at an area.

    :param start_s: begin of the transition towards it, on the steady clock [s]
    :param transition_s: until the gaze is on it [s]
    :param dwell_s: from then until it leaves [s]
    """

    area: Area
    start_s: float
    transition_s: float
    dwell_s: float

    @property
    def duration_s(self) -> float:
        """Return its duration: transition and dwell [s]."""
        return self.transition_s + self.dwell_s


class GlanceSum(NamedTuple):
    """
    The glances at an area, or at all areas of a kind.

    :param kind: of areas.
    :param object: which; None for all of the kind.
    :param total_s: sum of their durations [s]
    :param mean_s: mean duration [s]
    :param longest_s: longest duration [s]
    :param share: of the time of all glances.
    :param first_s: begin of the first, on the steady clock [s]
    """

    kind: str
    object: str | None  # noqa: A003
    glances: int
    total_s: float
    mean_s: float
    longest_s: float
    share: float
    first_s: float


class _Dwell(NamedTuple):
    area: Area
    start_s: float
    end_s: float


def glances(steady_s: FloatArray, found: LookedAt) -> list[Glance]:
    """
    Return the glances of a driver, in their order.

    :param steady_s: (R) times of the samples on the steady clock, in any order; those that are
        NaN do not count [s]
    :param found: what the samples are on.
    """
    dwells = _joined(_looks(steady_s, found))
    dwells = _joined([each for each in dwells if each.end_s - each.start_s >= SHORTEST_S])
    made = []
    for before, dwell in zip((None, *dwells), dwells, strict=False):
        way_s = np.inf if before is None else dwell.start_s - before.end_s
        transition_s = float(way_s) if way_s <= LONGEST_GAP_S else 0.0
        made.append(Glance(dwell.area, dwell.start_s - transition_s, transition_s,
                           dwell.end_s - dwell.start_s))
    return made


def glance_sums(made: Sequence[Glance]) -> list[GlanceSum]:
    """Return the sums over each area and, where a kind has areas of its own, over each kind."""
    whole_s = sum(each.duration_s for each in made)
    areas = dict.fromkeys(each.area for each in made)
    kinds = dict.fromkeys(area.kind for area in areas if area.object != area.kind)
    return [*(_sum(area.kind, area.object, [each for each in made if each.area == area], whole_s)
              for area in areas),
            *(_sum(kind, None, [each for each in made if each.area.kind == kind], whole_s)
              for kind in kinds)]


def _sum(kind: str, thing: str | None, made: Sequence[Glance], whole_s: float) -> GlanceSum:
    durations_s = [each.duration_s for each in made]
    total_s = sum(durations_s)
    return GlanceSum(kind, thing, len(made), total_s, total_s / len(made), max(durations_s),
                     total_s / whole_s, made[0].start_s)


def _looks(steady_s: FloatArray, found: LookedAt) -> list[_Dwell]:
    """Return the samples on areas, each until the next."""
    order = np.argsort(steady_s, kind='stable')
    order = order[np.isfinite(steady_s[order])]
    if len(order) < 2:
        return []
    begins_s = steady_s[order]
    steps_s = np.diff(begins_s)
    # The last sample before a gap lasts as long as one usually does.
    usual_s = min(float(np.median(steps_s)), LONGEST_GAP_S)
    ends_s = np.append(np.where(steps_s <= LONGEST_GAP_S, begins_s[1:], begins_s[:-1] + usual_s),
                       begins_s[-1] + usual_s)
    return [_Dwell(Area(found.kind[place], found.object[place] or found.kind[place]), *times)
            for place, *times in zip(order.tolist(), begins_s.tolist(), ends_s.tolist(),
                                     strict=True) if found.kind[place] not in NOWHERE]


def _joined(dwells: Sequence[_Dwell]) -> list[_Dwell]:
    """Join what follows on the same area, after a blink at most."""
    joined: list[_Dwell] = []
    for dwell in dwells:
        last = joined[-1] if joined else None
        if last is not None and last.area == dwell.area \
                and dwell.start_s - last.end_s <= LONGEST_GAP_S:
            joined[-1] = last._replace(end_s=dwell.end_s)
        else:
            joined.append(dwell)
    return joined
