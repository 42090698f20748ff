# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Samples of other instruments in a recording: on the run's clock, in tables."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.run_tables import tables_of
from crgame_ros.messages.instrument_samples import InstrumentStream, InstrumentStreams, STREAMS
from crgame_ros.recording.instrument_streams import read_streams
from crgame_ros.simulation.offline import OfflineResult
import numpy as np
import pandas as pd
import pytest

SCENARIO = 'ZAM_LaneChange-1_1_T-1.xml'
LOG_NS = 1_700_000_000_000_000_000
# Of the other clock in the recorder's messages.
DRIFT = 50e-6


@pytest.fixture(scope='module')
def result(drive: Callable[..., OfflineResult]) -> OfflineResult:
    """Drive a second."""
    return drive(SCENARIO)


@pytest.fixture(scope='module')
def bag(recorder: Any, result: OfflineResult, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record it with two instruments."""
    found: Path = recorder.ours(tmp_path_factory.mktemp('instruments') / 'bag', [
        *recorder.messages(result), *recorder.instruments()])
    return found


def test_tables_have_every_sample_on_the_runs_clock(bag: Path) -> None:
    """
    A value of the heart is its own time: what LSL has measured once a second gives it back.

    In this second the other clock drifts by 50 us, and it is half a million seconds ahead.
    """
    tables = tables_of([Run.of_recording(bag)])
    samples = tables['instrument_samples'].to_pandas()
    heart = samples[(samples.stream == 'Heart')].pivot(
        index='number', columns='channel', values='value')
    assert list(heart.columns) == ['lead 2', 'lead,1']
    times_s = samples[(samples.stream == 'Heart') & (samples.channel == 'lead 2')].time_s
    errors_s = times_s.to_numpy() - heart['lead,1'].to_numpy()
    assert np.abs(errors_s).max() < 6e-5
    assert (heart['lead 2'] == -heart['lead,1']).all()
    # Before the start, and within it; the gap of the program is one here.
    assert times_s.iloc[0] == pytest.approx(-0.2, abs=6e-5)
    assert ((times_s < 0.51) | (times_s > 0.79)).all()
    notes = samples[samples.stream == 'Notes']
    assert list(notes.text.fillna('')) == ['now', '', '=then\t"']
    assert np.allclose(notes.time_s, [0.25, 0.5, 0.75], atol=6e-5)
    assert notes.value.isna().all()
    channels = tables['instrument_channels'].to_pandas().set_index(['stream', 'channel'])
    lead = channels.loc[('Heart', 'lead,1'), ['unit', 'type', 'rate', 'samples', 'gaps']]
    assert lead.to_list() == ['mV', 'ECG', 50.0, 54, 1]
    assert pd.isna(channels.loc[('Notes', 'text'), ['rate', 'clock_drift']]).all()
    # Missing, not infinite: there was one measurement.
    assert tables['instrument_channels']['clock_drift'].null_count == 1
    assert channels.loc[('Heart', 'lead 2'), 'clock_drift'] == pytest.approx(DRIFT, abs=3e-5)


def test_a_sample_belongs_to_one_run(recorder: Any, result: OfflineResult, tmp_path: Path) -> None:
    """Of two runs in one recording, the later begins where the other was over."""
    later_ns = 1_000_000_000
    messages = [*recorder.messages(result), *recorder.instruments(),
                *recorder.messages(result, epoch=1, offset_ns=later_ns,
                                   log_ns=LOG_NS + later_ns, steady_s=1001.0)]
    bag = recorder.ours(tmp_path / 'bag', messages)
    first, second = ({item.id: item for item in read_streams(bag, epoch)} for epoch in (0, 1))
    assert len(first['Heart'].values) + len(second['Heart'].values) == 54
    assert first['Heart'].values[:, 0].max() <= 1.01
    assert np.abs(second['Heart'].times_s + 1.0 - second['Heart'].values[:, 0]).max() < 6e-5
    assert list(second) == ['Heart']


def test_what_is_no_sample_is_left_out(recorder: Any, samples: Any, result: OfflineResult,
                                       bag: Path, tmp_path: Path) -> None:
    """Text that is no JSON, other columns, a stream that is not listed, or other channels."""
    string, numbers = 'std_msgs/msg/String', 'std_msgs/msg/Float64MultiArray'
    columns = 'stream,connection,sent_s,offset_s,uncertainty_s,received_s,a'
    foreign = [
        ('/instruments/texts', string, LOG_NS, samples.string('no JSON')),
        ('/instruments/streams', string, LOG_NS, samples.string('{"streams": [{}]}')),
        ('/instruments/samples', numbers, LOG_NS, recorder.cycle_rows(['a'], np.ones((1, 1)))),
        *(('/instruments/samples', numbers, LOG_NS, recorder.cycle_rows(
            columns.split(','), np.array([[number, 0.0, 1.0, 0.0, 0.0, 1.0, 5.0]])))
          for number in (1, 2, 7, 0.5)),
        # A device that was there with other channels before.
        ('/instruments/streams', string, LOG_NS - 5_000_000_000, samples.string(STREAMS.write(
            InstrumentStreams((InstrumentStream(
                1, 'Heart', 'ECG', ('lead',), ('mV',), 50.0, 'float32', 'amplifier', 'lab'),))))),
        ('/instruments/samples', numbers, LOG_NS - 4_000_000_000, recorder.cycle_rows(
            columns.split(','), np.array([[1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 5.0]])))]
    spoilt = recorder.ours(tmp_path / 'bag', [
        *recorder.messages(result), *foreign, *recorder.instruments()])
    for found, expected in zip(read_streams(spoilt), read_streams(bag), strict=True):
        assert found.stream == expected.stream
        assert np.array_equal(found.times_s, expected.times_s)


def test_without_the_steady_clock_there_are_no_times(
        recorder: Any, result: OfflineResult, tmp_path: Path) -> None:
    """Earlier versions did not record it, and a run without instruments has no tables of them."""
    bare = recorder.ours(tmp_path / 'bare', recorder.messages(result))
    early = recorder.ours(tmp_path / 'early', [
        *recorder.messages(result, steady_s=np.nan), *recorder.instruments()])
    assert read_streams(bare) == read_streams(early) == ()
