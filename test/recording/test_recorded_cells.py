# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded humans in an evaluation: they repeat their drive, against any planner."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.evaluation.cell_grid import make_grid
from crgame_ros.evaluation.cell_run import run_cell
from crgame_ros.evaluation.content import ContentStore
from crgame_ros.evaluation.plan import parse_plan
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
import pytest

NAME = 'dense_merge'


@pytest.fixture(scope='module')
def recorded(recorder: Any, tmp_path_factory: pytest.TempPathFactory,
             ) -> tuple[Path, OfflineResult]:
    """Record a game with traffic over uneven steps."""
    setup = build_setup(load_game(scenarios_directory() / f'{NAME}.yaml'))
    intervals_s = np.random.default_rng(3).uniform(0.006, 0.014, 200)
    result = run_offline(setup, duration_s=2.0, intervals_s=intervals_s)
    folder = tmp_path_factory.mktemp('recorded') / 'somebody'
    recorder.ours(folder / 'bag', recorder.messages(result, intervals_s=intervals_s))
    return folder, result


@pytest.mark.exhaustive
def test_the_recorded_planner_gives_the_recorded_run(recorded: tuple[Path, OfflineResult],
                                                     tmp_path: Path) -> None:
    folder, result = recorded
    plan = parse_plan({'humans': [str(folder)], 'planners': ['own', 'constant-velocity'],
                       'seeds': [result.setup.game.seed]}, 'plan', tmp_path)
    store = ContentStore(tmp_path / 'files')
    same, other = make_grid(plan, store)
    assert same.factors['human'] == other.factors['human'] == 'somebody'
    assert same.factors['game'] == ''
    again, another = (run_cell(cell, store.folder) for cell in (same, other))
    assert again.state_hash == result.state_hash
    humans = len(result.setup.humans)
    assert np.array_equal(another.vehicle_states[:, :humans], result.vehicle_states[:, :humans])
    assert not np.array_equal(another.vehicle_states, result.vehicle_states)


def test_a_run_without_a_human_is_refused(recorder: Any, tmp_path: Path) -> None:
    setup = build_setup(replace(load_game(scenarios_directory() / 'two_avs.yaml'), humans=()))
    recorder.ours(tmp_path / 'run' / 'bag', recorder.messages(run_offline(setup, duration_s=0.5)))
    plan = parse_plan({'humans': [str(tmp_path / 'run')]}, 'plan', tmp_path)
    with pytest.raises(InputError, match='no vehicle was driven in it'):
        make_grid(plan, ContentStore(tmp_path / 'files'))
