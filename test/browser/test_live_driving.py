# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A person drives in a browser: real keys, a real graph, and every way of hands off."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

from browser_support import Browser
from crgame_ros.cockpit.frames import STATE_COLUMNS
from crgame_ros.recording.run_folder import run_folder
from live_browser_support import (
    BRAKE,
    Graph,
    live_graph,
    LivePage,
    SCENARIOS,
    STEERING,
    THROTTLE,
)
import numpy as np
from numpy.typing import NDArray
import pytest
from recorded_poses import DT_C_S, DT_S, read_recorded
from selenium.webdriver.common.keys import Keys

# The person stands on the lane towards -x, so that the heading is at the border of +-pi;
# the AV, the leader and the pedestrian are 400 m ahead.
GAME = f"""
scenario: {SCENARIOS / 'ZAM_Crossing-1_1_T-1.xml'}
duration: 3600
humans:
  - {{id: hv0, driver: cockpit, spawn: {{lanelet: 22, s: 40.0, d: 0.0, speed: 0.0}}}}
avs:
  - {{id: av0, planning_problem: 100, planner: idm}}
"""
# Half a second of cycles: pedals may stay pressed so long after hands off.
AT_ONCE = 50
# A pixel of a road marking and one of the road differ by more than this in some colour.
OTHER_COLOR = 25


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph]:
    """Keep one graph, whose run waits for a driver in a browser."""
    folder = tmp_path_factory.mktemp('driving')
    (folder / 'game.yaml').write_text(GAME)
    with live_graph(folder / 'game.yaml', folder / 'run') as running:
        yield running


@pytest.fixture(scope='module')
def only_page(graph: Graph, module_browser: Browser) -> LivePage:
    """Open the page once."""
    return LivePage(graph, module_browser)


def take_the_wheel(page: LivePage) -> None:
    """Set the hands on the controls of hv0 in a running run."""
    if page.run('return crgame.driving.seat') is None:
        page.claim('hv0')
    if page.run('return crgame.store.status.run') == 'paused':
        page.order('start')
    page.wait_for_run('running')


@pytest.fixture
def page(only_page: LivePage) -> Iterator[LivePage]:
    """Return the page of a driver."""
    take_the_wheel(only_page)
    yield only_page
    for tab in only_page.driver.window_handles[1:]:
        # Left open by a failed test.
        only_page.driver.switch_to.window(tab)
        only_page.driver.close()
    only_page.driver.switch_to.window(only_page.driver.window_handles[0])
    only_page.release('w')
    assert only_page.browser.console_errors() == []


def test_the_run_waits_for_a_person_and_shows_what_will_be_driven(only_page: LivePage) -> None:
    """The page opens without error at step 0; two buttons take the seat and start the run."""
    page = only_page
    assert page.browser.console_errors() == []
    page.wait_for_run('paused')
    x, y, yaw, speed = page.vehicle(0)[:4]
    assert (x, y, abs(yaw), speed) == pytest.approx((560.0, 1.75, np.pi, 0.0), abs=1e-6)
    assert 'Waits for a driver' in page.text('li[data-seat="hv0"]')
    page.claim('hv0')
    assert 'You drive' in page.text('li[data-seat="hv0"]')
    page.order('start')
    page.wait_for_run('running')
    page.graph.wait_for_steps(10)
    assert page.vehicle(0)[3] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.exhaustive
def test_holding_w_moves_the_car_and_the_picture(page: LivePage) -> None:
    """No pixel changes before the key press; a release closes the throttle."""
    page.follow('hv0')
    page.wait('Math.abs(crgame.world.shown.vehicles[3]) < 1e-9', 'the standing car')
    before, x = page.picture(), page.vehicle(0)[0]
    np.testing.assert_array_equal(page.picture(), before)
    page.hold('w')
    page.wait('crgame.driving.keyboard.isHeld("KeyW")'
              ' && document.querySelector(".cap-KeyW[data-on]")', 'the key in the picture')
    page.graph.wait_for_command('hv0', THROTTLE, 1.0, 1.0)
    page.wait('crgame.world.shown.vehicles[0] < arguments[0] - 4', 'a way of 4 m', x)
    # The lines repeat every few metres, so a single picture may show them at the old places.
    moved = max(_share_changed(before, page.picture()) for _ in range(3))
    assert moved > 0.002
    # While the pedal is down: a car that rolls on is slow at some time.
    page.wait('Number(document.querySelector(".hud-kmh").textContent) > 10', 'the speed in km/h')
    page.release('w')
    page.graph.wait_for_command('hv0', THROTTLE, 0.0, 0.0)
    assert page.vehicle(0)[0] < x - 4.0


def _share_changed(before: NDArray[np.int64], after: NDArray[np.int64]) -> float:
    return float(np.mean(np.abs(after - before).max(axis=2) > OTHER_COLOR))


def test_every_driving_key_does_what_it_says(page: LivePage) -> None:
    """Keys steer, with left positive (CRG 19), and drive; arrows and space do the same."""
    for key, column, low, high in (
            ('a', STEERING, 0.3, 0.65), ('d', STEERING, -0.65, -0.3), ('s', BRAKE, 0.5, 1.0),
            (Keys.ARROW_LEFT, STEERING, 0.3, 0.65), (' ', BRAKE, 0.5, 1.0)):
        page.hold(key)
        page.graph.wait_for_command('hv0', column, low, high)
        page.release(key)
        page.graph.wait_for_command('hv0', column, 0.0, 0.0)


class Leaving(NamedTuple):
    """A way to take the hands off the controls, the page's text, and the way back."""

    reason: str
    leave: Callable[[LivePage], object]
    come_back: Callable[[LivePage], object]


def _show_first_tab(page: LivePage) -> None:
    page.driver.close()
    page.driver.switch_to.window(page.driver.window_handles[0])


def _focus_another_document(page: LivePage) -> None:
    page.run("""
        const other = document.createElement('iframe');
        other.id = 'other';
        document.body.append(other);
        other.focus();""")


def _click_into_the_page(page: LivePage) -> None:
    page.wait_for_text('.hud-banner', 'Hands off')
    page.click('#world')
    page.run("document.querySelector('#other').remove();")


def _get_the_seat_back(page: LivePage) -> None:
    page.wait('crgame.driving.seat === "hv0"', 'the seat that was kept')


LEAVINGS = {
    'hidden tab': Leaving('hidden', lambda page: page.driver.switch_to.new_window('tab'),
                          _show_first_tab),
    'focus elsewhere': Leaving('focus', _focus_another_document, _click_into_the_page),
    'open dialog': Leaving('dialog', lambda page: page.click('[data-action="reset"]'),
                           lambda page: page.click('dialog[open] button:not(.danger)')),
    'closed socket': Leaving('connection',
                             lambda page: page.run('crgame.connection.socket.interrupt();'),
                             _get_the_seat_back),
}
# Notes the step at which the hands leave, and the page's messages about its hands.
WATCH = """
window.left = null;
window.said = [];
const note = () => { window.left ??= crgame.store.latest.n; };
for (const name of ['blur', 'pagehide']) {
  window.addEventListener(name, note, { capture: true });
}
document.addEventListener('visibilitychange', note, { capture: true });
new MutationObserver(() => document.querySelector('dialog[open]') && note())
  .observe(document.body, { subtree: true, childList: true, attributeFilter: ['open'] });
crgame.store.on('connection', (connected) => connected || note());
if (!Object.hasOwn(crgame.connection, 'send')) {
  const { connection } = crgame;
  const send = connection.send.bind(connection);
  connection.send = (message) => {
    if (message.type === 'input') {
      said.push(message);
    }
    return send(message);
  };
}
"""


@pytest.mark.clock
@pytest.mark.parametrize('leaving', LEAVINGS.values(), ids=LEAVINGS.keys())
def test_hands_off_lets_go_at_once(page: LivePage, leaving: Leaving) -> None:
    """The full pedal is released within 0.5 s, although the key is still down."""
    graph = page.graph
    page.run(WATCH)
    page.hold('w')
    graph.wait_for_command('hv0', THROTTLE, 1.0, 1.0)
    leaving.leave(page)
    graph.peer.wait_until(lambda: graph.commands('hv0')[1][-1, THROTTLE] == 0.0,
                          'the throttle released')
    graph.wait_for_steps(20)
    n, commands = graph.commands('hv0')
    if leaving.reason != 'hidden':
        page.wait('crgame.driving.away === arguments[0] || crgame.driving.seat === null',
                  leaving.reason, leaving.reason)
    leaving.come_back(page)
    left, said = page.run('return [window.left, window.said];')
    held = commands[:, THROTTLE] > 0.0
    assert commands[held, THROTTLE][-1] == 1.0, 'a ramp instead of letting go'
    assert left - AT_ONCE < n[held][-1] <= left + AT_ONCE
    # The page reports hands off if it still can, and never again that the key is down.
    down = [message.get('keys') == [1, 0, 0, 0] for message in said]
    after = said[len(down) - down[::-1].index(True):]
    assert leaving.reason == 'connection' or after[0].get('away')
    assert all(message.get('away') or message['keys'] == [0, 0, 0, 0] for message in after)
    # The key that was down all the time must be pressed again.
    page.wait('crgame.driving.away === null', 'the hands back on the controls')
    assert page.run('return crgame.driving.keyboard.keys') == [0, 0, 0, 0]
    page.release('w')
    page.hold('w')
    graph.wait_for_command('hv0', THROTTLE, 0.05, 1.0)


@pytest.mark.clock
def test_a_closed_tab_lets_go_at_once(page: LivePage) -> None:
    """The seat is left too, and another client may claim it."""
    graph, first = page.graph, page.driver.current_window_handle
    page.give_back('hv0')
    page.driver.switch_to.new_window('tab')
    LivePage(graph, page.browser).claim('hv0')
    page.hold('w')
    graph.wait_for_command('hv0', THROTTLE, 1.0, 1.0)
    page.driver.close()
    graph.peer.listen()
    closed = graph.peer.n
    graph.peer.wait_until(lambda: graph.commands('hv0')[1][-1, THROTTLE] == 0.0,
                          'the throttle released')
    n, commands = graph.commands('hv0')
    assert n[commands[:, THROTTLE] > 0.0][-1] <= closed + AT_ONCE
    page.driver.switch_to.window(first)
    page.wait('crgame.store.seats.hv0.holder === null', 'the seat without a holder')
    page.release('w')


# Collects the drawn poses of each frame, and the samples of the run around them.
COLLECT = """
window.drawn = [];
window.collecting = true;
const collect = () => {
  if (!window.collecting) {
    return;
  }
  requestAnimationFrame(collect);
  const { shown } = crgame.world;
  const { samples, steps } = crgame.store;
  const at = samples.indexAt(shown.t);
  drawn.push({ epoch: shown.epoch, t: shown.t, before: samples.at(at)?.n ?? -1,
    after: samples.at(at + 1)?.n ?? -1, step: steps.at(steps.indexAt(shown.t))?.k ?? -1,
    vehicles: [...shown.vehicles], objects: [...shown.objects] });
};
requestAnimationFrame(collect);
"""


@pytest.mark.clock
def test_poses_as_drawn_are_those_of_the_bag(only_page: LivePage) -> None:
    """They agree to a micrometre in each frame between two samples of the run."""
    page = only_page
    take_the_wheel(page)
    # The leader's recording is short, and the leader must move all the time.
    page.reset()
    page.wait('crgame.driving.away === null', 'the hands on the controls')
    page.run(COLLECT)
    for key in ('w', 'a', 'd'):
        page.hold(key)
        page.graph.wait_for_steps(70)
    for key in ('a', 'd', 'w'):
        page.release(key)
    page.run('window.collecting = false;')
    frames = page.run('return window.drawn;')
    page.order('stop')
    epoch = int(frames[0]['epoch'])
    bag = run_folder(page.graph.launcher.out, epoch) / 'bag'
    page.graph.launcher.wait_for(f'messages in .*{bag.parent.name}/bag')
    recorded = read_recorded(bag, epoch)
    # The other frames were ahead of the newest sample, as happens on a busy machine.
    between = [frame for frame in frames if frame['before'] >= 0 and frame['after'] >= 0
               and frame['step'] == recorded.k0 + int(frame['t'] / DT_C_S + 1e-9)]
    assert len(between) > max(10, 0.2 * len(frames))
    for frame in between:
        assert frame['before'] * DT_S <= frame['t'] + 1e-9 < frame['after'] * DT_S + 2e-9
        vehicles = np.array(frame['vehicles'], dtype=float).reshape(-1, STATE_COLUMNS)[:, :3]
        expected = recorded.vehicles_at(frame['t'], frame['before'], frame['after'])
        np.testing.assert_allclose(vehicles, expected, rtol=0.0, atol=1e-6)
        objects = np.array(frame['objects'], dtype=float).reshape(-1, 6)[:, :3]
        np.testing.assert_allclose(
            objects, recorded.objects_at(frame['t'], frame['step']), rtol=0.0, atol=1e-6)
    assert np.ptp([frame['vehicles'][0] for frame in between]) > 5.0
    assert np.ptp([frame['objects'][0] for frame in between]) > 5.0
