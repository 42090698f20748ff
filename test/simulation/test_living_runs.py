# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whole offline runs with objects of the game's own and agents, beside events and recordings."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
import pytest
import yaml

from crgame_ros.errors import InputError
from crgame_ros.paths import scenarios_directory
from crgame_ros.scenario.game_file import dump_game, parse_game
from crgame_ros.scenario.objects import Role
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup, Setup


def living(name: str, **changes: Any) -> Setup:
    """Load a game and change it."""
    values = yaml.safe_load((scenarios_directory() / f'{name}.yaml').read_text())
    return build_setup(parse_game(values | changes, name, scenarios_directory()))


def speeds(result: OfflineResult) -> NDArray[np.float64]:
    """Give the agents' speeds (ticks, A); NaN where absent."""
    columns = result.setup.agent_columns
    return np.hypot(*np.moveaxis(result.object_velocities[:, columns, :2], -1, 0))


def test_agents_obey_the_speed_limit_of_an_event() -> None:
    """After it they slow down to it, up to what drivers take liberties with; without it not."""
    event = {'name': 'slow', 'speed_limit': {'speed': 8.0}, 'when': {'time': 2.0}}
    traffic = {'agents': 8, 'speed_spread': 0.0}
    limited = speeds(run_offline(living('cut_in', traffic=traffic, events=[event])))
    free = speeds(run_offline(living('cut_in', traffic=traffic)))
    assert np.isfinite(limited[:20]).sum() > 100
    np.testing.assert_array_equal(limited[:20], free[:20])
    assert np.nanmax(limited[-1]) < 8.5 < 15.0 < np.nanmax(free[-1])


def test_recorded_vehicles_react_but_those_of_events() -> None:
    """With `reactive` recorded cars become agents under their ids; an event's stays recorded."""
    event = {'name': 'stop', 'brake': {'object': 200, 'deceleration': 4.0}, 'when': {'time': 1.0}}
    recorded = {item.id: item.role for item in living('traffic').descriptions}
    cars = [name for name, role in recorded.items() if role is Role.RECORDED]
    assert len(cars) >= 5 and 'o200' in cars
    for events, kept in ([], set()), ([event], {'o200'}):
        setup = living('traffic', traffic='reactive', events=events)
        roles = {item.id: item.role for item in setup.descriptions}
        assert {name for name in cars if roles[name] is Role.RECORDED} == kept
        assert {name for name in cars if roles[name] is Role.TRAFFIC} == set(cars) - kept
        result = run_offline(setup, duration_s=5.0)
        assert np.isfinite(result.object_poses[0]).all()
        assert np.nanmax(np.hypot(*np.moveaxis(
            np.diff(result.object_poses[..., :2], axis=0), -1, 0))) < 4.5


def test_agents_stop_behind_an_object_of_the_game() -> None:
    """A skip across a single lane: whoever comes up to it stands behind it, short of touching."""
    skip = {'id': 'skip', 'kind': 'static', 'at': [560.0, -1.75, 0.0], 'size': [3.0, 3.2]}
    setup = living('crossing', humans=[], objects=[skip], events=[],
                   traffic={'agents': 10, 'seed': 4})
    result = run_offline(setup)
    poses = result.object_poses[-1, setup.agent_columns]
    behind = (np.abs(poses[:, 1] + 1.75) < 1.0) & (poses[:, 0] < 560.0) & (poses[:, 0] > 530.0)
    assert behind.any()
    # The first one stands; whoever comes after it rolls up.
    assert speeds(result)[-1, behind][np.argmax(poses[behind, 0])] < 0.1
    front = poses[behind, 0].max() + 0.5 * 4.5
    assert 555.0 < front < 558.5


def test_ids_of_objects_are_their_own() -> None:
    """An id that a vehicle or an obstacle has already is refused with its name."""
    for name in ('hv0', 'av1', 'o200', 't3', 'e_stop'):
        with pytest.raises(InputError, match=f"objects.0.: \"id\" is '{name}'"):
            living('cut_in', objects=[{'id': name, 'kind': 'static', 'at': [0.0, 0.0, 0.0]}])


def test_a_map_that_is_not_there_is_refused() -> None:
    """Before anything starts, in one line with the file's name."""
    with pytest.raises(InputError, match='nowhere.yaml: cannot read the map file'):
        living('cut_in', occupancy='nowhere.yaml')


def test_the_written_game_has_objects_traffic_and_map() -> None:
    """What a run writes beside its recording gives the same run."""
    setup = living('blocked_lane')
    values = yaml.safe_load(dump_game(setup.game))
    again = build_setup(parse_game(values, 'written', scenarios_directory()))
    assert again.descriptions == setup.descriptions
    hashes = [run_offline(item, duration_s=3.0).object_poses.tobytes() for item in (setup, again)]
    assert hashes[0] == hashes[1]
