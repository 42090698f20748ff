# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Car following (FS 3 and Treiber 2000) against the equations, and in motion."""

from crgame_ros.errors import InputError
from crgame_ros.traffic.following.car_following import (
    AdaptiveCruise,
    CAR_FOLLOWING,
    CarFollowing,
    IntelligentDriver,
)
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]
MODELS = [AdaptiveCruise(), IntelligentDriver()]
NAMES = ['acc', 'idm']


def drive(model: CarFollowing, speed: Array, desired: Array, gap: Array, lead_speed: Array,
          lead_acceleration: float, duration: float) -> tuple[Array, Array, Array]:
    """Decide at 10 Hz, move at 100 Hz; return gaps, speeds and accelerations at each decision."""
    rows = []
    lead_speed = np.array(lead_speed, dtype=float)
    for _ in range(round(10 * duration)):
        wanted = model.acceleration(speed, desired, gap, lead_speed)
        rows.append((gap, speed, wanted))
        for _ in range(10):
            faster = np.maximum(speed + 0.01 * wanted, 0.0)
            lead_faster = np.maximum(lead_speed + 0.01 * lead_acceleration, 0.0)
            gap = gap + 0.005 * (lead_speed + lead_faster - speed - faster)
            speed, lead_speed = faster, lead_faster
    gaps, speeds, accelerations = (np.array(column) for column in zip(*rows, strict=True))
    return gaps, speeds, accelerations


def test_acc_is_fs_3_with_a_gap_at_standstill() -> None:
    """The ACC law equals FS 3 as published; l_lead is the distance of centres at contact + s0."""
    rng = np.random.default_rng(3)
    host, lead = rng.uniform(0.0, 50.0, 40), rng.uniform(60.0, 120.0, 40)
    v, v_lead = rng.uniform(0.3, 30.0, 40), rng.uniform(0.0, 30.0, 40)
    lengths = rng.uniform(4.0, 12.0, 40)
    big_t, h, gain = 1.7, 1.3, 0.35
    s_desired = (0.5 * (lengths + 4.5) + 2.0) + big_t * v
    s_actual = lead - host
    expected = -(1.0 / h) * (-(v_lead - v) + gain * (s_desired - s_actual))
    model = AdaptiveCruise(time_gap=big_t, h=h, gain=gain)
    got = model.follow(v, np.full(40, 1e3), s_actual - 0.5 * (lengths + 4.5), v_lead)
    np.testing.assert_allclose(got, expected, rtol=1e-12)


def test_idm_is_the_equation_of_treiber() -> None:
    """It equals a (1 - (v / v0)^4 - (s* / s)^2), s* = s0 + v T + v dv / (2 sqrt(a b))."""
    v, v0, s, dv = (np.array(column) for column in zip(
        (20.0, 33.0, 40.0, 2.0), (5.0, 14.0, 12.0, -1.0), (0.5, 8.0, 3.0, 0.5), strict=True))
    wanted_gap = 2.0 + v * 1.6 + v * dv / (2.0 * np.sqrt(0.73 * 1.67))
    expected = 0.73 * (1.0 - (v / v0) ** 4 - (wanted_gap / s) ** 2)
    model = IntelligentDriver(time_gap=1.6, max_acceleration=0.73, comfortable_deceleration=1.67)
    np.testing.assert_allclose(model.follow(v, v0, s, v - dv), expected, rtol=1e-12)


@pytest.mark.parametrize('model', MODELS, ids=NAMES)
def test_stops_behind_a_standing_vehicle_with_the_gap_of_standstill(model: CarFollowing) -> None:
    """From 1 to 36 m/s and distances that ask for 2 m/s^2 or less, it comes to rest and stays."""
    speed = np.repeat([1.0, 5.0, 10.0, 15.0, 22.0, 30.0, 36.0], 3)
    share = np.tile([1.1, 1.6, 3.0], 7)
    gap = 4.0 + 4.0 * speed + share * speed ** 2 / 4.0
    gaps, speeds, wanted = drive(model, speed, speed, gap, np.zeros(21), 0.0, 150.0)
    assert (speeds[-300:] == 0.0).all()
    assert (np.diff(gaps[-300:], axis=0) == 0.0).all()
    # The last 0.1 m/s are held: with acc the gap is then 0.1 / lambda = 0.25 m from s0.
    assert gaps[-1].min() > model.standstill_gap - 0.01
    assert gaps[-1].max() < model.standstill_gap + 0.3
    assert wanted.min() >= -7.0
    # No stop and go: after the first braking no agent accelerates again.
    braked = np.maximum.accumulate(wanted < -0.2, axis=0)
    assert wanted[braked].max() <= 0.0


@pytest.mark.parametrize('model', MODELS, ids=NAMES)
def test_never_touches_a_standing_vehicle_that_can_be_avoided(model: CarFollowing) -> None:
    """A gap of s0 + v^2 / (2 b_max) + 0.2 s is just enough; the guard keeps half of s0."""
    speed = np.repeat([1.0, 3.0, 8.0, 15.0, 22.0, 30.0, 36.0], 3)
    share = np.tile([1.0, 1.15, 1.5], 7)
    gap = 2.0 + share * (speed ** 2 / 16.0 + 0.2 * speed)
    gaps, speeds, wanted = drive(model, speed, speed, gap, np.zeros(21), 0.0, 60.0)
    assert (speeds[-1] == 0.0).all()
    assert gaps.min() > 0.85
    assert wanted.min() >= -8.0


@pytest.mark.parametrize('model', MODELS, ids=NAMES)
@pytest.mark.parametrize('braking', [-3.0, -8.0], ids=['firm', 'hardest'])
def test_follows_a_leader_to_a_stop(model: CarFollowing, braking: float) -> None:
    """From steady following behind a leader that brakes to rest: no contact."""
    speed = np.array([5.0, 14.0, 25.0, 36.0])
    gaps, speeds, _ = drive(model, speed, speed + 5.0, model.desired_gap(speed), speed, braking,
                            60.0)
    assert gaps.min() > 1.0
    assert (speeds[-1] == 0.0).all()


@pytest.mark.parametrize('model', MODELS, ids=NAMES)
@pytest.mark.parametrize('relief', [0.0, 100.0], ids=['plain', 'relieved'])
def test_a_short_gap_survives_the_hardest_braking_ahead(model: CarFollowing,
                                                        relief: float) -> None:
    """Right after a lane change, with no gap demanded at all, the guard still avoids contact."""
    speed = np.repeat([10.0, 15.0, 25.0, 30.0], 3)
    gap = np.tile([3.0, 4.0, 5.0], 4)
    lead = speed
    for _ in range(200):
        wanted = model.acceleration(speed, np.full(12, 30.0), gap, lead, relief)
        for _ in range(10):
            faster = np.maximum(speed + 0.01 * wanted, 0.0)
            slower = np.maximum(lead - 0.08, 0.0)
            gap = gap + 0.005 * (lead + slower - speed - faster)
            speed, lead = faster, slower
            assert gap.min() > 0.15
    assert (speed == 0.0).all()


def test_relief_spares_the_braking_for_a_short_gap() -> None:
    """At 15 m/s and 8 m: lambda 13.5 / 1.3 = 4.15 m/s^2 without relief, 0 relieved of 13.5 m."""
    model = AdaptiveCruise()
    v, gap = np.array([15.0, 15.0]), np.array([8.0, 8.0])
    got = model.acceleration(v, v + 20.0, gap, v, np.array([0.0, 13.5]))
    np.testing.assert_allclose(got, [-0.4 * 13.5 / 1.3, 0.0], atol=1e-12)


@pytest.mark.parametrize('model', MODELS, ids=NAMES)
def test_drives_freely_at_the_desired_speed(model: CarFollowing) -> None:
    """No leader: NaN as the leader's speed has no effect; limits hold on the way."""
    desired = np.array([8.0, 14.0, 30.0])
    start = np.array([0.0, 20.0, 29.0])
    none = np.full(3, np.inf)
    unknown = model.acceleration(start, desired, none, np.full(3, np.nan))
    np.testing.assert_array_equal(
        unknown, model.acceleration(start, desired, none, np.zeros(3)))
    _, speeds, wanted = drive(model, start, desired, none, np.zeros(3), 0.0, 90.0)
    np.testing.assert_allclose(speeds[-1], desired, rtol=0.01)
    assert wanted.max() <= 1.5
    assert wanted.min() >= -2.0
    assert (np.diff(speeds[:, 0]) >= -1e-12).all()


@pytest.mark.parametrize('model', MODELS, ids=NAMES)
def test_a_queue_starts_again(model: CarFollowing) -> None:
    """The follower stands while the leader stands, and leaves when the leader leaves."""
    rest = np.zeros(1)
    waiting = model.acceleration(rest, np.full(1, 14.0), np.array([2.05]), rest)
    assert waiting[0] < 0.0
    gaps, speeds, _ = drive(model, rest, np.full(1, 14.0), np.array([2.05]), rest, 1.0, 20.0)
    assert speeds[-1, 0] > 8.0
    assert gaps.min() > 2.0


@pytest.mark.parametrize('model', MODELS, ids=NAMES)
def test_the_steady_gap_is_the_desired_gap(model: CarFollowing) -> None:
    """At equal speeds and that gap the interaction only demands the leader's speed."""
    speed = np.array([3.0, 12.0, 25.0])
    gap = model.desired_gap(speed)
    np.testing.assert_allclose(gap, 2.0 + 1.3 * speed)
    _, speeds, _ = drive(model, speed, np.full(3, 1000.0), gap, speed, 0.0, 60.0)
    np.testing.assert_allclose(speeds, np.broadcast_to(speed, speeds.shape), atol=1e-6)


@pytest.mark.parametrize('model', MODELS, ids=NAMES)
def test_agents_do_not_depend_on_each_other(model: CarFollowing) -> None:
    """All at once equals one by one, to the last bit, overlapping vehicles included."""
    rng = np.random.default_rng(5)
    columns = [rng.uniform(0.0, 30.0, 50), rng.uniform(0.0, 30.0, 50),
               rng.uniform(-1.0, 60.0, 50), rng.uniform(0.0, 30.0, 50)]
    columns[2][::7] = np.inf
    together = model.acceleration(*columns)
    single = [model.acceleration(*(column[i:i + 1] for column in columns))[0] for i in range(50)]
    np.testing.assert_array_equal(together, single)
    assert np.isfinite(together).all()
    overlapping = model.acceleration(*(np.array([value]) for value in (10.0, 15.0, -0.5, 10.0)))
    assert overlapping[0] == -8.0


def test_models_are_found_by_name_and_their_options_checked() -> None:
    assert CAR_FOLLOWING.names()[:2] == ('acc', 'idm')
    assert CAR_FOLLOWING.create('acc', {'time_gap': 1.2}).h == 1.2
    assert isinstance(CAR_FOLLOWING.create('idm'), IntelligentDriver)
    with pytest.raises(InputError, match='"headway" is unknown'):
        CAR_FOLLOWING.create('acc', {'headway': 1.0})
    with pytest.raises(InputError, match='"gain" is -1'):
        CAR_FOLLOWING.create('acc', {'gain': -1.0})
    with pytest.raises(InputError, match='there is no car-following model "gipps"'):
        CAR_FOLLOWING.create('gipps')
