# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Collisions against an independent truth: polygons intersected by shapely."""

import itertools
import math

from crgame_ros.drivability.collision import CollisionDetector
from crgame_ros.errors import InputError
from crgame_ros.game.objects import ObjectStates
from crgame_ros.geometry.shape import Shape
import numpy as np
import pytest
import shapely
from shapely import affinity

CAR = Shape.rectangle(4.508, 1.61)
SHAPES = {
    'car': CAR,
    'truck': Shape.rectangle(12.0, 2.5),
    'pedestrian': Shape.circle(0.35),
    'triangle': Shape.polygon(((3.0, 0.0), (-1.0, 1.5), (-1.0, -1.0))),
    # An arrow head: its notch is inside the convex hull but not inside the shape.
    'arrow': Shape.polygon(((3.0, 0.0), (-3.0, 2.5), (-0.5, 0.0), (-3.0, -2.5))),
}
TOUCHING = 1e-9


def outline(shape: Shape, x: float, y: float, yaw: float) -> shapely.Geometry:
    """Place a shape by shapely alone; a circle is its centre, see `distance`."""
    if shape.kind == 'circle':
        return shapely.Point(x, y)
    corners = shape.vertices
    if shape.kind == 'rectangle':
        a, b = shape.length / 2, shape.width / 2
        corners = ((a, b), (-a, b), (-a, -b), (a, -b))
    turned = affinity.rotate(shapely.Polygon(corners), yaw, origin=(0, 0), use_radians=True)
    return affinity.translate(turned, x, y)


def separation(first: Shape, second: Shape, pose: tuple[float, float, float],
               other: tuple[float, float, float]) -> float:
    """Return the gap between two shapes [m]; negative: the area or depth of their overlap."""
    a, b = outline(first, *pose), outline(second, *other)
    circles = sum(0.5 * shape.length for shape in (first, second) if shape.kind == 'circle')
    distance = a.distance(b)
    if circles:
        return distance - circles
    return distance if distance > 0.0 else -a.intersection(b).area


def states(*rows: tuple[float, ...]) -> ObjectStates:
    """Build object states of rows x, y, yaw, vx, vy, yaw rate."""
    table = np.array(rows, dtype=float).reshape(-1, 6)
    return ObjectStates(table[:, :3], table[:, 3:])


@pytest.mark.slow
@pytest.mark.parametrize(('first', 'second'),
                         itertools.product(SHAPES, SHAPES), ids='-'.join)
@pytest.mark.parametrize('offset', [(0.0, 0.0), (5.6e6, 3.2e5)], ids=['local', 'projected'])
def test_against_shapely(first: str, second: str, offset: tuple[float, float]) -> None:
    """300 random pairs of poses per pair of shapes and origin: 15,000 in all agree."""
    random = np.random.default_rng(sum(map(ord, first + second)))
    own, other = SHAPES[first], SHAPES[second]
    reach = own.radius + other.radius
    as_object = CollisionDetector([own], [other])
    as_vehicle = CollisionDetector([own, other], [])
    seen = set()
    for _ in range(300):
        pose = (*(random.uniform(-50, 50, 2) + offset), random.uniform(-7, 7))
        shift = random.uniform(-1.1 * reach, 1.1 * reach, 2) * random.uniform(0.2, 1.0)
        other_pose = (pose[0] + shift[0], pose[1] + shift[1], random.uniform(-7, 7))
        # The truth counts from the pose, as doubles of millions of metres resolve 1e-9 m only.
        gap = separation(own, other, (0.0, 0.0, pose[2]),
                         (other_pose[0] - pose[0], other_pose[1] - pose[1], other_pose[2]))
        if abs(gap) < TOUCHING:
            continue
        as_object.set_objects(states((*other_pose, 0, 0, 0)))
        as_object.move(0.0)
        assert as_object.hits([pose])[1] == [[0] if gap < 0.0 else []]
        assert as_vehicle.hits([pose, other_pose])[0] == ([[1], [0]] if gap < 0.0 else [[], []])
        seen.add(gap < 0.0)
    assert seen == {True, False}


@pytest.mark.slow
def test_many_objects_at_once_against_shapely() -> None:
    """57 objects of all shapes and 3 vehicles: every index is that of shapely, 50 times."""
    random = np.random.default_rng(5)
    shapes = [list(SHAPES.values())[i % len(SHAPES)] for i in range(57)]
    driven = [CAR, SHAPES['truck'], CAR]
    detector = CollisionDetector(driven, shapes)
    for _ in range(50):
        poses = random.uniform((-40, -40, -4), (40, 40, 4), (57, 3))
        velocities = random.uniform(-20, 20, (57, 3))
        dt = random.uniform(0.0, 0.2)
        detector.set_objects(ObjectStates(poses, velocities))
        detector.move(dt)
        own = [tuple(row) for row in random.uniform((-40, -40, -4), (40, 40, 4), (3, 3)).tolist()]
        moved = poses + dt * velocities
        truth = [[i for i, shape in enumerate(shapes)
                  if separation(vehicle, shape, pose, tuple(moved[i])) < 0.0]
                 for vehicle, pose in zip(driven, own, strict=True)]
        assert detector.hits(own)[1] == truth


def test_steps_between_ticks_are_those_of_a_detector_that_knows_nothing() -> None:
    """What is too far away to be reached since it was measured is not measured again."""
    random = np.random.default_rng(8)
    shapes = [SHAPES['pedestrian'], CAR, SHAPES['truck']]
    detector, hits = CollisionDetector([CAR, CAR], shapes), []
    for _ in range(200):
        poses = random.uniform((-12, -12, -4), (12, 12, 4), (3, 3))
        objects = ObjectStates(poses, random.uniform(-80, 80, (3, 3)))
        objects.poses[random.random(3) < 0.2] = math.nan
        detector.set_objects(objects)
        own = random.uniform((-12, -12, -4), (12, 12, 4), (2, 3))
        ways = random.uniform(-80, 80, (2, 3)) * (random.random() < 0.5)
        for since_s in np.linspace(0.0, 0.1, 11).tolist():
            places = [tuple(row) for row in (own + since_s * ways).tolist()]
            fresh = CollisionDetector([CAR, CAR], shapes)
            fresh.set_objects(objects)
            for each in (detector, fresh):
                each.move(since_s)
            hits.append(detector.hits(places)[1])
            assert hits[-1] == fresh.hits(places)[1]
    assert 100 < sum(map(any, hits)) < len(hits) - 100


def test_obstacle_hits_between_two_ticks() -> None:
    """
    A crossing pedestrian of 0.35 m at 40 m/s is beside the car at both ticks and in it between.

    The pedestrian reaches the side of the car, 0.805 m from its centre line, with the centre
    1.155 m away: from 2 m that takes 21.1 ms. The contact ends on the other side after 78.9 ms.
    """
    detector = CollisionDetector([CAR], [SHAPES['pedestrian']])
    detector.set_objects(states((0.0, -2.0, 0.0, 0.0, 40.0, 0.0)))
    hit = []
    for step in range(101):
        detector.move(0.001 * step)
        hit.append(bool(detector.hits([(0.0, 0.0, 0.0)])[1][0]))
    assert [step for step, value in enumerate(hit) if value] == list(range(22, 79))


def test_obstacle_turns_between_two_ticks() -> None:
    """A truck that turns by pi/2 in place sweeps 6 m out, into a car 4 m to its side."""
    detector = CollisionDetector([CAR], [SHAPES['truck']])
    detector.set_objects(states((0.0, 4.0, 0.0, 0.0, 0.0, math.pi / 2)))
    detector.move(0.0)
    assert detector.hits([(0.0, 0.0, 0.0)])[1] == [[]]
    detector.move(1.0)
    assert detector.hits([(0.0, 0.0, 0.0)])[1] == [[0]]


def test_absent_objects_and_vehicles_touch_nothing() -> None:
    """A NaN means absence: of an object, its velocity or a vehicle, also before the first tick."""
    detector = CollisionDetector([CAR, CAR], [CAR, CAR])
    nan = math.nan
    detector.move(0.0)
    assert detector.hits([(0.0, 0.0, 0.0), (9.0, 0.0, 0.0)]) == ([[], []], [[], []])
    detector.set_objects(states((nan,) * 6, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    detector.move(0.05)
    assert detector.hits([(nan, nan, nan), (0.0, 0.0, 0.0)]) == ([[], []], [[], [1]])


def test_wrong_number_of_objects_is_refused() -> None:
    """States that don't match the announced objects would name the wrong ones."""
    detector = CollisionDetector([CAR], [CAR])
    with pytest.raises(InputError, match='of 1 objects'):
        detector.set_objects(states((0.0,) * 6, (0.0,) * 6))


def test_polygon_without_area_is_refused() -> None:
    """Three corners in one line can't collide with anything and are an error in the file."""
    line = Shape('polygon', 2.0, 1.0, ((0.0, 0.0), (1.0, 1.0), (2.0, 2.0)))
    with pytest.raises(InputError, match='no area'):
        CollisionDetector([CAR], [line])
