# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded gaze and recorded pictures of a driver's view become tables."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.run_tables import tables_of
from crgame_ros.game.instruments_spec import GazeSpec, InstrumentsSpec
from crgame_ros.game.view_documents import (
    ShownThing,
    VIEW_PICTURE,
    ViewEye,
    ViewPicture,
    ViewPlace,
)
from crgame_ros.messages.instrument_samples import (
    InstrumentStream,
    InstrumentStreams,
    SampleBatch,
    STREAMS,
)
from crgame_ros.recording.views import read_pictures
from crgame_ros.simulation.offline import OfflineResult
import numpy as np
import pandas as pd
import pytest

SCENARIO = 'ZAM_LaneChange-1_1_T-1.xml'
LOG_NS = 1_700_000_000_000_000_000
# Start of the run on the steady clock of its machine, as the recorder of tests has it [s].
STEADY_S = 1000.0
STRING, NUMBERS = 'std_msgs/msg/String', 'std_msgs/msg/Float64MultiArray'
EYE = ViewEye(0.0, 0.0, 0.0, 1.2, 0.0, 1.0, 1.0)
MIRROR = ShownThing('mirror', 'mirror_left', 0.0, 0.4, 0.2, 0.6)
Messages = list[tuple[str, str, int, bytes]]


@pytest.fixture(scope='module')
def result(drive: Callable[..., OfflineResult]) -> OfflineResult:
    """Drive a second, in a game that names the gaze of hv0."""
    found = drive(SCENARIO)
    spec = InstrumentsSpec(gaze=(GazeSpec('Eyes', 'hv0', 'gx', 'gy', 'view', 'sure', margin=0.0),))
    game = replace(found.setup.game, instruments=spec)
    return replace(found, setup=replace(found.setup, game=game))


def pictures(samples: Any, epoch: int = 0) -> Messages:
    """Return ten pictures in a second: a car drives from the left to the right."""
    made = []
    for at_s in np.arange(10) / 10.0:
        car = ShownThing('vehicle', 'av0', 0.3 + 0.3 * at_s, 0.4, 0.5 + 0.3 * at_s, 0.6, 20.0)
        text = VIEW_PICTURE.write(ViewPicture(
            'hv0', epoch, STEADY_S + at_s, 1.0, ViewPlace(0, 0, 800, 600, 800, 600, 1.0), EYE,
            (MIRROR, car)))
        made.append((VIEW_PICTURE.topic, STRING, LOG_NS, samples.string(text)))
    return made


def eyes(recorder: Any, samples: Any, channels: tuple[str, ...] = ('gx', 'gy', 'sure'),
         ) -> Messages:
    """Return gaze at 50 Hz: on the car for 0.4 s, on the mirror until 0.7 s, then lost."""
    at_s = np.arange(50) / 50.0
    x = np.where(at_s < 0.4, 0.4 + 0.3 * at_s, np.where(at_s < 0.7, 0.1, np.nan))
    stream = InstrumentStreams((InstrumentStream(
        1, 'Eyes', 'Gaze', channels, ('',) * 3, 50.0, 'float32'),))
    times = np.column_stack((np.zeros(50), STEADY_S + at_s, np.zeros(50), np.full(50, 1e-4),
                             STEADY_S + at_s))
    batch = SampleBatch(1, times, np.column_stack((x, np.full(50, 0.5), np.ones(50))))
    rows = np.array(batch.flat()).reshape(50, -1)
    return [(STREAMS.topic, STRING, LOG_NS, samples.string(STREAMS.write(stream))),
            ('/instruments/samples', NUMBERS, LOG_NS,
             recorder.cycle_rows(batch.label(channels).split(','), rows))]


def tables(recorder: Any, folder: Path, messages: Messages) -> dict[str, pd.DataFrame]:
    """Record and tabulate."""
    bag = recorder.ours(folder / 'bag', messages)
    return {name: table.to_pandas() for name, table in tables_of(
        [Run.of_recording(bag, scoring='none')]).items()}


def test_gaze_and_glances_are_tables_on_the_runs_clock(
        recorder: Any, samples: Any, result: OfflineResult, tmp_path: Path) -> None:
    found = tables(recorder, tmp_path, [
        *recorder.messages(result), *pictures(samples), *eyes(recorder, samples)])
    gaze = found['gaze']
    assert list(gaze.kind) == ['vehicle'] * 20 + ['mirror'] * 15 + ['lost'] * 15
    assert gaze.time_s.to_numpy() == pytest.approx(np.arange(50) / 50.0, abs=1e-6)
    assert list(gaze.vehicle.unique()) == ['hv0']
    assert list(gaze.object[:20].unique()) == ['av0']
    assert (gaze.distance_m[:20] == 20.0).all()
    assert gaze.between_s[:46].max() == pytest.approx(0.04, abs=1e-6)
    assert (gaze.confidence == 1.0).all()
    glances = found['glances']
    assert list(glances.object) == ['av0', 'mirror_left']
    assert glances.dwell_s.to_list() == pytest.approx([0.4, 0.3], abs=1e-6)
    assert glances.time_s.to_list() == pytest.approx([0.0, 0.4], abs=1e-6)
    sums = found['glance_sums'].set_index(['kind', 'object'])
    assert sums.total_s['vehicle', 'av0'] == pytest.approx(0.4)
    assert sums.share['mirror', 'all'] == pytest.approx(3.0 / 7.0)


def test_gaze_without_pictures_or_channels_is_told_as_such(
        recorder: Any, samples: Any, result: OfflineResult, tmp_path: Path) -> None:
    """A page that shows the map tells no pictures; a stream with other channels has no gaze."""
    run = recorder.messages(result)
    hidden = tables(recorder, tmp_path / 'hidden', [*run, *eyes(recorder, samples)])
    assert list(hidden['gaze'].kind) == ['unknown'] * 35 + ['lost'] * 15
    assert hidden['gaze'].between_s.isna().all()
    assert not len(hidden['glances'])
    assert not len(hidden['glance_sums'])
    other = tables(recorder, tmp_path / 'other', [
        *run, *pictures(samples), *eyes(recorder, samples, ('a', 'b', 'c'))])
    absent = tables(recorder, tmp_path / 'absent', [*run, *pictures(samples)])
    assert not len(other['gaze'])
    assert not len(absent['gaze'])


def test_pictures_of_other_runs_and_of_strangers_are_left_out(
        recorder: Any, samples: Any, result: OfflineResult, tmp_path: Path) -> None:
    foreign = [(VIEW_PICTURE.topic, STRING, LOG_NS, samples.string(text)) for text in (
        'no JSON', '{}', VIEW_PICTURE.write(ViewPicture(
            'hv0', 0, 1.0, 0.0, ViewPlace(0, 0, 1, 1, 1, 1, 1.0), EYE, ())).replace(
                '"hv0"', '"../x"'))]
    bag = recorder.ours(tmp_path / 'bag', [
        *recorder.messages(result), *foreign, *pictures(samples, 7), *pictures(samples)])
    found = read_pictures(bag, 0)
    assert list(found) == ['hv0']
    assert len(found['hv0'].times_s) == 10
    assert list(read_pictures(bag, 7)) == ['hv0']
    assert read_pictures(bag, 3) == {}
