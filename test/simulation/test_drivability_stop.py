# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A human's violation ends an offline run at its step, if the game asks for it."""

from dataclasses import replace
import json
from pathlib import Path

from crgame_ros.cli import main
from crgame_ros.game.game import PoseSpawn
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
import pytest
import yaml

# Well ahead of the AV, where no vehicle runs into the human: x, y, yaw and speed.
STARTS = {'USA_US101-4_1_T-1': (43.57, -38.65, -0.7094, 5.331),
          'ZAM_Tutorial-1_2_T-1': (76.59, 0.0, 0.0, 22.0)}


def run(path: Path, stop: bool, rate: float = 100.0, **options: bool) -> OfflineResult:
    """Run a published scenario with a human whose car rolls straight on."""
    game = effective_game(RunRequest(scenario=path, driver='idle'))
    game = replace(game, drivability=replace(game.drivability, stop=stop),
                   timing=replace(game.timing, rate=rate),
                   humans=(replace(game.humans[0], spawn=PoseSpawn(*STARTS[path.stem])),))
    return run_offline(build_setup(game), duration_s=7.0, **options)


@pytest.mark.matrix
@pytest.mark.slow
@pytest.mark.parametrize(('name', 'steps'), [
    ('USA_US101-4_1_T-1', 55),        # the road bends, the human doesn't
    ('ZAM_Tutorial-1_2_T-1', 559)])   # the AV has been in a collision since 296: no matter
def test_ends_where_the_human_first_violates(name: str, steps: int,
                                             shared_scenarios: Path) -> None:
    """All up to the violation is as without the rule, and nothing comes after it."""
    path = shared_scenarios / f'{name}.xml'
    free, ended = run(path, stop=False), run(path, stop=True)
    first = next(item for item in free.violations
                 if item.vehicle_id == 'hv0' and not item.is_valid)
    assert free.stop is None and len(free.vehicle_states) == 701
    assert first.n == steps
    assert ended.stop == first._replace(stop_requested=True)
    assert np.array_equal(ended.vehicle_states, free.vehicle_states[:steps + 1])
    assert np.array_equal(ended.commands, free.commands[:steps + 1], equal_nan=True)
    assert len(ended.object_poses) == len(ended.object_velocities) == steps // 10 + 1
    assert ended.violations[-1].n == steps


def test_a_game_that_stops_is_checked_in_any_case(shared_scenarios: Path) -> None:
    """Without the drivability checks the run ends at the same step."""
    ended = run(shared_scenarios / 'USA_US101-4_1_T-1.xml', stop=True, check_drivability=False)
    assert ended.stop is not None and ended.stop.n == 55


def test_above_100_hz_it_ends_at_a_step_that_live_is_published(shared_scenarios: Path) -> None:
    """At 1 kHz every tenth state is published, and the monitor sees no other in either runner."""
    path = shared_scenarios / 'USA_US101-4_1_T-1.xml'
    ended = run(path, stop=True, rate=1000.0)
    assert ended.stop is not None
    assert ended.stop.n % 10 == 0
    # 0.55 s as at 100 Hz, except for the finer integration.
    assert ended.stop.n == pytest.approx(550, abs=10)
    assert len(ended.vehicle_states) == ended.stop.n + 1


def test_the_command_tells_both_steps_and_writes_what_was(
        shared_scenarios: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Six scenario steps are in the file, 0 to 5, because n = 55 lies after the fifth."""
    game = tmp_path / 'game.yaml'
    game.write_text(yaml.safe_dump({
        'scenario': str(shared_scenarios / 'USA_US101-4_1_T-1.xml'),
        'humans': [{'id': 'hv0', 'driver': 'idle', 'spawn': dict(zip(
            ('x', 'y', 'yaw', 'speed'), STARTS['USA_US101-4_1_T-1'], strict=True))}],
        'drivability': {'stop': True}}))
    assert main(['offline', str(game), '--out', str(tmp_path)]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report['stop'] == {'vehicle': 'hv0', 'violation_n': 55, 'stop_n': 55}
    assert report['simulated_s'] == pytest.approx(0.55)
    written = load_scenario(next(tmp_path.glob('*.xml')))
    longest = max(obstacle.prediction.final_time_step
                  for obstacle in written.scenario.dynamic_obstacles)
    assert longest == 5
