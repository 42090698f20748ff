# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sound and rumble in use: they start by a click and are silent when they must be."""

from collections.abc import Iterator
import time

from browser_support import Browser
from crgame_ros.paths import scenarios_directory
import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from world_support import RecordedRun, RunBackend, Served, served

pytestmark = pytest.mark.exhaustive

# Every sample that the page sends to its speakers also passes `heardPeak`.
TAP = """
const connect = AudioNode.prototype.connect;
AudioNode.prototype.connect = function (to, ...rest) {
  if (to instanceof AudioDestinationNode && to.context instanceof AudioContext) {
    const tap = to.context.createAnalyser();
    tap.fftSize = 32768;
    connect.call(this, tap);
    window.heardPeak = () => {
      const samples = new Float32Array(tap.fftSize);
      tap.getFloatTimeDomainData(samples);
      return [to.context.state, Math.max(...samples.map(Math.abs))];
    };
  }
  return connect.call(this, to, ...rest);
};
"""
# Stands for missing hardware: one gamepad of the standard layout, whose motors record
# their commands.
PAD = """
window.effects = [];
const buttons = Array.from({ length: 17 }, () => ({ value: 0, pressed: false, touched: false }));
const pad = {
  id: 'Test pad (STANDARD GAMEPAD)', index: 0, connected: true, mapping: 'standard', timestamp: 1,
  axes: [0, 0, 0, 0], buttons,
  vibrationActuator: {
    playEffect(type, effect) {
      effects.push({ type, ...effect });
      return Promise.resolve('complete');
    },
    reset() {
      effects.push({ type: 'reset' });
      return Promise.resolve('complete');
    },
  },
};
navigator.getGamepads = () => [pad];
window.moveStick = (value) => { pad.axes = [value, 0, 0, 0]; };
"""


@pytest.fixture(scope='module')
def run() -> RecordedRun:
    """Return the cut-in game."""
    return RecordedRun(scenarios_directory() / 'cut_in.yaml', 15.0)


@pytest.fixture
def page(run: RecordedRun, browser: Browser) -> Iterator[Served]:
    """Open the page before the run begins."""
    added = [browser.driver.execute_cdp_cmd(
        'Page.addScriptToEvaluateOnNewDocument', {'source': source}) for source in (TAP, PAD)]
    with served(RunBackend(run)) as server:
        browser.open(server.address)
        browser.wait('window.crgame?.ready && crgame.world.shown && crgame.world.followed')
        yield server
    for script in added:
        browser.driver.execute_cdp_cmd('Page.removeScriptToEvaluateOnNewDocument', script)
    assert browser.console_errors() == []


def turn_on(browser: Browser) -> None:
    """Turn the sound on as a person does, by a click."""
    browser.click('#sound')
    browser.click('#sound-panel .drive-button')
    browser.wait('crgame.sound.on', 'sound')


def silent(browser: Browser) -> None:
    """Wait until only zeros go to the speakers: 32768 of them are 0.7 s."""
    browser.wait('crgame.sound.heard === null && (heardPeak()[0] === "suspended"'
                 ' || heardPeak()[1] === 0)', 'silence')


def take_seat(page: Served, browser: Browser) -> None:
    """Make this page hold the human's seat."""
    me = browser.run('return crgame.store.me')
    page.publish('seats', {'seats': {'hv0': {
        'source': 'cockpit', 'driver': 'cockpit', 'holder': me['id'], 'holder_name': me['name'],
        'requests': [], 'others': [], 'lost': False}}})
    browser.wait("crgame.driving.seat === 'hv0'", 'the seat')
    browser.run('window.focus();')
    browser.click('#world')
    browser.wait('crgame.driving.away === null', 'hands on the controls')


def test_it_begins_with_a_click_and_is_silent_in_a_pause(page: Served, browser: Browser) -> None:
    assert browser.run('return [crgame.sound.wanted, typeof window.heardPeak]') == [
        False, 'undefined']
    assert 'off' in browser.driver.find_element(By.ID, 'sound').get_attribute('title')
    page.control('start')
    turn_on(browser)
    browser.wait('heardPeak()[1] > 0.01', 'an engine')
    assert browser.run('return crgame.sound.heard.own.id') == 'hv0'
    assert browser.run('return heardPeak()[1]') < 1.0
    client = next(iter(page.backend.hub.clients.values()))
    assert client.sound.on and client.sound.volume == pytest.approx(0.7)
    page.control('pause')
    silent(browser)
    page.control('start')
    browser.wait('heardPeak()[1] > 0.01', 'the engine again')
    # M turns it off, also while the panel is open.
    browser.driver.find_element(By.TAG_NAME, 'body').send_keys('m')
    silent(browser)
    deadline = time.monotonic() + 10.0
    while client.sound.on and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not client.sound.on


def test_the_volume_is_kept_and_told(page: Served, browser: Browser) -> None:
    page.control('start')
    turn_on(browser)
    browser.wait('heardPeak()[1] > 0.01', 'an engine')
    slider = browser.driver.find_element(By.CSS_SELECTOR, '.sound-slider input')
    slider.send_keys(Keys.HOME)
    browser.wait('crgame.sound.volume === 0 && heardPeak()[1] === 0', 'silence at volume 0')
    slider.send_keys(Keys.ARROW_RIGHT)
    browser.wait('crgame.sound.volume === 0.05 && heardPeak()[1] > 0', 'something')
    client = next(iter(page.backend.hub.clients.values()))
    assert client.sound.volume == pytest.approx(0.05)
    browser.driver.refresh()
    browser.wait('window.crgame?.ready')
    # Sound was on: the page waits for a gesture and says so.
    assert browser.run('return [crgame.sound.volume, crgame.sound.wanted]') == [0.05, True]


def test_a_hidden_page_is_silent(page: Served, browser: Browser) -> None:
    page.control('start')
    turn_on(browser)
    browser.wait('heardPeak()[1] > 0.01', 'an engine')
    browser.run("""
        window.notes = [];
        setInterval(() => notes.push([document.visibilityState, ...heardPeak()]), 200);""")
    own = browser.driver.current_window_handle
    browser.driver.switch_to.new_window('tab')
    time.sleep(3.0)
    browser.driver.close()
    browser.driver.switch_to.window(own)
    hidden = [note for note in browser.run('return notes') if note[0] == 'hidden']
    # The analyser keeps the last samples of a suspended context.
    assert hidden and (hidden[-1][1] == 'suspended' or hidden[-1][2] == 0)
    browser.wait("document.visibilityState === 'visible' && heardPeak()[1] > 0.01", 'the engine')


def test_a_game_may_have_none(page: Served, browser: Browser, run: RecordedRun) -> None:
    page.publish('scene', run.scene | {'sound': 'none'})
    page.control('start')
    browser.wait("crgame.store.scene.sound === 'none'")
    take_seat(page, browser)
    browser.run('moveStick(0.6)')
    browser.driver.find_element(By.TAG_NAME, 'body').send_keys('m')
    browser.click('#sound')
    assert not browser.driver.find_element(
        By.CSS_SELECTOR, '#sound-panel .drive-button').is_enabled()
    off_road(page, browser)
    time.sleep(0.3)
    assert browser.run('return [crgame.sound.on, typeof window.heardPeak, effects.length]') == [
        False, 'undefined', 0]


def off_road(page: Served, browser: Browser) -> None:
    """Put the human's vehicle beside the road."""
    page.backend.drivability = {'hv0': {'collision': False, 'off_road': True, 'hit': []}}
    browser.wait('crgame.store.status.drivability.hv0?.off_road', 'off the road')


def test_a_kerb_between_two_lanes_is_felt(page: Served, browser: Browser,
                                          run: RecordedRun) -> None:
    """The human cuts in across the kerb without leaving the road."""
    page.publish('scene', run.scene | {'lanelets': [
        lanelet | {'right_line': 'curb'} if lanelet['left_line'] == 'solid' else lanelet
        for lanelet in run.scene['lanelets']]})
    page.control('start')
    take_seat(page, browser)
    browser.run('moveStick(0.6)')
    browser.wait('effects.some(({ strongMagnitude }) => strongMagnitude > 0.2)', 'the kerb')
    assert browser.run(
        'return crgame.store.status.drivability.hv0?.off_road ?? false') is False


def test_a_gamepad_rumbles_beside_the_road_and_stands_when_the_seat_is_lost(
        page: Served, browser: Browser) -> None:
    page.control('start')
    take_seat(page, browser)
    browser.run('moveStick(0.6)')
    browser.wait('crgame.driving.gamepads.active !== null', 'the gamepad')
    assert browser.run('return effects') == []
    off_road(page, browser)
    browser.wait('effects.some(({ weakMagnitude }) => weakMagnitude > 0)', 'rumble')
    effect = browser.run('return effects.at(-1)')
    assert effect['type'] == 'dual-rumble'
    assert 0.0 < effect['strongMagnitude'] <= 0.5 and effect['startDelay'] == 0
    page.control('pause')
    browser.wait("effects.at(-1).type === 'reset'", 'motors that stand in a pause')
    page.control('start')
    browser.wait("effects.at(-1).type === 'dual-rumble'", 'rumble again')
    page.publish('seats', {'seats': {}})
    browser.wait("effects.at(-1).type === 'reset'", 'motors that stand without a seat')
