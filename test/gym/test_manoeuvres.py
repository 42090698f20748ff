# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Manoeuvres with their mask; scaled observations within their bounds."""

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.gym.driving_env import DrivingEnv
from crgame_ros.policy.actions import MANOEUVRES
from crgame_ros.policy.manoeuvres import FASTER, KEEP, LEFT, RIGHT, SLOWER
import numpy as np
import pytest


@pytest.mark.parametrize('game', ['cut_in', 'merge', 'lane_change', 't_junction'])
def test_a_lane_is_masked_just_where_the_map_has_none(game: str) -> None:
    env = DrivingEnv(game=game, action='manoeuvre', ticks=5, ends=(), duration=15.0)
    network = env.agent.game.setup.loaded.scenario.lanelet_network
    random, compared = np.random.default_rng(1), 0
    _, info = env.reset(seed=1)
    for _ in range(25):
        mask = info['action_mask'].astype(bool)
        assert (env.action_masks() == mask).all()
        seat = env.agent.seats[0]
        assert seat.manoeuvres is not None
        found = network.find_lanelet_by_position([np.array(seat.state[:2])])[0]
        place = seat.manoeuvres._locate(seat.state)
        ahead = seat.manoeuvres._driving.path.pose_at(place.s + np.array([0.0, 130.0]))
        lanes = [network.find_lanelet_by_position([point[:2]])[0] for point in ahead]
        # In the middle of one lane that goes on, CommonRoad's own neighbours are the truth.
        if len(found) == 1 and lanes == [found, found] and abs(place.d) < 0.2:
            lanelet = network.find_lanelet_by_id(found[0])
            assert mask[LEFT] == bool(lanelet.adj_left and lanelet.adj_left_same_direction)
            assert mask[RIGHT] == bool(lanelet.adj_right and lanelet.adj_right_same_direction)
            compared += 1
        action = int(random.choice(np.flatnonzero(mask)))
        _, _, terminated, truncated, info = env.step(action)
        assert 'refusal' not in info
        if terminated or truncated:
            _, info = env.reset()
    assert compared or game not in ('cut_in', 'merge')


def test_a_masked_manoeuvre_is_refused_and_the_vehicle_keeps_on() -> None:
    kept, masked = (DrivingEnv(game='lane_change', action='manoeuvre') for _ in range(2))
    info = kept.reset(seed=0)[1]
    masked.reset(seed=0)
    gone = int(np.flatnonzero(info['action_mask'] == 0)[0])
    first, second = kept.step(KEEP), masked.step(gone)
    for part, values in first[0].items():
        assert (values == second[0][part]).all()
    assert 'refusal' not in first[4]
    assert second[4]['refusal'] == f'the manoeuvre "{MANOEUVRES[gone]}" is masked'


def test_manoeuvres_end_in_the_middle_of_the_lane_and_at_the_speed() -> None:
    env = DrivingEnv(game='cut_in', action='manoeuvre', ticks=5, drivers={'hv0': 'idle'}, ends=())
    info = env.reset(seed=0)[1]
    side = LEFT if info['action_mask'][LEFT] else RIGHT
    start = env.agent.seats[0].state
    network = env.agent.game.setup.loaded.scenario.lanelet_network
    own = network.find_lanelet_by_id(network.find_lanelet_by_position([np.array(start[:2])])[0][0])
    beside = network.find_lanelet_by_id(own.adj_left if side == LEFT else own.adj_right)
    env.step(side)
    # While the change is under way, there is no second one; back is possible.
    assert env.action_masks()[side] == 0
    assert env.action_masks()[RIGHT if side == LEFT else LEFT] == 1
    env.step(SLOWER)
    for _ in range(16):
        env.step(KEEP)
    state = env.agent.seats[0].state
    middle = beside.center_vertices
    across = np.interp(state.x, middle[:, 0], middle[:, 1])
    # The motorway runs along the x-axis.
    assert state.y == pytest.approx(across, abs=0.1)
    assert state.speed == pytest.approx(start.speed - 2.0, abs=0.05)
    for _ in range(2):
        env.step(FASTER)
    for _ in range(6):
        env.step(KEEP)
    assert env.agent.seats[0].state.speed == pytest.approx(start.speed + 2.0, abs=0.05)


def test_what_is_no_manoeuvre_and_has_no_mask_is_refused() -> None:
    env = DrivingEnv(game='cut_in', action='manoeuvre')
    env.reset(seed=0)
    for action in (5, -1, 1.5, np.zeros(2)):
        with pytest.raises(CrgameError, match='manoeuvre'):
            env.step(action)  # type: ignore[arg-type]
    env = DrivingEnv(game='cut_in')
    env.reset(seed=0)
    with pytest.raises(InputError, match='use the action manoeuvre'):
        env.action_masks()


@pytest.mark.slow
def test_scaled_observations_stay_within_their_bounds() -> None:
    random = np.random.default_rng(3)
    observation = {'parts': ['state', 'route', 'objects', 'lidar', 'image'], 'scaled': True,
                   'image_size': 16, 'history': {'objects': 2, 'image': 2}}
    used = np.zeros(9)
    for game, seat in (('cut_in', 'av0'), ('dense_merge', 'av0'), ('intersection', 'hv0'),
                       ('fog', 'av0'), ('lane_change', 'hv0')):
        env = DrivingEnv(game=game, seat=seat, observation=observation, worlds=1, ends=(),
                         duration=6.0, vary={'speed': 20.0})
        for part, space in env.observation_space.items():
            if part != 'image':
                assert (space.low.min(), space.high.max()) in ((-1.0, 1.0), (0.0, 1.0))
        for seed in range(2):
            seen, _ = env.reset(seed=seed)
            ended = False
            while not ended:
                assert seen in env.observation_space
                used = np.maximum(used, np.abs(seen['state']))
                seen, _, _, ended, _ = env.step(random.uniform(-1, 1, 2).astype(np.float32))
    # Each number makes use of its range; the bends are those of a motorway.
    assert (used > 0.01).all()
