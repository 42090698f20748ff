# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recording in the page shows the bag's content when scrubbed, stepped and played."""

from collections.abc import Iterator
from pathlib import Path
import sys
from typing import Any

from browser_support import Browser
from crgame_ros.analysis.criticality.criticality import COLUMN, Criticality
from crgame_ros.analysis.criticality.recorded import measure_log
from crgame_ros.cockpit.frames import STATE_COLUMNS
from crgame_ros.cockpit.replay_backend import ReplayBackend
from crgame_ros.game.game import load_game
from crgame_ros.paths import default_game
from crgame_ros.recording.offline_recording import write_recording
from crgame_ros.recording.run_trajectories import read_trajectories, RunTrajectories
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from world_support import served

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'cockpit'))

from replay_support import (  # noqa: E402, I100 - importable from here on
    CUT_IN,
    drive,
    happenings,
    PARKED,
    plans,
    record,
    recorder,
    START,
)

DURATION_S, SECOND_S = 32.0, 1.5
# Of the world: its last drawn state.
DRAWN = """
const { t, n, k, epoch, vehicles, objects } = crgame.world.shown;
return { t, n, k, epoch, vehicles: [...vehicles], objects: [...objects] };
"""
# When the world has drawn the time that the player is at.
IS_DRAWN = ('!crgame.replay.loading && crgame.world.shown?.t === crgame.replay.t'
            ' && crgame.world.shown.epoch === crgame.replay.info.epoch')


@pytest.fixture(scope='module')
def first_run() -> OfflineResult:
    """Drive for 32 s: seven chunks, more than are fetched at once."""
    return drive(PARKED, DURATION_S, seed=5)


@pytest.fixture(scope='module')
def bag(first_run: OfflineResult, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record a long run in which things happen, and a short one after a reset."""
    offset_ns = 60_000_000_000
    return record(tmp_path_factory.mktemp('replay') / 'bag', [
        *recorder.messages(first_run), *plans(first_run), *happenings(),
        *recorder.messages(drive(CUT_IN, SECOND_S, seed=2), epoch=1, offset_ns=offset_ns,
                           log_ns=START + offset_ns)])


@pytest.fixture(scope='module')
def log(bag: Path) -> RunTrajectories:
    """Read the first run as the converter does."""
    return read_trajectories(bag, 0)


@pytest.fixture
def page(bag: Path, browser: Browser) -> Iterator[Browser]:
    """Open the page on the first run of the recording."""
    with served(ReplayBackend(bag, 0)) as server:
        browser.open(server.address)
        browser.wait('window.crgame?.replay?.info && crgame.world.shown')
        yield browser
        assert browser.console_errors() == []


def drawn(page: Browser) -> dict[str, Any]:
    """Return the frame in which the world has drawn the player's time."""
    page.wait(IS_DRAWN)
    return last_frame(page)


def last_frame(page: Browser) -> dict[str, Any]:
    """Return the frame that the world has drawn last."""
    frame: dict[str, Any] = page.run(DRAWN)
    frame['vehicles'] = np.array(frame['vehicles'], dtype=float).reshape(-1, STATE_COLUMNS)
    frame['objects'] = np.array(frame['objects'], dtype=float).reshape(-1, 6)
    return frame


def seek(page: Browser, t: float) -> dict[str, Any]:
    """Go to a time; return the frame drawn there."""
    page.run_async('await crgame.replay.seek(arguments[0]);', t)
    return drawn(page)


@pytest.mark.exhaustive
def test_poses_are_those_of_the_bag(page: Browser, log: RunTrajectories,
                                    first_run: OfflineResult) -> None:
    """At ten seeded ticks, in any order, vehicles and objects agree to the last bit."""
    for k in np.random.default_rng(11).permutation(321)[:10].tolist():
        frame = seek(page, k * 10 * 0.01)
        assert (frame['k'], frame['n'], frame['epoch']) == (k, 10 * k, 0)
        np.testing.assert_array_equal(frame['vehicles'][:, :8], log.vehicle_states[k])
        np.testing.assert_array_equal(frame['objects'][:, :3], log.object_poses[k])
    # The bag's poses are those that were driven.
    np.testing.assert_array_equal(log.vehicle_states[:, :, :3],
                                  first_run.vehicle_states[::10, :, :3])


def test_the_recording_of_an_offline_run_plays(browser: Browser, tmp_path: Path) -> None:
    """Its vehicles and plans are drawn, at the time that the time line is at."""
    result = run_offline(build_setup(load_game(default_game())), duration_s=8.0,
                         keep_messages=True)
    with served(ReplayBackend(write_recording(result, tmp_path))) as server:
        browser.open(server.address)
        browser.wait('window.crgame?.replay?.info && crgame.world.shown')
        # In the second chunk, which begins with what is in force.
        frame = seek(browser, 6.2)
        np.testing.assert_array_equal(frame['vehicles'][:, :3], result.vehicle_states[620, :, :3])
        # The plan of the AV, which is the second vehicle, has been followed since this tick.
        assert browser.run('return crgame.store.plans.get(1).n') == 620
        slider = browser.driver.find_element(By.ID, 'timeline-slider')
        assert slider.get_attribute('value') == '620'
        slider.send_keys(Keys.END)
        browser.wait('crgame.replay.n === 800')
        assert browser.console_errors() == []


@pytest.mark.exhaustive
def test_until_its_data_has_come_a_time_is_not_shown(page: Browser, log: RunTrajectories) -> None:
    """The world keeps its picture and does not extrapolate old states."""
    before = seek(page, 1.0)
    page.run("""
      const { fetch } = window;
      const held = new Promise((release) => { crgame.release = release; });
      window.fetch = async (...asked) => { await held; return fetch(...asked); };
      crgame.replay.seek(29.0);""")
    page.run_async("""
      for (let i = 0; i < 5; i += 1) { await new Promise(requestAnimationFrame); }
      crgame.world.redraw();
      await new Promise(requestAnimationFrame);""")
    assert page.run('return [crgame.replay.loading, crgame.replay.t, crgame.world.shown.t]') \
        == [True, 29.0, 1.0]
    np.testing.assert_array_equal(last_frame(page)['vehicles'][:, :8],
                                  before['vehicles'][:, :8])
    page.run('crgame.release();')
    after = drawn(page)
    assert after['t'] == 29.0
    np.testing.assert_array_equal(after['vehicles'][:, :8], log.vehicle_states[290])


@pytest.mark.exhaustive
def test_states_between_the_ticks(page: Browser, first_run: OfflineResult) -> None:
    """The state is exact at a simulation step, and the mean half way between two."""
    frame = seek(page, 1234 * 0.01)
    np.testing.assert_array_equal(frame['vehicles'][:, :3], first_run.vehicle_states[1234, :, :3])
    middle = seek(page, 12.345)['vehicles'][:, :3]
    np.testing.assert_allclose(middle, first_run.vehicle_states[1234:1236, :, :3].mean(axis=0),
                               rtol=0, atol=1e-9)


@pytest.mark.exhaustive
def test_steps_land_on_ticks(page: Browser, log: RunTrajectories) -> None:
    """Keys and buttons step from tick to tick, also back, across the border of two chunks."""
    seek(page, 4.837)
    body = page.driver.find_element(By.TAG_NAME, 'body')
    for keys, k in (('.', 49), ('.', 50), ('.', 51), (',', 50), (',', 49), (Keys.ARROW_LEFT, 48),
                    (Keys.ARROW_RIGHT, 49)):
        body.send_keys(keys)
        page.wait(f'crgame.replay.k === {k} && crgame.replay.n === {10 * k}')
        frame = drawn(page)
        np.testing.assert_array_equal(frame['vehicles'][:, :8], log.vehicle_states[k])
    page.driver.find_element(By.CSS_SELECTOR, '#timeline [data-action="back"]').click()
    page.wait('crgame.replay.n === 480')
    assert page.run('return document.querySelector("#timeline output").textContent') == \
        '4.80 / 32.00 s   k 48'


@pytest.mark.exhaustive
def test_slider_is_dragged_and_steered_by_keys(page: Browser, log: RunTrajectories) -> None:
    """A drag to the middle and back shows each time; the slider's label names its place."""
    slider = page.driver.find_element(By.ID, 'timeline-slider')
    page.run("""
      crgame.dragged = [];
      document.querySelector('#timeline-slider').addEventListener(
        'input', () => crgame.dragged.push(crgame.replay.t));""")
    drag = ActionChains(page.driver).click_and_hold(slider)
    for distance in (100, 100, -150, -150, -200):
        drag.move_by_offset(distance, 0).pause(0.2)
    drag.release().perform()
    way = page.run('return crgame.dragged')
    # The slider is some 1250 px long: 32 s.
    assert np.diff(way) == pytest.approx([2.55, 2.55, -3.83, -3.83, -5.1], abs=0.3)
    back = drawn(page)
    assert 5.0 < back['t'] < 11.0
    before = int(back['n']) // 10
    poses = log.vehicle_states[before:before + 2, :, :2]
    assert np.all(back['vehicles'][:, :2] >= poses.min(axis=0) - 1e-6)
    assert np.all(back['vehicles'][:, :2] <= poses.max(axis=0) + 1e-6)
    slider.send_keys(Keys.HOME)
    page.wait('crgame.replay.n === 0')
    slider.send_keys(Keys.ARROW_RIGHT)
    page.wait('crgame.replay.n === 10')
    assert slider.get_attribute('aria-valuetext') == '0.10 seconds, step 1'
    slider.send_keys(Keys.END)
    page.wait('crgame.replay.n === 3200')
    np.testing.assert_array_equal(drawn(page)['vehicles'][:, :8], log.vehicle_states[320])


@pytest.mark.clock
def test_it_plays_at_its_speed_and_pauses(page: Browser) -> None:
    """The space bar plays; at 8 times real time it passes 3 s quickly and then pauses."""
    seek(page, 2.0)
    page.run('crgame.replay.speed = 8;')
    body = page.driver.find_element(By.TAG_NAME, 'body')
    body.send_keys(' ')
    page.wait('crgame.replay.playing && crgame.replay.t > 5', patience_s=5.0)
    assert page.run('return crgame.store.status.run') == 'running'
    body.send_keys(' ')
    page.wait('!crgame.replay.playing')
    t = page.run('return crgame.replay.t')
    page.wait(f'crgame.world.shown.t === {t}')
    page.run_async('await new Promise((done) => setTimeout(done, 300));')
    assert page.run('return crgame.replay.t') == t
    # It does not restart at the end.
    seek(page, 31.5)
    page.run('crgame.replay.play();')
    page.wait('!crgame.replay.playing')
    page.wait('crgame.store.status.run === "ended"')
    assert page.run('return [crgame.replay.t, crgame.store.status.t]') == [32.0, 32.0]
    # Some of the shown chunks are no longer stored.
    assert page.run('return crgame.replay.chunksHeld') <= 12


@pytest.mark.exhaustive
def test_events_are_jumped_to(page: Browser) -> None:
    """Bracket keys go from mark to mark in both directions and name the event."""
    marks = page.run('return [...document.querySelectorAll(".mark")].map((m) => '
                     '[m.dataset.kind, m.title, m.querySelector("path").getAttribute("d"), '
                     'getComputedStyle(m).color])')
    assert [kind for kind, *_ in marks] == ['collision', 'trigger', 'refused_plan', 'stale_plan']
    assert len({shape for _, _, shape, _ in marks}) == 4
    assert 'collision with o1' in marks[0][1] and '3 times' in marks[2][1]
    body = page.driver.find_element(By.TAG_NAME, 'body')
    for key, n in ((']', 453), (']', 610), (']', 700), (']', 800), (']', 800), ('[', 700),
                   ('[', 610), ('[', 453)):
        body.send_keys(key)
        page.wait(f'crgame.replay.n === {n}')
    told = page.run('return document.querySelector(".timeline-event").textContent')
    assert told == '4.53 s  Collision (hv0): collision with o1'
    page.driver.find_element(By.CSS_SELECTOR, '.mark[data-kind="stale_plan"]').click()
    page.wait('crgame.replay.n === 800')


@pytest.mark.exhaustive
def test_documents_follow_the_time_back_too(page: Browser) -> None:
    """Signals, fired events, alarms, plans and the status are those of the shown time."""
    def documents() -> Any:
        return page.run("""
          const { store } = crgame;
          return [store.signals.states['7'], store.fired.map((entry) => entry.name),
            store.alarms.map((alarm) => alarm.id), store.status.k,
            store.status.planners.av0?.stale ?? null, store.plans.get(1)?.n ?? null];""")

    for t, expected in (
            (2.0, ['red', [], [], 20, None, 190]),
            (4.6, ['green', [], ['collision:hv0'], 46, None, 450]),
            (8.5, ['green', ['barrier'], ['stale_plan:av0'], 85, True, 840]),
            (9.5, ['green', ['barrier'], [], 95, False, 940]),
            (6.05, ['green', [], [], 60, None, 600]),
            (0.0, ['red', [], [], 0, None, None])):
        seek(page, t)
        assert documents() == expected
    page.run('crgame.replay.seek(4.6);')
    page.wait('document.querySelector("#alarms [data-kind=collision]")')


@pytest.mark.exhaustive
def test_plots_have_the_past_and_the_future(page: Browser, log: RunTrajectories) -> None:
    """After a jump the history comes from the recording at once."""
    seek(page, 20.0)
    page.wait('crgame.store.history(0, 10).t.length > 100')
    past = page.run('return crgame.store.history(0, 10);')
    assert past['t'][0] == pytest.approx(10.0) and past['t'][-1] == 32.0
    at_ticks = {round(t * 10): speed for t, speed in zip(past['t'], past['speed'], strict=True)
                if abs(t * 10 - round(t * 10)) < 1e-6}
    assert [at_ticks[k] for k in range(100, 321)] == log.vehicle_states[100:, 0, 3].tolist()


@pytest.mark.exhaustive
def test_another_run_of_the_recording(page: Browser, bag: Path) -> None:
    """The list of runs opens the other run, with its own scene, and the first one again."""
    second = read_trajectories(bag, 1)
    choice = page.driver.find_element(By.CSS_SELECTOR, '#timeline select[aria-label="Run"]')
    assert [o.text for o in choice.find_elements(By.TAG_NAME, 'option')] == ['1 of 2', '2 of 2']
    choice.find_elements(By.TAG_NAME, 'option')[1].click()
    page.wait('crgame.replay.info.epoch === 1')
    frame = seek(page, 1.2)
    assert (frame['k'], frame['epoch']) == (12, 1)
    np.testing.assert_array_equal(frame['vehicles'][:, :8], second.vehicle_states[12])
    assert page.run('return crgame.store.scene.benchmark_id') == 'ZAM_CutIn-1_1_T-1'
    choice.find_elements(By.TAG_NAME, 'option')[0].click()
    page.wait('crgame.replay.info.epoch === 0')
    assert seek(page, 1.2)['epoch'] == 0
    assert page.run('return crgame.store.scene.benchmark_id') == 'ZAM_ParkedCars-1_1_T-1'


@pytest.mark.exhaustive
def test_criticality_is_measured_and_shown_at_any_time(page: Browser,
                                                       log: RunTrajectories) -> None:
    """The panel has the smallest distance now and so far, as measured from the bag."""
    found: dict[int, tuple[float, str]] = {}

    def take(criticality: Criticality) -> None:
        for tick in criticality.latest:
            if tick.subject == 0:
                values, others = tick.worst()
                column = COLUMN['min_distance']
                found[criticality.n] = values[column], criticality.ids[others[column]]

    measure_log(log, on_tick=take)
    seek(page, 6.0)
    page.run("document.querySelector('#tab-criticality').click()")
    cells = """[...document.querySelectorAll(
        '#panel-criticality [data-id=hv0] [data-key=min_distance] td')].map((it) => it.textContent)
    """
    page.wait(f'({cells})[0] > ""  && ({cells})[0] !== "–"')
    worst = min((value, n, other) for n, (value, other) in found.items() if n <= 600)
    now, other = found[600]
    assert page.run(f'return {cells}') == [
        f'{now:.2f}', other, f'{worst[0]:.2f} ({worst[2]}, {worst[1] / 100:.1f} s)']
