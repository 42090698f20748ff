# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The criticality of a recording as the page gets it: recorded, or measured from the run."""

import json
from pathlib import Path
import struct
import sys
from urllib.error import HTTPError
from urllib.request import urlopen

from crgame_ros.analysis.criticality.criticality import MEASURES, most_critical
from crgame_ros.analysis.criticality.recorded import measure_log
from crgame_ros.analysis.criticality.rows import (
    COLUMNS,
    criticality_rows,
    CRITICALITY_TOPIC,
    PET,
    PLACE_COLUMNS,
)
from crgame_ros.cockpit.replay_backend import measured_criticality, ReplayBackend
from crgame_ros.errors import CrgameError
from crgame_ros.recording.epochs import read_epoch
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_trajectories import trajectories_of
from crgame_ros.simulation.offline import OfflineResult
import numpy as np
from numpy.typing import NDArray
import pytest
from replay_support import drive, Message, PARKED, record, recorder, START, STEP_NS, TICK_NS

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'browser'))

from world_support import served  # noqa: E402, I100 - importable from here on

FloatArray = NDArray[np.float64]
DURATION_S = 4.0
# Header of a frame: kind, epoch, n, k, t and the number of rows.
HEAD = 6


@pytest.fixture(scope='module')
def parked() -> OfflineResult:
    """Drive past parked cars."""
    return drive(PARKED, DURATION_S)


@pytest.fixture(scope='module')
def rows(parked: OfflineResult) -> dict[int, FloatArray]:
    """Measure the run by step, independently of the code under test."""
    found: dict[int, FloatArray] = {}
    measure_log(trajectories_of(parked), on_tick=lambda it: found.update(
        {it.n: criticality_rows(it, 0, it.n)}))
    return found


def _frames(data: bytes) -> dict[int, FloatArray]:
    """Unpack frames, the rows of each by its step."""
    found: dict[int, FloatArray] = {}
    at = 0
    while at < len(data):
        (length,) = struct.unpack_from('<I', data, at)
        values = np.frombuffer(data, '<f8', length // 8, at + 4)
        assert values[0] == 9 and values[1] == 0
        assert values[3] == values[2] / 10 and values[4] == pytest.approx(values[2] / 100)
        found[int(values[2])] = values[HEAD:].reshape(int(values[5]), -1)
        at += 4 + length
    return found


def _asked(bag: Path) -> dict[int, FloatArray]:
    """Request the criticality of a recording's run from the server, as the page does."""
    with served(ReplayBackend(bag, 0)) as server:
        answers = []
        for _ in range(2):
            with urlopen(f'{server.address}api/replay/criticality?epoch=0', timeout=60) as answer:
                answers.append(answer.read())
        assert answers[0] == answers[1]
        return _frames(answers[0])


def _told(rows: dict[int, FloatArray], *more: tuple[str, FloatArray]) -> list[Message]:
    """Make messages of rows, and further ones with other labels."""
    kind = 'std_msgs/msg/Float64MultiArray'
    return [(CRITICALITY_TOPIC, kind, START + n * STEP_NS + 5,
             recorder.cycle_rows(COLUMNS, found)) for n, found in rows.items()] + [
        (CRITICALITY_TOPIC, kind, START + TICK_NS + i, recorder.cycle_rows(
            label.split(','), found)) for i, (label, found) in enumerate(more)]


def test_of_each_vehicle_the_most_critical_values_go_out(
        rows: dict[int, FloatArray], parked: OfflineResult, tmp_path: Path) -> None:
    """Without recorded rows the server measures each value and names the other vehicle."""
    bag = record(tmp_path / 'bag', recorder.messages(parked))
    found = _asked(bag)
    # One step more, as the recording also holds its first state.
    assert found.keys() == {n for n, block in rows.items() if len(block)}
    checked = 0
    for n, block in found.items():
        for row in block:
            mine = rows[n][rows[n][:, 2] == row[0]]
            values, others = most_critical(mine[:, len(PLACE_COLUMNS):PET],
                                           mine[:, 3].astype(np.int64))
            assert row[1:-2:2] == pytest.approx(values, rel=1e-9, abs=1e-9, nan_ok=True)
            assert np.array_equal(row[2:-2:2], others)
            checked += int((others >= 0).sum())
    assert checked > len(MEASURES)


def test_recorded_rows_are_shown_as_they_were_told(rows: dict[int, FloatArray],
                                                   parked: OfflineResult,
                                                   tmp_path: Path) -> None:
    """Recorded rows count even if the run differs; rows of another sender are ignored."""
    changed = {n: block.copy() for n, block in rows.items()}
    for block in changed.values():
        block[:, COLUMNS.index('min_distance')] += 1000.0
    stranger, nobody = np.full((1, len(COLUMNS)), 77.0), np.full((1, len(COLUMNS)), np.nan)
    bag = record(tmp_path / 'bag', [*recorder.messages(parked), *_told(
        changed, (','.join(COLUMNS), stranger), (','.join(COLUMNS), nobody),
        ('a,b', np.zeros((2, 2))))])
    found = _asked(bag)
    assert found.keys() == {n for n, block in rows.items() if len(block)}
    place = 1 + 2 * list(MEASURES).index('min_distance')
    assert all((block[:, place] > 999.0).all() for block in found.values())


def test_a_measurement_ends_with_the_replay(parked: OfflineResult, tmp_path: Path) -> None:
    """At any moment: while the recording is read, or after a step."""
    bag = record(tmp_path / 'bag', recorder.messages(parked))
    with BagReader(bag, parts=True) as reader:
        run = read_epoch(reader, 0)
    for most in (1, 30):
        shares: list[float] = []

        def go_on(share: float, shares: list[float] = shares, most: int = most) -> None:
            shares.append(share)
            if len(shares) == most:
                raise CrgameError('ended')
        with pytest.raises(CrgameError, match='ended'):
            measured_criticality(run, bag, go_on)
        assert len(shares) == most and shares[-1] < 1.0
    backend = ReplayBackend(bag, 0)
    backend.close()
    with pytest.raises(CrgameError, match='the replay has ended'):
        measured_criticality(run, bag, backend.go_on)


def test_a_run_that_is_not_there_is_said(parked: OfflineResult, tmp_path: Path) -> None:
    """The refusal is that of all other requests to a replay."""
    bag = record(tmp_path / 'bag', recorder.messages(parked))
    with served(ReplayBackend(bag, 0)) as server, pytest.raises(HTTPError) as refusal:
        urlopen(f'{server.address}api/replay/criticality?epoch=7', timeout=30)
    assert refusal.value.code == 404
    assert json.load(refusal.value)['error'] == 'there is no such epoch'
