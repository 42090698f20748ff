# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The reactive planner in the package's games: it answers without contacts; see test_cut_in."""

from pathlib import Path

from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game, with_planners
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
import pytest

# Share of ticks that the reactive planner has to answer with a plan of its own.
WANTED = 0.8


@pytest.mark.exhaustive
@pytest.mark.parametrize('name', ['parked_cars', 'roundabout'])
def test_reactive_planner_answers_and_hits_no_vehicle(name: str, project_root: Path) -> None:
    request = RunRequest(game=project_root / 'scenarios' / f'{name}.yaml')
    setup = with_planners(build_setup(effective_game(request)), ('reactive',))
    result = run_offline(setup)
    assert result.planners['av0'].accepted_ratio >= WANTED
    assert [item for item in result.violations if not item.is_valid] == []
