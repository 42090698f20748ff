# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Policies that drive games: as planners and as drivers, offline."""

from dataclasses import replace
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.game.game import Game, load_game, parse_game
from crgame_ros.policy.policy_file import load_policy
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from policies import HERE
import pytest
import yaml

SCENARIOS = Path(__file__).resolve().parents[2] / 'scenarios'


def driven(name: str, function: str, *, av: bool, seconds: float = 3.0) -> OfflineResult:
    """Run a game whose AV or human is driven by a policy."""
    game = load_game(SCENARIOS / f'{name}.yaml')
    policy = f'policy:{HERE}:{function}'
    if av:
        assert game.avs is not None
        game = replace(game, avs=(replace(game.avs[0], planner=policy), *game.avs[1:]))
    else:
        game = replace(game, humans=(replace(game.humans[0], driver=policy),))
    return run_offline(build_setup(game), duration_s=seconds)


@pytest.mark.parametrize('function', ['acceleration', 'every_third', 'by_pedals', 'by_plans',
                                      'with_lidar', 'manoeuvres'])
def test_a_policy_plans_for_an_av_without_a_fallback(function: str) -> None:
    record = driven('cut_in', function, av=True).planners['av0']
    assert record.statistics.fallbacks == 0
    assert record.counters.accepted == record.statistics.plans == 30
    assert record.counters.steps_without_plan == 0


def test_a_planning_policy_stays_in_its_lane_and_does_not_run_into_the_human() -> None:
    result = driven('cut_in', 'acceleration', av=True, seconds=18.0)
    assert [item for item in result.violations if not item.is_valid] == []
    # The human overtakes, cuts in and stops: the policy has to stop, too.
    assert result.states_of('av0')[-1, StateColumn.SPEED] < 1.0


def test_a_policy_drives_a_human_along_the_lane() -> None:
    result = driven('lane_change', 'acceleration', av=False, seconds=6.0)
    states = result.states_of('hv0')
    assert [item for item in result.violations
            if item.vehicle_id == 'hv0' and not item.is_valid] == []
    # Its desired speed is 0.8 of the limit, and the pedals reach it.
    assert np.abs(np.diff(states[-100:, StateColumn.SPEED])).max() < 0.02
    assert result.commands[:, 0, 2].any()


def test_pedals_of_a_policy_are_the_commands_of_its_seat() -> None:
    commands = driven('cut_in', 'by_pedals', av=False, seconds=1.0).commands[1:, 0]
    assert (commands == np.array((np.float32(0.5), 0.0, np.float32(0.01), 0.0, 0.0, 0.0))).all()


def test_a_policy_that_fails_brakes_as_every_planner_that_fails() -> None:
    record = driven('cut_in', 'failing', av=True, seconds=1.0).planners['av0']
    assert record.statistics.fallbacks == record.statistics.plans
    assert 'no weights' in next(iter(record.statistics.reasons))


def test_a_policy_that_fails_is_asked_again_and_its_last_action_not_held() -> None:
    record = driven('cut_in', 'failing_later', av=True, seconds=2.0).planners['av0']
    # It decides at every third step until it fails at the fourth decision, and brakes from then.
    assert record.statistics.plans == 20
    assert record.statistics.fallbacks == 11


def test_a_driver_whose_policy_fails_is_lost_and_its_vehicle_stopped() -> None:
    said: list[str] = []
    game = load_game(SCENARIOS / 'lane_change.yaml')
    game = replace(game, humans=(replace(
        game.humans[0], driver=f'policy:{HERE}:failing_later'),))
    result = run_offline(build_setup(game), duration_s=25.0, say=said.append)
    assert [text for text in said if 'no weights' in text] == [
        'hv0: the policy has failed (RuntimeError: no weights); mend it and reset the run']
    assert result.commands[150:, 0, 0].max() == 0.0
    assert result.commands[300, 0, 1] == pytest.approx(0.15)
    assert abs(result.states_of('hv0')[-1, StateColumn.SPEED]) < 0.01


@pytest.mark.parametrize(('name', 'said'), [
    (f'{HERE}:nobody', 'has no function'), (f'{HERE}:nothing', 'returns a int'),
    (f'{HERE}:no_keys', 'is no mapping'),
    ('nowhere.py:load', 'there is no file'), ('load', 'does not name a policy'),
    (f'{HERE.with_name("conftest.txt")}:x', 'does not name a policy')])
def test_what_is_no_policy_is_refused_in_a_line(name: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        load_policy(name)


def test_a_plan_is_nothing_to_press_pedals_by() -> None:
    for function in ('by_plans', 'manoeuvres'):
        with pytest.raises(InputError, match='plans'):
            driven('cut_in', function, av=False)


def test_a_game_finds_its_policies_beside_it_and_from_anywhere(tmp_path: Path) -> None:
    (tmp_path / 'mine.py').write_text(HERE.read_text())
    game: Game = parse_game(yaml.safe_load(f"""
        scenario: {SCENARIOS}/ZAM_CutIn-1_1_T-1.xml
        humans: [{{id: hv0, driver: "policy:mine.py:acceleration"}}]
        avs: [{{id: av0, planner: "policy:mine.py:acceleration"}}]
        """), 'game', tmp_path)
    assert game.avs is not None
    assert game.avs[0].planner == f'policy:{tmp_path}/mine.py:acceleration'
    assert build_setup(game).humans[0].driver == f'policy:{tmp_path}/mine.py:acceleration'
    again = parse_game(yaml.safe_load(game.dump()), 'game', Path('/'))
    assert again.avs == game.avs
    assert again.humans[0].driver == f'policy:{tmp_path}/mine.py:acceleration'
    assert run_offline(build_setup(again), duration_s=1.0).planners[
        'av0'].statistics.fallbacks == 0
