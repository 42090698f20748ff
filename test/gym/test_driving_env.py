# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Episodes: they equal runs of the same game."""

from copy import deepcopy
from dataclasses import replace
import math
from pathlib import Path

from commonroad.common.util import Interval
from commonroad.planning.goal import GoalRegion
from commonroad.scenario.state import CustomState
from crgame_ros.analysis.criticality.criticality import COLUMN, MEASURES, TickMeasures
from crgame_ros.drivability.monitor import DrivabilityMonitor
from crgame_ros.errors import CrgameError
from crgame_ros.game.game import LaneletSpawn, load_game
from crgame_ros.gym.driving_env import DrivingEnv
from crgame_ros.gym.driving_game import DrivingGame
from crgame_ros.gym.episode_setups import EpisodeSetups, StartVariation
from crgame_ros.gym.games_together import GamesTogether
from crgame_ros.gym.reward import Decision, Reward
from crgame_ros.policy.route_guide import RoutePlace
from crgame_ros.simulation.observer import drivability_monitor
from crgame_ros.simulation.offline import observed_run, OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from policies import change_lanes, follow_lane, HERE, LANES
import pytest

SCENARIOS = Path(__file__).resolve().parents[2] / 'scenarios'
POLICY = f'policy:{HERE}:acceleration'


def episode(env: DrivingEnv, seed: int, steps: int) -> list[tuple[object, ...]]:
    """Drive by the policy of the tests."""
    seen, _ = env.reset(seed=seed)
    drive = []
    for _ in range(steps):
        seen, reward, terminated, truncated, info = env.step(follow_lane(seen))
        drive.append((*(values.tobytes() for values in seen.values()), reward, terminated,
                      truncated, info['time_s'], info['hit']))
        if terminated or truncated:
            break
    return drive


@pytest.mark.matrix('fog')
@pytest.mark.slow
@pytest.mark.parametrize('game', ['cut_in', 'dense_merge', 'fog'])
def test_equal_seeds_give_equal_episodes_and_others_do_not(game: str) -> None:
    env = DrivingEnv(game=game, vary={'speed': 2.0})
    first = episode(env, 7, 15)
    assert episode(env, 8, 15) != first
    assert episode(env, 7, 15) == first
    assert episode(DrivingEnv(game=game, vary={'speed': 2.0}), 7, 15) == first


def test_vehicles_of_an_episode_are_those_of_its_seed_whatever_was_driven_before() -> None:
    keywords = {'game': 'dense_merge', 'duration': 1.0, 'reward': {'ttc': -1.0, 'drac': -0.1},
                'observation': {'parts': ['objects', 'lidar'], 'objects': 40}}
    used, fresh, two = (DrivingEnv(**keywords), DrivingEnv(**keywords),
                        GamesTogether(2, **keywords))
    episode_of_others = used.reset(seed=1)
    together = two.reset(seed=[1, 2])
    for part, values in episode_of_others[0].items():
        assert (together[0][part][0] == values).all()
    first, second = used.reset(seed=2), fresh.reset(seed=2)
    setup = used.agent.game.setup
    # Seed 2 has its trucks in other slots than the game as it is.
    assert setup.descriptions != used.agent.setups.base.descriptions
    others = [item for item in setup.descriptions if item.id != 'av0']
    still = np.zeros(2, np.float32)
    for _ in range(5):
        for part, values in first[0].items():
            assert (values == second[0][part]).all()
            assert (values == together[0][part][1]).all()
        rows = first[0]['objects']
        near = rows[rows[:, 0] > 0.5]
        around = used.agent.seats[0].around
        nearest = np.argsort(np.hypot(*(around.poses[:, :2] - around.state[:2]).T))[:len(near)]
        assert near[:, 6] == pytest.approx([others[index].shape.length for index in nearest])
        first, second = used.step(still), fresh.step(still)
        assert first[1:] == second[1:]
        together = two.step(np.zeros((2, 2), np.float32))
        assert together[1][1] == first[1]


@pytest.mark.exhaustive
def test_shared_placements_of_traffic_begin_as_if_unused() -> None:
    env = DrivingEnv(game='dense_merge', worlds=1)
    first = episode(env, 1, 10)
    episode(env, 2, 10)
    assert episode(env, 1, 10) == first


def test_a_placement_that_is_kept_drives_as_a_new_one() -> None:
    """There are so many that no two seeds share one."""
    kept = DrivingEnv(game='dense_merge', worlds=2**62)
    assert episode(kept, 1, 10) == episode(DrivingEnv(game='dense_merge'), 1, 10)


def _run(seat: str) -> OfflineResult:
    game = load_game(SCENARIOS / 'lane_change.yaml')
    assert game.avs is not None
    if seat == 'av0':
        game = replace(game, avs=(replace(game.avs[0], planner=POLICY),))
    else:
        game = replace(game, humans=(replace(game.humans[0], driver=POLICY),))
    return run_offline(build_setup(game), duration_s=4.0)


@pytest.mark.parametrize('seat', ['av0', 'hv0'])
def test_a_policy_drives_in_a_run_as_it_did_in_the_environment(seat: str) -> None:
    env = DrivingEnv(game='lane_change', seat=seat)
    seen, _ = env.reset(seed=0)
    states = []
    for _ in range(40):
        seen = env.step(follow_lane(seen))[0]
        states.append(env.agent.game.simulation.states)
    run = _run(seat).vehicle_states[10::10]
    # A request carries velocities as vectors: the two differ only by rounding.
    assert np.abs(np.array(states) - run)[:, :, :4].max() < 1e-6


def test_manoeuvres_of_a_policy_are_the_same_in_a_run_as_in_the_environment() -> None:
    env = DrivingEnv(game='cut_in', action='manoeuvre', observation=LANES, ticks=5)
    seen, _ = env.reset(seed=0)
    states = []
    for _ in range(14):
        seen = env.step(change_lanes(seen))[0]
        states.append(env.agent.game.simulation.states)
    game = load_game(SCENARIOS / 'cut_in.yaml')
    assert game.avs is not None
    game = replace(game, avs=(replace(game.avs[0], planner=f'policy:{HERE}:manoeuvres'),))
    run = run_offline(build_setup(game), duration_s=7.0)
    assert np.abs(np.array(states) - run.vehicle_states[50::50])[:, :, :4].max() < 1e-6
    # It has changed lanes.
    assert abs(states[-1][1].y - states[0][1].y) > 3.0


@pytest.mark.matrix('parked_cars-av0', 'dense_merge-av0')
@pytest.mark.slow
@pytest.mark.parametrize(('game', 'seat'), [
    ('two_avs', 'hv0'), ('parked_cars', 'av0'), ('occluded_pedestrian', 'hv0'),
    ('dense_merge', 'av0')])
def test_contacts_and_the_road_are_judged_as_the_monitor_does(game: str, seat: str) -> None:
    setups = EpisodeSetups(load_game(SCENARIOS / f'{game}.yaml'), StartVariation(), 1)
    drive = DrivingGame(setups.base, (seat,), 'acceleration', 1)
    monitors: list[DrivabilityMonitor] = []

    class Recorder:
        """Keep every state that the engine steps through."""

        def __init__(self) -> None:
            self.step = drive.simulation.step
            drive.simulation.step = self.stepped  # type: ignore[method-assign]
            self.hit: set[str] = set()
            self.off = False

        def stepped(self, *given: object) -> object:
            result = self.step(*given)  # type: ignore[arg-type]
            simulation = drive.simulation
            monitors[0].observe(result.n, simulation.scheduler.since_tick_s(result.n),
                                np.array(simulation.states), result.objects)
            verdict = monitors[0].verdicts[drive.seats[0].row]
            self.hit |= set(verdict.hit)
            self.off |= verdict.off_road
            return result

    found = 0
    for seed, action in enumerate(((1.0, 0.3), (1.0, -0.3), (0.5, 0.0), (1.0, 0.05))):
        drive.begin(setups.make(seed, {}))
        monitors[:] = [drivability_monitor(observed_run(drive.setup))]
        monitors[0].set_objects(drive.objects)
        for _ in range(25):
            recorder = Recorder()
            drive.act({seat: np.array(action)})
            del drive.simulation.step
            assert set(drive.seats[0].hit) == recorder.hit
            assert drive.off_road() == [recorder.off]
            found += len(recorder.hit) + recorder.off
    assert found


def test_an_episode_ends_by_contact_road_and_time_as_gymnasium_means_it() -> None:
    still = np.array((0.0, 0.0), np.float32)
    env = DrivingEnv(game='cut_in', reward={'collision': -3.0, 'progress': 0.0})
    env.reset(seed=0)
    for _ in range(200):
        _, reward, terminated, truncated, info = env.step(still)
        if terminated or truncated:
            break
    # An agent at constant speed runs into the human that has cut in and stops.
    assert (terminated, truncated, reward, info['hit']) == (True, False, -3.0, 'hv0')
    env = DrivingEnv(game='cut_in', ends=['goal'], duration=12.0)
    env.reset(seed=0)
    ends = [env.step(still)[2:4] for _ in range(120)]
    assert ends == [(False, False)] * 119 + [(False, True)]
    env = DrivingEnv(game='cut_in', reward={'off_road': -1.0})
    env.reset(seed=0)
    for _ in range(40):
        _, reward, terminated, _, info = env.step(np.array((0.0, 1.0), np.float32))
        if terminated:
            break
    assert (terminated, info['off_road'], reward) == (True, True, -1.0)


def test_a_vehicle_that_begins_off_the_road_leaves_it_further_off() -> None:
    game = load_game(SCENARIOS / 'cut_in.yaml')
    # Half a car beside the road's left edge.
    beside = replace(game.humans[0], driver='idle', spawn=LaneletSpawn(13, 234.0, 2.0, 15.0))
    env = DrivingEnv(seat='hv0', game=replace(game, humans=(beside,)))
    env.reset(seed=0)
    for _ in range(5):
        assert not env.step(np.zeros(2, np.float32))[2]
    # It returns to the road and then leaves it again: now that counts at once.
    for turn in (*[-0.5] * 4, *[0.0] * 8, *[0.5] * 4):
        assert not env.step(np.array((0.0, turn), np.float32))[2]
    assert env.agent.seats[0].overhang == 0.0
    over = [env.step(np.array((0.0, 0.4), np.float32))[2] for _ in range(30)]
    assert True in over
    env.reset(seed=0)
    over = [env.step(np.array((0.0, 0.4), np.float32))[2] for _ in range(30)]
    assert True in over


def test_the_goal_of_the_planning_problem_ends_an_episode() -> None:
    env = DrivingEnv(game='t_junction', drivers={'hv0': 'idle'}, reward={'goal': 5.0})
    seen, _ = env.reset(seed=0)
    distances = []
    for _ in range(150):
        distances.append(float(seen['state'][8]))
        seen, reward, terminated, truncated, info = env.step(follow_lane(seen))
        if terminated or truncated:
            break
    assert (terminated, truncated, info['goal'], reward) == (True, False, True, 5.0)
    # The vehicle's centre has come into the goal's area; the rear axle is 1.4 m behind it.
    assert float(seen['state'][8]) < 1.5
    assert (np.diff(distances) < 0.0).all()
    position = env.agent.game.setup.avs[0].planning_problem.goal.state_list[0].position
    state = env.agent.seats[0].state
    assert position.contains_point(np.array(state.center(1.4227)))
    assert not position.contains_point(np.array(env.agent.seats[0].before[0].center(1.4227)))


def test_a_goal_that_holds_between_two_decisions_is_reached() -> None:
    game = load_game(SCENARIOS / 't_junction.yaml')
    setups = EpisodeSetups(game, StartVariation())
    av = setups.base.avs[0]
    problem = deepcopy(av.planning_problem)
    # Anywhere, at the steps 30 and 31, which are no multiples of 4.
    problem.goal = GoalRegion([CustomState(time_step=Interval(30, 31))])
    setup = replace(setups.base, avs=(replace(av, planning_problem=problem),))
    drive = DrivingGame(setup, ('av0',), 'acceleration', 4)
    drive.begin(setup)
    reached = []
    for _ in range(9):
        drive.act({'av0': np.zeros(2)})
        reached.append(drive.seats[0].goal)
    assert reached == [False] * 7 + [True, False]


def test_at_a_contact_braking_terms_are_their_bounds() -> None:
    worst = np.full((1, len(MEASURES)), np.nan)
    worst[0, [COLUMN['drac'], COLUMN['a_req']]] = math.inf, -math.inf
    measures = TickMeasures(0, np.array([1]), worst, None)
    state = VehicleState(0.0, 0.0, 0.0, 10.0)
    place = RoutePlace(0.0, 0.0, 0.0, 0.0, 10.0, 1000.0, 0.0)
    reward, terms = Reward({'drac': 0.0, 'a_req': -1.0}).compute(
        Decision(0.1, state, state, place, True, False, False, measures))
    assert (reward, terms) == (-20.0, {'drac': 20.0, 'a_req': 20.0})


def test_rewards_are_what_the_states_say() -> None:
    env = DrivingEnv(game='lane_change', reward={
        'progress': 1.0, 'speed': 2.0, 'acceleration': 0.5, 'jerk': 0.25, 'time': -1.0,
        'lateral_acceleration': 0.1, 'ttc_2d': 0.0, 'min_distance': 0.0})
    env.reset(seed=0)
    before = env.agent.seats[0].state
    for action in ((0.5, 0.0), (-0.5, 0.05), (0.0, 0.0)):
        _, reward, _, _, info = env.step(np.array(action, np.float32))
        state = env.agent.seats[0].state
        terms = info['terms']
        driven = float(np.hypot(state.x - before.x, state.y - before.y))
        assert terms['progress'] == pytest.approx(driven, rel=0.01)
        assert terms['jerk'] == pytest.approx(
            ((state.acceleration - before.acceleration) / 0.1) ** 2)
        assert reward == pytest.approx(
            terms['progress'] + 2.0 * min(1.0, state.speed / env.agent.seats[0].place.speed_limit)
            + 0.5 * state.acceleration ** 2 + 0.25 * terms['jerk'] - 0.1
            + 0.1 * (state.speed * state.yaw_rate) ** 2)
        before = state


def test_a_refused_plan_is_told_and_not_driven() -> None:
    env = DrivingEnv(game='cut_in', action='plan')
    env.reset(seed=0)
    backwards = np.zeros((10, 4), np.float32)
    backwards[:, 0] = -50.0
    info = env.step(backwards)[4]
    assert 'state 1' in info['refusal']
    state = env.agent.seats[0].state
    assert state.acceleration < 0.0
    assert state.speed < 20.0


def test_a_scenario_alone_makes_an_environment() -> None:
    env = DrivingEnv(scenario=SCENARIOS / 'ZAM_Merge-1_1_T-1.xml')
    env.reset(seed=0)
    assert env.agent.game.setup.vehicle_ids == ('av0',)
    human = DrivingEnv(seat='hv0', scenario=SCENARIOS / 'ZAM_Merge-1_1_T-1.xml')
    human.reset(seed=0)
    assert human.agent.game.setup.vehicle_ids == ('hv0', 'av0')
    assert human.step(np.zeros(2, np.float32))[4]['time_s'] == pytest.approx(0.1)


def test_steps_before_a_reset_and_actions_that_are_none_are_refused() -> None:
    env = DrivingEnv(game='cut_in')
    with pytest.raises(CrgameError, match='reset'):
        env.step(np.zeros(2, np.float32))
    env.reset(seed=0)
    with pytest.raises(CrgameError, match='finite'):
        env.step(np.full(2, np.nan, np.float32))
