# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The world's camera, the visibility of vehicles and plans, and the drawing time."""

from collections.abc import Callable, Iterator
import math
from pathlib import Path
import time

from browser_support import Browser
from crgame_ros.paths import scenarios_directory
import numpy as np
import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from world_support import large_scene, RecordedRun, RunBackend, Served, served

NORTH = math.pi / 2
# Largest blend of a canvas colour with its neighbours' colours at a pixel's edge.
SAME_COLOR = 12
LONGEST_SCRIPT_MS = 8.0


@pytest.fixture(scope='module')
def run() -> RecordedRun:
    """Return the cut-in game: a human and an AV side by side on a straight road."""
    return RecordedRun(scenarios_directory() / 'cut_in.yaml', 5.0)


@pytest.fixture
def page(run: RecordedRun, browser: Browser) -> Iterator[Served]:
    """Open the page before the run begins."""
    with served(RunBackend(run)) as server:
        browser.open(server.address)
        browser.wait('window.crgame?.ready && crgame.world.shown && crgame.world.followed')
        still(browser)
        yield server


def still(browser: Browser) -> None:
    """Wait until the camera has arrived."""
    browser.run_async('await new Promise(requestAnimationFrame);'
                      'await new Promise(requestAnimationFrame);')
    browser.wait('!crgame.world.camera.moves', 'the camera to arrive')


def camera(browser: Browser) -> dict[str, float]:
    state: dict[str, float] = browser.run(
        'const { x, y, scale, up } = crgame.world.camera; return { x, y, scale, up };')
    return state


def press(browser: Browser, key: str) -> None:
    browser.driver.find_element(By.TAG_NAME, 'body').send_keys(key)
    still(browser)


def pixel(browser: Browser, x: float, y: float) -> list[int]:
    """Read the canvas at a point of the map [m]."""
    values: list[int] = browser.run("""
        const { camera } = crgame.world;
        const canvas = document.querySelector('#world');
        const ratio = canvas.width / canvas.clientWidth;
        const at = [camera.toX(...arguments), camera.toY(...arguments)];
        return [...canvas.getContext('2d').getImageData(
          Math.round(at[0] * ratio), Math.round(at[1] * ratio), 1, 1).data].slice(0, 3);
        """, x, y)
    return values


def theme(browser: Browser, name: str) -> list[int]:
    """Read a colour of the theme."""
    values: list[int] = browser.run("""
        const context = document.createElement('canvas').getContext('2d');
        const probe = document.body.appendChild(document.createElement('i'));
        probe.style.color = `var(--${arguments[0]})`;
        context.fillStyle = getComputedStyle(probe).color;
        probe.remove();
        context.fillRect(0, 0, 1, 1);
        return [...context.getImageData(0, 0, 1, 1).data].slice(0, 3);""", name)
    return values


def bonnet(run: RecordedRun, index: int) -> tuple[float, float]:
    """Return a point of a vehicle's bonnet, before the windscreen: 3.3 m before the rear axle."""
    x, y, yaw = run.states[0, index, :3]
    return float(x + 3.3 * math.cos(yaw)), float(y + 3.3 * math.sin(yaw))


@pytest.mark.parametrize('scheme', ['dark', 'light'])
def test_vehicles_and_ground_have_the_colours_of_the_theme(
        run: RecordedRun, page: Served, browser: Browser, scheme: str) -> None:
    browser.prefer(scheme)
    x, y = map(float, run.states[0, 0, :2])
    browser.run('crgame.world.follow(null); crgame.world.camera.zoom(2);'
                f'crgame.world.camera.lookAt({x}, {y}, false)')
    still(browser)
    for index, role in enumerate(('human', 'av')):
        assert pixel(browser, *bonnet(run, index)) == pytest.approx(
            theme(browser, role), abs=SAME_COLOR)
    ground = theme(browser, 'map-ground')
    assert pixel(browser, x + 1.7, y + 14.3) == pytest.approx(
        ground, abs=SAME_COLOR)
    assert (sum(ground) < 3 * 60) == (scheme == 'dark')
    assert browser.console_errors() == []


@pytest.mark.exhaustive
def test_theme_that_changes_repaints_a_world_that_stands_still(
        page: Served, browser: Browser) -> None:
    browser.run("document.documentElement.dataset.theme = 'dark'")
    browser.run('crgame.world.fit(false)')
    still(browser)
    corner = browser.run('return crgame.world.camera.toMap(20, 500)')
    before = pixel(browser, *corner)
    browser.run("document.documentElement.dataset.theme = 'light'")
    still(browser)
    assert np.subtract(pixel(browser, *corner), before).min() > 100


def test_begins_behind_the_first_human_with_its_heading_up(
        run: RecordedRun, page: Served, browser: Browser) -> None:
    assert browser.run('return crgame.world.followed') == 'hv0'
    view = camera(browser)
    assert view['up'] == pytest.approx(run.states[0, 0, 2], abs=1e-3)
    assert view['x'] == pytest.approx(run.states[0, 0, 0] + 1.4227, abs=0.05)
    # More road is shown ahead of it than behind it.
    assert browser.run('return crgame.world.camera.anchorY / crgame.world.camera.height') > 0.5


@pytest.mark.exhaustive
def test_camera_keeps_up_with_the_vehicle_it_follows(page: Served, browser: Browser) -> None:
    page.control('start')
    browser.wait('crgame.world.shown.t > 1')
    far = browser.run("""
        const { camera, shown } = crgame.world;
        const yaw = shown.vehicles[2];
        return Math.hypot(camera.x - shown.vehicles[0] - 1.4227 * Math.cos(yaw),
          camera.y - shown.vehicles[1] - 1.4227 * Math.sin(yaw));""")
    assert far < 0.01


def test_keys_follow_fit_turn_and_zoom(page: Served, browser: Browser) -> None:
    press(browser, 'f')
    assert browser.run('return crgame.world.followed') == 'av0'
    press(browser, 'h')
    assert camera(browser)['up'] == pytest.approx(NORTH)
    scale = camera(browser)['scale']
    press(browser, '+')
    assert camera(browser)['scale'] == pytest.approx(1.25 * scale)
    press(browser, '-')
    assert camera(browser)['scale'] == pytest.approx(scale)
    press(browser, 'q')
    assert camera(browser)['up'] == pytest.approx(NORTH - math.pi / 12)
    press(browser, 'e')
    press(browser, '0')
    assert browser.run('return crgame.world.followed') is None
    inside = browser.run("""
        const { camera } = crgame.world;
        const [left, bottom, right, top] = crgame.store.scene.bounds;
        return [[left, bottom], [right, top]].every(([x, y]) => camera.toX(x, y) >= 0
          && camera.toX(x, y) <= camera.width && camera.toY(x, y) >= 0
          && camera.toY(x, y) <= camera.height - camera.covered);""")
    assert inside


@pytest.mark.exhaustive
def test_keys_that_drive_leave_the_camera_alone(page: Served, browser: Browser) -> None:
    before = camera(browser)
    for key in ('w', 'a', 's', 'd', 'r', ' ', Keys.ARROW_UP, Keys.ARROW_LEFT):
        press(browser, key)
    assert camera(browser) == before


@pytest.mark.exhaustive
def test_wheel_zooms_about_the_pointer(page: Served, browser: Browser) -> None:
    browser.run('crgame.world.fit(false)')
    still(browser)
    under = browser.run('return crgame.world.camera.toMap(300, 200)')
    scale = camera(browser)['scale']
    browser.run("""
        const box = document.querySelector('#world').getBoundingClientRect();
        document.querySelector('#world').dispatchEvent(new WheelEvent('wheel', {
          deltaY: -300, clientX: box.left + 300, clientY: box.top + 200, cancelable: true }));""")
    still(browser)
    assert camera(browser)['scale'] == pytest.approx(scale * math.exp(0.45))
    # Mouse events round to whole pixels.
    assert browser.run('return crgame.world.camera.toMap(300, 200)') == pytest.approx(
        under, abs=1.0 / scale)


@pytest.mark.exhaustive
def test_drag_moves_the_map_with_the_hand_and_right_drag_turns_it(
        page: Served, browser: Browser) -> None:
    canvas = browser.driver.find_element(By.ID, 'world')
    grip = browser.run('return crgame.world.camera.toMap('
                       'document.querySelector("#world").clientWidth / 2,'
                       'document.querySelector("#world").clientHeight / 2)')
    ActionChains(browser.driver).move_to_element(canvas).click_and_hold() \
        .move_by_offset(60, -40).release().perform()
    still(browser)
    assert browser.run('return crgame.world.followed') is None
    there = browser.run('const { camera } = crgame.world; const [x, y] = arguments;'
                        'return [camera.toX(x, y) - camera.width / 2,'
                        'camera.toY(x, y) - camera.height / 2];', *grip)
    assert there == pytest.approx([60, -40], abs=1.5)
    up = camera(browser)['up']
    ActionChains(browser.driver).key_down(Keys.SHIFT).move_to_element_with_offset(
        canvas, 200, 0).click_and_hold().move_by_offset(0, 100).release() \
        .key_up(Keys.SHIFT).perform()
    still(browser)
    # The hand moves down on the right of the middle: the map turns clockwise, with its up.
    assert 0.2 < camera(browser)['up'] - up < 0.8


@pytest.mark.exhaustive
def test_two_fingers_zoom(page: Served, browser: Browser) -> None:
    browser.run('crgame.world.fit(false)')
    still(browser)
    scale = camera(browser)['scale']
    browser.run("""
        const canvas = document.querySelector('#world');
        canvas.setPointerCapture = () => {};
        const box = canvas.getBoundingClientRect();
        const touch = (type, pointerId, x) => canvas.dispatchEvent(new PointerEvent(type, {
          pointerId, pointerType: 'touch', clientX: box.left + x, clientY: box.top + 200 }));
        touch('pointerdown', 11, 300);
        touch('pointerdown', 12, 400);
        touch('pointermove', 12, 500);
        touch('pointerup', 11, 300);
        touch('pointerup', 12, 500);""")
    still(browser)
    assert camera(browser)['scale'] == pytest.approx(2.0 * scale)


def test_plan_is_drawn_until_an_event_hides_it(
        run: RecordedRun, page: Served, browser: Browser) -> None:
    browser.run("crgame.world.follow('av0', false)")
    still(browser)
    x, y, yaw = run.states[0, 1, :3]
    times = 0.1 * np.arange(31)
    plan = np.column_stack([x + 8.0 * times * math.cos(yaw), y + 8.0 * times * math.sin(yaw),
                            np.full(31, yaw), np.full(31, 8.0), times])
    # 14.6 m ahead is no multiple of half a second of the plan: on band and line, on no dot.
    beside = (float(x + 14.6 * math.cos(yaw) - 0.6 * math.sin(yaw)),
              float(y + 14.6 * math.sin(yaw) + 0.6 * math.cos(yaw)))
    road = pixel(browser, *beside)
    page.call(page.backend.send_plan, 1, plan)
    browser.wait('crgame.store.plans.size === 1')
    still(browser)
    covered = pixel(browser, *beside)
    assert np.abs(np.subtract(covered, road)).max() > 2 * SAME_COLOR
    event = {'name': 'hide', 'label': 'Hide', 'kind': 'plan_display', 'when': None,
             'av': 'av0', 'show': False}
    page.publish('scene', page.backend.run.scene | {'events': [event]})
    browser.wait('crgame.store.scene.events.length === 1')
    page.publish('events', {'fired': [{'name': 'hide', 'n': 0, 'k': 0, 'by': 'trigger'}]})
    browser.wait('crgame.store.fired.length === 1')
    still(browser)
    assert pixel(browser, *beside) == road


@pytest.mark.exhaustive
def test_predictions_are_asked_for_when_they_are_shown(page: Served, browser: Browser) -> None:
    client = next(iter(page.backend.hub.clients.values()))
    assert not client.wants_predictions
    browser.run("crgame.world.setLayer('predictions', true)")
    end = time.monotonic() + 5.0
    while not client.wants_predictions:
        assert time.monotonic() < end, 'the server was not told'
        time.sleep(0.02)


@pytest.mark.exhaustive
def test_layers_of_others_are_drawn_in_metres(page: Served, browser: Browser) -> None:
    browser.run("""
        crgame.world.addLayer('rays', (context, { camera, ratio, shown }) => {
          camera.enterMap(context, ratio, shown.vehicles[0] + 20, shown.vehicles[1]);
          context.fillStyle = 'rgb(1, 2, 250)';
          context.fillRect(-2, -2, 4, 4);
        }, 'above');""")
    still(browser)
    at = browser.run('return [crgame.world.shown.vehicles[0] + 20,'
                     'crgame.world.shown.vehicles[1]]')
    assert pixel(browser, *at) == [1, 2, 250]
    browser.run("crgame.world.setLayer('rays', false)")
    still(browser)
    assert pixel(browser, *at) != [1, 2, 250]


@pytest.mark.exhaustive
def test_canvas_has_the_pixels_of_the_screen(page: Served, browser: Browser) -> None:
    for width, height, ratio in ((1280, 720, 1.0), (1920, 1080, 2.0)):
        browser.resize(width, height, ratio)
        browser.wait(f'window.devicePixelRatio === {ratio} && '
                     f'window.innerWidth === {width}')
        still(browser)
        sizes = browser.run('const c = document.querySelector("#world");'
                            'return [c.width, c.height, c.clientWidth, c.clientHeight]')
        assert sizes[:2] == [ratio * sizes[2], ratio * sizes[3]]
        assert sizes[2] > width / 2


@pytest.mark.clock
def test_400_lanelets_and_60_obstacles_draw_within_8_ms_of_script(
        new_browser: Callable[..., Browser], run: RecordedRun, tmp_path: Path) -> None:
    """The script time of a frame on a map of 400 lanelets with 60 cars, all in view."""
    browser = new_browser(1920, 1080)
    with served(RunBackend(run)) as server:
        browser.open(server.address)
        browser.wait('window.crgame?.ready && crgame.world.shown')
        server.publish('scene', large_scene(run))
        browser.wait('crgame.store.scene.lanelets.length === 400')
        script_ms = browser.run_async(SIXTY_CARS)
    assert len(script_ms) == 120
    assert np.median(script_ms) < LONGEST_SCRIPT_MS
    assert browser.console_errors() == []


# Moves 60 cars; returns the script time of 120 frames, without 30 for the compiler. In the
# first half all cars are in view; in the second the camera is near and all details are drawn.
SIXTY_CARS = """
const { world, store } = crgame;
const cars = new Float64Array(6 + 60 * 6);
for (let i = 0; i < 60; i += 1) {
  cars.set([60 * (i % 10) + 20, 60 * Math.floor(i / 10) + 2, 0.2, 10, 1, 0], 6 + 6 * i);
}
world.setLayer('object_labels', true);
const times = [];
for (let frame = 0; frame < 150; frame += 1) {
  cars.set([2, store.epoch, 0, 0, 0, 60]);
  store.receiveFrame(cars.slice().buffer, performance.now());
  if (frame === 0) {
    world.fit(false);
  } else if (frame === 75) {
    world.camera.lookAt(200, 200, false);
  }
  const before = world.stats.frames;
  while (world.stats.frames === before) {
    await new Promise(requestAnimationFrame);
  }
  if (frame >= 30) {
    times.push(world.stats.frame_ms[(world.stats.frames - 1) % world.stats.frame_ms.length]);
  }
}
return times;
"""
