# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The games with perception: an AV brakes late for objects that it sees late."""

from typing import Any

from crgame_ros.simulation.offline import OfflineResult
from engine_games_support import (
    bodies,
    column,
    distances,
    ListeningIdm,
    play,
    played,
    speeds,
    STEPS_PER_TICK,
    strongest_braking,
    TICK_S,
)
import numpy as np
import pytest
import shapely

# They share the games that are played as they are.
pytestmark = pytest.mark.xdist_group('scenarios/games')


def _perfect(values: dict[str, Any]) -> None:
    del values['avs'][0]['perception']


def _listening(values: dict[str, Any]) -> None:
    values['avs'][0]['planner'] = f'{ListeningIdm.__module__}:{ListeningIdm.__name__}'


def _ticks_with_walker() -> list[int]:
    """Return the ticks whose request contained the pedestrian, and forget the requests."""
    ticks = [request.k for request in ListeningIdm.requests if 'walker' in request.obstacle_ids]
    ListeningIdm.requests.clear()
    return ticks


def _line_of_sight(result: OfflineResult) -> list[int]:
    """List the ticks at which anything of the pedestrian can be seen from the front bumper."""
    av = result.setup.avs[0]
    ahead = av.vehicle.rear_to_center + 0.5 * av.vehicle.length
    others = [item.id for item in result.setup.descriptions if item.id not in ('av0', 'walker')]
    walls = shapely.union_all(np.stack([bodies(result, id_) for id_ in others]), axis=0)
    around = np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False)
    circle = 0.35 * np.stack((np.cos(around), np.sin(around)), axis=-1)
    found = []
    walkers = result.object_poses[:, column(result, 'walker'), :2]
    for k, (x, y, yaw) in enumerate(result.states_of('av0')[::STEPS_PER_TICK, :3]):
        eye = np.array([x + ahead * np.cos(yaw), y + ahead * np.sin(yaw)])
        points = walkers[k] + circle
        to = points - eye
        ahead_of = np.abs(np.arctan2(to[:, 1], to[:, 0]) - yaw) < np.pi / 3.0
        near = np.hypot(*to.T) < 80.0
        rays = shapely.linestrings(np.stack((np.broadcast_to(eye, points.shape), points), axis=1))
        if (ahead_of & near & ~shapely.intersects(rays, walls[k])).any():
            found.append(k)
    return found


@pytest.mark.exhaustive
def test_pedestrian_is_known_from_the_first_line_of_sight_on() -> None:
    """
    Never before, and at most two scans later, when a ray of the fan meets the visible part.

    The rays are 120 degrees / 360 apart, 0.12 m at 20 m: less than the pedestrian comes forward
    in a scan and a half at 1.5 m/s. Without perception the very first request has the pedestrian.
    """
    ListeningIdm.requests.clear()
    result = play('occluded_pedestrian', _listening)
    known, visible = _ticks_with_walker(), _line_of_sight(result)
    assert visible[0] <= known[0] <= visible[0] + 2
    # The pedestrian becomes visible when the AV is 20 m away: 2 s at its speed.
    assert 6.0 < known[0] * TICK_S < 8.0
    play('occluded_pedestrian', _listening, _perfect)
    assert _ticks_with_walker()[0] == 0


@pytest.mark.exhaustive
def test_an_av_that_sees_late_brakes_late() -> None:
    """
    Without perception the AV reacts gently to a pedestrian that walks up behind the vans.

    With it, the AV knows of the pedestrian only once visible, has to brake more than twice as
    hard, and still keeps its standstill gap of 2 m.
    """
    seeing, knowing = played('occluded_pedestrian'), play('occluded_pedestrian', _perfect)
    starts = []
    for result in (seeing, knowing):
        braking = np.diff(speeds(result, 'av0')) / TICK_S < -1.5
        starts.append(int(np.argmax(braking)) * TICK_S)
    assert starts[1] + 1.0 < starts[0]
    assert strongest_braking(knowing, 'av0') < 4.0
    assert strongest_braking(seeing, 'av0') > 2.0 * strongest_braking(knowing, 'av0')
    assert distances(seeing, 'av0', 'walker').min() > 1.9
    assert distances(seeing, 'hv0', 'walker').min() > 1.0


def _clear(values: dict[str, Any]) -> None:
    values['avs'][0]['perception']['sensors'][0]['horizon'] = 200.0


def _fast(values: dict[str, Any]) -> None:
    values['avs'][0]['options']['v0'] = 22.0


def _gap_when_braking_begins(result: OfflineResult) -> float:
    """Return the distance to the human when the AV is fastest, before it brakes [m]."""
    return float(distances(result, 'av0', 'hv0')[int(np.argmax(speeds(result, 'av0')))])


@pytest.mark.exhaustive
def test_av_in_fog_stops_within_its_sight() -> None:
    """At 13 m/s it needs comfortable braking only, for the human and for the van behind."""
    pytest.importorskip('commonroad_rp')
    result = played('fog')
    assert strongest_braking(result, 'av0') < 4.0
    # It closes up to the van that the human has passed, and stands behind it.
    assert speeds(result, 'av0')[-1] < 1.0
    assert 1.5 < distances(result, 'av0', 'van')[-1] < 6.0


@pytest.mark.exhaustive
def test_too_fast_in_fog_brakes_late_and_hard() -> None:
    """At 22 m/s braking begins at the horizon of 30 m; with clear sight twice as far away."""
    pytest.importorskip('commonroad_rp')
    fog, clear = play('fog', _fast), play('fog', _fast, _clear)
    assert _gap_when_braking_begins(fog) < 31.0
    assert _gap_when_braking_begins(clear) > 45.0
    assert strongest_braking(fog, 'av0') > 6.0
    assert strongest_braking(clear, 'av0') < 3.0
    assert distances(fog, 'av0', 'hv0').min() > 1.5
