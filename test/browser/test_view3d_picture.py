# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One picture of the 3D view: its drawing costs, its saved file, and its focus."""

from collections.abc import Iterator
import math
from pathlib import Path
import time

from browser_support import Browser, skip_without_three
from crgame_ros.paths import scenarios_directory
from PIL import Image
import pytest
from world_support import large_scene, RecordedRun, RunBackend, Served, served

MOST_CALLS, MOST_TRIANGLES = 150, 300_000
# 60 cars on the roads of the large scene, which drive a bend.
CARS = """
const cars = new Float64Array(6 + 60 * 6);
cars.set([2, crgame.store.epoch, 0, 0, 0, 60]);
for (let i = 0; i < 60; i += 1) {
  cars.set([60 * (i % 10) + 20, 60 * Math.floor(i / 10) + 2, 0.2, 10, 1, 0.1], 6 + 6 * i);
}
crgame.store.receiveFrame(cars.buffer, performance.now());
"""
# Draws from several places all around: each mirror once, from behind and from above. Returns
# the maximum of each count.
ALL_AROUND = CARS + """
const { picture } = crgame.view3d;
picture.sharp = true;
picture.resize(1920, 1080);
const shown = { ...crgame.store.displayed(performance.now()) };
shown.vehicles = Float64Array.from(shown.vehicles);
const most = { draw_calls: 0, triangles: 0, cars: shown.objects.length / 6, drawn: 0,
  ratio: picture.stats.ratio, width: document.querySelector('#view3d').width };
const [x, y] = arguments;
// Across the map, where most is in view.
for (let yaw = Math.PI / 4; yaw < 2 * Math.PI; yaw += Math.PI / 2) {
  shown.vehicles.set([x, y, yaw]);
  for (const viewpoint of ['driver', 'driver', 'driver', 'chase', 'bird']) {
    most.drawn += picture.draw(shown, 0, { viewpoint, index: 0, aside: 0, height: 0.8,
      mirrors: true, plans: true });
    for (const count of ['draw_calls', 'triangles']) {
      most[count] = Math.max(most[count], picture.stats[count]);
    }
  }
}
return most;
"""

# Returns each car's front wheel angle and wheelbase.
WHEELS = CARS + """
const { FittedParts } = await import('/static/js/view3d/fitted_parts.js');
const { addWheels } = FittedParts.prototype;
const found = [];
FittedParts.prototype.addWheels = function note(place, wheels, scale, steering, ...rest) {
  found.push([scale[0] * (wheels.front - wheels.rear), steering]);
  return addWheels.call(this, place, wheels, scale, steering, ...rest);
};
const shown = { ...crgame.store.displayed(performance.now()) };
shown.vehicles = Float64Array.from(shown.vehicles);
shown.vehicles.set([5, 2, 0]);
const { picture } = crgame.view3d;
// Near and far.
picture.sharp = true;
picture.draw(shown, 0, { viewpoint: 'chase', index: 0, aside: 0, height: 0.8,
  mirrors: false, plans: false });
FittedParts.prototype.addWheels = addWheels;
return found.slice(0, -shown.vehicles.length / 13);
"""


@pytest.fixture(scope='module')
def run() -> RecordedRun:
    return RecordedRun(scenarios_directory() / 'cut_in.yaml', 1.0)


@pytest.fixture
def cockpit(run: RecordedRun) -> Iterator[Served]:
    with served(RunBackend(run)) as running:
        yield running


@pytest.fixture
def page(cockpit: Served, browser: Browser) -> Browser:
    """Return a page whose 3D view is open."""
    skip_without_three()
    browser.resize(800, 500)
    browser.open(cockpit.address)
    browser.wait('window.crgame?.ready && crgame.store.scene && crgame.store.latest')
    assert browser.run_async('return await crgame.view3d.show(true)')
    browser.wait('crgame.view3d.stats.frames > 3')
    return browser


@pytest.mark.exhaustive
@pytest.mark.parametrize('light', ['day', 'dusk'])
def test_60_vehicles_on_400_lanelets_take_few_calls_and_triangles(
        run: RecordedRun, cockpit: Served, page: Browser, light: str) -> None:
    """The limits hold at 1920x1080 with all detail, lamps and beams of all vehicles at dusk."""
    cockpit.publish('scene', large_scene(run) | {
        'environment': {'light': light, 'visibility': 30000.0}})
    page.wait('crgame.store.scene.lanelets.length === 400 && crgame.store.latest')
    around = [page.run_async(ALL_AROUND, *place) for place in ((5, 2), (320, 182), (595, 542))]
    for found in around:
        assert (found['ratio'], found['width'], found['cars']) == (1, 1920, 60)
        assert found['drawn'] == 4 * 5
    assert 20 < max(found['draw_calls'] for found in around) <= MOST_CALLS
    assert 20_000 < max(found['triangles'] for found in around) <= MOST_TRIANGLES
    assert page.console_errors() == []


@pytest.mark.exhaustive
def test_wheels_of_others_are_turned_as_they_drive(
        run: RecordedRun, cockpit: Served, page: Browser) -> None:
    """The angle is a single-track model's at their speed and yaw rate: 1.6 degrees here."""
    cockpit.publish('scene', large_scene(run))
    page.wait('crgame.store.scene.lanelets.length === 400 && crgame.store.latest')
    found = page.run_async(WHEELS)
    speed = 10.0 * math.cos(0.2) + math.sin(0.2)
    assert len(found) > 5
    for wheelbase, steering in found:
        assert 2.0 < wheelbase < 3.5
        assert steering == pytest.approx(math.atan(wheelbase * 0.1 / speed), abs=1e-9)


@pytest.mark.exhaustive
def test_the_view_is_saved_as_it_is_seen(page: Browser, tmp_path: Path) -> None:
    """The button saves a PNG with mirrors, even without motion since the last picture."""
    page.driver.execute_cdp_cmd('Browser.setDownloadBehavior', {
        'behavior': 'allow', 'downloadPath': str(tmp_path)})
    # After all pictures of the last change are drawn, the canvas has no content.
    frames = page.run_async("""
        let before = -1;
        while (before !== crgame.view3d.stats.frames) {
          before = crgame.view3d.stats.frames;
          await new Promise((resolve) => setTimeout(resolve, 500));
          for (let i = 0; i < 3; i += 1) {
            await new Promise(requestAnimationFrame);
          }
        }
        return before;""")
    size = page.run('const { width, height } = document.querySelector("#view3d");'
                    'return [width, height]')
    page.driver.find_element('css selector', '[data-action=save-view]').click()
    end = time.monotonic() + 20.0
    while not (found := list(tmp_path.glob('*_3d_*.png'))):
        assert time.monotonic() < end, list(tmp_path.iterdir())
        time.sleep(0.1)
    with Image.open(found[0]) as picture:
        assert list(picture.size) == size
        colors = picture.convert('RGB').getcolors(maxcolors=1 << 24)
    # Sky, road, trees, a cabin: an empty canvas has one colour.
    assert colors is not None and len(colors) > 500
    assert page.run('return crgame.view3d.stats.frames') == frames + 1
    assert page.console_errors() == []


@pytest.mark.exhaustive
def test_the_view_shows_that_it_has_the_focus_and_says_what_is_around(page: Browser) -> None:
    """It has a ring, as the map has, and the words about surrounding vehicles as description."""
    # The ring is visible only if the page has the focus.
    page.driver.find_element('css selector', '#view3d').click()
    assert page.run('return document.activeElement.id') == 'view3d'
    found = page.run("""
        const view = document.querySelector('#view3d');
        view.blur();
        view.focus({ focusVisible: true });
        const style = getComputedStyle(view);
        const words = document.getElementById(view.getAttribute('aria-describedby'));
        return [document.activeElement === view, style.outlineStyle,
          parseFloat(style.outlineWidth) >= 2, words.id];""")
    assert found == [True, 'solid', True, 'around']
    page.wait('document.querySelector("#around").textContent.includes("hv0")')


@pytest.mark.exhaustive
def test_keys_typed_into_fields_bring_no_pictures_out_of_turn(
        cockpit: Served, page: Browser) -> None:
    """Extra pictures follow only keys that may drive, at the pace of the run."""
    cockpit.publish('seats', {'seats': {'hv0': {
        'source': 'cockpit', 'driver': 'cockpit', 'holder_name': 'Me',
        'holder': page.run('return crgame.store.me.id')}}})
    page.wait("crgame.driving.seat === 'hv0'")
    waited = page.run_async("""
        const { KeyAnswer } = await import('/static/js/view3d/key_answer.js');
        const { pressed } = KeyAnswer.prototype;
        const waited = [];
        KeyAnswer.prototype.pressed = function note(...given) {
          waited.push(given);
          return pressed.apply(this, given);
        };
        const field = document.querySelector('.name-field input');
        for (const node of [field, document.body, field]) {
          for (const type of ['keydown', 'keyup']) {
            node.dispatchEvent(new KeyboardEvent(type, { code: 'KeyG', bubbles: true }));
          }
        }
        KeyAnswer.prototype.pressed = pressed;
        return [waited, crgame.store.latest.t, crgame.store.clock.rate];""")
    given, newest_t, rate = waited
    assert given == 2 * [[newest_t, rate]]
