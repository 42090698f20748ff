# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded run as a game that varies: its human on the driven path, later or faster."""

from dataclasses import replace
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.game.game import load_game
from crgame_ros.geometry.reference_point import ahead
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.offline_recording import write_recording
from crgame_ros.schema.writing import write
from crgame_ros.search.findings import for_a_person
from crgame_ros.search.recorded_human import game_of_run
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.variation.space import game_of, space_of
import numpy as np
import pytest

DURATION_S = 8.0


@pytest.fixture(scope='module')
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, OfflineResult]:
    """Return the folder of a recorded run of the cut-in game, and the run."""
    game = load_game(scenarios_directory() / 'cut_in.yaml')
    result = run_offline(build_setup(replace(game, duration=DURATION_S)), keep_messages=True)
    folder = tmp_path_factory.mktemp('run')
    write_recording(result, folder)
    return folder, result


def human_centres(result: OfflineResult) -> np.ndarray:
    """Return the human's centre (ticks, 2) in the recorded run."""
    states = result.states_of('hv0')[::result.setup.scheduler.steps_per_tick]
    back = result.setup.humans[0].vehicle.rear_to_center
    return np.array([ahead(*state[:3], back) for state in states])


def test_the_game_as_it_is_repeats_the_humans_path(recorded: tuple[Path, OfflineResult],
                                                   tmp_path: Path) -> None:
    run, result = recorded
    game = load_game(game_of_run(run, tmp_path, other_planners=False))
    assert game.humans == () and [item.id for item in game.objects] == ['recorded_hv0']
    again = run_offline(build_setup(game))
    driven = human_centres(result)
    ticks = min(len(driven), len(again.object_poses))
    assert ticks > 70
    assert np.abs(again.object_poses[:ticks, 0, :2] - driven[:ticks]).max() < 1e-3
    # The AV sees the same vehicle, and drives as it did.
    steps = min(len(result.states_of('av0')), len(again.states_of('av0')))
    apart = result.states_of('av0')[:steps, :2] - again.states_of('av0')[:steps, :2]
    assert np.abs(apart).max() < 0.5


def test_a_game_that_was_edited_stays(recorded: tuple[Path, OfflineResult],
                                      tmp_path: Path) -> None:
    run, _ = recorded
    path = game_of_run(run, tmp_path, other_planners=False)
    assert game_of_run(run, tmp_path, other_planners=True) == path
    edited = path.read_text() + '# mine\n'
    path.write_text(edited)
    with pytest.raises(InputError, match='is another game than that of the run'):
        game_of_run(run, tmp_path, other_planners=False)
    assert path.read_text() == edited


def test_the_human_comes_later_and_faster(recorded: tuple[Path, OfflineResult],
                                          tmp_path: Path) -> None:
    run, result = recorded
    game = load_game(game_of_run(run, tmp_path, other_planners=False))
    space = space_of(write(game, game.base), '')
    assert space.nominal == {'hv0_shift': 0.0, 'hv0_speed': 1.0}
    space.check(game.base, '')
    made = run_offline(build_setup(game_of(game, {'hv0_shift': 0.5, 'hv0_speed': 1.1}, '')))
    driven = human_centres(result)
    for tick in (10, 30, 60):
        then = 1.1 * (0.1 * tick - 0.5) / 0.1
        expected = [np.interp(then, np.arange(len(driven)), column) for column in driven.T]
        assert made.object_poses[tick, 0, :2] == pytest.approx(expected, abs=0.02)


def test_a_person_takes_the_place_of_the_recorded_one(recorded: tuple[Path, OfflineResult],
                                                      tmp_path: Path) -> None:
    run, result = recorded
    game = load_game(game_of_run(run, tmp_path, other_planners=False))
    live = for_a_person(game)
    assert [(human.id, human.driver) for human in live.humans] == [('hv0', 'auto')]
    placed = build_setup(replace(live, humans=(replace(live.humans[0], driver='idle'),)))
    start = result.states_of('hv0')[0]
    assert placed.humans[0].state[:4] == pytest.approx(start[:4], abs=0.1)


def test_a_run_without_a_human_is_refused(tmp_path: Path) -> None:
    game = load_game(scenarios_directory() / 'cut_in_family.yaml')
    write_recording(run_offline(build_setup(replace(game, duration=1.0)), keep_messages=True),
                    tmp_path)
    with pytest.raises(InputError, match='no human drove in it'):
        game_of_run(tmp_path, tmp_path, other_planners=False)
