# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The time controller on synthetic clocks (CRG 11-13)."""

from collections.abc import Callable
from dataclasses import replace

from crgame_ros.errors import InputError
from crgame_ros.game.game import TimingSpec
from crgame_ros.timing.metrics import TimingMetrics
from crgame_ros.timing.time_controller import Cycle, TimeController
import numpy as np
import pytest

DT = 0.01
START_NS = 5_000_000_000
MS = 1_000_000
SPEC = TimingSpec()


def late_by(controller: TimeController, lags_ns: list[int]) -> list[Cycle]:
    """Begin one cycle for each lag, so much after its deadline or after the last one's begin."""
    cycles, now_ns = [], 0
    for lag_ns in lags_ns:
        now_ns = max(now_ns, controller.deadline_ns() + lag_ns)
        cycles.append(controller.begin_cycle(now_ns))
    return cycles


def busy_loop(controller: TimeController, busy_ns: Callable[[int], int], steps: int,
              start_ns: int = START_NS) -> list[Cycle]:
    """Run a loop that works for busy_ns(n) and then waits for its deadline."""
    cycles, now_ns = [], start_ns
    controller.start(now_ns)
    for n in range(steps):
        now_ns = max(now_ns + busy_ns(n), controller.deadline_ns())
        cycles.append(controller.begin_cycle(now_ns))
    return cycles


def started(spec: TimingSpec = SPEC, dt_s: float = DT) -> TimeController:
    """Make a controller whose t0 is START_NS."""
    controller = TimeController(spec, dt_s)
    controller.start(START_NS)
    return controller


def test_deadlines_are_absolute() -> None:
    """CRG 11: tau*_n = t0 + n dt, however late the cycles before were."""
    controller = started()
    for n, lag_ns in enumerate([0, 300_000, 2 * MS, 0, 7 * MS, 0], start=1):
        assert controller.deadline_ns() == pytest.approx(START_NS + n * 10 * MS, abs=1)
        controller.begin_cycle(controller.deadline_ns() + lag_ns)


def test_deadlines_do_not_drift() -> None:
    """A step of 33.3 ms, which nanoseconds don't divide: 30,000 of them end at 1000 s."""
    controller = started(dt_s=0.1 / 3.0)
    late_by(controller, [0] * 29_999)
    assert controller.deadline_ns() == pytest.approx(START_NS + 1000 * 10**9, abs=10)


def test_step_and_cumulative_errors() -> None:
    """CRG 12: e_n is the measured interval less dt, E_n its sum."""
    lags_ms = np.array([0.0, 1.0, 3.0, 0.5, 0.0, 2.0])
    cycles = late_by(started(), [round(lag * MS) for lag in lags_ms])
    steps = np.array([cycle.step_error_s for cycle in cycles])
    np.testing.assert_allclose(steps, np.diff(lags_ms, prepend=0.0) * 1e-3, atol=1e-8)
    totals = [cycle.cumulative_error_s for cycle in cycles]
    np.testing.assert_allclose(totals, np.cumsum(steps), atol=1e-12)
    np.testing.assert_allclose(totals, lags_ms * 1e-3, atol=1e-8)
    for n, cycle in enumerate(cycles, start=1):
        assert cycle.n == n
        assert cycle.ideal_s == pytest.approx(n * DT)
        assert cycle.actual_s - cycle.ideal_s == pytest.approx(cycle.cumulative_error_s)


def test_stall_is_caught_up() -> None:
    """After 50 ms the loop does not wait until it is on schedule: 1 ms of work a cycle."""
    cycles = busy_loop(started(), lambda n: 60 * MS if n == 100 else MS, 200)
    errors = np.array([cycle.cumulative_error_s for cycle in cycles])
    assert errors[100] == pytest.approx(0.05)
    # Each of the following cycles gains 9 ms: 41, 32, 23, 14, 5, then back on schedule.
    np.testing.assert_allclose(
        errors[101:107], (0.041, 0.032, 0.023, 0.014, 0.005, 0.0), atol=1e-8)
    np.testing.assert_allclose(errors[107:], 0.0, atol=1e-8)
    assert cycles[-1].resets == 0


def test_catch_up_steps_are_counted() -> None:
    """A cycle counts as catching up while the lag exceeds one step: 50, 41, 32, 23 and 14 ms."""
    metrics = TimingMetrics(DT)
    cycles = busy_loop(TimeController(SPEC, DT), lambda n: 60 * MS if n == 100 else MS, 200)
    metrics.add_rows(np.array([[cycle.ideal_s, cycle.actual_s, 0.001, cycle.dropped_s]
                               for cycle in cycles]))
    assert metrics.summary().catch_up_steps == 5


def stall_intervals(spec: TimingSpec, stall_ms: int) -> np.ndarray:
    """Return Delta t_eff of 400 cycles around a stall."""
    cycles = busy_loop(TimeController(spec, DT), lambda n: stall_ms * MS if n == 100 else MS, 400)
    return np.array([cycle.dt_eff_s for cycle in cycles])


def test_carried_clip_returns_to_n_dt() -> None:
    """A 200 ms stall: no interval above dt_max, and the sum of Delta t_eff is n dt again."""
    effective = stall_intervals(SPEC, 200)
    assert effective.max() == SPEC.dt_max
    assert effective.min() >= SPEC.dt_min
    assert effective.sum() == pytest.approx(400 * DT, abs=1e-8)
    # The rest of the stall follows at once: 50 ms each until 200 ms are made up for.
    np.testing.assert_allclose(effective[100:103], 0.05)


def test_shortest_interval_while_catching_up() -> None:
    """Cycles of no work at all after a stall integrate dt_min each, and the sum is n dt again."""
    cycles = busy_loop(TimeController(SPEC, DT), lambda n: 100 * MS if n == 100 else 0, 200)
    effective = np.array([cycle.dt_eff_s for cycle in cycles])
    assert effective.min() == SPEC.dt_min
    assert effective.sum() == pytest.approx(200 * DT, abs=1e-8)


def test_dropped_clip_loses_the_stall() -> None:
    """As printed (CRG 13) the clipped time is lost: 150 of 200 ms."""
    effective = stall_intervals(replace(SPEC, clip='drop'), 200)
    assert effective.max() == SPEC.dt_max
    assert effective.sum() == pytest.approx(400 * DT - 0.15, abs=1e-8)


def test_carry_holds_under_random_load() -> None:
    """
    The sum follows the wall clock: ahead of n dt by the lag at most, and back after every stall.

    Cycles shorter than dt_min, here of almost no work, run ahead until later ones compensate.
    """
    random = np.random.default_rng(41)
    busy = (random.exponential(3 * MS, 3000) + 80 * MS * (random.random(3000) < 0.01)).astype(int)
    spec = replace(SPEC, drift_reset=False)
    cycles = busy_loop(TimeController(spec, DT), lambda n: int(busy[n]), 3000)
    total = np.cumsum([cycle.dt_eff_s for cycle in cycles])
    lag = np.array([cycle.cumulative_error_s for cycle in cycles])
    owed = total - np.arange(1, 3001) * DT
    assert np.abs(lag).max() > 0.05
    assert (owed <= lag + 3 * SPEC.dt_min).all()
    on_time = np.convolve(lag < 1e-8, np.ones(30), 'valid') == 30
    assert on_time.any()
    np.testing.assert_allclose(owed[29:][on_time], 0.0, atol=1e-8)


def test_clip_bounds_never_exclude_the_nominal_step() -> None:
    """At 10 Hz dt is 0.1 s, above the configured dt_max of 0.05 s; still the sum is n dt."""
    cycles = busy_loop(TimeController(SPEC, 0.1), lambda n: MS, 50)
    np.testing.assert_allclose([cycle.dt_eff_s for cycle in cycles], 0.1, atol=1e-8)


def test_nominal_interval_where_measuring_is_off() -> None:
    """Every step integrates dt whatever the clock says."""
    assert (stall_intervals(replace(SPEC, measured_interval=False), 200) == DT).all()


def test_reset_re_anchors_and_counts() -> None:
    """A stall of 400 ms exceeds the 250 ms: t0 moves by 390 ms, E_n is 0, the run goes on."""
    controller = TimeController(SPEC, DT)
    cycles = busy_loop(controller, lambda n: 400 * MS if n == 100 else MS, 200)
    assert [cycle.resets for cycle in cycles[98:103]] == [0, 0, 1, 1, 1]
    assert controller.resets == 1
    assert controller.dropped_s == pytest.approx(0.39)
    at_reset = cycles[100]
    assert at_reset.cumulative_error_s == 0.0
    assert at_reset.step_error_s == pytest.approx(0.39)
    assert at_reset.dropped_s == pytest.approx(0.39)
    # The original schedule stays known: ideal and actual start of the moved schedule.
    assert at_reset.ideal_s == pytest.approx(101 * DT + 0.39)
    assert at_reset.actual_s == pytest.approx(at_reset.ideal_s)
    np.testing.assert_allclose(
        [cycle.cumulative_error_s for cycle in cycles[101:]], 0.0, atol=1e-8)
    # The dropped time isn't integrated either: the human's time is n dt.
    assert sum(cycle.dt_eff_s for cycle in cycles) == pytest.approx(200 * DT, abs=1e-8)


def test_no_reset_below_the_threshold_or_when_off() -> None:
    """240 ms are caught up; without the mechanism 400 ms are too."""
    for spec, stall in ((SPEC, 250), (replace(SPEC, drift_reset=False), 400)):
        controller = TimeController(spec, DT)
        cycles = busy_loop(controller, lambda n, stall=stall: stall * MS if n == 100 else MS, 200)
        assert controller.resets == 0
        assert controller.dropped_s == 0.0
        assert cycles[-1].cumulative_error_s == pytest.approx(0.0, abs=1e-8)


def test_warm_up_suppresses_the_reset() -> None:
    """A stall at the start is caught up; its rest after step 50 causes a reset there."""
    for step, reset_at in ((10, None), (45, 51), (60, 61)):
        controller = TimeController(SPEC, DT)
        cycles = busy_loop(controller, lambda n, step=step: 400 * MS if n == step else MS, 200)
        resets = [cycle.n for cycle in cycles if cycle.resets]
        assert (resets[0] if resets else None) == reset_at
        assert cycles[-1].cumulative_error_s == pytest.approx(0.0, abs=1e-8)
    # 390 ms at step 46, 9 ms less at each step until 51.
    controller = TimeController(SPEC, DT)
    busy_loop(controller, lambda n: 400 * MS if n == 45 else MS, 200)
    assert controller.dropped_s == pytest.approx(0.39 - 5 * 0.009)


def test_late_steps_in_a_row_are_no_reason_for_a_reset() -> None:
    """Cycles of 10.5 ms lag by 0.5 ms more each: 250 ms are exceeded at every 501st."""
    controller = TimeController(SPEC, DT)
    cycles = busy_loop(controller, lambda n: 10_500_000, 2000)
    resets = [cycle.n for before, cycle in zip(cycles, cycles[1:], strict=False)
              if cycle.resets > before.resets]
    assert resets == [501, 1002, 1503]
    assert controller.dropped_s == pytest.approx(3 * 0.2505)
    controller = TimeController(replace(SPEC, drift_reset=False), DT)
    cycles = busy_loop(controller, lambda n: 10_700_000, 2000)
    assert cycles[-1].cumulative_error_s == pytest.approx(1.4)
    metrics = TimingMetrics(DT)
    metrics.add_rows(np.array([[cycle.ideal_s, cycle.actual_s, 0.0107, cycle.dropped_s]
                               for cycle in cycles]))
    # The lag exceeds one step from the 15th cycle on.
    assert metrics.summary().catch_up_steps == 1986


def test_given_intervals_are_taken_as_they_are() -> None:
    """
    A recorded run's intervals, whatever is measured; the difference comes when they end.

    The machine stalls for 40 ms in step 30, while the recording gives 9 ms a step for 50 steps:
    in the end the human has moved over n dt all the same.
    """
    controller = started()
    given_s, total_s, now_ns = 0.009, 0.0, START_NS
    for n in range(1, 101):
        now_ns = max(controller.deadline_ns(), now_ns + MS) + (40 * MS if n == 30 else 0)
        cycle = controller.begin_cycle(now_ns, given_s if n <= 50 else None)
        total_s += cycle.dt_eff_s
        if n <= 50:
            assert cycle.dt_eff_s == given_s
        assert cycle.step_error_s == pytest.approx(0.04, abs=1e-7) or n != 30
    # 50 * 9 ms were given: the missing 50 ms come at once, with the first measured interval.
    assert total_s == pytest.approx(100 * DT, abs=1e-7)


@pytest.mark.parametrize('factor', [0.1, 0.5, 2.0, 10.0])
def test_real_time_factor(factor: float) -> None:
    """A cycle of dt lasts dt / factor on the wall; errors and intervals are in simulated time."""
    controller = started()
    controller.resume(START_NS, factor)
    for n in range(1, 101):
        assert controller.deadline_ns() == pytest.approx(START_NS + n * 10 * MS / factor, abs=2)
        cycle = controller.begin_cycle(controller.deadline_ns() + 100_000)
        assert cycle.cumulative_error_s == pytest.approx(1e-4 * factor, abs=1e-7)
        if n > 1:
            assert cycle.dt_eff_s == pytest.approx(DT, abs=1e-7)
    assert controller.real_time_factor == factor


@pytest.mark.parametrize('factor', [0.0, 0.09, 10.1, -1.0, float('nan'), float('inf')])
def test_real_time_factor_is_bounded(factor: float) -> None:
    """0.1 to 10; the former rate stays."""
    controller = started()
    with pytest.raises(InputError, match='real_time_factor.*give 0.1 to 10'):
        controller.resume(START_NS, factor)
    assert controller.real_time_factor == 1.0


def test_pause_is_taken_out() -> None:
    """Ten seconds between two cycles count in no error, no interval and no deadline."""
    controller = started()
    late_by(controller, [0] * 9 + [2 * MS])
    resumed_ns = START_NS + 10_000 * MS
    controller.resume(resumed_ns)
    # The lag of 2 ms that the last cycle had stays.
    assert controller.deadline_ns() == pytest.approx(resumed_ns + 8 * MS, abs=2)
    cycle = controller.begin_cycle(controller.deadline_ns())
    assert cycle.n == 11
    assert cycle.cumulative_error_s == pytest.approx(0.0, abs=1e-8)
    assert cycle.step_error_s == pytest.approx(-0.002, abs=1e-8)
    assert cycle.dt_eff_s == pytest.approx(0.008, abs=1e-8)
    assert cycle.actual_s == pytest.approx(0.11, abs=1e-8)
    assert controller.resets == 0


def test_change_of_rate_keeps_the_time_line() -> None:
    """From step 50 on at twice the rate: simulated time goes on without a jump."""
    controller = started()
    cycles = late_by(controller, [0] * 50)
    controller.resume(START_NS + 500 * MS, 2.0)
    cycles += late_by(controller, [0] * 50)
    np.testing.assert_allclose([cycle.actual_s for cycle in cycles], DT * np.arange(1, 101),
                               atol=1e-7)
    assert controller.deadline_ns() == pytest.approx(START_NS + 755 * MS, abs=2)


def test_without_pacing_the_wait_is_relative() -> None:
    """The naive loop sleeps dt from the begin of a cycle, so every delay stays in E_n."""
    spec = replace(SPEC, pacing=False, drift_reset=False)
    cycles = late_by(started(spec), [MS] * 100)
    np.testing.assert_allclose([cycle.cumulative_error_s for cycle in cycles],
                               1e-3 * np.arange(1, 101), atol=1e-7)
    paced = late_by(started(), [MS] * 100)
    np.testing.assert_allclose([cycle.cumulative_error_s for cycle in paced], 1e-3, atol=1e-7)
