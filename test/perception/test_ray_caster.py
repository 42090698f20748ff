# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Line tracing (FS II-B2) compared with shapely, which does not use sectors."""

import math
from typing import Any

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.perception_spec import SensorSpec
from crgame_ros.geometry.shape import Shape
from crgame_ros.occupancy.occupancy import OccupancyGrid
from crgame_ros.perception.ray_caster import RayCaster
from crgame_ros.perception.sensors import NOTHING, PERMANENT, Scan, SensedBodies
import numpy as np
from numpy.typing import NDArray
import pytest
import shapely
from shapely import affinity

Array = NDArray[np.float64]
FULL = 2.0 * math.pi
# Concave on purpose: a ray may meet it twice.
ARROW = Shape.polygon(((2.0, 0.0), (-1.5, 1.5), (-0.5, 0.0), (-1.5, -1.5)))
KINDS = {'rectangles': [Shape.rectangle(4.5, 1.8)], 'circles': [Shape.circle(0.3)],
         'polygons': [ARROW],
         'all': [Shape.rectangle(12.0, 2.5), Shape.circle(1.0), ARROW]}


def bodies_of(shapes: list[Shape], poses: Any) -> SensedBodies:
    bodies = SensedBodies([ObjectDescription(f'o{i}', 'car', Role.RECORDED, shape)
                           for i, shape in enumerate(shapes)])
    bodies.poses = np.array(poses, dtype=float).reshape(-1, 3)
    return bodies


def caster(**fields: Any) -> RayCaster:
    return RayCaster(SensorSpec('s', **fields))


def outline(shape: Shape, pose: Array) -> shapely.Geometry:
    """Return the outline of a body; a circle becomes a polygon of 4,096 corners."""
    if shape.kind == 'circle':
        ground = shapely.Point(0.0, 0.0).buffer(shape.radius, quad_segs=1024)
    elif shape.kind == 'polygon':
        ground = shapely.Polygon(shape.vertices)
    else:
        ground = shapely.box(-shape.length / 2, -shape.width / 2, shape.length / 2,
                             shape.width / 2)
    turned = affinity.rotate(ground, pose[2], origin=(0.0, 0.0), use_radians=True)
    return affinity.translate(turned, pose[0], pose[1]).exterior


def lines_of(scan: Scan, horizon: float) -> Array:
    """Return the rays as shapely lines."""
    x, y, yaw = scan.pose
    direction = scan.angles + yaw
    ends = np.stack((x + horizon * np.cos(direction), y + horizon * np.sin(direction)), axis=1)
    return shapely.linestrings(np.stack((np.broadcast_to((x, y), ends.shape), ends), axis=1))


def first_met(scan: Scan, things: list[Any], horizon: float) -> tuple[Array, Array]:
    """Return the distances (R) at which each ray meets its first and its second body (R)."""
    origin = shapely.Point(scan.pose[:2])
    met = shapely.intersection(lines_of(scan, horizon)[:, None], np.array(things)[None, :])
    distance = shapely.distance(origin, met)
    distance = np.where(np.isnan(distance), np.inf, distance)
    return distance, distance.min(axis=1)


@pytest.mark.slow
@pytest.mark.parametrize('seed', range(4))
@pytest.mark.parametrize('kind', KINDS)
def test_ranges_and_hits_are_those_of_shapely(kind: str, seed: int) -> None:
    """Every ray agrees among many bodies around a turned sensor, for several fields of view."""
    rng = np.random.default_rng(seed)
    shapes = [KINDS[kind][i % len(KINDS[kind])] for i in range(30)]
    poses = np.column_stack((rng.uniform(-40.0, 40.0, (30, 2)), rng.uniform(-9.0, 9.0, 30)))
    poses[np.hypot(poses[:, 0] - 1.0, poses[:, 1] + 2.0) < 9.0] = np.nan
    field = (FULL, 2.0, math.pi, 5.5)[seed]
    scan = caster(field_of_view=field, rays=361, horizon=35.0).scan(
        (1.0, -2.0, rng.uniform(-4.0, 4.0)), bodies_of(shapes, poses))
    present = np.flatnonzero(np.isfinite(poses[:, 0]))
    things = [outline(shapes[i], poses[i]) for i in present]
    each, expected = first_met(scan, things, 35.0)
    # A ray very near an outline may hit or miss; the polygon of a circle lies inside it.
    sure = np.isfinite(scan.ranges) == np.isfinite(expected)
    assert (~sure).sum() <= (0 if kind in ('rectangles', 'polygons') else 1)
    hit = sure & np.isfinite(expected)
    assert 10 < hit.sum() < 361
    grazing = 0 if kind in ('rectangles', 'polygons') else 2
    error = np.abs(scan.ranges[hit] - expected[hit])
    assert (error > (1e-9 if grazing == 0 else 1e-3)).sum() <= grazing
    assert (scan.hits[hit] == present[each.argmin(axis=1)[hit]]).all()
    assert (scan.hits[~np.isfinite(scan.ranges)] == NOTHING).all()


def test_rays_spread_over_the_field_of_view() -> None:
    """The first and last ray are on its borders; in a full circle no ray occurs twice."""
    quarter = caster(field_of_view=math.pi / 2, rays=3).scan((0, 0, 0), bodies_of([], []))
    np.testing.assert_allclose(quarter.angles, (-math.pi / 4, 0.0, math.pi / 4))
    circle = caster(field_of_view=FULL, rays=4).scan((0, 0, 0), bodies_of([], []))
    np.testing.assert_allclose(circle.angles, (-math.pi, -math.pi / 2, 0.0, math.pi / 2))
    single = caster(field_of_view=1.0, rays=1).scan(
        (0, 0, 0), bodies_of([Shape.circle(0.1)], [(5.0, 0.0, 0.0)]))
    assert single.angles.tolist() == [0.0]
    assert single.ranges.tolist() == pytest.approx([4.9])


@pytest.mark.parametrize(('bearing', 'seen'), [
    (59.0, True), (61.0, False), (-59.0, True), (-61.0, False), (180.0, False)])
def test_field_of_view_ends_at_its_borders(bearing: float, seen: bool) -> None:
    """A field of view of 120 degrees has 60 to each side; the disc covers half a degree."""
    angle = math.radians(bearing)
    disc = bodies_of([Shape.circle(0.1)], [(20 * math.cos(angle), 20 * math.sin(angle), 0.0)])
    scan = caster(field_of_view=math.radians(120.0), rays=721).scan((0, 0, 0), disc)
    assert (scan.hits == 0).any() == seen


@pytest.mark.parametrize(('x', 'seen'), [(52.24, True), (52.26, False)])
def test_horizon_is_constant(x: float, seen: bool) -> None:
    """The near side of a car of 4.5 m is at x - 2.25 m, the horizon at 50 m."""
    car = bodies_of([Shape.rectangle(4.5, 1.8)], [(x, 0.0, 0.0)])
    scan = caster(field_of_view=1.0, rays=101, horizon=50.0).scan((0, 0, 0), car)
    assert (scan.hits == 0).any() == seen
    assert np.isfinite(scan.ranges).any() == seen
    if seen:
        assert scan.ranges[50] == pytest.approx(x - 2.25)


def test_the_nearest_body_hides_what_is_behind() -> None:
    """All rays towards the far car end at the near van; rays beside the van pass."""
    bodies = bodies_of([Shape.rectangle(4.5, 1.8), Shape.rectangle(6.0, 2.2)],
                       [(30.0, 0.0, 0.0), (10.0, 0.0, 0.0)])
    spec: dict[str, Any] = {'field_of_view': 0.6, 'rays': 301}
    scan = caster(**spec).scan((0, 0, 0), bodies)
    assert set(scan.hits.tolist()) == {1, NOTHING}
    aside = caster(**spec).scan((0, 4.0, -0.1), bodies)
    assert set(aside.hits.tolist()) == {0, 1, NOTHING}


def test_a_body_across_the_seam_is_met() -> None:
    """Rays hit a body behind a full-circle sensor, where bearings jump from pi to -pi."""
    wall = bodies_of([Shape.rectangle(1.0, 20.0)], [(-10.0, 0.0, 0.0)])
    scan = caster(field_of_view=FULL, rays=360).scan((0, 0, 0), wall)
    behind = np.abs(scan.angles) > math.pi - 0.7
    assert (scan.hits[behind] == 0).all()
    np.testing.assert_allclose(scan.ranges[behind], 9.5 / -np.cos(scan.angles[behind]))


@pytest.mark.parametrize('yaw', [0.0, math.pi / 2, math.pi, -math.pi / 2])
def test_an_edge_seen_from_its_end(yaw: float) -> None:
    """A ray along a side of a body stops exactly at the corner."""
    cos, sin = round(math.cos(yaw)), round(math.sin(yaw))
    # Its left side lies on the middle ray.
    center = (12.0 * cos + 1.0 * sin, 12.0 * sin - 1.0 * cos)
    bodies = bodies_of([Shape.rectangle(4.0, 2.0)], [(*center, yaw)])
    scan = caster(field_of_view=0.2, rays=3).scan((0.0, 0.0, yaw), bodies)
    assert scan.ranges[1] == pytest.approx(10.0) or math.isinf(scan.ranges[1])
    assert scan.ranges[0] == pytest.approx(10.0 / math.cos(0.1))
    assert math.isinf(scan.ranges[2])


@pytest.mark.parametrize(('shape', 'ahead'), [
    (Shape.rectangle(4.0, 2.0), 2.0), (Shape.circle(3.0), 3.0)], ids=['rectangle', 'circle'])
def test_inside_a_body_its_walls_are_seen(shape: Shape, ahead: float) -> None:
    """All rays of a sensor inside a body hit its walls."""
    scan = caster(field_of_view=FULL, rays=4).scan((0, 0, 0), bodies_of([shape], [(0, 0, 0)]))
    assert (scan.hits == 0).all()
    assert scan.ranges[2] == pytest.approx(ahead)


def grid_of(occupied: Any) -> OccupancyGrid:
    return OccupancyGrid((-10.0, -5.0), 0.5, np.array(occupied, dtype=bool))


def test_a_wall_of_the_grid_hides_what_is_behind() -> None:
    """With cells from x = 5 m on, rays end at 5 m / cos and the car behind is not seen."""
    occupied = np.zeros((20, 60), dtype=bool)
    occupied[:, 30:32] = True
    car = bodies_of([Shape.rectangle(4.5, 1.8)], [(12.0, 0.0, 0.0)])
    sensor = caster(field_of_view=0.6, rays=61)
    assert (sensor.scan((0.0, 0.1, 0.0), car).hits == 0).any()
    scan = sensor.scan((0.0, 0.1, 0.0), car, grid_of(occupied))
    assert (scan.hits == PERMANENT).all()
    np.testing.assert_allclose(scan.ranges, 5.0 / np.cos(scan.angles))
    before = bodies_of([Shape.circle(0.3)], [(3.0, 0.1, 0.0)])
    assert sensor.scan((0.0, 0.1, 0.0), before, grid_of(occupied)).hits[30] == 0


@pytest.mark.parametrize('seed', range(3))
def test_ranges_to_cells_are_found_by_walking_the_rays(seed: int) -> None:
    """Walking each ray by a millimetre meets the first occupied cell at the given range."""
    rng = np.random.default_rng(seed)
    occupied = rng.uniform(size=(40, 60)) < 0.02
    occupied[28:36, 40:55] = True
    occupied[8:12, 18:22] = False
    grid = grid_of(occupied)
    scan = caster(field_of_view=FULL, rays=90, horizon=12.0).scan(
        (0.13, 0.07, 0.4), bodies_of([], []), grid)
    steps = np.arange(0.0, 12.0, 0.001)
    direction = scan.angles + 0.4
    points = np.stack((0.13 + steps * np.cos(direction)[:, None],
                       0.07 + steps * np.sin(direction)[:, None]), axis=-1)
    inside = grid.occupied_at(points)
    met = inside.any(axis=1)
    assert 10 < met.sum() < 90
    expected = np.where(met, steps[inside.argmax(axis=1)], np.inf)
    # The walk may miss a corner that the ray cuts by less than a millimetre.
    differ = ~np.isclose(scan.ranges, expected, atol=1.1e-3)
    assert (scan.ranges[differ] < expected[differ]).all()
    assert differ.sum() <= 1
    assert (scan.hits == np.where(np.isfinite(scan.ranges), PERMANENT, NOTHING)).all()


@pytest.mark.parametrize('yaw', [0.0, math.pi / 2, math.pi, -math.pi / 2])
def test_no_ray_slips_between_two_cells(yaw: float) -> None:
    """The middle ray runs exactly on the line that two cells of the wall share."""
    ring = np.ones((44, 44), dtype=bool)
    ring[1:-1, 1:-1] = False
    grid = OccupancyGrid((-11.0, -11.0), 0.5, ring)
    scan = caster(field_of_view=0.2, rays=3).scan((0.0, 0.0, yaw), bodies_of([], []), grid)
    np.testing.assert_allclose(scan.ranges, 10.5 / np.cos(scan.angles))


def test_a_sensor_within_an_obstacle_is_blind() -> None:
    """In an occupied cell every ray has range 0."""
    scan = caster(rays=9).scan((0.0, 0.0, 0.0), bodies_of([Shape.circle(1.0)], [(5, 0, 0)]),
                               grid_of(np.ones((20, 60))))
    assert (scan.hits == PERMANENT).all()
    assert (scan.ranges == 0.0).all()
