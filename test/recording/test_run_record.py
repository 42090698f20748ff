# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The measures' input from a recording is the same as from the run itself."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from crgame_ros.analysis.scores.scored_run import score_drives
from crgame_ros.game.events import FiredEvent
from crgame_ros.game.game import load_game
from crgame_ros.game.seat_documents import DRIVERS, DrivingSpell, DrivingSpells
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.recorded_game import recorded_inputs
from crgame_ros.recording.run_record import read_run_record, run_record_of
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np


def test_a_recording_has_the_same_record(recorder: Any, tmp_path: Path) -> None:
    """Commands of humans bit by bit, none of AVs that follow their plans, and no more events."""
    setup = build_setup(load_game(scenarios_directory() / 'cut_in.yaml'))
    drivers, intervals_s = recorded_inputs(setup)
    result = run_offline(setup, duration_s=3.0, drivers=drivers, intervals_s=intervals_s)
    here = run_record_of(result)
    there = read_run_record(recorder.ours(tmp_path / 'bag', recorder.messages(result)))
    assert np.array_equal(here.ns, np.arange(1, 301))
    for record in (here, there):
        assert np.array_equal(record.ns, here.ns)
        assert np.allclose(record.times_s, 0.01 * here.ns, rtol=0.0, atol=1e-12)
        assert np.array_equal(record.commands[:, 0], result.commands[1:, 0])
        # Of a vehicle that follows a plan: the motion that others see.
        assert np.isnan(record.commands[:, 1, [0, 1, 2, 3, 5]]).all()
        assert np.array_equal(record.commands[:, 1, 4], result.commands[1:, 1, 4])
        assert record.fired == result.fired
        assert np.array_equal(record.log.ks, here.log.ks)
        # No step led to the first state.
        assert np.isnan(record.log.commands[0]).all()
        assert np.array_equal(record.log.commands[1:], result.commands[10::10], equal_nan=True)


def test_a_vehicle_put_back_before_the_log_begins_does_not_jump_in_it() -> None:
    """The log holds 1 s to 3 s: what was put back at 0.5 s counts no more, at 2 s it does."""
    setup = build_setup(load_game(scenarios_directory() / 'cut_in.yaml'))
    drivers, intervals_s = recorded_inputs(setup)
    record = run_record_of(run_offline(setup, duration_s=3.0, drivers=drivers,
                                       intervals_s=intervals_s))
    log = record.log
    log = replace(log, ks=log.ks[10:], vehicle_states=log.vehicle_states[10:],
                  published_states=log.published_states[10:],
                  object_poses=log.object_poses[10:],
                  object_velocities=log.object_velocities[10:])
    early, late = (replace(record, log=log, fired=(FiredEvent.put_back('hv0', n, n // 10),))
                   for n in (50, 200))
    assert early.put_back == {} and early.jumps(0) == ()
    assert early.ways()[0] > late.ways()[0]
    scores = score_drives(log, put_back=early.put_back)
    assert scores[0].remarks == score_drives(log)[0].remarks
    row, = late.jumps(0)
    assert 2.0 <= 0.1 * int(log.ks[row]) <= 2.1


def test_delays_of_drivers_are_their_runs(recorder: Any, samples: Any, tmp_path: Path) -> None:
    """The median of what was measured in a run; what others say besides is skipped."""
    setup = build_setup(load_game(scenarios_directory() / 'cut_in.yaml'))
    result = run_offline(setup, duration_s=0.1)
    start_ns, name, kind = 1_700_000_000_000_000_000, 'driver_node: hv0 driver', \
        'diagnostic_msgs/msg/DiagnosticArray'
    messages = []
    for epoch, delays_ms in enumerate((('40', '', '50', 'nan', 'inf'), ('7.5',))):
        offset_ns = epoch * 5_000_000_000
        log_ns = start_ns + offset_ns
        messages += recorder.messages(result, epoch=epoch, offset_ns=offset_ns, log_ns=log_ns)
        messages += [('/diagnostics', kind, log_ns + 200_000_000, recorder.status(
            offset_ns + 100_000_000, name, '', input_delay_ms=text)) for text in delays_ms]
        messages += [('/diagnostics', kind, log_ns + 200_000_000, bytes(20)),
                     ('/seats/drivers', 'std_msgs/msg/String', log_ns + 200_000_000,
                      samples.string(DRIVERS.write(DrivingSpells(epoch, (
                          DrivingSpell('hv0', 'device', 'keyboard', None, 0),)))))]
    bag = recorder.ours(tmp_path / 'bag', messages)
    for epoch, median_ms in enumerate((45.0, 7.5)):
        driver, = read_run_record(bag, epoch).drivers
        assert (driver.input_delay_ms, driver.round_trip_ms) == (median_ms, None)
