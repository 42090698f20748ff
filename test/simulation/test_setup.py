# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From a game to placed vehicles."""

import copy
from dataclasses import replace
import hashlib
import math
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.game.game import AvSpec, HumanSpec, LaneletSpawn, load_game, PoseSpawn
from crgame_ros.game.objects import Role
from crgame_ros.paths import scenarios_directory
from crgame_ros.scenario.loading import load_scenario, LoadedScenario, scenario_digest
from crgame_ros.simulation.setup import build_setup
import numpy as np
import pytest
import simulation_support as support

REACH = 1.4227170936


def test_av_starts_at_its_planning_problem(cut_in: LoadedScenario) -> None:
    """The problem's pose is the centre; the rear axle is l_r behind it. Identity transform."""
    setup = support.setup_of(support.moved(cut_in, 12.0, turn=0.2))
    state, problem = setup.avs[0].state, cut_in.planning_problems[0].initial_state
    assert state.center(REACH) == pytest.approx(tuple(problem.position))
    assert (state.yaw, state.speed) == pytest.approx((problem.orientation + 0.2, 12.0))
    assert setup.avs[0].transform.is_identity


def test_every_planning_problem_becomes_an_av(two_avs: LoadedScenario) -> None:
    """Without a list of AVs: in the order of the file, with the default planner."""
    setup = support.setup_of(two_avs)
    assert [(av.id, av.planning_problem.planning_problem_id, av.spec.planner)
            for av in setup.avs] == [('av0', 100, 'idm'), ('av1', 101, 'idm')]
    # The setup records the AVs it has found.
    assert [av.spec.planning_problem for av in setup.avs] == [100, 101]


def test_unnamed_problem_is_the_next_free_one(two_avs: LoadedScenario) -> None:
    """A problem that one AV names is not free for the others."""
    setup = support.setup_of(two_avs, avs=(AvSpec('av0'), AvSpec('av1', planning_problem=100)))
    assert [av.planning_problem.planning_problem_id for av in setup.avs] == [101, 100]


@pytest.mark.parametrize(('avs', 'named'), [
    ((AvSpec('av0'), AvSpec('av1'), AvSpec('av2')), 'av2: no planning problem is left'),
    ((AvSpec('av0', planning_problem=7),), 'planning problem 7 does not exist; use one of 100'),
    ((AvSpec('av0', planning_problem=100), AvSpec('av1', planning_problem=100)),
     'av1: planning problem 100 has an AV already')])
def test_bad_planning_problem_is_refused(two_avs: LoadedScenario, avs: tuple[AvSpec, ...],
                                         named: str) -> None:
    """The message names the scenario, the AV and the problems there are."""
    with pytest.raises(InputError, match=named) as caught:
        support.setup_of(two_avs, avs=avs)
    assert Path(two_avs.source).name in str(caught.value)


def test_lanelet_spawn_aligns_both_references(cut_in: LoadedScenario) -> None:
    """CRG 6-8: the simulator's pose is on the lane, the transform maps it to the declared one."""
    declared = support.moved(cut_in, 10.0, (0.0, -0.6), -0.1)
    av = support.setup_of(declared, avs=(AvSpec('av0', spawn='lanelet'),)).avs[0]
    target = support.setup_of(declared).avs[0].state
    assert (av.state.y, av.state.yaw) == pytest.approx((0.0, 0.0), abs=1e-9)
    mapped = av.transform.to_scenario(np.array(av.state[:3]))
    assert tuple(mapped) == pytest.approx(target[:3])
    assert av.state.speed == 10.0


@pytest.mark.parametrize(('shift', 'turn', 'told'), [
    (0.49, 0.0, ''), (1.5, 0.0, '1.50 m and 0.0 deg apart'), (-0.6, 0.0, '0.60 m and 0.0 deg'),
    (0.1, 0.019, ''), (0.1, -0.05, 'm and 2.9 deg apart')])
def test_a_large_discrepancy_is_told(cut_in: LoadedScenario, shift: float, turn: float,
                                     told: str) -> None:
    """More than 0.5 m or 0.02 rad (1.1 deg): the AV will drive beside its lane."""
    declared = support.moved(cut_in, 10.0, (0.0, shift), turn)
    setup = support.setup_of(declared, avs=(AvSpec('av0', spawn='lanelet'),))
    notices = [item for item in setup.notices if 'apart' in item]
    assert len(notices) == bool(told)
    assert all(told in item and item.startswith('av0: ') for item in notices)
    assert not any('apart' in item for item in support.setup_of(declared).notices)


def test_the_recording_of_an_av_is_known_wherever_it_starts(traffic: LoadedScenario) -> None:
    """It begins at the declared pose, 1.5 m beside the lane on which the AV is put."""
    declared = support.moved(traffic, 10.0, (0.0, 1.5))
    declared = replace(declared, scenario=copy.deepcopy(declared.scenario))
    problem = declared.planning_problems[0].initial_state
    other = copy.deepcopy(declared.scenario.dynamic_obstacles[0])
    other.initial_state.position = problem.position + np.array((0.2, 0.0))
    declared.scenario.remove_obstacle(declared.scenario.dynamic_obstacles[0])
    declared.scenario.add_objects(other)
    for spawn in ('problem', 'lanelet'):
        setup = support.setup_of(declared, avs=(AvSpec('av0', spawn=spawn),))
        assert any(f'obstacle {other.obstacle_id} is the recorded av0' in item
                   for item in setup.notices)


def test_human_starts_where_the_game_says(cut_in: LoadedScenario) -> None:
    """A pose as given; a lanelet by arc length along it and offset to its left."""
    humans = [HumanSpec('hv0', 'idle', spawn=PoseSpawn(3.0, 4.0, 0.5, 6.0)),
              HumanSpec('hv1', 'idle', spawn=LaneletSpawn(13, 234.0, 0.5, 26.0))]
    setup = support.setup_of(cut_in, humans)
    assert setup.humans[0].state[:4] == (3.0, 4.0, 0.5, 6.0)
    assert setup.humans[1].state[:4] == pytest.approx((-16.0, 4.25, 0.0, 26.0), abs=1e-6)


def test_human_without_a_place_is_put_near_the_av(cut_in: LoadedScenario) -> None:
    """Clear of it, in driving direction, as fast."""
    setup = support.setup_of(cut_in, [HumanSpec('hv0', 'idle')])
    human, av = setup.humans[0].state, setup.avs[0].state
    assert 2.0 < math.hypot(human.x - av.x, human.y - av.y) < 100.0
    assert human.yaw == pytest.approx(av.yaw, abs=0.1)
    assert human.speed == pytest.approx(av.speed)


def test_descriptions(traffic: LoadedScenario) -> None:
    """Humans, AVs, then the others; driven vehicles by their rear axle."""
    setup = support.setup_of(traffic, [support.BESIDE])
    assert [item.id for item in setup.descriptions[:2]] == ['hv0', 'av0']
    assert [item.role for item in setup.descriptions[:2]] == [Role.HUMAN, Role.AUTONOMOUS]
    assert setup.descriptions[2:] == setup.obstacles.descriptions
    assert {item.reference_point for item in setup.descriptions[:2]} == {'rear_axle'}
    assert {item.rear_to_center for item in setup.descriptions[2:]} == {0.0}
    assert setup.descriptions[0].rear_to_center == pytest.approx(REACH)


def test_step_of_the_run_divides_the_scenarios(cut_in: LoadedScenario) -> None:
    """CRG 14 for the scenario's 0.1 s: 30 Hz are three steps a tick."""
    assert support.setup_of(cut_in).scheduler.steps_per_tick == 10
    assert support.setup_of(cut_in, rate=30.0).scheduler.steps_per_tick == 3


def test_run_without_any_vehicle_is_refused(cut_in: LoadedScenario) -> None:
    """No human, no planning problem, no traffic, no obstacle: nothing would move."""
    with pytest.raises(InputError, match='the game is empty'):
        support.setup_of(replace(cut_in, planning_problems=()))


def test_timeline_is_read_beside_the_game() -> None:
    """A scripted driver's file is found from any directory; its text is kept."""
    setup = build_setup(load_game(scenarios_directory() / 'cut_in.yaml'))
    assert setup.humans[0].driver == 'keys:cut_in.keys.yaml'
    assert 'throttle' in setup.humans[0].timeline
    missing = replace(setup.game, humans=(
        replace(setup.game.humans[0], driver='keys:no.keys.yaml'),))
    with pytest.raises(InputError, match=r'no\.keys\.yaml'):
        build_setup(missing)


def test_unknown_driver_is_refused(cut_in: LoadedScenario) -> None:
    """The message lists the possible forms."""
    with pytest.raises(InputError, match='no driver source .telepathy.*keys:FILE'):
        support.setup_of(cut_in, [HumanSpec('hv0', 'telepathy', spawn=support.BESIDE.spawn)])


def test_scenario_is_named_by_its_digest(cut_in: LoadedScenario) -> None:
    """SHA-256 of the text: a planner can tell whether it has the right scenario."""
    content = Path(cut_in.source).read_bytes()
    assert scenario_digest(content.decode('utf-8')) == hashlib.sha256(content).hexdigest()
    assert load_scenario(Path(cut_in.source)).sha256 == scenario_digest(content.decode('utf-8'))
