# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cooperative lane changes: the gap that courtesy opens, and the shock wave that it spares."""

from crgame_ros.traffic.changing import courtesy
from crgame_ros.traffic.changing.courtesy import CourtesyRules, fading
from crgame_ros.traffic.following.car_following import AdaptiveCruise
from crgame_ros.traffic.motion.lane_change import GapAcceptance
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]
LENGTH = 4.5
# The functions of one vehicle, for platoons.
relief_at_change = np.vectorize(courtesy.relief_at_change)
fade_relief = np.vectorize(courtesy.fade_relief)


def one(value: float) -> Array:
    return np.array([value])


@pytest.mark.parametrize(('v_f', 'v', 'gap'), [(15.0, 15.0, 3.0), (15.0, 14.0, 6.0),
                                               (12.0, 12.5, -1.0)])
def test_courtesy_opens_the_gap_in_its_time(v_f: float, v: float, gap: float) -> None:
    """The constant deceleration, integrated over D_t, opens the gap to the needed one."""
    rules = CourtesyRules()
    b, yields = rules.courtesy_deceleration(one(v_f), one(gap), one(v), one(8.0), 1.0, 0.0)
    assert yields[0] and 0.0 < b[0] <= 2.5
    dt, speed = 1e-4, v_f
    for _ in range(round(rules.time / dt)):
        gap += dt * (v - (speed - 0.5 * dt * b[0]))
        speed -= dt * b[0]
    assert gap == pytest.approx(8.0, abs=1e-6)


def test_asked_at_every_decision_courtesy_ends_smoothly() -> None:
    """
    The missing gap follows x'' + 2 x' / D_t + 2 x / D_t^2 = 0 until t = pi D_t / 4.

    That is x_0 exp(-t / D_t) (cos(t / D_t) + sin(t / D_t)); then b is 0 and the gap opens at the
    constant x' = -sqrt(2) x_0 / D_t exp(-pi / 4).
    """
    rules = CourtesyRules()
    speed, gap, dt = one(15.0), one(4.0), 0.01
    turn = np.pi
    opened = None
    for n in range(1500):
        t = dt * n
        expected = 4.0 * np.exp(-t / 4.0) * (np.cos(t / 4.0) + np.sin(t / 4.0))
        if t > turn:
            expected = np.sqrt(2.0) * np.exp(-np.pi / 4.0) * (4.0 - (t - turn))
        b, yields = rules.courtesy_deceleration(speed, gap, one(15.0), one(8.0), 1.0, 0.0)
        if gap[0] >= 8.0:
            opened = t
            break
        assert yields[0]
        assert 8.0 - gap[0] == pytest.approx(expected, abs=0.02)
        faster = speed - dt * b
        gap = gap + dt * (15.0 - 0.5 * (speed + faster))
        speed = faster
    assert not yields[0]
    assert opened == pytest.approx(np.pi + 4.0, abs=0.1)


def test_no_agent_brakes_harder_for_others_than_its_own_limit() -> None:
    """Urgency raises the limit, aggressivity lowers it to 0; no agent brakes beyond it."""
    rules = CourtesyRules()
    hurry, temper = np.array([0.0, 1.0, 1.0, 1.0]), np.array([0.0, 0.0, 0.4, 1.0])
    np.testing.assert_allclose(rules.deceleration_limit(hurry, temper), [1.0, 2.5, 1.5, 0.0])
    v = np.full(4, 15.0)
    # 2 * 16 / 16 = 2 m/s^2 are wanted, a drop of 8 m/s.
    generous = CourtesyRules(max_speed_drop=10.0)
    b, yields = generous.courtesy_deceleration(v, np.full(4, -6.0), v, np.full(4, 10.0), hurry,
                                               temper)
    np.testing.assert_array_equal(yields, [False, True, False, False])
    np.testing.assert_allclose(b, [0.0, 2.0, 0.0, 0.0])
    _, yields = rules.courtesy_deceleration(v, np.full(4, -6.0), v, np.full(4, 10.0), hurry,
                                            temper)
    assert not yields.any()
    # A gap that is wide enough needs no braking, not even by an aggressive agent.
    b, yields = rules.courtesy_deceleration(v, np.full(4, 20.0), v, np.full(4, 10.0), hurry,
                                            temper)
    assert not yields.any() and (b == 0.0).all()
    # No agent stops for it.
    assert not rules.courtesy_deceleration(one(1.0), one(0.0), one(1.0), one(5.0), 1.0, 0.0)[1][0]


def test_relief_is_what_is_missing_and_fades() -> None:
    gap, desired = np.array([5.0, 40.0, np.inf]), np.array([24.5, 24.5, 24.5])
    relief = relief_at_change(gap, desired)
    np.testing.assert_allclose(relief, [19.5, 0.0, 0.0])
    for _ in range(100):
        relief = fade_relief(relief, gap, desired, fading(0.1))
    np.testing.assert_allclose(relief, [19.5 / np.e, 0.0, 0.0])
    # Once the gap is nearly open only the rest is left; without a leader there is no relief.
    left = fade_relief(relief, np.array([23.0, 1.0, 1.0]), desired, fading(0.1))
    np.testing.assert_allclose(left[0], 1.5)
    assert fade_relief(one(5.0), one(np.inf), one(24.5), fading(0.1))[0] == 0.0


def merge(cooperative: bool, merging_speed: float = 15.0) -> tuple[Array, float, float]:
    """
    Merge a vehicle into a platoon of ten at 15 m/s with gaps of 12 m, between two of them.

    The platoon is in equilibrium: T = 10 m / 15 m/s. Without cooperation the vehicle goes into
    the gap as it is, and all follow FS 3. With it the two behind the gap and the vehicle
    make room first, and it changes when the least gaps are there.

    :return: (11) accelerations at worst after the change, that of the courtesy before, and the
        time of the change.
    """
    model, rules, gaps = AdaptiveCruise(time_gap=10.0 / 15.0), CourtesyRules(), GapAcceptance()
    # Only the first drives as fast as it wants: the others are held up by it.
    desired_speed = np.array([15.0] + [17.0] * 10)
    x = -(12.0 + LENGTH) * np.arange(10)
    v, own = np.full(10, 15.0), one(merging_speed)
    own_x = one(0.5 * (x[3] + x[4]))
    before, changed_at = 0.0, 0.0
    while cooperative:
        lead_gap, follow_gap = x[3:4] - own_x - LENGTH, own_x - x[4:5] - LENGTH
        ahead, behind = gaps.minimum_gap(own, v[3:4], 1.0), gaps.minimum_gap(v[4:5], own, 1.0)
        if lead_gap[0] >= ahead[0] and follow_gap[0] >= behind[0]:
            break
        assert changed_at < 30.0
        gap = np.concatenate(([np.inf], x[:-1] - x[1:] - LENGTH))
        wanted = model.acceleration(v, desired_speed[:10], gap, np.concatenate(([0.0], v[:-1])))
        room = rules.courtesy_deceleration(v[4:5], follow_gap, own, behind, 1.0, 0.2)[0]
        back = rules.courtesy_deceleration(own, lead_gap, v[3:4], ahead, 1.0, 0.0)[0]
        wanted[4] = min(wanted[4], -room[0])
        before = min(before, float(wanted.min()), -float(back[0]))
        x, v = x + 0.1 * v + 0.005 * wanted, v + 0.1 * wanted
        own_x, own = own_x + 0.1 * own - 0.005 * back, own - 0.1 * back
        changed_at += 0.1
    x, v = np.insert(x, 4, own_x), np.insert(v, 4, own)
    relief = None
    worst = np.zeros(11)
    for _ in range(900):
        gap = np.concatenate(([np.inf], x[:-1] - x[1:] - LENGTH))
        assert gap.min() > 2.0
        desired = model.desired_gap(v)
        if relief is None:
            relief = relief_at_change(gap, desired) * (cooperative & (np.arange(11) < 6))
        relief = fade_relief(relief, gap, desired, fading(0.1))
        wanted = model.acceleration(v, desired_speed, gap, np.concatenate(([0.0], v[:-1])),
                                    relief)
        worst = np.minimum(worst, wanted)
        for _ in range(10):
            x, v = x + 0.01 * v + 0.5e-4 * wanted, np.maximum(v + 0.01 * wanted, 0.0)
    # In the end every vehicle has the usual gap again.
    np.testing.assert_allclose(x[:-1] - x[1:] - LENGTH, 12.0, atol=0.3)
    return worst, before, changed_at


def test_cooperation_spares_the_shock_wave() -> None:
    """
    Cooperation lowers the hardest braking.

    Without it, gaps of 3.75 m instead of 12 m make FS 3 brake with lambda 8.25 / T = 4.95 m/s^2.
    """
    plain, _, _ = merge(cooperative=False)
    gentle, before, changed_at = merge(cooperative=True)
    assert plain.min() == pytest.approx(-0.4 * 8.25 * 1.5, abs=0.01)
    factor = plain.min() / min(gentle.min(), before)
    followers = plain[5:].sum() / gentle[5:].sum()
    print(f'hardest braking {-plain.min():.2f} m/s^2 plainly, {-min(gentle.min(), before):.2f} '
          f'cooperatively after {changed_at:.1f} s: {factor:.1f} times less, '
          f'{followers:.1f} times over all followers')
    assert factor > 10.0
    assert followers > 5.0
    assert 1.0 < changed_at < 15.0


def test_cooperation_also_helps_a_slower_vehicle() -> None:
    """At 14 m/s, into a gap that closes by 1 m/s, it spares less: the speeds differ."""
    plain, _, _ = merge(cooperative=False, merging_speed=14.0)
    gentle, before, _ = merge(cooperative=True, merging_speed=14.0)
    assert plain.min() / min(gentle.min(), before) > 1.5
