# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An AV's perception in a recorded run, as the page gets it."""

from collections.abc import Iterator
from pathlib import Path
import struct

from crgame_ros.cockpit.frames import FrameKind
from crgame_ros.cockpit.replay_backend import ReplayBackend
import numpy as np
from numpy.typing import NDArray
from perception_recording import OCCUPIED, Perceived, record_perceiving, SENSORS
import pytest

DURATION_S = 6.0
FloatArray = NDArray[np.float64]
# Tolerance of values that were sent as float32.
SINGLE = 1e-5


@pytest.fixture(scope='module')
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Perceived, Path]:
    """Record 6 s of a run: two chunks."""
    return record_perceiving(tmp_path_factory.mktemp('perceived') / 'bag', DURATION_S)


@pytest.fixture(scope='module')
def backend(recorded: tuple[Perceived, Path]) -> Iterator[ReplayBackend]:
    """Open the recording."""
    opened = ReplayBackend(recorded[1])
    yield opened
    opened.close()


def frames(chunk: bytes) -> list[FloatArray]:
    """Unpack a chunk, in its order."""
    found, at = [], 0
    while at < len(chunk):
        (length,) = struct.unpack_from('<I', chunk, at)
        found.append(np.frombuffer(chunk, '<f8', length // 8, at + 4))
        at += 4 + length
    return found


def of_kind(found: list[FloatArray], kind: FrameKind) -> dict[int, FloatArray]:
    """Return the frames of a kind by n; of scans those of the first sensor."""
    return {int(frame[2]): frame for frame in found if frame[0] == kind
            and (kind is not FrameKind.SCAN or frame[6] == 0)}


def test_estimates_are_those_of_every_step(backend: ReplayBackend,
                                           recorded: tuple[Perceived, Path]) -> None:
    perceived = recorded[0]
    found = of_kind([*frames(backend.chunk(0)), *frames(backend.chunk(1))], FrameKind.ESTIMATE)
    assert sorted(found) == list(range(601))
    rows = np.array([found[n][6:] for n in range(601)])
    np.testing.assert_allclose(rows[:, :3], perceived.estimates, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(rows[:, 5:], perceived.covariances.reshape(-1, 4)[:, [0, 1, 3]])


def test_scans_begin_where_the_sensor_was(backend: ReplayBackend,
                                          recorded: tuple[Perceived, Path]) -> None:
    """Every scan of both sensors has the pose from which perception scanned."""
    perceived = recorded[0]
    found = {(SENSORS[int(frame[6])].name, int(frame[2])): frame
             for chunk in (0, 1) for frame in frames(backend.chunk(chunk))
             if frame[0] == FrameKind.SCAN}
    assert set(found) == set(perceived.scans) and len(found) == 61 + 31
    for (name, n), (pose, ranges) in perceived.scans.items():
        frame = found[name, n]
        assert frame[:7].tolist() == [5, 0, n, n // 10, n * 0.01, 1, name == 'rear']
        np.testing.assert_allclose(frame[7:10], pose, rtol=0.0, atol=1e-12)
        assert frame[14:].tolist() == pytest.approx(
            [len(ranges), *ranges.astype(np.float32).tolist()])
    spread = 0.5 * SENSORS[0].field_of_view
    assert found['front', 0][10:14].tolist() == pytest.approx(
        [-spread, 2.0 * spread / 120, 80.0, 0.1], rel=SINGLE)


def test_seen_vehicles_are_those_of_the_request(backend: ReplayBackend,
                                                recorded: tuple[Perceived, Path]) -> None:
    perceived = recorded[0]
    ids = [item.id for item in perceived.result.setup.descriptions]
    found = of_kind([*frames(backend.chunk(0)), *frames(backend.chunk(1))], FrameKind.SEEN)
    assert sorted(found) == list(range(0, 601, 10))
    for n, frame in found.items():
        assert frame[5:7].tolist() == [1, len(frame) - 7]
        assert {ids[int(column)] for column in frame[7:]} == perceived.seen[n // 10]
    # The run is a useful case: some vehicles are unseen, and the set of the seen changes.
    assert len({frozenset(seen) for seen in perceived.seen}) > 3
    assert max(map(len, perceived.seen)) < len(ids)


def test_a_chunk_can_be_shown_alone(backend: ReplayBackend) -> None:
    """It begins with the map, the last request and estimate, and each sensor's last scan."""
    found = frames(backend.chunk(1))
    first = next(place for place, frame in enumerate(found) if frame[0] == FrameKind.STATE)
    carried = {(int(frame[0]), int(frame[6]) if frame[0] == FrameKind.SCAN else 0): int(frame[2])
               for frame in found[:first] if frame[2] < 500 or frame[0] == FrameKind.OCCUPANCY}
    assert {kind: n for kind, n in carried.items() if kind[0] >= FrameKind.SCAN} == {
        (FrameKind.SCAN, 0): 490, (FrameKind.SCAN, 1): 480, (FrameKind.ESTIMATE, 0): 499,
        (FrameKind.SEEN, 0): 490, (FrameKind.OCCUPANCY, 0): 500}
    for chunk in (0, 1):
        grid = of_kind(frames(backend.chunk(chunk)), FrameKind.OCCUPANCY)[500 * chunk]
        assert grid[5:10].tolist() == [30.0, 8.0, 0.5, *OCCUPIED.shape]
        bits = np.unpackbits(np.frombuffer(grid[10:].tobytes(), np.uint8), bitorder='little')
        assert bits[:6].astype(bool).tolist() == OCCUPIED.ravel().tolist()


def test_the_scene_lists_the_perceiving_avs(backend: ReplayBackend) -> None:
    vehicles = backend.info()['scene']['vehicles']
    assert vehicles[0]['perception'] is None
    assert vehicles[1]['perception']['sensors'] == ['front', 'rear']
