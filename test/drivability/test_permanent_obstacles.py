# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Curbs and fences in the drivability monitor: hits, checked by shapely and by hand."""

import math
from pathlib import Path

from crgame_ros.drivability.collision import PERMANENT_OBSTACLE, PermanentObstacles
from crgame_ros.drivability.monitor import DrivabilityMonitor
from crgame_ros.game.game import DrivabilitySpec
from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.geometry.shape import Shape
from crgame_ros.occupancy.map_file import RasterSpec
from crgame_ros.occupancy.occupancy import OccupancyGrid
from crgame_ros.occupancy.rasterize import Raster, write_map
from crgame_ros.occupancy.tiles import TiledOccupancy
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.vehicle.parameters import load_vehicle_parameters
import numpy as np
from numpy.typing import NDArray
import pytest
import shapely

BMW = load_vehicle_parameters()
HUMAN = ObjectDescription('hv0', 'car', Role.HUMAN, BMW.shape, BMW.rear_to_center)
AV = ObjectDescription('av0', 'car', Role.AUTONOMOUS, BMW.shape, BMW.rear_to_center)
WALKER = ObjectDescription('o4', 'pedestrian', Role.RECORDED, Shape.circle(0.35))


class Fixed:
    """A map that is one grid."""

    def __init__(self, grid: OccupancyGrid) -> None:
        self.grid = grid
        self.asked: list[float] = []

    def near(self, points: NDArray[np.float64], reach_m: float) -> OccupancyGrid:
        self.asked.append(reach_m)
        assert points.shape == (1, 2)
        return self.grid


def fence(low: tuple[float, float], high: tuple[float, float], cell: float = 0.1) -> OccupancyGrid:
    """Occupy the cells of a box in a grid of 40 m x 40 m around the origin."""
    occupied = np.zeros((round(40.0 / cell),) * 2, dtype=bool)
    rows = slice(round((low[1] + 20.0) / cell), round((high[1] + 20.0) / cell))
    occupied[rows, round((low[0] + 20.0) / cell):round((high[0] + 20.0) / cell)] = True
    return OccupancyGrid((-20.0, -20.0), cell, occupied)


def rear(x: float, y: float, yaw: float = 0.0) -> list[float]:
    """Return the rear-axle state of a BMW whose centre is at a pose."""
    return [x - BMW.rear_to_center * math.cos(yaw), y - BMW.rear_to_center * math.sin(yaw), yaw,
            0.0, 0.0, 0.0, 0.0, 0.0]


@pytest.mark.matrix('0.5-polygon')
@pytest.mark.slow
@pytest.mark.parametrize('shape', [
    BMW.shape, Shape.circle(0.6), Shape.polygon(((2.0, 0.0), (-1.0, 1.0), (-0.5, 0.0),
                                                 (-1.0, -1.0)))
], ids=['rectangle', 'circle', 'polygon'])
@pytest.mark.parametrize('cell', [0.1, 0.5])
def test_against_shapely(shape: Shape, cell: float) -> None:
    """4,000 random poses among random cells, far from the origin: overlap means a hit."""
    random = np.random.default_rng(8)
    occupied = random.random((round(20.0 / cell),) * 2) < 0.0015 * (cell / 0.1) ** 2
    origin = np.array((5.6e6, 3.2e5))
    rows, columns = np.nonzero(occupied)
    x, y = columns * cell, rows * cell
    squares = shapely.union_all(shapely.box(x, y, x + cell, y + cell))
    obstacles = PermanentObstacles(
        Fixed(OccupancyGrid((origin[0], origin[1]), cell, occupied)), [shape])
    hits = 0
    for x, y, yaw in random.uniform((-3.0, -3.0, -4.0), (23.0, 23.0, 4.0), (4000, 3)):
        half_length, half_width = shape.length / 2, shape.width / 2
        corners = shape.vertices or ((half_length, half_width), (-half_length, half_width),
                                     (-half_length, -half_width), (half_length, -half_width))
        own = shapely.Point(x, y).buffer(half_length, quad_segs=64) if shape.kind == 'circle' \
            else shapely.affinity.translate(shapely.affinity.rotate(
                shapely.Polygon(corners), yaw, origin=(0, 0), use_radians=True), x, y)
        hit = obstacles.is_hit(0, (x + origin[0], y + origin[1], yaw))
        # A circle's polygon reaches 0.12 % of the radius beyond it.
        gap = own.distance(squares)
        area = own.intersection(squares).area
        if hit:
            assert gap < 1e-3
        else:
            assert area < 1e-5 * shape.length
        hits += hit
    assert 400 < hits < 3600


def test_into_a_fence_and_beside_it() -> None:
    """
    A fence from y = 3 m on; the car is 1.61 m wide and 4.508 m long.

    Along the fence it touches from y = 3 - 0.805 m on, head-on from 3 - 2.254 m on.
    """
    grid = fence((-10.0, 3.0), (10.0, 3.2))
    monitor = DrivabilityMonitor([HUMAN, AV], [WALKER], None, DrivabilitySpec(stop=True),
                                 occupancy=Fixed(grid))
    monitor.set_objects(ObjectStates(np.array([[-6.0, 0.0, 0.0]]), np.zeros((1, 3))))
    for y, yaw, hit in ((2.19, 0.0, False), (2.20, 0.0, True), (0.74, math.pi / 2, False),
                        (0.75, math.pi / 2, True), (3.1, 0.0, True), (4.00, 0.0, True),
                        (4.01, 0.0, False), (-9.0, 0.4, False)):
        human, av = monitor.check(7, 0.0, np.array([rear(0.0, y, yaw), rear(15.0, 3.1)]))
        assert human.hit == ((PERMANENT_OBSTACLE,) if hit else ())
        assert (human.collision, human.stop_requested) == (hit, hit)
        assert av.is_valid
    # If there are other hits, it is named last.
    both = monitor.check(8, 0.0, np.array([rear(-5.0, 2.5, 0.0), rear(-5.0, 1.0)]))
    assert both[0].hit == ('av0', PERMANENT_OBSTACLE)
    assert both[1].hit == ('hv0', 'o4')


def test_corners_and_small_cells() -> None:
    """One cell at the corner of the turned car: the box around the car holds it, the car not."""
    monitor = DrivabilityMonitor([HUMAN], [], None, DrivabilitySpec(),
                                 occupancy=Fixed(fence((1.0, 1.0), (1.1, 1.1))))
    yaw = -math.pi / 4
    # Across the car the cell's nearest corner is at sqrt(2) m, half the car's width is 0.805 m.
    for shift, hit in ((0.0, False), (math.sqrt(2.0) - 0.805 - 0.01, False),
                       (math.sqrt(2.0) - 0.805 + 0.01, True)):
        center = shift * math.cos(math.pi / 4)
        verdict = monitor.check(0, 0.0, np.array([rear(center, center, yaw)]))[0]
        assert verdict.collision is hit


def test_switched_off_absent_and_no_map() -> None:
    """Without the collision check, without a pose, and without a map there is no hit."""
    grid = fence((-20.0, -20.0), (20.0, 20.0))
    state = np.array([rear(0.0, 0.0)])
    asked = Fixed(grid)
    off = DrivabilityMonitor([HUMAN], [], None, DrivabilitySpec(collision=False), occupancy=asked)
    assert off.check(0, 0.0, state)[0].is_valid
    assert not asked.asked
    on = DrivabilityMonitor([HUMAN], [], None, DrivabilitySpec(), occupancy=asked)
    assert on.check(0, 0.0, np.full((1, 8), math.nan))[0].is_valid
    assert on.check(0, 0.0, state)[0].hit == (PERMANENT_OBSTACLE,)
    assert on.check(0, 0.0, np.array([rear(500.0, 0.0)]))[0].is_valid
    assert DrivabilityMonitor([HUMAN], [], None, DrivabilitySpec()
                              ).check(0, 0.0, state)[0].is_valid
    # The monitor asks for no more than the circle around the car.
    assert set(asked.asked) == {BMW.shape.radius}


def test_a_drive_off_the_road_of_a_real_scenario(tmp_path: Path, project_root: Path) -> None:
    """
    A car drifts out of the right lane of the straight motorway of the cut-in game.

    Its curb begins at the road's edge; its cells reach at most one cell further in. The car's
    right side hits it at the edge or at most a cell earlier.
    """
    loaded = load_scenario(project_root / 'scenarios' / 'ZAM_CutIn-1_1_T-1.xml')
    path = write_map(Raster(loaded, RasterSpec()), tmp_path / 'map', 'cut-in').path
    occupancy = TiledOccupancy(path)
    network = loaded.scenario.lanelet_network
    edge = min(lanelet.right_vertices[:, 1].min() for lanelet in network.lanelets)
    monitor = DrivabilityMonitor([HUMAN], [], network, DrivabilitySpec(), occupancy=occupancy)
    monitor.prepare(np.array([rear(40.0, edge + 2.0)]))
    loaded_before = occupancy.loaded
    verdicts = []
    for side in np.arange(edge + 1.0, edge - 3.0, -0.01):
        verdict = monitor.check(0, 0.0, np.array([rear(40.0, side + 0.805)]))[0]
        verdicts.append((side - edge, verdict.hit == (PERMANENT_OBSTACLE,), verdict.off_road))
    first_hit = next(side for side, hit, _ in verdicts if hit)
    first_off = next(side for side, _, off in verdicts if off)
    assert 0.0 <= first_hit <= 0.1
    assert first_off == pytest.approx(0.0, abs=0.011)
    # Across the curb, the car is off the road without touching it any more.
    assert verdicts[-1][1:] == (False, True)
    assert occupancy.loaded == loaded_before == 1
