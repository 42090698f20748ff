# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Glances (ISO 15007): how long and how often drivers looked at an area of interest.

The gaze dwells on an area as long as successive samples are on it. A glance is the transition
towards the area and the dwell on it. What is shorter than a fixation is no dwell, but part of a
transition; a blink does not end one.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from crgame_ros.analysis.behaviour.gaze import LookedAt, NOWHERE
import numpy as np
from numpy.typing import NDArray

# The shortest dwell; the longest blink, or loss, that does not end one, which is the longest
# transition, too [s].
SHORTEST_S, LONGEST_GAP_S = 0.12, 0.3

FloatArray = NDArray[np.float64]


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

    :param area: which.
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
    :param glances: their number.
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
    for before, dwell in pairwise([None, *dwells]):
        assert dwell is not None
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
