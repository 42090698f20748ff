# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The criticality of a run: observed offline, from its log and from its recording."""

import json
from pathlib import Path
from typing import Any

from crgame_ros.analysis.criticality.criticality import Criticality
from crgame_ros.analysis.criticality.recorded import measure_log
from crgame_ros.cli import main
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.recorded_game import recorded_inputs
from crgame_ros.recording.run_trajectories import read_trajectories, trajectories_of
from crgame_ros.simulation.offline import observed_run, OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
import pytest


@pytest.fixture(scope='module', params=['cut_in', 'occluded_pedestrian'])
def observed(request: pytest.FixtureRequest) -> tuple[Criticality, OfflineResult]:
    """Run a game offline under observation."""
    setup = build_setup(load_game(scenarios_directory() / f'{request.param}.yaml'))
    criticality = Criticality(observed_run(setup))
    drivers, intervals_s = recorded_inputs(setup)
    return criticality, run_offline(setup, drivers=drivers, intervals_s=intervals_s,
                                    observers=[criticality])


def _flat(found: Any, name: str = '') -> dict[str, Any]:
    """Return the leaves of a document by their paths."""
    if isinstance(found, dict | list):
        entries = found.items() if isinstance(found, dict) else enumerate(found)
        return {path: leaf for key, value in entries
                for path, leaf in _flat(value, f'{name}/{key}').items()}
    return {name: found}


@pytest.mark.exhaustive
def test_one_code_for_runs_logs_and_recordings(
        observed: tuple[Criticality, OfflineResult], recorder: Any, tmp_path: Path) -> None:
    """Worst moments, times and crossings are the same for each source of the run."""
    criticality, result = observed
    expected = _flat(criticality.as_dict())
    assert len(expected) > 30
    bag = recorder.ours(tmp_path / 'bag', recorder.messages(result))
    for log in (trajectories_of(result), read_trajectories(bag)):
        found = _flat(measure_log(log).as_dict())
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.slow
def test_the_cut_in_is_what_its_trajectories_say(
        recorder: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The smallest distance along the road, by hand from the two cars' states; the command."""
    setup = build_setup(load_game(scenarios_directory() / 'cut_in.yaml'))
    drivers, _ = recorded_inputs(setup)
    result = run_offline(setup, drivers=drivers)
    bag = recorder.ours(tmp_path / 'run' / 'bag', recorder.messages(result))
    for run in (bag, bag.parent):
        assert main(['measure', str(run), '--json']) == 0
        found = json.loads(capsys.readouterr().out)['vehicles']['av0']['worst']
        states = result.vehicle_states[::setup.scheduler.steps_per_tick]
        human, av = states[:, 0], states[:, 1]
        lengths = [vehicle.vehicle.length for vehicle in setup.vehicles]
        centers = [each[:, 0] + vehicle.vehicle.rear_to_center * np.cos(each[:, 2])
                   for each, vehicle in zip((human, av), setup.vehicles, strict=True)]
        ahead = (centers[0] > centers[1]) & (np.abs(human[:, 1] - av[:, 1]) < 1.5)
        gap = centers[0] - centers[1] - 0.5 * sum(lengths)
        # Both drive along the x axis, but for a few degrees of the lane change.
        assert found['gap']['value'] == pytest.approx(gap[ahead].min(), abs=0.05)
        closing = av[:, 3] - human[:, 3]
        ttc = np.where(ahead & (closing > 0.0), gap / np.maximum(closing, 1e-9), np.inf)
        assert found['ttc']['value'] == pytest.approx(ttc.min(), abs=0.1)
    assert main(['measure', str(bag)]) == 0
    text = capsys.readouterr().out
    assert '  ttc ' in text and '<- critical' in text


@pytest.mark.parametrize('words', [('missing',), ('.', '--ttc', '0'), ('.', '--pet', 'nan')])
def test_what_cannot_be_measured_is_told_in_a_line(
        words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    """No recording, no sensible threshold."""
    assert main(['measure', *words]) == 2
    error = capsys.readouterr().err
    assert error.startswith('error: ') and error.count('\n') == 1
