# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""nuPlan's score of drives on a straight road, each part by hand."""

from dataclasses import replace
import math
from pathlib import Path
import sys

from crgame_ros.analysis.scores.nuplan import (
    BOUNDS,
    Expert,
    measure_comfort,
    NuplanScore,
    NuplanScorer,
)
from crgame_ros.analysis.scores.scored_drive import ScoredDrive
from crgame_ros.errors import InputError
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from score_roads import CAR, drive, DT_S, LENGTH, road, straight, track  # noqa: E402, I100


@pytest.fixture(scope='module')
def scorer() -> NuplanScorer:
    """Return a scorer of the road with a limit of 10 m/s."""
    return NuplanScorer(road())


def _expert(way: float, steps: int = 51) -> Expert:
    """Return an expert that drives so far along the lane [m]."""
    return Expert('human', straight(way / ((steps - 1) * DT_S), steps)[0])


def test_a_drive_at_the_limit_has_every_point(scorer: NuplanScorer) -> None:
    """As far as the free drive, at constant speed, alone: 1."""
    found = scorer.score(drive(), None, None)
    assert found.score == pytest.approx(1.0, abs=1e-9)
    assert found.own_progress == pytest.approx(50.0, abs=1e-6)
    assert found.expert_progress == pytest.approx(50.0, abs=0.01)
    assert found.expert == 'free drive at the speed limit'
    assert not found.collisions and found.remarks == ()


def test_the_score_is_the_product_times_the_weighted_mean(scorer: NuplanScorer) -> None:
    """Weights 5, 5, 4 and 2 of nuPlan's configuration: 0.5 * (2.5 + 5 + 1 + 0) / 16."""
    found: NuplanScore = replace(
        scorer.score(drive(), None, None),
        multipliers={'no_collision_at_fault': 1.0, 'drivable_area': 1.0,
                     'driving_direction': 0.5, 'making_progress': 1.0},
        weighted={'progress': 0.5, 'time_to_collision': 1.0, 'speed_limit': 0.25, 'comfort': 0.0})
    assert found.score == pytest.approx(0.5 * 8.5 / 16.0, abs=1e-12)
    assert found.as_dict()['weighted']['progress'] == {'value': 0.5, 'weight': 5.0}


@pytest.mark.parametrize(('kind', 'expected'), [
    ('vehicle', 0.0), ('vulnerable', 0.0), ('object', 0.5)])
def test_multiplier_of_collisions(scorer: NuplanScorer, kind: str, expected: float) -> None:
    """One at fault with an object halves the score, any other takes it all."""
    found = scorer.score(drive(10.0, track(0.0, 50.0, kind=kind)), None, None)
    assert [each.kind for each in found.collisions] == ['stopped track']
    assert found.multipliers['no_collision_at_fault'] == expected
    both = track(0.0, 50.0, kind=kind), track(0.0, 60.0, kind=kind, name='o2')
    assert scorer.score(drive(10.0, *both), None, None).score == 0.0


@pytest.mark.parametrize(('off', 'expected'), [(0.29, 1.0), (0.31, 0.0)])
def test_multiplier_of_the_drivable_area(scorer: NuplanScorer, off: float,
                                         expected: float) -> None:
    """The right corners so far beyond the right bound at y = -1.75."""
    found = scorer.score(drive(y=-1.75 - off + 0.9), None, None)
    assert found.overhang == pytest.approx(off, abs=1e-6)
    assert found.multipliers['drivable_area'] == expected


@pytest.mark.parametrize(('speed', 'expected'), [(1.8, 1.0), (1.9, 0.5), (5.4, 0.5), (5.5, 0.0)])
def test_multiplier_of_the_direction(scorer: NuplanScorer, speed: float, expected: float) -> None:
    """In the oncoming lane nuPlan's window of a second holds 11 steps: 1.1 s times the speed."""
    found = scorer.score(drive(speed, y=7.0), None, None)
    assert found.against == pytest.approx(1.1 * speed, abs=1e-6)
    assert found.multipliers['driving_direction'] == expected
    right = scorer.score(drive(speed, start=300.0, y=7.0, yaw=math.pi), None, None)
    assert right.against == 0.0 and right.multipliers['driving_direction'] == 1.0
    back = scorer.score(drive(-speed, start=100.0), None, None)
    assert back.against == pytest.approx(1.1 * speed, abs=1e-6)


@pytest.mark.parametrize(('way', 'making'), [(9.9, 0.0), (10.1, 1.0), (60.0, 1.0)])
def test_progress(scorer: NuplanScorer, way: float, making: float) -> None:
    """Of the expert's 50 m, 1 at most; above 0.2 it is making progress."""
    found = scorer.score(drive(way / 5.0), _expert(50.0), None)
    assert found.own_progress == pytest.approx(way, abs=1e-6)
    assert found.expert_progress == pytest.approx(50.0, abs=1e-6)
    assert found.weighted['progress'] == pytest.approx(min(1.0, way / 50.0), abs=1e-9)
    assert found.multipliers['making_progress'] == making


def test_what_is_to_be_known_of_an_expert(scorer: NuplanScorer) -> None:
    """No score for an expert that drove for less time, elsewhere, or off every lane."""
    found = scorer.score(drive(), _expert(20.0, 21), None)
    assert found.own_progress == pytest.approx(20.0, abs=1e-6)
    assert found.remarks == ('human drove for 2.0 s: progress is compared as long',)
    away = Expert('human', straight(10.0, start=60.0)[0])
    assert scorer.score(drive(), away, None).remarks == ('human starts 40.0 m away',)
    off = scorer.score(drive(), Expert('human', straight(10.0, y=-50.0)[0]), None)
    assert off.weighted['progress'] == 1.0
    assert off.remarks == ('human has no route: progress counts as 1',)


@pytest.mark.parametrize(('gap', 'least_s', 'expected'), [
    (9.45, 1.0, 1.0), (8.95, 0.9, 0.0), (31.0, math.inf, 1.0)])
def test_time_to_collision(scorer: NuplanScorer, gap: float, least_s: float,
                           expected: float) -> None:
    """At last 10 m/s faster than the leader at such a gap: the next tenth of a second counts."""
    leader = track(0.001, 20.0 + LENGTH + gap + 4.0, steps=5)
    leader.speeds[:] = 0.0
    found = scorer.score(drive(10.0, leader, steps=5), None, None)
    assert found.least_ttc_s == pytest.approx(least_s)
    assert found.weighted['time_to_collision'] == expected


def test_a_car_beside_counts_only_between_lanes(scorer: NuplanScorer) -> None:
    """A car that comes from the side at 6 m/s counts only for a car astride two lanes."""
    beside = track(6.0, 24.0, y=8.0, yaw=-math.pi / 2.0, steps=5)
    for y, counts in ((0.0, False), (1.75, True)):
        found = scorer.score(drive(5.0, beside, steps=5, y=y), None, None)
        assert (found.least_ttc_s < 0.95) is counts, y


@pytest.mark.parametrize('excess', [0.5, 1.115, 2.5])
def test_speed_limit(scorer: NuplanScorer, excess: float) -> None:
    """1 - the mean excess / 2.23; nuPlan's sum has one step more than there are intervals."""
    found = scorer.score(drive(10.0 + excess), None, None)
    assert found.weighted['speed_limit'] == pytest.approx(
        max(0.0, 1.0 - excess * 51.0 / 50.0 / 2.23), abs=1e-9)
    assert found.speed.worst_excess == pytest.approx(excess, abs=1e-9)


def test_without_a_limit_there_is_no_excess() -> None:
    """The score says so."""
    found = NuplanScorer(road(None)).score(drive(30.0), None, None)
    assert found.weighted['speed_limit'] == 1.0
    assert 'no speed limit is known where it drove' in found.remarks


def _turning(speed: float, rate: float = 0.0, bend: float = 0.0, gain: float = 0.0,
             jerk: float = 0.0, steps: int = 5) -> ScoredDrive:
    """Return a drive with constant derivatives of speed and yaw; where it is does not matter."""
    time_s = DT_S * np.arange(steps)
    yaw = rate * time_s + 0.5 * bend * time_s ** 2
    speeds = speed + gain * time_s + 0.5 * jerk * time_s ** 2
    return ScoredDrive('av0', DT_S, CAR, 0.0, np.column_stack((time_s, 0.0 * time_s, yaw)), speeds)


@pytest.mark.parametrize(('name', 'within', 'beyond'), [
    ('longitudinal_acceleration', {'gain': 2.39}, {'gain': 2.41}),
    ('longitudinal_acceleration', {'gain': -4.04}, {'gain': -4.06}),
    ('lateral_acceleration', {'speed': 10.0, 'rate': 0.488}, {'speed': 10.0, 'rate': -0.490}),
    ('jerk', {'speed': 10.0, 'bend': 0.83}, {'speed': 10.0, 'bend': 0.84}),
    ('longitudinal_jerk', {'jerk': 4.12}, {'jerk': 4.14}),
    ('yaw_rate', {'rate': 0.94}, {'rate': -0.96}),
    ('yaw_acceleration', {'bend': 1.92}, {'bend': 1.94})])
def test_comfort(name: str, within: dict[str, float], beyond: dict[str, float]) -> None:
    """Each bound alone, with constant derivatives, which the filter gives exactly."""
    inside = measure_comfort(_turning(**{'speed': 1.0} | within))
    outside = measure_comfort(_turning(**{'speed': 1.0} | beyond))
    assert inside is not None and outside is not None
    assert inside.exceeded == () and outside.exceeded == (name,)
    assert set(BOUNDS) == set(outside.as_dict())


def test_comfort_counts(scorer: NuplanScorer) -> None:
    """Braking with 4.1 m/s^2 takes its 2 of 16."""
    found = scorer.score(drive(30.0 - 0.41 * np.arange(51)), None, None)
    assert found.weighted['comfort'] == 0.0
    soft = scorer.score(drive(9.0 - 0.01 * np.arange(51)), None, None)
    assert soft.weighted['comfort'] == 1.0


def test_the_centre_turns_with_its_vehicle() -> None:
    """On a circle the centre, r ahead, has - r w^2 along (nuPlan: centre_acceleration_2d)."""
    found = measure_comfort(replace(_turning(5.0, rate=0.9), rear_to_center=2.0))
    assert found is not None
    assert found.lowest['longitudinal_acceleration'] == pytest.approx(-2.0 * 0.81, abs=1e-9)


def test_too_short_a_drive_is_told(scorer: NuplanScorer) -> None:
    """Four steps have no jerk."""
    with pytest.raises(InputError, match='4 time steps'):
        scorer.score(drive(steps=4), None, None)
