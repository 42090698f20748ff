# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The world shows the recorded states: between samples, at every rate, and at standstill."""

from collections.abc import Iterator
import time
from typing import Any

from browser_support import Browser
from crgame_ros.cockpit.frames import STATE_COLUMNS
from crgame_ros.paths import scenarios_directory
import numpy as np
from numpy.typing import NDArray
import pytest
from world_support import RecordedRun, RunBackend, Served, served

# Linear interpolation over two missing samples (30 ms) at 9 m/s^2 is wrong by a t^2 / 8 = 1 mm;
# a display one sample (10 ms) off is wrong by 0.2 m at this game's speeds of 20 m/s and more.
SAME_PLACE_M = 0.002
SHOWN = """
const { t, n, epoch, vehicles, objects } = crgame.world.shown;
const { latest } = crgame.store;
return { t, n, epoch, vehicles: [...vehicles], objects: [...objects], latest: latest.t,
  frames: crgame.world.stats.frames };
"""


@pytest.fixture(scope='module')
def run() -> RecordedRun:
    """Return a game with traffic: two vehicles and six recorded obstacles."""
    return RecordedRun(scenarios_directory() / 'traffic.yaml', 20.0)


@pytest.fixture
def page(run: RecordedRun, browser: Browser) -> Iterator[Served]:
    """Open the page before a run that has not begun, with arrivals up to 8 ms late."""
    with served(RunBackend(run, jitter_s=0.008)) as server:
        browser.open(server.address)
        browser.wait('window.crgame?.ready && crgame.world.shown')
        yield server


def shown(browser: Browser) -> dict[str, Any]:
    """Return the last frame as it was drawn."""
    frame: dict[str, Any] = browser.run(SHOWN)
    frame['vehicles'] = np.array(frame['vehicles'], dtype=float).reshape(-1, STATE_COLUMNS)
    frame['objects'] = np.array(frame['objects'], dtype=float).reshape(-1, 6)
    return frame


def recorded_at(run: RecordedRun, t: float) -> NDArray[np.float64]:
    """Interpolate the recorded vehicle poses (V, 3) linearly."""
    position = t / run.dt_s
    before = min(int(position), len(run.states) - 2)
    first, second = run.states[before, :, :3], run.states[before + 1, :, :3]
    return first + (position - before) * (second - first)


@pytest.mark.exhaustive
def test_vehicles_and_objects_stand_where_the_recording_has_them(
        run: RecordedRun, page: Served, browser: Browser) -> None:
    page.control('start')
    browser.wait('crgame.world.shown.t > 0.5')
    seen = 0
    for _ in range(60):
        frame = shown(browser)
        time.sleep(0.03)
        if frame['t'] > frame['latest']:
            continue
        seen += 1
        assert frame['vehicles'][:, :3] == pytest.approx(
            recorded_at(run, frame['t']), abs=SAME_PLACE_M)
        tick = int(frame['t'] / (run.dt_s * run.steps_per_tick) + 1e-9)
        since = frame['t'] - tick * run.dt_s * run.steps_per_tick
        moved = run.objects[tick, :, :3] + since * run.objects[tick, :, 3:]
        assert frame['objects'][:, :3] == pytest.approx(moved, abs=1e-9, nan_ok=True)
    # The clock is nearly always behind the newest sample.
    assert seen > 40


@pytest.mark.clock
def test_time_never_goes_back_and_keeps_close_behind(page: Served, browser: Browser) -> None:
    page.control('start')
    browser.wait('crgame.world.shown.t > 0.5')
    times, behind = np.array(browser.run_async("""
        const rows = [[], []];
        for (let i = 0; i < 90; i += 1) {
          await new Promise(requestAnimationFrame);
          rows[0].push(crgame.world.shown.t);
          rows[1].push(crgame.store.latest.t - crgame.world.shown.t);
        }
        return rows;"""))
    assert (np.diff(times) >= 0.0).all()
    assert times[-1] > times[0] + 0.5
    # 10 ms of sample period and 8 ms of jitter, and the same again for a busy machine.
    assert np.median(behind) < 0.04


def test_pause_holds_the_last_state_exactly(
        run: RecordedRun, page: Served, browser: Browser) -> None:
    page.control('start')
    browser.wait('crgame.world.shown.t > 0.5')
    page.control('pause')
    browser.wait("crgame.store.status.run === 'paused' && crgame.store.latest.n === arguments[0]"
                 ' && crgame.world.shown.t === crgame.store.latest.t', 'the last state',
                 arguments=(page.backend.n,))
    first = shown(browser)
    time.sleep(0.7)
    second = shown(browser)
    assert first['t'] == second['t'] == first['latest'] == pytest.approx(page.backend.n * 0.01)
    assert np.array_equal(second['vehicles'][:, :8], run.states[page.backend.n, :, :8])
    # Nothing moves, so only changes of the status cause a new picture.
    assert second['frames'] - first['frames'] < 10


@pytest.mark.exhaustive
def test_single_step_shows_the_next_step(page: Served, browser: Browser) -> None:
    page.control('step')
    browser.wait('crgame.world.shown.n === 1', 'the first step')
    page.control('step')
    browser.wait('crgame.world.shown.n === 2', 'the second step')
    assert shown(browser)['t'] == pytest.approx(0.02)


@pytest.mark.exhaustive
def test_reset_shows_the_new_epoch_only(
        run: RecordedRun, page: Served, browser: Browser) -> None:
    page.control('start')
    browser.wait('crgame.world.shown.t > 1')
    page.control('pause')
    page.control('reset')
    # Nothing can be shown between the reset and the first state after it.
    browser.wait('crgame.world.shown?.epoch === 1')
    frame = shown(browser)
    assert frame['t'] == 0.0
    assert np.array_equal(frame['vehicles'][:, :8], run.states[0, :, :8])
    assert browser.run('return crgame.store.samples.length') == 1
    assert browser.run('return crgame.store.history(0, 120).t.length') == 1


@pytest.mark.clock
@pytest.mark.parametrize('factor', [0.2, 5.0])
def test_real_time_factor_is_followed(
        run: RecordedRun, browser: Browser, factor: float) -> None:
    backend = RunBackend(run, every=3)
    backend.factor = factor
    with served(backend) as page:
        browser.open(page.address)
        browser.wait('window.crgame?.ready && crgame.world.shown')
        page.control('start')
        browser.wait('crgame.store.samples.length > 12')
        first = shown(browser), time.monotonic()
        time.sleep(1.5)
        second = shown(browser), time.monotonic()
    rate = (second[0]['t'] - first[0]['t']) / (second[1] - first[1])
    assert rate == pytest.approx(factor, rel=0.25)


@pytest.mark.clock
def test_late_states_are_bridged_for_100_ms_and_no_longer(
        run: RecordedRun, page: Served, browser: Browser) -> None:
    page.control('start')
    browser.wait('crgame.world.shown.t > 0.5')
    page.backend.stalled = True
    time.sleep(0.8)
    frame = shown(browser)
    assert frame['t'] == pytest.approx(frame['latest'] + 0.1)
    last = run.states[page.backend.n]
    moved = last[:, 0] + 0.1 * last[:, 3] * np.cos(last[:, 2] + 0.05 * last[:, 6])
    assert frame['vehicles'][:, 0] == pytest.approx(moved, abs=1e-9)


def test_history_gives_the_recorded_speeds(
        run: RecordedRun, page: Served, browser: Browser) -> None:
    page.control('start')
    browser.wait('crgame.store.latest.t > 2')
    past = browser.run('return crgame.store.history(1, 1.0)')
    steps = np.rint(np.array(past['t']) / run.dt_s).astype(int)
    assert past['speed'] == pytest.approx(run.states[steps, 1, 3], abs=1e-12)
    # At 20 Hz, for the requested time.
    assert 10 <= len(steps) <= 21
    assert np.ptp(past['t']) <= 1.0


@pytest.mark.exhaustive
def test_connection_that_breaks_is_taken_up_again(
        run: RecordedRun, page: Served, browser: Browser) -> None:
    page.control('start')
    browser.wait('crgame.world.shown.t > 0.3')
    # Held, so that a later time comes by the next connection.
    page.control('pause')
    browser.wait('crgame.store.latest.n === arguments[0] && crgame.world.shown.t'
                 ' === crgame.store.latest.t', arguments=(page.backend.n,))
    t = shown(browser)['t']
    clients = list(page.backend.hub.clients)
    browser.run("""window.lost = false;
        crgame.store.on('connection', (connected) => { window.lost ||= !connected; });
        crgame.connection.socket.interrupt();""")
    browser.wait('window.lost', 'the loss')
    browser.wait('crgame.store.connected && crgame.store.me.id !== arguments[0]',
                 'the connection', arguments=(clients[0],))
    page.control('start')
    browser.wait('crgame.world.shown.t > arguments[0] + 0.3', arguments=(t,))


@pytest.mark.exhaustive
def test_simulation_that_began_anew_behind_a_new_connection_is_shown(
        run: RecordedRun, browser: Browser) -> None:
    with served(RunBackend(run)) as page:
        browser.open(page.address)
        browser.wait('window.crgame?.ready && crgame.world.shown')
        page.backend.epoch, page.backend.n = 2, 150
        page.call(page.backend.send_now)
        browser.wait('crgame.world.shown?.epoch === 2 && crgame.world.shown.n === 150')
        # Late frames of a past epoch stay hidden while the connection lasts.
        page.backend.epoch = 0
        page.call(page.backend.send_now)
        time.sleep(0.3)
        assert shown(browser)['epoch'] == 2
        page.backend.n = 0
        browser.run('crgame.connection.socket.interrupt()')
        browser.wait('crgame.world.shown?.epoch === 0 && crgame.world.shown.n === 0')
