# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Road compliance on drawn and on published maps."""

from collections.abc import Sequence
import math
from pathlib import Path

from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from crgame_ros.geometry.shape import Shape
from crgame_ros.roads import boundary as road_boundary
from crgame_ros.roads.boundary import RoadBoundary
import numpy as np
from numpy.typing import NDArray
import pytest
import shapely

SHARED = Path(__file__).resolve().parents[2].parent / 'shared' / 'scenarios'
CAR = Shape.rectangle(4.508, 1.61)
SHAPES = (CAR, Shape.circle(0.8),
          Shape.polygon(((2.0, 0.0), (0.0, 1.0), (-2.0, 1.0), (-1.0, 0.0), (-2.0, -1.0))))
PUBLISHED = ('DEU_Flensburg-10_1_T-1', 'DEU_Guetersloh-36_1_T-1', 'FRA_Anglet-1_1_T-1',
             'OSC_PedestrianCollision-1_1_T-1', 'USA_Lanker-1_3_T-1', 'USA_US101-4_1_T-1',
             'ZAM-Ramp-1_1-T-1', 'ZAM_Over-1_1', 'ZAM_Tjunction-1_42_T-1')


def lanelet(lanelet_id: int, left: Sequence[Sequence[float]] | NDArray[np.float64],
            right: Sequence[Sequence[float]] | NDArray[np.float64], **links: object) -> Lanelet:
    """Draw a lanelet by its two sides."""
    left, right = np.asarray(left, dtype=float), np.asarray(right, dtype=float)
    return Lanelet(left, 0.5 * (left + right), right, lanelet_id, **links)


def straight(lanelet_id: int, x: float, y: float, length: float = 100.0) -> Lanelet:
    """Draw a lanelet of 4 m width eastwards from (x, y), its right corner."""
    return lanelet(lanelet_id, [(x, y + 4.0), (x + length, y + 4.0)], [(x, y), (x + length, y)])


def boundary(lanelets: Sequence[Lanelet], *places: tuple[float, float]) -> RoadBoundary:
    """Build the boundary and prepare it at places."""
    road = RoadBoundary(LaneletNetwork.create_from_lanelet_list(list(lanelets)))
    road.prepare(places)
    return road


def ring(lanelet_id: int, inner: float, outer: float) -> list[Lanelet]:
    """Draw a roundabout of four lanelets around the origin."""
    parts = []
    for quarter in range(4):
        angles = np.linspace(quarter, quarter + 1, 25) * math.pi / 2
        circle = np.column_stack((np.cos(angles), np.sin(angles)))
        parts.append(lanelet(lanelet_id + quarter, inner * circle, outer * circle))
    return parts


def published(name: str) -> tuple[LaneletNetwork, list[shapely.Polygon]]:
    """Load a published map and the polygons of its lanelets."""
    path = SHARED / f'{name}.xml'
    if not path.is_file():
        pytest.skip(f'{path} is absent')
    network = CommonRoadFileReader(str(path)).open()[0].lanelet_network
    return network, [shapely.Polygon(np.vstack((part.left_vertices, part.right_vertices[::-1])))
                     for part in network.lanelets]


def footprint(x: float, y: float, yaw: float, shape: Shape) -> shapely.Polygon:
    """Draw a footprint by shapely alone."""
    if shape.kind == 'circle':
        return shapely.Point(x, y).buffer(0.5 * shape.length, quad_segs=64)
    corners = shape.vertices
    if shape.kind == 'rectangle':
        a, b = shape.length / 2, shape.width / 2
        corners = ((a, b), (-a, b), (-a, -b), (a, -b))
    turned = shapely.affinity.rotate(shapely.Polygon(corners), yaw, origin=(0, 0),
                                     use_radians=True)
    return shapely.affinity.translate(turned, x, y)


@pytest.mark.parametrize('places', [(), ((50.0, 4.0),)], ids=['fallback', 'prepared'])
@pytest.mark.parametrize(('x', 'y', 'yaw', 'off'), [
    (50.0, 2.0, 0.0, False),                # in its lane
    (50.0, 4.0, 0.3, False),                # straddling two lanes
    (98.0, 4.0, 0.0, True),                 # half a metre over the end of the road: 98 + 2.254
    (97.7, 4.0, 0.0, False),                # just before it: 97.7 + 2.254 = 99.954
    (2.2, 4.0, 0.0, True),                  # tail over its beginning
    (50.0, 0.79, 0.0, True),                # half the width is 0.805: 15 mm over the edge
    (50.0, 0.82, 0.0, False),               # 15 mm within
    (50.0, -3.0, 0.0, True),                # 3 m off the road
    (50.0, 108.0, 0.0, True),               # 100 m off
    (50.0, -4000.0, 1.0, True),             # beyond the margin of the boundary object
    (-9.0e5, 7.0e5, 1.0, True)])
def test_two_lanes(x: float, y: float, yaw: float, off: bool,
                   places: tuple[tuple[float, float], ...]) -> None:
    """Two lanes, y from 0 to 8 m and x from 0 to 100 m: known by hand."""
    road = boundary([straight(1, 0.0, 0.0), straight(2, 0.0, 4.0)], *places)
    assert road.is_off_road(x, y, yaw, CAR) is off
    assert bool(road.are_off_road(np.array([(x, y, yaw)]), CAR)[0]) is off


def test_roundabout() -> None:
    """Between 8 and 14 m from the middle is road; the island in the middle is not."""
    road = boundary(ring(1, 8.0, 14.0), (11.0, 0.0))
    for angle in np.linspace(0.0, 2.0 * math.pi, 73):
        x, y, along = math.cos(angle), math.sin(angle), angle + math.pi / 2
        assert not road.is_off_road(11.0 * x, 11.0 * y, along, CAR)
        assert road.is_off_road(8.5 * x, 8.5 * y, along, CAR)
        assert road.is_off_road(13.8 * x, 13.8 * y, along, CAR)
        assert road.is_off_road(17.0 * x, 17.0 * y, along, CAR)
    assert road.is_off_road(0.0, 0.0, 0.0, CAR)


def test_junction() -> None:
    """On the crossing of two roads a car may have any heading; in the corners it may not."""
    north = lanelet(2, [(48.0, -50.0), (48.0, 54.0)], [(52.0, -50.0), (52.0, 54.0)])
    road = boundary([straight(1, 0.0, 0.0), north], (50.0, 2.0))
    for yaw in (0.0, math.pi / 2, math.pi):
        assert not road.is_off_road(50.0, 2.0, yaw, CAR)
    assert road.is_off_road(50.0, 2.0, math.pi / 4, Shape.rectangle(7.0, 2.0))
    assert road.is_off_road(46.0, 6.0, 0.0, CAR)


@pytest.mark.parametrize('places', [(), ((50.0, 4.0),)], ids=['fallback', 'prepared'])
def test_seams_are_no_boundary_but_ditches_are(places: tuple[tuple[float, float], ...]) -> None:
    """A slit of up to 0.1 m between lanelets, open or closed at its ends, is part of the road."""
    for gap, off in ((0.0, False), (1e-12, False), (1e-6, False), (0.03, False), (0.09, False),
                     (0.12, True), (1.0, True)):
        road = boundary([straight(1, 0.0, 0.0), straight(2, 0.0, 4.0 + gap)], *places)
        assert road.is_off_road(50.0, 4.0 + gap / 2, 0.0, CAR) is off
    wedge = lanelet(2, [(0.0, 8.0), (50.0, 8.0), (100.0, 8.0)],
                    [(0.0, 4.0), (50.0, 4.02), (100.0, 4.0)])
    road = boundary([straight(1, 0.0, 0.0), wedge], *places)
    assert not road.is_off_road(50.0, 4.0, 0.0, CAR)


def test_neighbours_that_are_missing_or_point_in_a_circle() -> None:
    """Broken links between lanelets, which exist in published maps, don't matter."""
    lanes = [lanelet(1, [(0, 4), (100, 4)], [(0, 0), (100, 0)], adjacent_left=2,
                     adjacent_left_same_direction=True),
             lanelet(2, [(0, 8), (100, 8)], [(0, 4), (100, 4)], adjacent_left=1,
                     adjacent_left_same_direction=True, adjacent_right=77,
                     adjacent_right_same_direction=True)]
    network = LaneletNetwork()
    for lane in lanes:
        network.add_lanelet(lane)
    road = RoadBoundary(network)
    road.prepare([(50.0, 4.0)])
    assert not road.is_off_road(50.0, 4.0, 0.0, CAR)
    assert road.is_off_road(50.0, 8.0, 0.0, CAR)


def test_lanelet_that_crosses_itself() -> None:
    """Sides that swap places half way leave two triangles of road, not an error."""
    swapped = lanelet(1, [(0.0, 8.0), (100.0, 0.0)], [(0.0, 0.0), (100.0, 8.0)])
    road = boundary([swapped], (10.0, 4.0))
    assert not road.is_off_road(10.0, 4.0, 0.0, CAR)
    assert road.is_off_road(50.0, 4.0, 0.0, CAR)


def test_no_lanelets_means_off_road_everywhere() -> None:
    """A map without lanelets has no road."""
    assert boundary([], (0.0, 0.0)).is_off_road(0.0, 0.0, 0.0, CAR)


@pytest.mark.exhaustive
def test_large_map_is_built_only_around_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """2,000 lanelets: few polygons are triangulated, and the answer is right everywhere."""
    built: list[int] = []
    triangulate = road_boundary._triangulated_outside

    def counting(pieces: list[shapely.Polygon]) -> object:
        built.append(len(pieces))
        return triangulate(pieces)

    monkeypatch.setattr(road_boundary, '_triangulated_outside', counting)
    lanes = [straight(1 + 20 * row + column, 30.0 * column, 12.0 * row, 30.0)
             for row in range(100) for column in range(20)]
    road = boundary(lanes, (300.0, 600.0), (301.0, 601.0), (20.0, 20.0))
    assert built == [road_boundary.TILE_POLYGONS] * 2  # the second place lies in the first tile
    random = np.random.default_rng(3)
    verdicts = set()
    for x, y in random.uniform((-20.0, -20.0), (620.0, 1220.0), (4000, 2)):
        yaw = random.choice((0.0, 0.4))
        half_x = 2.254 * math.cos(yaw) + 0.805 * math.sin(yaw)
        half_y = 2.254 * math.sin(yaw) + 0.805 * math.cos(yaw)
        row = math.floor(y / 12.0)
        on = half_x < x < 600.0 - half_x and 0 <= row < 100 \
            and 12.0 * row + half_y < y < 12.0 * row + 4.0 - half_y
        verdicts.add(on)
        assert road.is_off_road(x, y, yaw, CAR) is not on
    assert verdicts == {True, False}
    assert len(built) == 2  # nothing is built during checks


@pytest.mark.matrix('projected-USA_Lanker-1_3_T-1')
@pytest.mark.slow
@pytest.mark.parametrize('name', PUBLISHED)
@pytest.mark.parametrize('offset', [(0.0, 0.0), (5.6e6, 3.2e5)], ids=['local', 'projected'])
def test_published_maps_against_containment(name: str, offset: tuple[float, float]) -> None:
    """
    1,500 poses per map, around the lanelets: boundary, fallback and plain shapely agree.

    Plain shapely judges by the area of the footprint outside the united lanelets: off the road
    it is positive, on the road it is no more than a seam of 0.1 m can hold along the footprint.
    """
    network, polygons = published(name)
    union = shapely.union_all(polygons)
    network.translate_rotate(np.array(offset), 0.0)
    road = RoadBoundary(network)
    road.prepare([tuple(network.lanelets[0].center_vertices[0])])
    random = np.random.default_rng(len(name))
    verdicts = set()
    for i in range(1500):
        line = network.lanelets[random.integers(len(network.lanelets))].center_vertices - offset
        j = random.integers(len(line) - 1)
        heading = math.atan2(*(line[j + 1] - line[j])[::-1]) + random.normal(0.0, 0.3)
        x, y = line[j] + random.random() * (line[j + 1] - line[j]) + random.normal(0.0, 2.0, 2)
        shape = SHAPES[i % 3]
        placed = (x + offset[0], y + offset[1], heading, shape)
        off = road.is_off_road(*placed)
        own = footprint(x, y, heading, shape)
        outside = own.difference(union).area
        # A circle's polygon in the fallback is 1 mm too large.
        near = shape.kind == 'circle' and outside < 1e-3
        assert near or bool(road.are_off_road(np.array([placed[:3]]), shape)[0]) is off
        assert near or (outside > 1e-9 if off else outside < 0.1 * 2.0 * shape.radius)
        verdicts.add(off)
    assert verdicts == {True, False}


def test_recorded_cars_of_a_motorway_ramp_stay_on_the_road() -> None:
    """
    The ramp's recorded cars drive between its markings.

    The checker's own boundary uses a section's outermost bounds. It reports 10 of 51 poses off
    the road, although the lanelets contain every one of them.
    """
    network, polygons = published('ZAM-Ramp-1_1-T-1')
    scenario = CommonRoadFileReader(str(SHARED / 'ZAM-Ramp-1_1-T-1.xml')).open()[0]
    road = RoadBoundary(network)
    road.prepare([(100.0, 0.0)])
    union = shapely.union_all(polygons)
    poses = 0
    for obstacle in scenario.dynamic_obstacles:
        shape = Shape.rectangle(obstacle.obstacle_shape.length, obstacle.obstacle_shape.width)
        for state in obstacle.prediction.trajectory.state_list[::3]:
            pose = (*state.position.tolist(), float(state.orientation))
            assert union.contains(footprint(*pose, shape))
            assert not road.is_off_road(*pose, shape)
            poses += 1
    assert poses == 51
