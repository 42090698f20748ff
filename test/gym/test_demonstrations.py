# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded people as demonstrations, and as a data set of Minari."""

from dataclasses import replace
from pathlib import Path

from crgame_ros.analysis.criticality.criticality import COLUMN, Criticality
from crgame_ros.errors import InputError
from crgame_ros.game.game import load_game
from crgame_ros.gym.demonstrations import demonstration, TOLERANCE, write_demonstrations
from crgame_ros.recording.offline_recording import write_recording
from crgame_ros.simulation.offline import observed_run, OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.state import StateColumn
import numpy as np
import pytest

SCENARIOS = Path(__file__).resolve().parents[2] / 'scenarios'
OBSERVATION = {'parts': ['state', 'objects'], 'objects': 1}


@pytest.fixture(scope='module')
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[OfflineResult, Path]:
    """Record the game in which the human's timeline cuts in, with a latency of the planner."""
    folder = tmp_path_factory.mktemp('runs') / 'first'
    result = run_offline(build_setup(load_game(SCENARIOS / 'cut_in.yaml')), duration_s=12.0,
                         latency_steps=7, keep_messages=True)
    write_recording(result, folder)
    return result, folder


def test_a_demonstration_is_the_recorded_run(run: tuple[OfflineResult, Path]) -> None:
    result, folder = run
    made = demonstration(folder, observation=OBSERVATION, ticks=2)
    assert made.deviation <= TOLERANCE
    assert (made.run, made.terminated, len(made.rewards)) == ('first', False, 60)
    states = result.states_of('hv0')[::20]
    seen = np.array([each['state'] for each in made.observations])
    assert seen[:, 0] == pytest.approx(states[:, StateColumn.SPEED], abs=1e-4)
    assert made.times_s == pytest.approx(0.2 * np.arange(61))
    # The AV is where it was recorded, also with the latency that the environment has not.
    av, car = result.states_of('av0')[::20], result.setup.avs[0].vehicle
    x = av[:, 0] + car.rear_to_center * np.cos(av[:, 2]) - states[:, 0]
    y = av[:, 1] + car.rear_to_center * np.sin(av[:, 2]) - states[:, 1]
    rows = np.array([each['objects'][0] for each in made.observations])
    near = rows[:, 0] > 0.5
    assert near.sum() > 30
    assert np.hypot(rows[near, 1], rows[near, 2]) == pytest.approx(np.hypot(x, y)[near], abs=1e-3)
    # Row 0 of the commands was consumed by no step.
    commands = result.commands[1:1201, 0].reshape(60, 20, -1)
    assert made.actions[:, 0] == pytest.approx(
        (commands[..., 0] - commands[..., 1]).mean(axis=1), abs=1e-6)
    assert made.actions[:, 1] == pytest.approx(commands[..., 2].mean(axis=1), abs=1e-6)


def test_a_demonstration_ends_as_an_episode_does(run: tuple[OfflineResult, Path]) -> None:
    short = demonstration(run[1], duration=3.0)
    assert (len(short.rewards), short.terminated) == (30, False)
    with pytest.raises(InputError, match='hv7'):
        demonstration(run[1], 'hv7')
    with pytest.raises(InputError, match='unknown'):
        demonstration(run[1], observation={'part': []})


def test_a_demonstration_measures_criticality_to_those_that_were_recorded(
        tmp_path: Path) -> None:
    game = load_game(SCENARIOS / 'dense_merge.yaml')
    assert game.traffic is not None
    game = replace(game, seed=3, traffic=replace(game.traffic, seed=11))
    assert game.humans
    setup = build_setup(game)
    criticality = Criticality(observed_run(setup))
    limits = {'thw': 2.0, 'ttc_2d': 3.0, 'min_distance': 2.0}
    shortages: list[float] = []

    class Measured:
        """Keeps the shortages of the human at each state."""

        def observe(self, *given: object) -> None:
            criticality.observe(*given)  # type: ignore[arg-type]
            worst = criticality.latest[0].worst()[0]
            shortages.append(sum(max(0.0, 1.0 - worst[COLUMN[name]] / limit)
                                 for name, limit in limits.items()
                                 if worst[COLUMN[name]] == worst[COLUMN[name]]))

        def report(self) -> None:
            """Return nothing."""

    result = run_offline(setup, duration_s=8.0, keep_messages=True, observers=[Measured()])
    write_recording(result, tmp_path / 'run')
    made = demonstration(tmp_path / 'run', reward=dict.fromkeys(limits, 1.0), ends=())
    assert max(shortages) > 0.1
    assert made.rewards == pytest.approx(shortages[10::10], abs=1e-6)


def test_a_run_that_cannot_be_replayed_is_refused(tmp_path: Path) -> None:
    game = load_game(SCENARIOS / 'cut_in.yaml')
    result = run_offline(build_setup(game), duration_s=1.0, keep_messages=True)
    # The commands of another drive: full throttle.
    other = result.commands.copy()
    other[:, 0, :2] = 1.0, 0.0
    assert result.messages is not None
    write_recording(replace(result, commands=other), tmp_path / 'run')
    with pytest.raises(InputError, match='replayed states differ'):
        demonstration(tmp_path / 'run')


def test_minari_reads_what_was_written(run: tuple[OfflineResult, Path], tmp_path: Path,
                                       monkeypatch: pytest.MonkeyPatch) -> None:
    minari = pytest.importorskip('minari', reason='Minari is not installed: an extra of its own')
    monkeypatch.setenv('MINARI_DATASETS_PATH', str(tmp_path))
    runs = [run[1], run[1]]
    made = write_demonstrations('cut_in/people-v0', runs, observation=OBSERVATION)
    data = minari.load_dataset('cut_in/people-v0')
    assert (data.total_episodes, data.total_steps) == (2, 240)
    episode = next(iter(data.iterate_episodes()))
    for part in ('state', 'objects'):
        wanted = np.array([seen[part] for seen in made[0].observations])
        assert (episode.observations[part] == wanted).all()
    assert (episode.actions == made[0].actions).all()
    assert episode.rewards == pytest.approx(made[0].rewards)
    assert (episode.terminations.any(), episode.truncations[-1]) == (False, True)
    assert set(episode.infos['run']) == {'first'}
    with pytest.raises(InputError, match='no name'):
        write_demonstrations('people', runs)
    with pytest.raises(InputError, match='exists'):
        write_demonstrations('cut_in/people-v0', runs, observation=OBSERVATION)


def test_what_to_install_is_told_where_minari_is_missing(
        run: tuple[OfflineResult, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__('sys').modules, 'minari', None)
    with pytest.raises(InputError, match='needs the package minari'):
        write_demonstrations('cut_in/people-v0', [run[1]])
