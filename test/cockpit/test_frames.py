# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The binary frames: each number is where the page reads it."""

import math
import time

from crgame_ros.cockpit.frames import (
    encode_estimate,
    encode_objects,
    encode_occupancy,
    encode_plan,
    encode_prediction,
    encode_scan,
    encode_seen,
    encode_state,
    Place,
)
from crgame_ros.errors import InputError
import numpy as np
import pytest


def numbers(frame: bytes) -> list[float]:
    """Read a frame as the page does: little-endian float64."""
    return np.frombuffer(frame, '<f8').tolist()


def test_state_holds_header_count_and_rows() -> None:
    rows = np.arange(26.0).reshape(2, 13)
    assert numbers(encode_state(Place(3, 150, 15, 1.5), rows)) == [
        1, 3, 150, 15, 1.5, 2, *range(26)]


def test_state_without_vehicles_is_the_header() -> None:
    assert numbers(encode_state(Place(0, 0, 0, 0.0), np.empty((0, 13)))) == [1, 0, 0, 0, 0.0, 0]


def test_an_absent_object_is_nan_and_the_others_stay() -> None:
    rows = np.array([[math.nan] * 6, [1, 2, 3, 4, 5, 6]])
    frame = numbers(encode_objects(Place(1, 20, 2, 0.2), rows))
    assert frame[:6] == [2, 1, 20, 2, 0.2, 2]
    assert all(map(math.isnan, frame[6:12])) and frame[12:] == [1, 2, 3, 4, 5, 6]


def test_a_transposed_table_is_written_by_rows() -> None:
    # Tables made of columns are not contiguous in memory.
    columns = np.arange(12.0).reshape(6, 2)
    frame = numbers(encode_objects(Place(0, 0, 0, 0.0), columns.T))
    assert frame[6:] == columns.T.ravel().tolist()


def test_plan_names_its_vehicle_before_its_points() -> None:
    points = [[1.0, 2.0, 0.1, 5.0, 0.0], [1.5, 2.0, 0.1, 5.0, 0.1]]
    assert numbers(encode_plan(Place(2, 10, 1, 0.1), 4, points)) == [
        3, 2, 10, 1, 0.1, 4, 2, *points[0], *points[1]]


def test_prediction_puts_each_column_before_its_points() -> None:
    points = np.arange(12.0).reshape(2, 2, 3)
    assert numbers(encode_prediction(Place(0, 10, 1, 0.1), 1, [0, 7], points)) == [
        4, 0, 10, 1, 0.1, 1, 2, 2, 0, *range(6), 7, *range(6, 12)]


@pytest.mark.parametrize('shape', [(13,), (2, 12), (1, 2, 13)], ids=str)
def test_a_state_of_another_width_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(InputError, match=r'STATE of shape .*give \(any, 13\)'):
        encode_state(Place(0, 0, 0, 0.0), np.zeros(shape))


def test_predictions_without_their_columns_are_refused() -> None:
    with pytest.raises(InputError, match='for 1 objects'):
        encode_prediction(Place(0, 0, 0, 0.0), 0, [0], np.zeros((2, 3, 3)))


def test_a_state_costs_little_of_a_cycle() -> None:
    # 100 Hz leave 10 ms. The best of many runs measures the code and not the machine's load.
    rows = np.random.default_rng(0).random((10, 13))
    best = min(_seconds(rows) for _ in range(2000))
    assert best < 20e-6


def _seconds(rows: np.ndarray) -> float:
    start = time.perf_counter()
    encode_state(Place(1, 2, 3, 0.4), rows)
    return time.perf_counter() - start


def test_a_prediction_of_no_vehicle() -> None:
    """The prediction frame of an AV that is alone has eight numbers only."""
    frame = np.frombuffer(encode_prediction(Place(0, 10, 1, 0.1), 1, (), np.empty((0, 31, 3))))
    assert frame.tolist() == [4.0, 0.0, 10.0, 1.0, 0.1, 1.0, 31.0, 0.0]


def test_a_scan_has_its_fan_before_its_ranges() -> None:
    fan = (1.0, 2.0, 0.5, -1.0, 0.25, 80.0, 0.1)
    assert numbers(encode_scan(Place(2, 15, 1, 0.15), 3, 1, fan, [4.0, math.inf])) == [
        5, 2, 15, 1, 0.15, 3, 1, *fan, 2, 4.0, math.inf]
    with pytest.raises(InputError, match='give .7,. and .R,.'):
        encode_scan(Place(2, 15, 1, 0.15), 3, 1, fan[1:], [4.0])


def test_an_estimate_has_pose_rates_and_covariance() -> None:
    row = [1.0, 2.0, 0.5, 12.0, 0.1, 0.04, -0.01, 0.09]
    assert numbers(encode_estimate(Place(2, 15, 1, 0.15), 3, row)) == [6, 2, 15, 1, 0.15, 3, *row]
    with pytest.raises(InputError, match='give .8,.'):
        encode_estimate(Place(2, 15, 1, 0.15), 3, row[1:])


def test_seen_lists_columns_and_may_be_empty() -> None:
    place = Place(0, 10, 1, 0.1)
    assert numbers(encode_seen(place, 1, [0, 1, 7])) == [7, *place, 1, 3, 0, 1, 7]
    assert numbers(encode_seen(place, 1, ())) == [7, *place, 1, 0]


def test_occupied_cells_are_bits_from_the_lower_left_corner() -> None:
    occupied = np.zeros((7, 11), dtype=bool)
    occupied[0, 0] = occupied[0, 9] = occupied[6, 10] = True
    frame = encode_occupancy(Place(1, 0, 0, 0.0), (-5.0, 8.0), 0.25, occupied)
    assert len(frame) % 8 == 0
    assert np.frombuffer(frame[:80]).tolist() == [8, 1, 0, 0, 0.0, -5.0, 8.0, 0.25, 7, 11]
    # Bit i of the number is cell i; 77 cells take 10 bytes, padded to 16.
    bits = int.from_bytes(frame[80:], 'little')
    assert len(frame) == 96 and bits == 1 | 1 << 9 | 1 << (6 * 11 + 10)
    with pytest.raises(InputError, match='cells of nan m'):
        encode_occupancy(Place(1, 0, 0, 0.0), (0.0, 0.0), math.nan, occupied)
