# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Clocks of instruments: the run's against the steady one, and a sender's that drifts."""

from crgame_ros.instruments.run_clock import clock_drift, corrected_s, CycleStarts, run_times_s
import numpy as np

PPM = 1e-6
DT_S = 0.01


def test_a_clock_that_drifts_by_50_ppm_is_corrected_for_an_hour() -> None:
    """
    The error stays that of LSL's measurements; the last offset alone would be older and older.

    Offsets are measured every two seconds with an error of 0.1 ms, as liblsl does; in between, the
    drift makes 0.1 ms. After an hour an uncorrected stamp is off by 180 ms.
    """
    true_s = np.arange(0.0, 3600.0, 0.05)
    begun_s, drift, noise = 1000.0, 50 * PPM, np.random.default_rng(1)
    sent_s = (1.0 + drift) * true_s + begun_s
    known_at_s = np.floor(true_s / 2.0) * 2.0
    measured = noise.uniform(-1e-4, 1e-4, 1801)[(known_at_s / 2.0).astype(int)]
    offsets_s = known_at_s - ((1.0 + drift) * known_at_s + begun_s) + measured
    # Before the first measurement there is none.
    offsets_s[:8] = np.nan
    connections = np.zeros(len(sent_s), dtype=np.int64)
    found_s = corrected_s(connections, sent_s, offsets_s)
    # A drift of 0.4 s before the first known offset, too, makes 0.02 ms.
    assert np.abs(found_s - true_s).max() < 2.5e-4
    assert abs(clock_drift(connections, sent_s, offsets_s) - drift) < 0.1 * PPM
    assert np.abs(sent_s - begun_s - true_s).max() > 0.17


def test_a_sender_that_begins_anew_has_offsets_of_its_own() -> None:
    """Its clock may have jumped by days; one that was never measured has no time at all."""
    connections = np.array([0, 0, 1, 1, 2])
    sent_s = np.array([10.0, 11.0, 500_000.0, 500_001.0, 7.0])
    offsets_s = np.array([5.0, 5.0, -499_000.0, np.nan, np.nan])
    assert corrected_s(connections, sent_s, offsets_s)[:4].tolist() == [15.0, 16.0, 1000.0, 1001.0]
    assert np.isnan(corrected_s(connections, sent_s, offsets_s)[4])
    assert np.isnan(clock_drift(connections, sent_s, offsets_s))


def test_the_runs_clock_stands_in_a_pause_and_goes_on_outside_the_run() -> None:
    """Between two starts it is on the line between them; a pause of 10 s lies within a step."""
    starts = np.array([[1, 100.0], [2, 100.01], [3, 110.01], [4, 110.02]])
    steady_s = np.array([99.0, 100.005, 105.01, 110.01, 110.02, 111.02])
    assert np.allclose(run_times_s(steady_s, starts, DT_S),
                       [-0.99, 0.015, 0.025, 0.03, 0.04, 1.04], atol=1e-12)


def test_a_step_has_the_start_of_its_cycle() -> None:
    """It is not known before its cycle is heard; a step that was not heard has the next start."""
    starts = CycleStarts(DT_S)
    assert starts.steady_s(1) is None
    starts.add(2, 100.0)
    starts.add(4, 100.02)
    starts.add(3, 99.0)
    assert [starts.steady_s(n) for n in (0, 2, 3, 4, 5)] == [99.98, 100.0, 100.02, 100.02, None]
