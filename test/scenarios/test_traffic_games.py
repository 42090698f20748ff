# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The games with traffic: agents make room, swerve, and react to the human."""

from pathlib import Path
from typing import Any

from crgame_ros.paths import scenarios_directory
from crgame_ros.simulation.offline import OfflineResult
from engine_games_support import (
    agents,
    Array,
    column,
    distances,
    play,
    played,
    speeds,
    STEPS_PER_TICK,
    TICK_S,
    touching,
    without_human,
)
import numpy as np
import pytest
import shapely

# They share the games that are played as they are.
pytestmark = pytest.mark.xdist_group('scenarios/games')

# The time at which the human brakes after merging in a test [s].
BRAKES_S = 15.0


def _selfish(values: dict[str, Any]) -> None:
    values['traffic']['cooperative'] = False


def _no_changes(values: dict[str, Any]) -> None:
    values['traffic']['lane_changes'] = False


def _crawling_s(result: OfflineResult) -> float:
    """Return the total time of agents on the acceleration lane below 5 m/s [s]."""
    poses, speed = agents(result)
    lane = (poses[..., 1] < -3.75) & (poses[..., 0] > 0.0) & (poses[..., 0] < 300.0)
    return float((lane & (speed < 5.0)).sum()) * TICK_S


@pytest.mark.exhaustive
def test_courtesy_keeps_the_acceleration_lane_moving() -> None:
    """Without courtesy some crawl to its end; without lane changes all wait there for good."""
    waiting = [_crawling_s(played('dense_merge')), _crawling_s(play('dense_merge', _selfish)),
               _crawling_s(play('dense_merge', _no_changes))]
    assert waiting[0] < 2.0
    assert waiting[1] > waiting[0]
    assert waiting[2] > waiting[1] + 10.0


@pytest.mark.exhaustive
def test_agents_react_to_how_the_human_drives(tmp_path: Path) -> None:
    """
    The human brakes to a stop after merging: followers brake harder, leaders are unaffected.

    Until then all drive as in the game, to the last bit.
    """
    lines = (scenarios_directory() / 'dense_merge.joy.yaml').read_text('utf-8').splitlines()
    points = [line for line in lines if line.startswith('    - ')
              and float(line.split('[')[1].split(',')[0]) <= BRAKES_S]
    head = [line for line in lines if not line.startswith('    - ')]
    points.append(f'    - [{BRAKES_S + 0.5}, 0.0, 0.5, 0.0]')
    script = tmp_path / 'brake.yaml'
    script.write_text('\n'.join(head + points) + '\n', 'utf-8')

    def braking(values: dict[str, Any]) -> None:
        values['humans'][0]['driver'] = f'joy:{script}'

    driven, braked = played('dense_merge'), play('dense_merge', braking)
    assert speeds(braked, 'hv0')[-1] == 0.0
    assert touching(braked) == []
    (poses, speed), (others, other_speed) = agents(driven), agents(braked)
    now = round(BRAKES_S / TICK_S)
    assert poses[:now].tobytes() == others[:now].tobytes()
    human = driven.states_of('hv0')[now * STEPS_PER_TICK, 0]
    harder = np.diff(speed, axis=0)[now:now + 100] - np.diff(other_speed, axis=0)[now:now + 100]
    behind = (poses[now, :, 0] < human) & (poses[now, :, 0] > human - 300.0)
    ahead = poses[now, :, 0] > human + 100.0
    assert behind.sum() >= 3
    assert ahead.sum() >= 3
    assert np.nanmax(harder[:, behind]) / TICK_S > 2.0
    assert np.nanmax(np.abs(harder[:, ahead])) == 0.0


def _no_swerve(values: dict[str, Any]) -> None:
    values['traffic']['swerve'] = False


def _along(result: OfflineResult, poses: Array) -> tuple[Array, Array]:
    """Project poses on the way of the human's lane: arc length and offset to the left [m]."""
    network = result.setup.loaded.scenario.lanelet_network
    line = np.concatenate([network.find_lanelet_by_id(id_).center_vertices for id_ in (11, 21)])
    way = shapely.LineString(line)
    points = shapely.points(poses[..., :2])
    s: Array = shapely.line_locate_point(way, points)
    foot = shapely.get_coordinates(shapely.line_interpolate_point(way, s)).reshape(*s.shape, 2)
    yaw = shapely.get_coordinates(shapely.line_interpolate_point(
        way, s + 0.5)).reshape(*s.shape, 2) - foot
    aside = poses[..., :2] - foot
    return s, np.sign(yaw[..., 0] * aside[..., 1] - yaw[..., 1] * aside[..., 0]) * np.hypot(
        aside[..., 0], aside[..., 1])


def _passing(result: OfflineResult) -> list[str]:
    """List the agents that drive past the skip in its lane."""
    poses, _ = agents(result)
    there = np.isfinite(poses[..., 0])
    s, d = _along(result, np.where(there[..., None], poses, 1e4))
    own = there & (np.abs(d) < 1.5)
    at = _along(result, result.object_poses[0, column(result, 'skip')])[0]
    assert result.setup.traffic is not None
    passing = []
    for agent, description in enumerate(result.setup.traffic.descriptions):
        before = np.flatnonzero(own[:, agent] & (s[:, agent] < at - 20.0))
        behind = np.flatnonzero(own[:, agent] & (s[:, agent] > at + 20.0))
        # A slot that left the map is reused by an agent that enters at its other end.
        if len(before) and len(behind) and before[0] < behind[-1]:
            passing.append(description.id)
    return passing


@pytest.mark.exhaustive
def test_agents_swerve_around_the_skip_with_the_stated_clearance() -> None:
    """
    The band keeps 0.5 m between the skip and a vehicle 2 m wide (1.8 m: 0.1 m more).

    It bends about the middle of the lane, so the corner of a turned vehicle takes a little back.
    The room left in the lane is 3.75 m - 1.2 m, so no agent crosses the middle of the road.
    """
    result = played('blocked_lane')
    passing = _passing(result)
    at = _along(result, result.object_poses[0, column(result, 'skip')])[0]
    assert len(passing) >= 3
    for id_ in passing:
        assert 0.5 < np.nanmin(distances(result, id_, 'skip')) < 0.75
        poses = result.object_poses[:, column(result, id_)]
        poses = poses[np.isfinite(poses[:, 0])]
        s, d = _along(result, poses)
        assert 0.6 < d.max() < 0.5 * (3.75 - 1.8)
        assert np.abs(d[(s < at - 100.0) | (s > at + 100.0)]).max() < 0.05
    # The human takes more room: the vehicle's left side is beyond the middle of the road.
    _, d = _along(result, result.states_of('hv0'))
    assert d.max() + 0.5 * 1.61 > 0.5 * 3.75 + 0.5


@pytest.mark.exhaustive
def test_agents_that_do_not_swerve_queue_behind_the_skip() -> None:
    """No agent passes; the first stands behind the skip, the others behind the first."""
    result = play('blocked_lane', _no_swerve, without_human)
    assert _passing(result) == []
    poses, speed = agents(result)
    at = _along(result, result.object_poses[0, column(result, 'skip')])[0]
    s, d = _along(result, np.where(np.isfinite(poses), poses, 1e4)[-1])
    queue = (np.abs(d) < 1.0) & (at - 60.0 < s) & (s < at)
    assert queue.sum() >= 2
    assert speed[-1][queue].max() < 0.5
    assert touching(result) == []


@pytest.mark.exhaustive
def test_oncoming_av_gives_way_to_the_human_but_not_to_agents() -> None:
    """Agents pass the skip in their own lane; only the human makes the AV brake there."""
    result, alone = played('blocked_lane'), play('blocked_lane', without_human)
    assert speeds(result, 'av0').min() < 4.0
    assert speeds(alone, 'av0')[30:].min() > 12.0
