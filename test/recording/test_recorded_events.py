# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Events of recorded runs: read back, repeated, and their objects in an export."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.game.events import AtStep
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.conversion import convert
from crgame_ros.recording.recorded_game import (
    read_run_events,
    recorded_inputs,
    with_replayed_events,
)
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
import pytest

CROSSING = scenarios_directory() / 'crossing.yaml'
TRIGGERS = ((95, 'pedestrian'), (150, 'roadworks'), (40, 'leader-brakes'))


def play(triggers: Sequence[tuple[int, str]] = TRIGGERS) -> OfflineResult:
    """Run 3 s of the crossing."""
    return run_offline(build_setup(load_game(CROSSING)), duration_s=3.0, triggers=triggers)


def test_events_are_read_back(tmp_path: Path, recorder: Any) -> None:
    """They are those of the chosen run, the last by default; there may be none."""
    first, second = play(), play(())
    bag = recorder.ours(tmp_path / 'bag', [
        *recorder.messages(first),
        *recorder.messages(second, epoch=1, offset_ns=9_000_000_000,
                           log_ns=1_700_000_009_000_000_000)])
    assert read_run_events(bag, 0).fired == first.fired
    assert [event.name for event in first.fired] == ['leader-brakes', 'pedestrian', 'roadworks']
    assert read_run_events(bag).fired == ()
    assert read_run_events(bag).known == {event.name for event in first.setup.game.events}
    with pytest.raises(InputError, match='no epoch 2 in it'):
        read_run_events(bag, 2)


def test_recording_repeats_with_its_events(tmp_path: Path, recorder: Any) -> None:
    """`replay:BAG` alone repeats the human and the events; the bits differ from those without."""
    original = play()
    recorder.ours(tmp_path / 'bag', recorder.messages(original))
    game = replace(load_game(CROSSING), base=tmp_path)
    human = replace(game.humans[0], driver='replay:bag')
    setup = with_replayed_events(build_setup(replace(game, humans=(human,))))
    assert {event.name: event.when for event in setup.game.events if event.when is not None} == {
        'pedestrian': AtStep(10), 'roadworks': AtStep(15), 'leader-brakes': AtStep(4)}
    drivers, intervals_s = recorded_inputs(setup)
    again = run_offline(setup, duration_s=3.0, drivers=drivers, intervals_s=intervals_s)
    assert again.state_hash == original.state_hash
    assert again.object_poses.tobytes() == original.object_poses.tobytes()
    assert play(()).object_poses.tobytes() != original.object_poses.tobytes()


@pytest.mark.parametrize('triggers', (((120, 'pedestrian'),), ()))
def test_the_last_of_two_simulations_repeats_with_its_own_events(
        tmp_path: Path, recorder: Any, triggers: Sequence[tuple[int, str]]) -> None:
    """A simulation that was started again counts its runs from 0: the last run is that of all."""
    log_ns, step_ns = 1_700_000_000_000_000_000, 9_000_000_000
    before, last = play(), play(triggers)
    recorder.ours(tmp_path / 'bag', [
        *recorder.messages(before),
        *recorder.messages(before, epoch=1, offset_ns=step_ns, log_ns=log_ns + step_ns),
        *recorder.messages(last, log_ns=log_ns + 2 * step_ns)])
    assert read_run_events(tmp_path / 'bag').fired == last.fired
    game = replace(load_game(CROSSING), base=tmp_path)
    human = replace(game.humans[0], driver='replay:bag')
    setup = with_replayed_events(build_setup(replace(game, humans=(human,))))
    drivers, intervals_s = recorded_inputs(setup)
    again = run_offline(setup, duration_s=3.0, drivers=drivers, intervals_s=intervals_s)
    assert again.state_hash == last.state_hash
    assert again.object_poses.tobytes() == last.object_poses.tobytes()


def test_game_without_a_replay_keeps_its_events() -> None:
    """Scripted humans repeat nothing."""
    setup = build_setup(load_game(CROSSING))
    assert with_replayed_events(setup) is setup


def test_converted_run_holds_what_events_did(tmp_path: Path, recorder: Any) -> None:
    """
    Braking leader and released pedestrian as dynamic obstacles, the put one as a phantom.

    Every pose is that of the run to the four decimals of the file; the construction site is
    absent up to its time step, and there to the end.
    """
    original = play()
    bag = recorder.ours(tmp_path / 'bag', recorder.messages(original))
    made, report = convert(bag, tmp_path)
    found = ScenarioObstacles(load_scenario(made))
    for column, name in enumerate(('o200', 'o201', 'e_roadworks')):
        number = found.ids.index(f'o{report.obstacle_ids[name]}')
        poses = np.array([found.states_at(k).poses[number] for k in range(31)])
        np.testing.assert_allclose(poses, original.object_poses[:, column], atol=1e-4)
    assert np.isnan(original.object_poses[14, 2]).all()
    assert np.isfinite(original.object_poses[15:, 2]).all()
    assert any('e_roadworks appears at time step 15' in notice for notice in report.notices)


def test_put_from_the_start_is_a_static_obstacle(tmp_path: Path, recorder: Any) -> None:
    """It has its type, unlike a phantom obstacle."""
    bag = recorder.ours(tmp_path / 'bag', recorder.messages(play([(0, 'roadworks')])))
    made, report = convert(bag, tmp_path)
    scenario = load_scenario(made).scenario
    (static,) = scenario.static_obstacles
    assert static.obstacle_id == report.obstacle_ids['e_roadworks']
    assert static.obstacle_type.value == 'constructionZone'
    assert static.initial_state.position.tolist() == [330.0, -1.75]
