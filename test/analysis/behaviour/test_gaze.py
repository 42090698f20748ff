# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What gaze is on, against answers by hand: boxes between pictures, depth, mirrors, the road."""

from dataclasses import replace
import math
from typing import Any

from crgame_ros.analysis.behaviour.gaze import GazeSamples, looked_at, LookedAt, on_the_ground
from crgame_ros.game.instruments_spec import GazeSpec
from crgame_ros.game.view_documents import ShownThing, ViewEye, ViewPicture, ViewPlace
from crgame_ros.recording.views import PictureKeeper
import numpy as np
import pytest
import shapely

# Half angles of 45 and 30 degrees; the eye is 1.2 m above the road, and looks level to the east.
EYE = ViewEye(100.0, 50.0, 0.0, 1.2, 0.0, 1.0, math.tan(math.radians(30.0)))
# The view is in the middle of a screen of 1600 x 900 CSS pixels, of which each has two.
PLACE = ViewPlace(400.0, 200.0, 800.0, 500.0, 1600.0, 900.0, 2.0)
NO_ROAD = shapely.Polygon()
SPEC = GazeSpec('Eyes', unit='view', margin=0.0)
WIDTH, HEIGHT = 1.8, 1.4


def picture(at_s: float, *shown: ShownThing, eye: ViewEye = EYE) -> ViewPicture:
    """Return a picture of hv0's view."""
    return ViewPicture('hv0', 0, at_s, 1.0, PLACE, eye, shown)


def rear(name: str, ahead_m: float, left_m: float = 0.0) -> ShownThing:
    """Return the rear of a car, as a pinhole sees it."""
    right, left = (0.5 - (left_m + side * WIDTH / 2) / ahead_m / EYE.across / 2
                   for side in (-1, 1))
    top, bottom = (0.5 - (height - EYE.height_m) / ahead_m / EYE.tall / 2
                   for height in (HEIGHT, 0.0))
    return ShownThing('vehicle', name, left, top, right, bottom, ahead_m)


def look(pictures: list[ViewPicture], at_s: Any, x: Any, y: Any, spec: GazeSpec = SPEC,
         road: shapely.Geometry = NO_ROAD, confidence: Any = None) -> LookedAt:
    """Return what samples are on."""
    columns = np.broadcast_arrays(*(np.asarray(each, dtype=float) for each in (at_s, x, y)))
    samples = GazeSamples(*(np.atleast_1d(each) for each in columns),
                          None if confidence is None else np.array(confidence))
    keeper = PictureKeeper()
    for each in pictures:
        keeper.add(each)
    return looked_at(samples, keeper.kept(), spec, road)


def test_a_box_is_between_those_of_the_pictures_around_the_sample() -> None:
    """
    A car recedes from 20 m to 30 m in 0.1 s, and its box shrinks on straight lines.

    Its left edge is at 0.5 - 0.9 / (2 d): 0.4775 at first and 0.485 at last; after a quarter of
    the time it is at 0.479375, after three quarters at 0.483125.
    """
    pictures = [picture(10.0, rear('o1', 20.0)), picture(10.1, rear('o1', 30.0))]
    for share, edge in ((0.25, 0.479375), (0.75, 0.483125), (0.0, 0.4775), (1.0, 0.485)):
        found = look(pictures, 10.0 + 0.1 * share, [edge - 1e-6, edge + 1e-6], 0.5)
        assert list(found.kind) == ['surroundings', 'vehicle'], share
        assert list(found.object) == [None, 'o1']
        assert found.distance_m[1] == pytest.approx(20.0 + 10.0 * share, abs=1e-6)
        assert found.between_s == pytest.approx(0.1 * min(share, 1.0 - share), abs=1e-9)


def test_what_is_in_one_picture_alone_is_there_as_long_as_it_is_the_nearer_one() -> None:
    """A light that has gone out, and a car behind it."""
    light = ShownThing('task', 'drt', 0.4, 0.4, 0.6, 0.6)
    found = look([picture(1.0, light, rear('o1', 20.0)), picture(1.1, rear('o1', 20.0))],
                 [1.0, 1.04, 1.06, 1.1], 0.5, 0.5)
    assert list(found.object) == ['drt', 'drt', 'o1', 'o1']
    assert list(found.kind[:2]) == ['task', 'task']
    assert np.isnan(found.distance_m[:2]).all()


def test_the_nearer_one_hides_the_other_as_they_pass() -> None:
    """One car overtakes the other between two pictures: at the middle they are level."""
    pictures = [picture(0.0, rear('o1', 10.0), rear('o2', 12.0)),
                picture(0.1, rear('o2', 10.0), rear('o1', 12.0))]
    assert list(look(pictures, [0.02, 0.049, 0.051, 0.09], 0.5, 0.5).object) \
        == ['o1', 'o1', 'o2', 'o2']


def test_a_mirror_lies_over_the_world_and_what_is_in_it_is_told_with_it() -> None:
    """The vehicle behind is in the mirror, that ahead behind the mirror."""
    glass = ShownThing('mirror', 'mirror_left', 0.4, 0.3, 0.6, 0.6)
    behind = ShownThing('vehicle', 'av0', 0.45, 0.4, 0.5, 0.5, 17.0, 'mirror_left')
    farther = ShownThing('vehicle', 'o2', 0.44, 0.4, 0.55, 0.5, 40.0, 'mirror_left')
    found = look([picture(0.0, behind, farther, glass, rear('o1', 5.0))], 0.0,
                 [0.47, 0.52, 0.42, 0.65, 0.585], [0.45, 0.45, 0.45, 0.7, 0.61])
    assert list(found.kind) == ['mirror', 'mirror', 'mirror', 'surroundings', 'vehicle']
    assert list(found.object) == ['mirror_left'] * 3 + [None, 'o1']
    assert list(found.in_mirror) == ['av0', 'o2', None, None, None]
    assert found.distance_m == pytest.approx([17.0, 40.0, np.nan, np.nan, 5.0], nan_ok=True)


def test_the_margin_is_an_angle_and_exact_hits_come_first() -> None:
    """At the middle of a picture of 90 degrees, 1 degree is tan(1 deg) / 2 of its width."""
    thing = ShownThing('sign', '7', 0.5, 0.4, 0.51, 0.6, 50.0)
    degree = math.tan(math.radians(1.0)) / 2.0
    spec = replace(SPEC, margin=1.0)
    found = look([picture(0.0, thing)], 0.0, [0.5 - 0.99 * degree, 0.5 - 1.01 * degree], 0.5, spec)
    assert list(found.kind) == ['sign', 'surroundings']
    # Farther, but hit; and of two that are missed the one whose edge is nearer.
    far = ShownThing('vehicle', 'o1', 0.49, 0.4, 0.499, 0.6, 90.0)
    assert list(look([picture(0.0, thing, far)], 0.0, [0.4985, 0.4993, 0.4998], 0.5,
                     spec).object) == ['o1', 'o1', '7']


@pytest.mark.parametrize(('unit', 'x', 'y'), [
    # The point is 0.25 and 0.8 of the view: 600 and 600 CSS pixels of the screen.
    ('pixels', 1200.0, 1200.0), ('screen', 600.0 / 1600.0, 600.0 / 900.0), ('view', 0.25, 0.8)])
def test_gaze_on_the_screen_is_converted_by_the_place_of_the_view(
        unit: Any, x: float, y: float) -> None:
    found = look([picture(0.0)], 0.0, x, y, replace(SPEC, unit=unit))
    assert (found.x[0], found.y[0]) == pytest.approx((0.25, 0.8))
    beside = look([picture(0.0)], 0.0, [-1e-3, 0.5], [0.5, 1.001])
    assert list(beside.kind) == ['off_view'] * 2


def test_what_tells_nothing_is_lost_or_unknown() -> None:
    """No gaze, little confidence, no picture near, and no time."""
    pictures = [picture(1.0, rear('o1', 9.0)), picture(2.0, rear('o1', 9.0))]
    spec = replace(SPEC, confidence='sure', least=0.6)
    found = look(pictures, [1.0, 1.0, 1.0, 1.0, 1.19, 1.21, 0.79, math.nan],
                 [0.5, math.nan, math.inf, 0.5, 0.5, 0.5, 0.5, 0.5], 0.5, spec,
                 confidence=[0.6, 1.0, 1.0, 0.59, 1.0, 1.0, 1.0, 1.0])
    assert list(found.kind) == ['vehicle', 'lost', 'lost', 'lost', 'vehicle', 'unknown', 'unknown',
                                'unknown']
    assert np.isnan(found.x[[1, 2, 3, 5, 6, 7]]).all()
    assert found.between_s[5] == pytest.approx(0.21)
    none = looked_at(GazeSamples(np.zeros(1), np.zeros(1), np.zeros(1)), None, SPEC, NO_ROAD)
    assert list(none.kind) == ['unknown']


def test_a_line_of_sight_meets_the_road_where_trigonometry_has_it() -> None:
    """
    An eye of 1.2 m that looks 2 degrees down sees the road 34.36 m ahead.

    It does so by its own pitch, by a place in the picture, or by half of each; to the north, and
    10 degrees aside.
    """
    ahead_m = 1.2 / math.tan(math.radians(2.0))

    def y_of(down_deg: float) -> float:
        return 0.5 + math.tan(math.radians(down_deg)) / math.tan(math.radians(30.0)) / 2.0

    north = EYE._replace(yaw=math.pi / 2, pitch=math.radians(-2.0))
    eyes = np.array([EYE, north, EYE._replace(pitch=math.radians(-1.0)), EYE, EYE])
    aside = math.tan(math.radians(10.0))
    points, away_m = on_the_ground(np.array([0.5, 0.5, 0.5, 0.5 - aside / 2, 0.5]),
                                   np.array([y_of(2.0), 0.5, y_of(1.0), y_of(2.0), 0.4]), eyes)
    assert points[:3] == pytest.approx(np.array([
        [100.0 + ahead_m, 50.0], [100.0, 50.0 + ahead_m], [100.0 + ahead_m, 50.0]]))
    assert points[3] == pytest.approx([100.0 + ahead_m, 50.0 + ahead_m * aside])
    assert away_m[:3] == pytest.approx(np.hypot(ahead_m, 1.2))
    assert np.isnan(away_m[4])
    # A lane from 30 m to 40 m ahead, and gaze at 34 m and 60 m, and above the horizon.
    lane = shapely.box(130.0, 48.0, 140.0, 52.0)
    seen = look([picture(0.0), picture(0.1)], 0.05, 0.5,
                [y_of(2.0), y_of(math.degrees(math.atan(1.2 / 60.0))), 0.4], road=lane)
    assert list(seen.kind) == ['road', 'surroundings', 'surroundings']
    assert seen.distance_m[0] == pytest.approx(math.hypot(ahead_m, 1.2))
    # Within the margin below the line the road counts: 1.15 degrees more at 60 m.
    near = look([picture(0.0)], 0.0, 0.5, [y_of(math.degrees(math.atan(1.2 / 60.0)))],
                replace(SPEC, margin=1.0), lane)
    assert list(near.kind) == ['road']


def test_the_eye_turns_the_short_way_between_two_pictures() -> None:
    """From 179 to -179 degrees it looks to the west all the time, not to the east."""
    pictures = [picture(at_s, eye=EYE._replace(yaw=math.radians(yaw), pitch=-0.05))
                for at_s, yaw in ((0.0, 179.0), (0.1, -179.0))]
    west = shapely.box(60.0, 48.0, 90.0, 52.0)
    assert list(look(pictures, [0.0, 0.02, 0.05, 0.09], 0.5, 0.5, road=west).kind) == ['road'] * 4


def test_pictures_in_disorder_and_twice_are_as_in_order() -> None:
    """Two pages of one driver, or a message that came twice."""
    early, late = picture(1.0, rear('o1', 9.0)), picture(1.1, rear('o2', 9.0))
    found = look([late, early, late], [1.0, 1.1], 0.5, 0.5)
    assert list(found.object) == ['o1', 'o2']
