# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Return to the lane after a contact, a restart, and a local device."""

from collections.abc import Iterator
from itertools import count
import signal

from browser_support import Browser
from crgame_ros.launcher.run_plan import effective_setup, RunRequest
from crgame_ros.recording.recorded_game import read_run_events, recorded_inputs
from crgame_ros.recording.run_folder import run_folders
from crgame_ros.recording.run_points import recorded_states
from crgame_ros.recording.run_record import read_run_record
from crgame_ros.simulation.offline import run_offline
from crgame_ros.verdict.validation import validate
from live_browser_support import Graph, live_graph, LivePage, PATIENCE_S, SCENARIOS
import numpy as np
import pytest
from selenium.webdriver.common.keys import Keys
from sensor_msgs.msg import Joy

pytestmark = pytest.mark.exhaustive

# The person approaches from behind a vehicle that a joy node drives and that stands askew.
GAME = f"""
scenario: {SCENARIOS / 'ZAM_CutIn-1_1_T-1.xml'}
duration: 3600
humans:
  - {{id: hv0, driver: cockpit, spawn: {{x: -90.0, y: 0.0, yaw: 0.0, speed: 10.0}}}}
  - {{id: hv1, driver: joy, spawn: {{x: -60.0, y: 1.2, yaw: 0.2, speed: 0.0}}}}
avs: []
drivability: {{contact: stop}}
"""


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph]:
    """Keep one graph."""
    folder = tmp_path_factory.mktemp('seat')
    (folder / 'game.yaml').write_text(GAME)
    with live_graph(folder / 'game.yaml', folder / 'run') as running:
        yield running


@pytest.fixture(scope='module')
def page(graph: Graph, module_browser: Browser) -> LivePage:
    """Open the page once; the tests are one session, in their order."""
    opened = LivePage(graph, module_browser)
    opened.keep_messages()
    return opened


def put_backs(page: LivePage) -> list[dict[str, object]]:
    """Return the events by drivers, as stored in the page."""
    return list(page.run('return crgame.store.fired.filter((event) => event.by === "driver")'))


def drive_into_it(page: LivePage) -> None:
    """Hold the throttle until the vehicle has touched the other one and stands."""
    page.hold('w')
    page.wait('document.querySelector("#outcome").dataset.phase === "mishap"', 'the contact')
    page.wait('Math.abs(crgame.world.shown.vehicles[3]) < 0.5', 'the vehicle to stand')
    page.release('w')
    page.wait('crgame.world.shown.vehicles[8] === 0', 'the throttle to be released')


def test_a_vehicle_is_put_back_by_button_and_by_key(page: LivePage) -> None:
    page.claim('hv0')
    page.order('start')
    page.wait_for_run('running')
    drive_into_it(page)
    x = page.vehicle(0)[0]
    page.click('#outcome [data-action=put_back]')
    page.wait('crgame.store.fired.some((event) => event.by === "driver")', 'the event')
    page.wait('document.querySelector("#outcome").hidden', 'the notice to go')
    page.wait('crgame.world.shown.vehicles[0] < arguments[0] - 2', 'the jump to be shown', x)
    row = page.vehicle(0)
    assert abs(row[1]) < 0.05 and abs(row[2]) < 1e-3 and row[3] == pytest.approx(0.0, abs=1e-3)
    contacts = 'crgame.store.fired.filter((event) => event.by === "contact").length'
    before = page.run(f'return {contacts}')
    page.hold('w')
    # It has driven on, as it touches the other one again.
    page.wait(f'{contacts} > arguments[0]', 'the next contact', before)
    page.wait('Math.abs(crgame.world.shown.vehicles[3]) < 0.5', 'to stand again')
    page.release('w')
    page.hold(Keys.BACKSPACE)
    page.wait('crgame.store.fired.filter((event) => event.by === "driver").length === 2',
              'the second event')
    page.release(Keys.BACKSPACE)
    assert {event['name'] for event in put_backs(page)} == {'put back hv0'}
    assert page.browser.console_errors() == []


def test_the_delay_of_a_device_at_the_machine_is_shown(page: LivePage, graph: Graph) -> None:
    publisher, numbers = graph.peer.publisher('/<hv>/joy', 'hv1'), count()

    def shown() -> bool:
        # The left trigger, with slight changes: only inputs that change something are measured.
        publisher.publish(Joy(axes=[0.0, 0.0, 0.2 + 0.1 * (next(numbers) % 2), 0.0, 0.0, 1.0],
                              buttons=[0] * 11))
        graph.peer.listen_for(0.04)
        return 'input latency' in page.text('li[data-device="hv1"]')
    graph.peer.wait_until(shown, 'the delay of the device', PATIENCE_S)
    text = page.text('li[data-device="hv1"]')
    assert text.startswith('generic_gamepad') and 'command latency' in text


def test_once_more_needs_no_second_start(page: LivePage) -> None:
    epoch = page.run('return crgame.store.status.epoch')
    page.hold('r')
    page.wait('crgame.store.status.epoch > arguments[0]', 'a new run', epoch)
    page.release('r')
    page.wait('crgame.store.status.run === "running" && crgame.store.status.n > 0',
              'the run to go on by itself')
    # A run that was paused stays paused.
    page.order('pause')
    page.wait_for_run('paused')
    page.order('reset')
    page.wait('crgame.store.status.epoch > arguments[0] + 1'
              ' && crgame.store.status.run === "paused"', 'a run that stands', epoch)


def test_again_from_the_card_needs_no_second_start(page: LivePage) -> None:
    """One click starts the next run after a run in which the seat was driven."""
    page.order('start')
    page.wait_for_run('running')
    page.order('stop')
    page.wait_for_run('ended')
    epoch = page.run('return crgame.store.status.epoch')
    page.click('#outcome [data-action=again]')
    page.wait('crgame.store.status.epoch > arguments[0] && crgame.store.status.run === "running"'
              ' && crgame.store.status.n > 0', 'the next run to go on by itself', epoch)
    assert page.run('return [crgame.driving.seat, document.querySelector("#outcome").hidden]'
                    ) == ['hv0', True]
    assert page.browser.console_errors() == []


def test_how_it_went_after_a_contact(page: LivePage) -> None:
    """The card of a held run shows the contact and choices; score and files come at the end."""
    page.reset()
    drive_into_it(page)
    # A refused pause does not hold the run and has no effect on a later pause.
    page.run("""const ask = crgame.connection.request;
        crgame.connection.request = async () => {
          crgame.connection.request = ask;
          return { ok: false, text: 'not now' };
        };""")
    page.click('#outcome [data-action=look]')
    page.wait_for_text('#notices', 'not now')
    page.order('pause')
    page.wait_for_run('paused')
    assert page.run('return crgame.lastSeconds.isOpen') is False
    page.order('start')
    page.wait_for_run('running')
    page.click('#outcome [data-action=hold]')
    page.wait('document.querySelector("#outcome").dataset.phase === "held"', 'the card')
    text = page.text('#outcome')
    assert text.startswith('Collision') and 'You touched hv1 at' in text
    assert 'hv0 with hv1 at' in text and 'No score: it is made when the run is over' in text
    page.click('#outcome [data-action=look]')
    page.wait('crgame.lastSeconds.isOpen'
              ' && !document.querySelector("#outcome").checkVisibility()', 'the last 10 s')
    page.click('#last-seconds [data-action=end]')
    page.click('#outcome [data-action=start]')
    page.wait('crgame.store.status.run === "running"'
              ' && document.querySelector("#outcome").hidden', 'the run to go on')
    assert page.browser.console_errors() == []


def test_a_mere_driver_gets_the_reason_of_a_refusal(page: LivePage) -> None:
    """Buttons and the key that the server would refuse give the reason and send no request."""
    page.reset()
    drive_into_it(page)
    page.run_async("await crgame.connection.request({type: 'role', role: 'drive'});")
    page.wait('document.querySelector("#outcome [data-action=hold]").disabled', 'no holding')
    assert page.run("""return [...document.querySelectorAll('#outcome button:disabled')].map(
        (node) => [node.dataset.action, node.title]);""") == [
        [action, f'Only a director can {deed} the run; you are a driver.'] for action, deed in (
            ('hold', 'pause'), ('look', 'pause'), ('again', 'reset'))]
    epoch = page.run('return crgame.store.status.epoch')
    page.hold('r')
    page.wait('!document.querySelector(".restart-hint").hidden', 'the hint')
    assert page.text('.restart-hint') == 'Only a director can reset the run; you are a driver.'
    # Longer than the key must be held for a reset.
    page.graph.peer.listen_for(1.5)
    page.release('r')
    assert page.run('return crgame.store.status.epoch') == epoch
    page.run_async("await crgame.connection.request({type: 'role', role: 'all'});")
    page.click('#outcome [data-action=hold]')
    page.click('#outcome [data-action=stop]')
    page.click('dialog.confirm[open] .danger')
    page.wait('document.querySelector(".score[data-state=told]")', 'the score')
    assert 'It was stopped by hand' in page.text('#outcome')
    page.run_async("await crgame.connection.request({type: 'role', role: 'drive'});")
    page.wait_for_text('.outcome-gone', 'Only a director can choose what is run')
    assert page.run("""return [...document.querySelectorAll('#outcome button:disabled')].map(
        (node) => node.dataset.action);""") == ['again', 'next', 'another']
    page.run_async("await crgame.connection.request({type: 'role', role: 'all'});")
    assert page.browser.console_errors() == []


def test_the_screen_is_filled_and_left_again(page: LivePage) -> None:
    for pressed in ('true', 'false'):
        page.click('#fullscreen')
        page.wait('String(document.fullscreenElement !== null) === arguments[0] && document'
                  '.querySelector("#fullscreen").getAttribute("aria-pressed") === arguments[0]',
                  'the screen', pressed)
    assert page.browser.console_errors() == []


def test_the_recording_repeats_the_jumps_to_the_last_bit(graph: Graph) -> None:
    launcher = graph.launcher
    launcher.signal(signal.SIGINT)
    assert launcher.wait() == 0, launcher.text
    bag = run_folders(launcher.out)[0] / 'bag'
    fired = read_run_events(bag).fired
    # The vehicle rolls on afterwards and may touch the other one again.
    assert [event.name for event in fired[:4]] == [
        'contact of hv0 with hv1', 'put back hv0'] * 2
    assert [event.vehicle for event in fired].count('hv0') == 2
    device = [item for item in read_run_record(bag).drivers if item.spell.seat == 'hv1']
    assert device[0].input_delay_ms is not None and 0.0 < device[0].input_delay_ms < 1000.0
    setup = effective_setup(RunRequest(driver=f'replay:{bag}'))
    inputs = recorded_inputs(setup)
    assert inputs.intervals_s is not None
    result = run_offline(setup, duration_s=len(inputs.intervals_s) * setup.scheduler.dt_s,
                         drivers=inputs.drivers, intervals_s=inputs.intervals_s)
    assert [(event.name, event.n) for event in result.fired] == [
        (event.name, event.n) for event in fired]
    recorded = recorded_states(bag)['hv0']
    known = np.isfinite(recorded[:, 0])
    np.testing.assert_array_equal(
        result.states_of('hv0')[:len(recorded)][known][:, :3], recorded[known][:, :3])
    assert not validate(next(bag.parent.glob('*.xml'))).faults
