# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Glances of made gaze, against numbers by hand."""

from crgame_ros.analysis.behaviour.gaze import Area, glance_sums, glances, GlanceSum, LookedAt
import numpy as np
import pytest

STEP_S = 0.02
ROAD, LEFT, CAR = Area('road', 'road'), Area('mirror', 'mirror_left'), Area('vehicle', 'o1')
RIGHT = Area('mirror', 'mirror_right')


def gaze(*parts: tuple[Area | str, float]) -> tuple[np.ndarray, LookedAt]:
    """Return samples at 50 Hz that are on areas, lost or unknown, for some time each [s]."""
    areas = [area for area, time_s in parts for _ in range(round(time_s / STEP_S))]
    kinds = np.array([area if isinstance(area, str) else area.kind for area in areas], object)
    things = np.array([None if isinstance(area, str) or area == ROAD else area.object
                       for area in areas], object)
    none = np.full(len(areas), np.nan)
    return 5.0 + STEP_S * np.arange(len(areas)), LookedAt(
        none, none, kinds, things, np.full(len(areas), None), none, none)


def rows(*parts: tuple[Area | str, float]) -> list[tuple[Area, float, float, float]]:
    """Return area, begin after the first sample, transition and dwell of each glance."""
    return [(each.area, round(each.start_s - 5.0, 6), round(each.transition_s, 6),
             round(each.dwell_s, 6)) for each in glances(*gaze(*parts))]


def test_a_glance_is_the_transition_and_the_dwell() -> None:
    """Eyes that are lost on their way for 60 ms: the way belongs to the next glance."""
    assert rows((ROAD, 1.0), ('lost', 0.06), (LEFT, 0.5), (ROAD, 0.3)) == [
        (ROAD, 0.0, 0.0, 1.0), (LEFT, 1.0, 0.06, 0.5), (ROAD, 1.56, 0.0, 0.3)]


def test_what_is_shorter_than_a_fixation_is_on_the_way() -> None:
    """A car that the gaze crosses in 80 ms is not looked at; one for 120 ms is."""
    assert rows((ROAD, 1.0), (CAR, 0.08), (LEFT, 0.5)) == [
        (ROAD, 0.0, 0.0, 1.0), (LEFT, 1.0, 0.08, 0.5)]
    assert rows((ROAD, 1.0), (CAR, 0.08), (ROAD, 0.5)) == [(ROAD, 0.0, 0.0, 1.58)]
    assert [each[0] for each in rows((ROAD, 1.0), (CAR, 0.12), (LEFT, 0.5))] == [ROAD, CAR, LEFT]


@pytest.mark.parametrize(('lost_s', 'expected'), [
    (0.3, [(LEFT, 0.0, 0.0, 0.9)]),
    (0.32, [(LEFT, 0.0, 0.0, 0.3), (LEFT, 0.62, 0.0, 0.3)])])
def test_a_blink_does_not_end_a_glance_but_a_loss_does(
        lost_s: float, expected: list[tuple[Area, float, float, float]]) -> None:
    assert rows((LEFT, 0.3), ('unknown', lost_s), (LEFT, 0.3)) == expected


def test_a_fixation_that_a_blink_divides_is_long_enough() -> None:
    assert rows((LEFT, 0.08), ('lost', 0.1), (LEFT, 0.08)) == [(LEFT, 0.0, 0.0, 0.26)]


def test_samples_may_be_missing_in_disorder_and_without_a_time() -> None:
    """A tracker that stops for a second: its last sample lasts as long as any."""
    times_s, found = gaze((CAR, 0.4), (ROAD, 1.0), (CAR, 0.4))
    kept = np.flatnonzero(found.kind == 'vehicle')[::-1]
    found = LookedAt(*(column[kept] for column in found))
    times_s = times_s[kept]
    made = glances(np.append(times_s, np.nan), LookedAt(*(
        np.append(column, column[-1:]) for column in found)))
    assert [(each.start_s, each.duration_s) for each in made] == [
        (pytest.approx(5.0), pytest.approx(0.4)), (pytest.approx(6.4), pytest.approx(0.4))]
    assert glances(np.array([np.nan, 1.0]), LookedAt(*(column[:2] for column in found))) == []
    assert glances(np.empty(0), LookedAt(*(column[:0] for column in found))) == []


def test_sums_are_those_of_areas_and_of_kinds() -> None:
    """Of 3 s, 1.5 s are on two mirrors in three glances."""
    made = glances(*gaze((ROAD, 1.0), (LEFT, 0.4), (ROAD, 0.5), (RIGHT, 0.7), (LEFT, 0.4)))
    sums = {(each.kind, each.object): each for each in glance_sums(made)}
    assert list(sums) == [('road', 'road'), ('mirror', 'mirror_left'), ('mirror', 'mirror_right'),
                          ('mirror', None)]
    expected = GlanceSum('mirror', None, 3, 1.5, 0.5, 0.7, 0.5, 6.0)
    assert sums['mirror', None][2:] == pytest.approx(expected[2:])
    assert sums['mirror', 'mirror_left'][2:] == pytest.approx((2, 0.8, 0.4, 0.4, 0.8 / 3.0, 6.0))
    assert glance_sums([]) == []
