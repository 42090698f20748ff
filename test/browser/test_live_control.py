# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Several people and an experimenter at their pages: seats, run control, planners and events."""

from collections.abc import Iterator
import time

from browser_support import Browser, OpenBrowser
from live_browser_support import BRAKE, Graph, live_graph, LivePage, SCENARIOS, THROTTLE
import numpy as np
import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.select import Select
import yaml

PEDESTRIAN = "crgame.store.scene.objects.findIndex(({ id }) => id === 'o201')"
# Difference of blue and red: the road is grey, the AV's plan is blue.
GREY, BLUE = 25, 60


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph]:
    """Keep one graph of the crossing, whose human's car has no driver at first."""
    folder = tmp_path_factory.mktemp('control')
    game = yaml.safe_load((SCENARIOS / 'crossing.yaml').read_text())
    # On a busy machine the page would get no plans while frames are skipped.
    game |= {'scenario': str(SCENARIOS / game['scenario']), 'duration': 3600,
             'timing': {'frame_skipping': False}}
    game['humans'][0]['driver'] = 'idle'
    (folder / 'game.yaml').write_text(yaml.safe_dump(game))
    with live_graph(folder / 'game.yaml', folder / 'run') as running:
        yield running


@pytest.fixture(scope='module')
def only_page(graph: Graph, module_browser: Browser) -> LivePage:
    """Open the page once."""
    return LivePage(graph, module_browser)


@pytest.fixture
def page(only_page: LivePage) -> Iterator[LivePage]:
    """Return the page of a running run."""
    if only_page.run('return crgame.store.status.run') == 'paused':
        # State left by a failed test.
        only_page.order('start')
    only_page.wait_for_run('running')
    yield only_page
    assert only_page.browser.console_errors() == []


@pytest.fixture
def new_run(page: LivePage) -> LivePage:
    """Return the page of a run that has just begun."""
    page.reset()
    return page


@pytest.mark.exhaustive
def test_a_seat_is_claimed_and_handed_over_between_two_browsers(
        page: LivePage, new_browser: OpenBrowser) -> None:
    """Buttons alone request, hand over and release a seat; one client drives at a time."""
    graph = page.graph
    other = LivePage(graph, new_browser(1000, 640))
    name = other.driver.find_element(By.ID, 'my-name')
    name.send_keys(Keys.CONTROL, 'a')
    name.send_keys('Bob', Keys.ENTER)
    page.claim('hv0')
    other.wait_for_text('li[data-seat="hv0"]', 'Driven by Guest')
    other.click(other.seat_button('hv0', 'ask'))
    page.wait_for_text('.drive-news', 'Bob asks for hv0')
    page.wait_for_text(page.seat_button('hv0', 'hand_over'), 'Hand over to Bob')
    page.hold('w')
    graph.wait_for_command('hv0', THROTTLE, 1.0, 1.0)
    page.click(page.seat_button('hv0', 'hand_over'))
    # It is an offer, which may be declined; nothing changes until it is accepted.
    other.wait_for_text('.drive-news', 'offers you hv0')
    other.click(other.seat_button('hv0', 'decline'))
    page.wait_for_text('.drive-news', 'You keep hv0')
    graph.wait_for_command('hv0', THROTTLE, 1.0, 1.0)
    other.click(other.seat_button('hv0', 'ask'))
    page.click(page.seat_button('hv0', 'hand_over'))
    other.click(other.seat_button('hv0', 'accept'))
    other.wait("crgame.driving.seat === 'hv0'", 'the seat that was handed over')
    # The previous driver's key is still down.
    graph.wait_for_command('hv0', THROTTLE, 0.0, 0.0)
    other.hold('s')
    graph.wait_for_command('hv0', BRAKE, 1.0, 1.0)
    graph.wait_for_steps(20)
    assert np.all(graph.commands('hv0')[1][:, THROTTLE] == 0.0)
    page.wait_for_text('li[data-seat="hv0"]', 'Driven by Bob')
    page.release('w')
    other.release('s')
    other.give_back('hv0')
    page.wait("crgame.store.seats.hv0.source === 'game'", 'the seat of the game')
    graph.wait_for_command('hv0', BRAKE, 0.0, 0.0)
    assert other.browser.console_errors() == []


@pytest.mark.exhaustive
def test_an_av_is_taken_over_and_given_back(page: LivePage) -> None:
    """It brakes by the key, and its planner drives on from that state."""
    graph = page.graph
    # Held until the key is down: the AV brakes from its first step on, at any pace of the test.
    page.hold_at_the_start()
    speed = page.vehicle(1)[3]
    assert speed > 5.0
    page.claim('av0')
    page.wait_for_text('.hud-who', 'You drive av0')
    page.hold('s')
    page.order('start')
    graph.wait_for_command('av0', BRAKE, 1.0, 1.0)
    page.wait('crgame.world.shown.vehicles[13 + 3] < arguments[0] - 3', 'the braking', speed)
    page.wait('Math.abs(crgame.world.shown.vehicles[13 + 3]) < 0.1', 'the AV to stand')
    page.release('s')
    graph.peer.forget()
    page.give_back('av0')
    # The road ahead is free for 30 m, so the IDM accelerates again.
    graph.peer.wait_until(lambda: graph.peer.messages['/vehicles/state']
                          and graph.peer.states('av0')[:, 4].max() > 1.0, 'the planner')
    assert np.isnan(graph.commands('av0')[1][-1][:4]).all()
    page.wait_for_text('li[data-seat="av0"]', 'Driven by the planner idm')


def test_pause_and_step(page: LivePage) -> None:
    """No pixel changes in a pause; a step is one scenario step of N simulation steps."""
    graph = page.graph
    page.follow('hv0')
    page.pause()
    n, before = graph.peer.n, page.picture()
    graph.peer.listen_for(0.3)
    assert graph.peer.n == n == page.run('return crgame.world.shown.n')
    np.testing.assert_array_equal(page.picture(), before)
    # The N steps of a whole tick, from any step of the pause.
    page.order('step')
    graph.peer.wait_until(lambda: graph.peer.n == n + 10, 'ten steps')
    page.wait('crgame.world.shown.n === arguments[0]', 'the step in the picture', n + 10)
    assert np.any(page.picture() != before)
    page.order('start')
    graph.wait_for_steps(20)


@pytest.mark.clock
def test_the_real_time_factor(page: LivePage) -> None:
    """At factor 0.2 a second of simulated time takes five seconds."""
    graph = page.graph
    factor = Select(page.driver.find_element(By.CSS_SELECTOR, '#run-control select'))
    factor.select_by_value('0.2')
    page.wait('crgame.store.status.real_time_factor === 0.2', 'the slow pace')
    graph.peer.listen()
    n, begin_s = graph.peer.n, time.monotonic()
    graph.wait_for_steps(20)
    passed_s = time.monotonic() - begin_s
    assert passed_s >= 0.8 * (graph.peer.n - n) * 0.01 / 0.2
    factor.select_by_value('1')
    page.wait('crgame.store.status.real_time_factor === 1', 'the usual pace')


def _since_reset(graph: Graph) -> dict[int, float]:
    """Return x of the human's car by step of the present epoch; empty before its first step."""
    scheduler = graph.peer.games[-1].scheduler
    graph.peer.listen()
    steps = {scheduler.step_of_stamp(int(row[0])): row[1] for row in graph.peer.states('hv0')}
    return {n: x for n, x in steps.items() if n >= 0} if 0 in steps else {}


def test_reset_begins_anew(page: LivePage) -> None:
    """A reset returns to step 0 of a new epoch, also in the picture."""
    graph = page.graph
    graph.wait_for_steps(50)
    begin = graph.peer.games[-1].epoch
    x = page.vehicle(0)[0]
    graph.peer.forget()
    page.reset()
    # The first state as it was published, and a later one in the picture: the run goes on.
    graph.peer.wait_until(lambda: graph.peer.games[-1].epoch > begin and _since_reset(graph),
                          'the first step of the next epoch')
    assert graph.peer.games[-1].epoch == begin + 1 == page.run('return crgame.world.shown.epoch')
    assert _since_reset(graph)[0] < x
    page.pause()
    n = page.run('return crgame.world.shown.n')
    graph.peer.wait_until(lambda: max(_since_reset(graph)) >= n, 'the state that is shown')
    assert page.vehicle(0)[0] == pytest.approx(_since_reset(graph)[n], abs=1e-6)
    page.order('start')
    page.wait_for_run('running')
    # A declined confirmation changes nothing.
    page.click('#run-control [data-action="reset"]')
    page.click('dialog[open] button:not(.danger)')
    graph.wait_for_steps(20)
    assert graph.peer.games[-1].epoch == begin + 1


@pytest.mark.exhaustive
def test_a_planner_is_stopped_and_goes_on(page: LivePage) -> None:
    """The switch beside its numbers stops and starts a planner."""
    page.tab('timing')
    page.wait_for_text('tbody[data-av="av0"] .tag', 'running')
    page.click('.planner-switch')
    page.wait_for_text('tbody[data-av="av0"] .tag', 'stopped')
    page.wait('crgame.store.status.planners.av0.running === false')
    page.wait_for_text('.planner-switch', 'Go')
    page.click('.planner-switch')
    page.wait_for_text('tbody[data-av="av0"] .tag', 'running')
    assert page.run('return crgame.store.status.planners.av0.running')


def trigger(page: LivePage, label: str) -> None:
    """Press the button of an event."""
    page.tab('events')
    page.click(f'button[aria-label="Trigger {label}"]')


@pytest.mark.exhaustive
def test_a_trigger_lets_the_pedestrian_go(new_run: LivePage) -> None:
    """The pedestrian stands until the button is pressed, and then crosses the road."""
    page = new_run
    at = f'crgame.world.shown.objects[6 * {PEDESTRIAN} + 1]'
    page.wait(f'Number.isFinite({at})', 'the pedestrian')
    stands = page.run(f'return {at}')
    page.graph.wait_for_steps(50)
    assert page.run(f'return {at}') == stands
    trigger(page, 'Let the pedestrian cross')
    page.wait('crgame.store.fired.length === 1', 'the event')
    assert page.run('return [crgame.store.fired[0].name, crgame.store.fired[0].by]') \
        == ['pedestrian', 'trigger']
    page.wait(f'{at} > arguments[0] + 1', 'the pedestrian on the road', stands)
    assert 'Let the pedestrian cross' in page.text('.event-log')
    assert page.run('return document.querySelector(arguments[0]).disabled',
                    'button[aria-label="Trigger Let the pedestrian cross"]')


def plan_color(page: LivePage) -> int:
    """Return the blue of the picture at the plan's place one second ahead."""
    page.wait('crgame.store.plans.size > 0 && crgame.store.status.n === crgame.world.shown.n'
              ' && !crgame.world.camera.moves && crgame.store.plans.get(1).t'
              ' + crgame.store.plans.get(1).points.at(-1) > crgame.world.shown.t + 1', 'a plan')
    red, _, blue = page.run("""
        const { camera, shown } = crgame.world;
        const { t, points } = crgame.store.plans.get(1);
        let i = 0;
        while (t + points[i + 4] < shown.t + 1) {
          i += 5;
        }
        const canvas = document.querySelector('#world');
        const ratio = canvas.width / canvas.clientWidth;
        const at = [camera.toX(points[i], points[i + 1]), camera.toY(points[i], points[i + 1])];
        return [...canvas.getContext('2d').getImageData(
          Math.round(at[0] * ratio), Math.round(at[1] * ratio), 1, 1).data].slice(0, 3);""")
    return int(blue) - int(red)


@pytest.mark.exhaustive
def test_an_event_blanks_the_plan_in_the_picture(new_run: LivePage) -> None:
    """One event hides the plan, another shows it; both act at the next scenario step."""
    page = new_run
    page.follow('av0')
    page.wait('crgame.store.plans.get(1)?.n > 30', 'plans')
    page.pause()
    assert plan_color(page) > BLUE
    for count, (label, shown) in enumerate((('Hide the plan', False),
                                            ('Show the plan again', True)), start=1):
        trigger(page, label)
        page.wait_for_text('.event-list', 'Sent')
        page.order('step')
        page.wait('crgame.store.fired.length === arguments[0]', label, count)
        page.wait_for_frame()
        assert (plan_color(page) > BLUE) == shown
        assert shown or plan_color(page) < GREY
    page.order('start')
    page.wait_for_run('running')
