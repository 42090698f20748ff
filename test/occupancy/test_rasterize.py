# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Drawn maps against the true edges of roads and obstacles, and as other programs read them."""

import math
import os
from pathlib import Path
import signal
import subprocess
import sys

from crgame_ros.errors import InputError
from crgame_ros.geometry.shape import Shape
from crgame_ros.occupancy.map_file import RasterSpec
from crgame_ros.occupancy.occupancy import OccupancyGrid
from crgame_ros.occupancy.rasterize import draw, Raster, write_map
from crgame_ros.occupancy.tiles import TiledOccupancy
from crgame_ros.roads.boundary import RoadBoundary
from crgame_ros.scenario.loading import load_scenario, LoadedScenario, parse_scenario
import numpy as np
from numpy.typing import NDArray
from PIL import Image
import pytest
import shapely
import yaml

WIDTH, CELL = 0.15, 0.1
BOUND = '<{0}><point><x>{1}</x><y>{3}</y></point><point><x>{2}</x><y>{3}</y></point></{0}>'
ROAD = ('<commonRoad timeStepSize="0.1" commonRoadVersion="2020a" benchmarkID="ZAM_Mini-1">'
        '{}</commonRoad>')


def straight(lanelet_id: int, x: tuple[float, float], y: float, links: str = '') -> str:
    """Write a lanelet 4 m wide along x, whose right side is at y."""
    return (f'<lanelet id="{lanelet_id}">' + BOUND.format('leftBound', *x, y + 4.0)
            + BOUND.format('rightBound', *x, y) + links + '</lanelet>')


def road(*lanelets: str) -> LoadedScenario:
    """Read a scenario of some lanelets."""
    return parse_scenario(ROAD.format(''.join(lanelets)), 'x')


def whole(raster: Raster) -> OccupancyGrid:
    """Return the whole map, joined from its tiles."""
    cells = raster.spec.tile_cells
    occupied = np.zeros((raster.rows * cells, raster.columns * cells), dtype=bool)
    for row, column, tile in raster.tiles():
        if tile is not None:
            occupied[row * cells:(row + 1) * cells, column * cells:(column + 1) * cells] = tile
    return OccupancyGrid(raster.origin, raster.spec.resolution, occupied)


def squares(grid: OccupancyGrid) -> NDArray[np.object_]:
    """Draw the occupied cells."""
    row, column = np.nonzero(grid.occupied)
    low = np.stack((column, row), axis=1) * grid.resolution + grid.origin
    return shapely.box(*low.T, *(low + grid.resolution).T)


def outlines(loaded: LoadedScenario) -> tuple[shapely.Geometry, shapely.Geometry]:
    """
    Find the edges of the road and the static obstacles, by commonroad-io and shapely alone.

    It closes seams up to 0.1 m and holes below 2 m^2 in another way than the program.
    """
    network = loaded.scenario.lanelet_network
    lanes = shapely.union_all([
        shapely.Polygon(np.vstack((part.left_vertices, part.right_vertices[::-1]))).buffer(0.0)
        for part in network.lanelets])
    closed = lanes.union(lanes.buffer(0.05, join_style='mitre').buffer(-0.05, join_style='mitre'))
    parts = [shapely.Polygon(part.exterior, [
        ring for ring in part.interiors if shapely.Polygon(ring).area >= 2.0])
        for part in shapely.get_parts(closed)]
    obstacles = [obstacle.occupancy_at_time(0).shape.shapely_object
                 for obstacle in loaded.scenario.static_obstacles]
    return shapely.MultiPolygon(parts), shapely.union_all(obstacles)


def ends(loaded: LoadedScenario) -> shapely.Geometry:
    """Find the lines across lanelets without predecessor or successor."""
    lines = []
    for lanelet in loaded.scenario.lanelet_network.lanelets:
        for row, links in ((0, lanelet.predecessor), (-1, lanelet.successor)):
            if not links:
                lines.append(shapely.LineString((lanelet.left_vertices[row, :2],
                                                 lanelet.right_vertices[row, :2])))
    return shapely.union_all(lines)


@pytest.mark.matrix('DEU_Guetersloh-36_1_T-1')
@pytest.mark.slow
@pytest.mark.parametrize('name', [
    'ZAM_ParkedCars-1_1_T-1', 'ZAM_Roundabout-1_1_T-1', 'USA_Lanker-1_3_T-1',
    'DEU_Guetersloh-36_1_T-1', 'ZAM_Tutorial-1_2_T-1'])
def test_curbs_and_obstacles_are_where_they_are(name: str, project_root: Path,
                                                request: pytest.FixtureRequest) -> None:
    """
    Every occupied cell meets a curb or an obstacle; each point of these lies in such a cell.

    The curb lies outside the road, up to its width away. Where a road ends with the map, it is
    open.
    """
    path = project_root / 'scenarios' / f'{name}.xml'
    if not path.is_file():
        path = request.getfixturevalue('shared_scenarios') / f'{name}.xml'
    loaded = load_scenario(path)
    grid = whole(Raster(loaded, RasterSpec()))
    surface, obstacles = outlines(loaded)
    edge, open_ends = surface.boundary, ends(loaded)
    shapely.prepare([surface, obstacles, edge])
    cells = squares(grid)
    # The two ways to close seams differ by some millimetres at their ends.
    slack = 0.01
    at_curb = shapely.dwithin(edge, cells, WIDTH + slack)
    at_obstacle = shapely.intersects(obstacles, cells)
    assert (at_curb | at_obstacle).all()
    # Centres: half a cell in x and in y.
    centers = shapely.centroid(cells)
    within = edge.buffer(WIDTH + slack).difference(surface.buffer(-slack)).union(obstacles)
    shapely.prepare(within)
    assert shapely.dwithin(within, centers, CELL / 2 * math.sqrt(2) + slack).all()
    # On the road there are at most the cells that the edge runs through.
    on_road = shapely.contains_properly(surface, cells) & ~at_obstacle
    assert shapely.dwithin(edge, cells[on_road], slack).all()
    points = shapely.points([
        line.interpolate(s).coords[0] for line in shapely.get_parts(edge)
        for s in np.arange(0.0, line.length, 0.37)])
    points = points[shapely.distance(points, open_ends) > 0.2]
    tree = shapely.STRtree(cells)
    assert len(points) > 300
    assert not len(missed := np.setdiff1d(
        np.arange(len(points)), tree.query(points, predicate='dwithin', distance=slack)[0])), \
        points[missed]
    # Obstacles are filled.
    for obstacle in loaded.scenario.static_obstacles:
        part = obstacle.occupancy_at_time(0).shape.shapely_object
        inside = shapely.union_all(cells[tree.query(part, predicate='intersects')])
        assert part.difference(inside).area < 1e-6
    # There is no curb across the middle of the ends.
    middles = shapely.line_interpolate_point(shapely.get_parts(open_ends), 0.5, normalized=True)
    middles = middles[shapely.distance(middles, edge) < slack]
    assert len(middles) > 1
    assert not len(tree.query(middles, predicate='dwithin', distance=1.0)[0])


def test_a_straight_road_cell_by_cell() -> None:
    """
    A road from (0, 0) to (50, 4), ends open, cells of 0.1 m, curbs of 0.15 m.

    The curbs lie at y from -0.15 to 0 and from 4 to 4.15: two rows of cells each, 500 cells long.
    """
    grid = whole(Raster(road(straight(1, (0.0, 50.0), 0.0)), RasterSpec()))
    assert grid.origin == (0.0, -0.2)
    assert np.flatnonzero(grid.occupied.any(axis=1)).tolist() == [0, 1, 42, 43]
    assert np.flatnonzero(grid.occupied.any(axis=0)).tolist() == list(range(500))
    assert int(grid.occupied.sum()) == 4 * 500


def test_closed_ends_and_lanes_that_end() -> None:
    """
    An end of the road is open; a lane that ends beside one that goes on has a curb.

    Lanelet 1 goes on as 2; lanelet 3 beside 1 ends at x = 50.
    """
    lanes = (straight(1, (0.0, 50.0), 4.0, '<successor ref="2"/><adjacentRight ref="3" '
                      'drivingDir="same"/>'),
             straight(2, (50.0, 90.0), 4.0, '<predecessor ref="1"/>'),
             straight(3, (0.0, 50.0), 0.0, '<adjacentLeft ref="1" drivingDir="same"/>'))
    grid = whole(Raster(road(*lanes), RasterSpec()))
    across = np.array([(-0.05, 2.0), (-0.05, 6.0), (50.05, 2.0), (90.05, 6.0)])
    assert grid.occupied_at(across).tolist() == [False, False, True, False]
    closed = whole(Raster(road(*lanes), RasterSpec(close_ends=True)))
    assert closed.occupied_at(across).all()
    assert not closed.occupied_at(across + (1.0, 0.0)).any()


def test_a_seam_at_the_end_of_the_road_is_no_curb() -> None:
    """Two lanes with a slit of 5 cm between them end at x = 50: open over their whole width."""
    grid = whole(Raster(road(straight(1, (0.0, 50.0), 0.0), straight(2, (0.0, 50.0), 4.05)),
                        RasterSpec()))
    assert np.flatnonzero(grid.occupied.any(axis=0)).tolist() == list(range(500))
    middle = np.array([(x, y) for x in (-0.05, 0.05, 49.95, 50.05) for y in (3.95, 4.02, 4.1)])
    assert not grid.occupied_at(middle).any()


def test_small_gaps_between_lanelets_are_no_islands() -> None:
    """Lanelets around a hole of 1 m x 1 m, and of 2 m x 2 m."""
    for edge, island in ((1.0, False), (2.0, True)):
        lanes = [straight(1, (0.0, 30.0), 0.0), straight(2, (0.0, 30.0), 4.0 + edge),
                 straight(3, (0.0, 10.0), 4.0), straight(4, (10.0 + edge, 30.0), 4.0)]
        grid = whole(Raster(road(*lanes), RasterSpec()))
        hole = np.array([[10.0 + edge / 2, 4.05]])
        assert grid.occupied_at(hole).tolist() == [island]
    grid = whole(Raster(road(*lanes), RasterSpec(min_island=5.0)))
    assert not grid.occupied_at(hole).any()


def test_projected_coordinates_move_the_map_only() -> None:
    """The same road millions of metres away has the same cells."""
    near = whole(Raster(road(straight(1, (0.0, 50.0), 0.0)), RasterSpec()))
    text = ROAD.format('<lanelet id="1">' + BOUND.format('leftBound', 5.6e6, 5.6e6 + 50, 3.2e5 + 4)
                       + BOUND.format('rightBound', 5.6e6, 5.6e6 + 50, 3.2e5) + '</lanelet>')
    far = whole(Raster(parse_scenario(text, 'x'), RasterSpec()))
    assert far.origin == (5.6e6, 3.2e5 - 0.2)
    np.testing.assert_array_equal(near.occupied, far.occupied)


def test_drawing_against_each_cell_alone() -> None:
    """Random polygons with holes: quartering gives the same cells as tests of each cell."""
    random = np.random.default_rng(6)
    for _ in range(20):
        shape = shapely.Point(*random.uniform(0, 8, 2)).buffer(random.uniform(0.5, 4)).difference(
            shapely.box(*random.uniform(0, 4, 2), *random.uniform(4, 8, 2)))
        occupied = np.zeros((37, 53), dtype=bool)
        draw(shape, (-1.0, 0.5), 0.2, occupied)
        rows, columns = np.mgrid[:37, :53]
        x, y = -1.0 + 0.2 * columns, 0.5 + 0.2 * rows
        cells = shapely.box(x + 1e-6, y + 1e-6, x + 0.2 - 1e-6, y + 0.2 - 1e-6)
        np.testing.assert_array_equal(occupied, shapely.intersects(cells, shape))


def by_map_server_rules(path: Path) -> tuple[NDArray[np.int8], dict[str, object]]:
    """Read a map by the documentation of map_server, with Pillow and PyYAML only."""
    values = yaml.safe_load(path.read_text())
    grey = np.asarray(Image.open(path.parent / values['image']), dtype=float)
    p = grey / 255.0 if values['negate'] else (255.0 - grey) / 255.0
    cells = np.full(grey.shape, -1, dtype=np.int8)
    cells[p > values['occupied_thresh']] = 100
    cells[p < values['free_thresh']] = 0
    # The image's upper row is the largest y, that of the grid the smallest.
    return cells[::-1], values


def test_each_file_is_a_map_for_map_server(tmp_path: Path, project_root: Path) -> None:
    """Index and tiles read by its rules: no unknown cells, the same cells in the same places."""
    loaded = load_scenario(project_root / 'scenarios' / 'ZAM_ParkedCars-1_1_T-1.xml')
    raster = Raster(loaded, RasterSpec(resolution=0.2, tile=40.0))
    written = write_map(raster, tmp_path / 'map', loaded.benchmark_id)
    grid = whole(raster)
    index, values = by_map_server_rules(written.path)
    assert values['mode'] == 'trinary'
    assert values['tile_cells'] == 200
    found = np.zeros_like(grid.occupied)
    tiles = [path for path in (tmp_path / 'map').glob('*.yaml') if path.name != 'map.yaml']
    for path in tiles:
        cells, tile = by_map_server_rules(path)
        assert set(np.unique(cells)) == {0, 100}
        assert tile['resolution'] == 0.2
        assert tile['origin'][2] == 0.0
        column, row = (round((tile['origin'][axis] - values['origin'][axis]) / 0.2)
                       for axis in (0, 1))
        assert index[row // 200, column // 200] == 100
        found[row:row + 200, column:column + 200] = cells == 100
    assert len(tiles) == np.sum(index == 100) == written.tiles
    np.testing.assert_array_equal(found, grid.occupied)
    assert written.cells == grid.occupied.sum()
    # The package reads the map back, too.
    occupancy = TiledOccupancy(tmp_path / 'map')
    left, low, right, high = occupancy.bounds
    assert (right - left, high - low) == pytest.approx(written.size)
    again = occupancy.near(np.array([(left + 1, low + 1), (right - 1, high - 1)]), 0.5)
    assert again is not None
    np.testing.assert_array_equal(again.occupied, grid.occupied)


def test_the_same_scenario_gives_the_same_bytes(tmp_path: Path, project_root: Path) -> None:
    """Two runs into two folders."""
    path = project_root / 'scenarios' / 'ZAM_TJunction-1_1_T-1.xml'
    for name in ('a', 'b'):
        write_map(Raster(load_scenario(path), RasterSpec()), tmp_path / name, 'T')
    names = sorted(file.name for file in (tmp_path / 'a').iterdir())
    assert names == sorted(file.name for file in (tmp_path / 'b').iterdir())
    for name in names:
        assert (tmp_path / 'a' / name).read_bytes() == (tmp_path / 'b' / name).read_bytes()


def test_cars_on_the_road_touch_no_curb_a_cell_away(project_root: Path) -> None:
    """A disc of 0.15 m on the road leaves more than a cell to the edge: its centre is free."""
    loaded = load_scenario(project_root / 'scenarios' / 'ZAM_Intersection-1_1_T-1.xml')
    grid = whole(Raster(loaded, RasterSpec()))
    boundary = RoadBoundary(loaded.scenario.lanelet_network)
    dot = Shape.circle(0.15)
    random = np.random.default_rng(7)
    off = 0
    for lanelet in loaded.scenario.lanelet_network.lanelets:
        for _ in range(100):
            x, y = lanelet.center_vertices[random.integers(len(lanelet.center_vertices)), :2] \
                + random.normal(0.0, 1.5, 2)
            if boundary.is_off_road(x, y, 0.0, dot):
                off += 1
            else:
                assert not grid.occupied_at(np.array([[x, y]])).any()
    assert off > 100


@pytest.mark.parametrize(('values', 'message'), [
    ({'resolution': 0.0}, '--resolution: is 0; give a number from 0.01 to 10'),
    ({'resolution': math.nan}, '--resolution: is nan'), ({'tile': -1.0}, '--tile: is -1'),
    ({'tile': 100.0, 'resolution': 0.3}, 'are 333.333 cells of 0.3 m; give a whole number'),
    ({'tile': 1000.0}, '1000 m are 10000 cells of 0.1 m'),
    ({'curb_width': math.inf}, '--curb-width: is inf')],
    ids=['no resolution', 'nan', 'negative', 'not whole', 'too many', 'infinite'])
def test_specs_that_are_refused(values: dict[str, float], message: str) -> None:
    """The message names the option, its value, and the valid values."""
    with pytest.raises(InputError, match=message):
        RasterSpec(**values)


def test_maps_that_are_refused() -> None:
    """Maps without anything to draw, or with too many tiles to list."""
    with pytest.raises(InputError, match='x: has nothing to draw'):
        Raster(road(straight(1, (0.0, 50.0), 0.0)), RasterSpec(curbs=False))
    far = road(straight(1, (0.0, 50.0), 0.0),
               straight(2, (9e8, 9e8 + 50.0), 9e8))
    with pytest.raises(InputError, match='tiles; give a larger --tile'):
        Raster(far, RasterSpec())


SLOW = """
import os, sys, time
from pathlib import Path
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.occupancy.map_file import RasterSpec
from crgame_ros.occupancy.rasterize import Raster, write_map

def progress(done, total):
    print(done, total, flush=True)
    time.sleep(60.0)

raster = Raster(load_scenario(Path(sys.argv[1])), RasterSpec())
write_map(raster, Path(sys.argv[2]), 'T', progress=progress)
"""


@pytest.mark.slow
@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGINT], ids=['killed', 'interrupted'])
def test_killed_while_writing(tmp_path: Path, project_root: Path, number: signal.Signals) -> None:
    """With only the first tile written, there is no map at its place, and no part of one."""
    out = tmp_path / 'maps' / 'map'
    process = subprocess.Popen(
        [sys.executable, '-c', SLOW,
         str(project_root / 'scenarios' / 'ZAM_TJunction-1_1_T-1.xml'), str(out)],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == '1 9\n'
    parts = list(out.parent.iterdir())
    assert [part.suffix for part in parts] == ['.part']
    assert {file.suffix for file in parts[0].iterdir()} == {'.pgm', '.yaml'}
    os.kill(process.pid, number)
    process.wait(30.0)
    process.stdout.close()
    assert not out.exists()
    assert bool(list(out.parent.iterdir())) is (number is signal.SIGKILL)
    with pytest.raises(InputError, match='cannot read the map file'):
        TiledOccupancy(out)
