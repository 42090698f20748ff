# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whole offline runs with the game's own objects and agents, beside events and recordings."""

from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.game.game import parse_game
from crgame_ros.game.objects import Role
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.recorded_game import with_recorded_events
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup, Setup
import numpy as np
from numpy.typing import NDArray
import pytest
import yaml


def living(name: str, **changes: Any) -> Setup:
    """Load a game and change it."""
    values = yaml.safe_load((scenarios_directory() / f'{name}.yaml').read_text())
    return build_setup(parse_game(values | changes, name, scenarios_directory()))


def speeds(result: OfflineResult) -> NDArray[np.float64]:
    """Return the agents' (ticks, A) speeds; NaN where absent."""
    columns = result.setup.agent_columns
    return np.hypot(*np.moveaxis(result.object_velocities[:, columns, :2], -1, 0))


@pytest.mark.exhaustive
def test_agents_obey_the_speed_limit_of_an_event() -> None:
    """After it agents slow down to the limit, within drivers' tolerance; without it they don't."""
    event = {'name': 'slow', 'speed_limit': {'speed': 8.0}, 'when': {'time': 2.0}}
    traffic = {'agents': 8, 'speed_spread': 0.0}
    limited = speeds(run_offline(living('cut_in', traffic=traffic, events=[event])))
    free = speeds(run_offline(living('cut_in', traffic=traffic)))
    assert np.isfinite(limited[:20]).sum() > 100
    np.testing.assert_array_equal(limited[:20], free[:20])
    assert np.nanmax(limited[-1]) < 8.5 < 15.0 < np.nanmax(free[-1])


def test_recorded_vehicles_react_but_those_of_events() -> None:
    """With `reactive` recorded cars become agents with their ids; cars of events stay recorded."""
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
    """A skip across a single lane: agents that reach it stand behind it without contact."""
    skip = {'id': 'skip', 'kind': 'static', 'at': [560.0, -1.75, 0.0], 'size': [3.0, 3.2]}
    setup = living('crossing', humans=[], objects=[skip], events=[],
                   traffic={'agents': 10, 'seed': 4})
    result = run_offline(setup)
    poses = result.object_poses[-1, setup.agent_columns]
    behind = (np.abs(poses[:, 1] + 1.75) < 1.0) & (poses[:, 0] < 560.0) & (poses[:, 0] > 530.0)
    assert behind.any()
    # The first agent stands; the agents after it roll up.
    assert speeds(result)[-1, behind][np.argmax(poses[behind, 0])] < 0.1
    front = poses[behind, 0].max() + 0.5 * 4.5
    assert 555.0 < front < 558.5


def test_ids_of_objects_are_their_own() -> None:
    """An id that a vehicle or an obstacle already has is refused with its name."""
    for name in ('hv0', 'av1', 'o200', 't3', 'e_stop'):
        with pytest.raises(InputError, match=f"objects.0.: \"id\" is '{name}'"):
            living('cut_in', objects=[{'id': name, 'kind': 'static', 'at': [0.0, 0.0, 0.0]}])


def test_a_map_that_is_not_there_is_refused() -> None:
    """Before anything starts, in one line with the file's name."""
    with pytest.raises(InputError, match='nowhere.yaml: cannot read the map file'):
        living('cut_in', occupancy='nowhere.yaml')


def test_the_written_game_has_objects_traffic_and_map() -> None:
    """The game that a run writes beside its recording gives the same run."""
    setup = living('blocked_lane')
    values = yaml.safe_load(setup.game.dump())
    again = build_setup(parse_game(values, 'written', scenarios_directory()))
    assert again.descriptions == setup.descriptions
    hashes = [run_offline(item, duration_s=3.0).object_poses.tobytes() for item in (setup, again)]
    assert hashes[0] == hashes[1]


@pytest.mark.exhaustive
def test_agents_drive_otherwise_by_an_event() -> None:
    """
    One hurries, then all crawl; until each event all is as without it, to the last bit.

    The run repeats, and again with the recorded events as conditions.
    """
    events = [{'name': 'hurry', 'traffic': {'agent': 't1', 'desired_speed': 30.0},
               'when': {'time': 2.0}},
              {'name': 'crawl', 'traffic': {'agent': 'all', 'speed_factor': 0.3}}]
    traffic = {'agents': 8, 'speed_spread': 0.0}

    def run(told: list[dict[str, Any]], *triggers: tuple[int, str]) -> OfflineResult:
        setup = living('cut_in', humans=[], avs=[], traffic=traffic, events=told)
        return run_offline(setup, duration_s=18.0, triggers=triggers)

    free, once = run([]), run(events)
    twice, again = (run(events, (700, 'crawl')) for _ in range(2))
    assert twice.state_hash == again.state_hash
    assert twice.object_poses.tobytes() == again.object_poses.tobytes()
    np.testing.assert_array_equal(speeds(once)[:21], speeds(free)[:21])
    np.testing.assert_array_equal(speeds(twice)[:71], speeds(once)[:71])
    column = [item.id for item in once.setup.traffic.descriptions].index('t1')
    # A truck, whose 80 km/h the event overrides; then 0.3 of 100 km/h.
    assert np.nanmax(speeds(free)[:, column]) < 22.3 < 25.0 < np.nanmax(speeds(once)[:, column])
    assert np.nanmax(speeds(twice)[-1]) < 0.3 * 100.0 / 3.6 + 0.1
    recorded = with_recorded_events(twice.setup.game, twice.fired)
    repeated = run_offline(build_setup(recorded), duration_s=18.0)
    assert repeated.object_poses.tobytes() == twice.object_poses.tobytes()


def test_an_event_waits_for_its_agent() -> None:
    """It is due from the start, and takes effect when the first agent arrives."""
    setup = living('cut_in', humans=[], avs=[], traffic={'flow': 600.0, 'capacity': 3}, events=[
        {'name': 'stop', 'traffic': {'agent': 't0', 'desired_speed': 1.0}, 'when': {'time': 0.0}}])
    result = run_offline(setup, duration_s=8.0)
    column = setup.agent_columns[0]
    there = np.isfinite(result.object_poses[:, column, 0])
    first = int(there.argmax())
    assert first > 1 and not there[:first].any()
    assert [(event.name, event.k) for event in result.fired] == [('stop', first)]
    with pytest.raises(InputError, match='trigger at step 15: t0 is not on the road'):
        run_offline(setup, duration_s=2.0, triggers=[(15, 'stop')])


@pytest.mark.parametrize(('traffic', 'change', 'message'), [
    ({'agents': 2}, {'agent': 't7', 'politeness': 0},
     'event a: there is no agent "t7"; there is t0, t1; use all for all of them'),
    ({'agents': 2}, {'agent': 'hv0', 'politeness': 0}, 'there is no agent "hv0"'),
    (None, {'agent': 'all', 'politeness': 0}, 'the game has no traffic; add "traffic"'),
    ({'agents': 2}, {'agent': 't0', 'options': {'headway': 1}},
     'event a: options of car-following model acc: "headway" is unknown; allowed are: time_gap'),
    ({'agents': 2}, {'agent': 't0', 'options': {'time_gap': 0}},
     'event a: options of car-following model acc: "time_gap" is 0; give a number above 0'),
], ids=['no such agent', 'no agent', 'no traffic', 'no such option', 'no good value'])
def test_changes_that_cannot_be_are_refused(traffic: Any, change: dict[str, Any],
                                            message: str) -> None:
    """Before the run, in one line with the event's name."""
    with pytest.raises(InputError, match=message) as raised:
        living('cut_in', traffic=traffic, events=[{'name': 'a', 'traffic': change}])
    assert '\n' not in str(raised.value)
