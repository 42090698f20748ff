# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Maps of any extent: nearby cells equal the map, and memory stays small."""

from pathlib import Path
import shutil
import tracemalloc

from crgame_ros.errors import InputError
from crgame_ros.occupancy.map_file import map_text
from crgame_ros.occupancy.occupancy import OccupancyGrid
from crgame_ros.occupancy.sources import write_pgm
from crgame_ros.occupancy.tiles import TiledOccupancy
import numpy as np
from numpy.typing import NDArray
import pytest

ORIGIN = (-40.0, 25.0)
# A motorway map: 10 km at 0.5 m, in tiles of 50 m.
EDGE_M, TILE_M, CELL_M = 10_000.0, 50.0, 0.5
CELLS = round(TILE_M / CELL_M)


def single(folder: Path, occupied: NDArray[np.bool_], resolution: float = 0.5) -> Path:
    """Write a plain map_server map, as other programs do."""
    folder.mkdir(exist_ok=True)
    write_pgm(folder / 'm.pgm', np.where(occupied[::-1], 0, 254).astype(np.uint8))
    path = folder / 'm.yaml'
    path.write_text(map_text('m.pgm', resolution, ORIGIN))
    return path


def tiled(folder: Path, tiles: dict[tuple[int, int], NDArray[np.bool_]], shape: tuple[int, int],
          cell_m: float = CELL_M) -> Path:
    """Write a folder of tiles by hand."""
    folder.mkdir()
    filled = np.zeros(shape, dtype=bool)
    for (row, column), cells in tiles.items():
        filled[row, column] = True
        name, size = f'tile_{row}_{column}', len(cells) * cell_m
        write_pgm(folder / f'{name}.pgm', np.where(cells[::-1], 0, 254).astype(np.uint8))
        (folder / f'{name}.yaml').write_text(map_text(
            f'{name}.pgm', cell_m, (ORIGIN[0] + column * size, ORIGIN[1] + row * size)))
    write_pgm(folder / 'tiles.pgm', np.where(filled[::-1], 0, 254).astype(np.uint8))
    (folder / 'map.yaml').write_text(map_text(
        'tiles.pgm', len(cells) * cell_m, ORIGIN, 'By hand.', len(cells)))
    return folder / 'map.yaml'


def piece(whole: NDArray[np.bool_], grid: OccupancyGrid) -> NDArray[np.bool_]:
    """Return the part of a whole map that a grid covers, with free cells beyond the map."""
    column, row = np.rint((np.array(grid.origin) - ORIGIN) / grid.resolution).astype(int)
    rows, columns = grid.occupied.shape
    cut = whole[row:row + rows, column:column + columns]
    result = np.zeros((rows, columns), dtype=bool)
    result[:cut.shape[0], :cut.shape[1]] = cut
    return result


@pytest.mark.matrix('folder')
@pytest.mark.parametrize('kind', ['folder', 'single'])
def test_near_equals_the_whole_map(tmp_path: Path, kind: str) -> None:
    """300 random places and reaches, inside and outside: cells in reach are those of the map."""
    random = np.random.default_rng(4)
    # 37 x 29 tiles of 8 cells are not whole in the single image: 290 x 227 cells.
    whole = random.random((29 * 8, 37 * 8)) < 0.003
    if kind == 'folder':
        path = tiled(tmp_path / 'map', {
            (row, column): cells for row in range(29) for column in range(37)
            if (cells := whole[row * 8:row * 8 + 8, column * 8:column * 8 + 8]).any()}, (29, 37))
    else:
        whole = np.kron(whole, np.ones((10, 10), dtype=bool))[:2290, :2870]
        path = single(tmp_path / 'map', whole)
    occupancy = TiledOccupancy(path)
    extent = np.array(whole.shape[::-1]) * 0.5
    empty = 0
    for _ in range(300):
        points = random.uniform(-0.1, 1.1) * extent + ORIGIN + random.uniform(-9, 9, (2, 2))
        reach = random.uniform(0.0, 15.0)
        grid = occupancy.near(points, reach)
        probes = random.uniform(points.min(axis=0) - reach, points.max(axis=0) + reach, (500, 2))
        if grid is None:
            empty += 1
            grid = OccupancyGrid(ORIGIN, 0.5, np.zeros((1, 1), dtype=bool))
        else:
            np.testing.assert_array_equal(grid.occupied, piece(whole, grid))
        np.testing.assert_array_equal(
            grid.occupied_at(probes), OccupancyGrid(ORIGIN, 0.5, whole).occupied_at(probes))
    assert 0 < empty < 200


# Coverage allocates, too.
@pytest.mark.no_cover
@pytest.mark.exhaustive
def test_ten_kilometres_stay_on_disk(tmp_path: Path) -> None:
    """
    Along the diagonal of 10 km x 10 km with a reach of 60 m, no more than 16 tiles are in memory.

    Every tenth step is compared with a fresh map without tiles in memory.
    """
    count = round(EDGE_M / TILE_M)
    random = np.random.default_rng(5)
    tiles = {}
    for index in range(count):
        cells = random.random((CELLS, CELLS)) < 0.01
        for side in (0, 1):
            if index + side < count:
                tiles[index, index + side] = cells if side else cells.T
    path = tiled(tmp_path / 'map', tiles, (count, count))
    occupancy = TiledOccupancy(path, max_cells=16 * CELLS ** 2)
    assert occupancy.bounds == (*ORIGIN, ORIGIN[0] + EDGE_M, ORIGIN[1] + EDGE_M)
    assert (occupancy.max_tiles, occupancy.resident_tiles) == (16, 0)
    tracemalloc.start()
    most = 0
    for step in range(1, 500):
        point = np.full((1, 2), step / 500 * EDGE_M) + ORIGIN
        grid = occupancy.near(point, 60.0)
        assert grid is not None
        assert 4 <= grid.occupied.size // CELLS ** 2 <= 16
        most = max(most, occupancy.resident_tiles)
        assert occupancy.resident_tiles == occupancy.loaded - occupancy.dropped
        if step % 10 == 0:
            fresh = TiledOccupancy(path).near(point, 60.0)
            assert fresh is not None
            assert grid.origin == fresh.origin
            np.testing.assert_array_equal(grid.occupied, fresh.occupied)
            del fresh
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert 7 <= most <= 16
    # Each tile is read once, because the car does not turn back.
    assert occupancy.loaded == len(tiles)
    assert occupancy.dropped >= len(tiles) - 16
    # The whole map has 400 MB of cells; two maps of 16 tiles and as much for grids are 0.64 MB.
    assert peak < 4e6


def test_a_large_single_map_is_not_read_whole(tmp_path: Path) -> None:
    """A sparse image of 10 km x 10 km at 0.5 m, negated so that holes in the file are free."""
    path, edge = tmp_path / 'm.pgm', round(EDGE_M / CELL_M)
    with path.open('wb') as stream:
        stream.write(b'P5\n%d %d\n255\n' % (edge, edge))
        first = stream.tell()
        # The cell at row 15000, column 12345 from the lower left.
        stream.seek(first + (edge - 1 - 15000) * edge + 12345)
        stream.write(b'\xff')
        stream.truncate(first + edge * edge)
    (tmp_path / 'm.yaml').write_text(
        map_text('m.pgm', CELL_M, ORIGIN).replace('negate: 0', 'negate: 1'))
    tracemalloc.start()
    occupancy = TiledOccupancy(tmp_path / 'm.yaml')
    corner = np.array([[12345, 15000]]) * CELL_M + ORIGIN
    grid = occupancy.near(corner + 0.25, 1.0)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert grid is not None
    assert int(grid.occupied.sum()) == 1
    assert grid.occupied_at(corner + 0.25).all()
    assert occupancy.near(corner + 2000.0, 1.0) is None
    assert occupancy.resident_tiles == 1
    assert peak < 10e6


def test_the_same_object_while_the_same_tiles_are_needed(tmp_path: Path) -> None:
    """No step builds or reads anything, also for two vehicles in turn."""
    cells = np.eye(8, dtype=bool)
    occupancy = TiledOccupancy(tiled(
        tmp_path / 'map', {(0, column): cells for column in range(6)}, (1, 6)))
    first = occupancy.near(np.array([[-38.0, 27.0]]), 1.0)
    second = occupancy.near(np.array([[-27.9, 27.0]]), 0.5)
    assert first is not None
    assert second is not None
    assert (first.occupied.shape, second.occupied.shape) == ((8, 8), (8, 16))
    for _ in range(3):
        assert occupancy.near(np.array([[-37.5, 27.5]]), 1.0) is first
        assert occupancy.near(np.array([[-28.1, 27.0]]), 0.5) is second
    assert (occupancy.loaded, occupancy.dropped) == (3, 0)
    with pytest.raises(ValueError, match='read-only'):
        first.occupied[0, 0] = True
    with pytest.raises(ValueError, match='read-only'):
        second.occupied[0, 0] = True


def test_absent_vehicles_and_places_without_a_map(tmp_path: Path) -> None:
    """Points that are NaN don't count; no points, or none near the map, give None."""
    occupancy = TiledOccupancy(single(tmp_path / 'map', np.ones((10, 10), dtype=bool)))
    nobody = [np.nan, np.nan]
    grid = occupancy.near(np.array([nobody, [-39.0, 26.0], nobody]), 2.0)
    assert grid is not None
    assert grid.occupied.shape == (10, 10)
    for points in (np.array([nobody]), np.empty((0, 2)), np.array([[5e6, 0.0]])):
        assert occupancy.near(points, 2.0) is None
        assert occupancy.fits(points, 2.0)


def test_more_than_fits_is_refused(tmp_path: Path) -> None:
    """A neighbourhood larger than its memory limit is refused."""
    occupancy = TiledOccupancy(tiled(
        tmp_path / 'map', {(0, 0): np.ones((8, 8), dtype=bool)}, (9, 9)), max_cells=4 * 64)
    far = np.array([[-38.0, 27.0], [-20.0, 27.0]])
    assert not occupancy.fits(far, 1.0)
    assert occupancy.fits(far[:1], 1.0)
    with pytest.raises(InputError, match='6 tiles are wanted at once, more than 4'):
        occupancy.near(far, 1.0)
    # Tiles of 4 m: 3.8 m are in 2 of them at most, 4.2 m in 3.
    assert occupancy.fits_anywhere(1.9) and not occupancy.fits_anywhere(2.1)
    corner = np.array([ORIGIN]) + 4.0
    assert occupancy.fits(corner, 1.9) and not occupancy.fits(corner + 2.0, 2.1)
    # A map of one row has no more, however far one sees.
    row = tiled(tmp_path / 'row', {(0, 0): np.ones((8, 8), dtype=bool)}, (1, 4))
    assert TiledOccupancy(row, max_cells=4 * 64).fits_anywhere(1000.0)
    with pytest.raises(InputError, match='a tile has 64 cells, more than 10'):
        TiledOccupancy(tmp_path / 'map', max_cells=10)


@pytest.mark.parametrize(('damage', 'message'), [
    ('missing', 'the tile tile_1_2.yaml is missing'), ('moved', 'does not fit into its map'),
    ('coarse', 'does not fit into its map'), ('smaller', 'does not fit into its map'),
    ('no image', 'cannot be read'), ('outside', 'lies outside the folder'),
    ('index', 'does not fit into its map')])
def test_damaged_tiles_are_refused(tmp_path: Path, damage: str, message: str) -> None:
    """Tiles may come from any source: the refusal is one line with the name of the faulty file."""
    folder = tiled(tmp_path / 'map', {(1, 2): np.ones((8, 8), dtype=bool)}, (3, 4)).parent
    tile = folder / 'tile_1_2.yaml'
    text = tile.read_text()
    if damage == 'missing':
        tile.unlink()
    elif damage == 'smaller':
        write_pgm(folder / 'tile_1_2.pgm', np.zeros((7, 8), dtype=np.uint8))
    elif damage == 'no image':
        (folder / 'tile_1_2.pgm').unlink()
    elif damage == 'outside':
        shutil.move(folder / 'tile_1_2.pgm', tmp_path / 'out.pgm')
        tile.write_text(text.replace('tile_1_2.pgm', '../out.pgm'))
    elif damage == 'index':
        tile.write_text(text + 'tile_cells: 8\n')
    else:
        tile.write_text(text.replace(*{'moved': ('-32.0', '-31.0'),
                                       'coarse': ('resolution: 0.5', 'resolution: 1.0')}[damage]))
    with pytest.raises(InputError, match=message) as caught:
        TiledOccupancy(folder).near(np.array([[-30.0, 31.0]]), 1.0)
    assert str(tmp_path) in str(caught.value)
