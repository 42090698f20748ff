# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Grids, and the map_server files they come from: valid files and refused ones."""

import os
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.occupancy.map_file import read_map_file
from crgame_ros.occupancy.occupancy import OccupancyGrid
from crgame_ros.occupancy.sources import open_pgm, write_pgm
import numpy as np
from PIL import Image
import pytest

MAP = {'image': 'map.pgm', 'resolution': '0.5', 'origin': '[1.0, -2.0, 0.0]', 'negate': '0',
       'occupied_thresh': '0.65', 'free_thresh': '0.196'}


def write(folder: Path, **values: str | None) -> Path:
    """Write a map's YAML file with some values changed, or left out where they are None."""
    path = folder / 'map.yaml'
    path.write_text(''.join(f'{key}: {value}\n' for key, value in (MAP | values).items()
                            if value is not None))
    return path


def test_points_of_a_grid() -> None:
    """Cells of 0.5 m from (1, -2) on: rows grow with y; no point outside is occupied."""
    grid = OccupancyGrid((1.0, -2.0), 0.5, np.array([[False, True, False], [True, False, False]]))
    points = np.array([(1.6, -1.9), (1.2, -1.4), (1.2, -1.9), (0.99, -1.4), (1.2, -0.99),
                       (2.51, -1.9)])
    assert grid.occupied_at(points).tolist() == [True, True, False, False, False, False]


@pytest.mark.parametrize('negate', [0, 1])
@pytest.mark.parametrize('maximum', [255, 100])
def test_greys_mean_what_map_server_says(tmp_path: Path, negate: int, maximum: int) -> None:
    """Of each grey p = (255 - x) / 255, or x / 255 if negated; occupied is p > occupied_thresh."""
    values = np.arange(maximum + 1, dtype=np.uint8)
    probability = values / maximum if negate else (maximum - values) / maximum
    map_file = read_map_file(write(tmp_path, negate=str(negate)))
    occupied = map_file.occupied(values[None, :], maximum)[0]
    # On the threshold itself rounding decides.
    sure = np.abs(probability - 0.65) > 1e-12
    np.testing.assert_array_equal(occupied[sure], (probability > 0.65)[sure])


def test_the_top_row_is_the_largest_y(tmp_path: Path) -> None:
    """One black pixel in the upper left corner of the image is the cell of small x, large y."""
    pixels = np.full((3, 4), 254, dtype=np.uint8)
    pixels[0, 0] = 0
    occupied = read_map_file(write(tmp_path)).occupied(pixels, 255)
    assert np.argwhere(occupied).tolist() == [[2, 0]]


@pytest.mark.parametrize('header', [
    b'P5\n7 5\n255\n', b'P5 7 5 255 ', b'P5\n# CREATOR: map_saver.cpp 0.050 m/pix\n7 5\n255\n',
    b'P5 # a\n# b\n 7\t5\n# c\n255\n'],
    ids=['plain', 'one line', 'map_saver', 'comments'])
def test_images_of_others(tmp_path: Path, header: bytes) -> None:
    """The same pixels as Pillow, whole and in pieces, for any spacing of the header."""
    pixels = np.random.default_rng(1).integers(0, 256, (5, 7), dtype=np.uint8)
    path = tmp_path / 'map.pgm'
    path.write_bytes(header + pixels.tobytes())
    image = open_pgm(path)
    np.testing.assert_array_equal(np.asarray(Image.open(path)), pixels)
    np.testing.assert_array_equal(image.read((0, 5), (0, 7)), pixels)
    np.testing.assert_array_equal(image.read((1, 4), (2, 6)), pixels[1:4, 2:6])


def test_image_of_numbers_as_text(tmp_path: Path) -> None:
    """P2, as image programs export it."""
    path = tmp_path / 'map.pgm'
    path.write_bytes(b'P2\n3 2\n# text\n200\n0 1 2\n# more\n3 199\n200')
    image = open_pgm(path)
    assert image.maximum == 200
    assert image.read((0, 2), (0, 3)).tolist() == [[0, 1, 2], [3, 199, 200]]


def test_written_images_are_read_by_pillow(tmp_path: Path) -> None:
    """Written images are PGM files for other programs."""
    pixels = np.random.default_rng(2).integers(0, 256, (4, 9), dtype=np.uint8)
    write_pgm(tmp_path / 'map.pgm', pixels)
    image = Image.open(tmp_path / 'map.pgm')
    assert (image.format, image.mode) == ('PPM', 'L')
    np.testing.assert_array_equal(np.asarray(image), pixels)


@pytest.mark.parametrize(('content', 'message'), [
    (b'', 'is no PGM image'), (b'\x89PNG\r\n', 'is no PGM image'),
    (b'P6\n1 1\n255\n123', 'is no PGM image'),
    (b'P5\n' + b'#' * 5000 + b'\n1 1\n255\n1', 'is no PGM image'),
    (b'P5\n0 4\n255\n', '0 x 4 pixels'), (b'P5\n99999999 4\n255\n', 'give an image of 1 to'),
    (b'P5\n4 4\n65535\n' + 32 * b'0', 'convert it to 8 bits'), (b'P5\n4 4\n0\n', 'up to 0'),
    (b'P5\n4 4\n255\n123456789012345', 'is shorter than its header says'),
    (b'P2\n2 2\n255\n1 2 3', 'is shorter than its header says'),
    (b'P2\n2 2\n255\n1 2 3 four', 'no number from 0 to 255'),
    (b'P2\n2 2\n255\n1 2 3 256', 'no number from 0 to 255'),
    (b'P2\n2 2\n255\n1 2 3 -1', 'no number from 0 to 255')],
    ids=['empty', 'png', 'colour', 'long comment', 'no width', 'huge', '16 bit', 'no maximum',
         'short', 'few numbers', 'word', 'large number', 'negative'])
def test_images_that_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    """The refusal is one line with the file's name."""
    path = tmp_path / 'map.pgm'
    path.write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        open_pgm(path)
    assert str(path) in str(caught.value)


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    """Reading a pipe would block for ever."""
    os.mkfifo(tmp_path / 'pipe')
    for name in ('pipe', '.', 'none'):
        with pytest.raises(InputError, match='is no regular file|No such file'):
            open_pgm(tmp_path / name)
    with pytest.raises(InputError, match='is no regular file'):
        read_map_file(tmp_path / 'pipe')


def test_an_image_that_is_cut_short_while_in_use(tmp_path: Path) -> None:
    """It raises an error and does not end the process."""
    path = tmp_path / 'map.pgm'
    write_pgm(path, np.zeros((100, 100), dtype=np.uint8))
    image = open_pgm(path)
    os.truncate(path, 5000)
    with pytest.raises(InputError, match='is shorter'):
        image.read((0, 100), (0, 100))
    path.unlink()
    with pytest.raises(InputError, match='cannot be read'):
        image.read((0, 1), (0, 1))


@pytest.mark.parametrize(('values', 'message'), [
    ({'origin': '[0, 0, 0.1]'}, 'the map is turned: "origin" has the yaw 0.1 rad; turn the image'),
    ({'origin': '[0]'}, '"origin" is'), ({'origin': '[.nan, 0, 0]'}, '"origin" holds'),
    ({'origin': '[1e30, 0, 0]'}, '"origin" holds'), ({'resolution': '0'}, '"resolution" is 0'),
    ({'resolution': '.inf'}, '"resolution" is inf'), ({'resolution': 'fine'}, '"resolution" is'),
    ({'resolution': None}, '"resolution" is missing'), ({'image': None}, '"image" is missing'),
    ({'image': '../secret.pgm'}, 'lies outside the folder of the map'),
    ({'image': '/etc/passwd'}, 'lies outside the folder of the map'),
    ({'image': 'link.pgm'}, 'lies outside the folder of the map'),
    ({'image': '[a]'}, '"image" is'), ({'mode': 'raw'}, 'use one of trinary, scale'),
    ({'negate': '2'}, '"negate" is 2'), ({'occupied_thresh': '1.5'}, 'a number from 0 to 1'),
    ({'free_thresh': '0.9'}, '"free_thresh" is larger'),
    ({'tile_cells': '0'}, '"tile_cells" is 0'), ({'tile_cells': '100000'}, '"tile_cells" is')],
    ids=lambda value: next(iter(value.items()))[0] if isinstance(value, dict) else None)
def test_map_files_that_are_refused(tmp_path: Path, values: dict[str, str | None], message: str
                                    ) -> None:
    """The refusal is one line that names file, key and remedy."""
    (tmp_path / 'map').mkdir()
    (tmp_path / 'secret.pgm').write_bytes(b'P5\n1 1\n255\n0')
    (tmp_path / 'map' / 'link.pgm').symlink_to(tmp_path / 'secret.pgm')
    path = write(tmp_path / 'map', **values)
    with pytest.raises(InputError, match=message.replace('[', r'\[')) as caught:
        read_map_file(path)
    assert str(path) in str(caught.value)


def test_a_folder_stands_for_its_map(tmp_path: Path) -> None:
    """A full turn counts as no turn, and integers are accepted as numbers."""
    write(tmp_path, resolution='1', origin='[3, 4, 6.283185307179586]')
    map_file = read_map_file(tmp_path)
    assert (map_file.entry.resolution, map_file.entry.origin[:2]) == (1.0, (3.0, 4.0))
    assert map_file.image == (tmp_path / 'map.pgm').resolve()
