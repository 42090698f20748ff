# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Touch in the 3D view: keys on phones and tablets that leave the road visible."""

from collections.abc import Iterator
from typing import Any

from browser_support import Browser, skip_without_three
from crgame_ros.paths import scenarios_directory
import pytest
from world_support import RecordedRun, RunBackend, Served, served

pytestmark = pytest.mark.exhaustive

SIZES = ((390, 844), (640, 360), (844, 390), (820, 1180), (1180, 820))
# Functions without a touch key have other ways: S brakes, both indicators are hazard lights.
LEFT_OUT = {'cap cap-Space', 'cap cap-KeyJ'}
COARSE = [{'name': name, 'value': 'coarse'} for name in ('pointer', 'any-pointer')]
# Keys that the browser does not find under a finger, and elements that lie under keys.
LAYOUT = """
const box = (node) => node.getBoundingClientRect();
const seen = (name) => [...document.querySelectorAll(name)].filter(
  (node) => node.checkVisibility({ visibilityProperty: true }));
const caps = seen('.cap');
const told = seen('.hud-kmh, .hud-unit, .hud-limit, .hud-gear, .hud-lights, .hud-pedals, '
  + '.hud-steering, .hud-title > *, .hud-banner');
const covers = (a, b) => a.left < b.right - 0.5 && b.left < a.right - 0.5
  && a.top < b.bottom - 0.5 && b.top < a.bottom - 0.5;
const stage = box(document.querySelector('#stage'));
const board = box(document.querySelector('.hud-board'));
const area = ({ width, height }) => width * height;
return {
  hidden: [...document.querySelectorAll('.cap')].filter((cap) => !caps.includes(cap))
    .map((cap) => cap.className),
  missed: caps.filter((cap) => {
    const { left, right, top, bottom } = box(cap);
    return document.elementFromPoint((left + right) / 2, (top + bottom) / 2) !== cap
      || left < stage.left || right > stage.right || bottom > stage.bottom;
  }).map((cap) => cap.className),
  covered: [...told, ...caps].filter((node) => caps.some((cap) => cap !== node
    && covers(box(cap), box(node)))).map((node) => node.className),
  sizes: ['KeyA', 'KeyD', 'KeyS', 'KeyW'].flatMap((code) => {
    const { width, height } = box(document.querySelector(`.cap-${code}`));
    return [width, height];
  }),
  free: 1 - (area(board) + seen('.world-toolbar').map(box).map(area).reduce((a, b) => a + b, 0)
    + caps.map(box).map(({ width, top }) => width * Math.max(board.top - top, 0))
      .reduce((a, b) => a + b, 0)) / area(stage),
};"""


@pytest.fixture(scope='module')
def cockpit() -> Iterator[Served]:
    with served(RunBackend(RecordedRun(scenarios_directory() / 'merge.yaml', 1.0))) as running:
        yield running


@pytest.fixture(params=['', '?stage=hv0'], ids=['page', 'stage'])
def phone(cockpit: Served, browser: Browser, request: pytest.FixtureRequest) -> Iterator[Browser]:
    """Open the driver's view of a seat with touch input, in the page and on its own."""
    skip_without_three()
    driver = browser.driver
    driver.execute_cdp_cmd('Emulation.setTouchEmulationEnabled',
                           {'enabled': True, 'maxTouchPoints': 5})
    driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {'features': COARSE})
    try:
        browser.resize(390, 844)
        browser.open(cockpit.address + request.param)
        browser.wait('window.crgame?.ready && crgame.store.latest && crgame.store.me.id')
        assert browser.run_async('return await crgame.view3d.show(true)')
        cockpit.publish('seats', {'seats': {'hv0': {
            'source': 'cockpit', 'driver': 'cockpit', 'holder_name': 'Me',
            'holder': browser.run('return crgame.store.me.id')}}})
        browser.wait('crgame.driving.seat === "hv0"'
                     ' && document.querySelector(".cap-KeyW").checkVisibility()')
        yield browser
    finally:
        driver.execute_cdp_cmd('Emulation.setTouchEmulationEnabled', {'enabled': False})
        driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {'features': []})


def test_keys_lie_beside_what_is_read_and_the_road_is_free(phone: Browser) -> None:
    """On phones and tablets, in both orientations, each key can be hit and hides nothing."""
    for width, height in SIZES:
        phone.resize(width, height)
        phone.wait('innerWidth === arguments[0] && crgame.view3d.stats.width > 0 && '
                   'crgame.view3d.stats.width === document.querySelector("#stage").clientWidth',
                   arguments=(width,))
        found = phone.run(LAYOUT)
        assert set(found['hidden']) == LEFT_OUT, (width, height)
        assert found['missed'] == found['covered'] == [], (width, height)
        # A touch target has at least 44 px, by the guidelines of the platforms.
        assert min(found['sizes']) >= 44, (width, height)
        assert found['free'] > 0.7, (width, height)


def test_two_fingers_drive(phone: Browser) -> None:
    """Real touches press throttle and left at once and release them one by one."""
    phone.driver.find_element('css selector', '#view3d').click()
    phone.wait('crgame.driving.away === null', 'hands on the controls')
    points = phone.run("""return ['KeyW', 'KeyA'].map((code) => {
        const { x, y, width, height } = document.querySelector(`.cap-${code}`)
          .getBoundingClientRect();
        return { x: x + width / 2, y: y + height / 2 }; });""")
    throttle, left = ({**point, 'id': index} for index, point in enumerate(points))

    def touch(kind: str, *fingers: dict[str, Any]) -> list[int]:
        phone.driver.execute_cdp_cmd('Input.dispatchTouchEvent', {
            'type': kind, 'touchPoints': list(fingers)})
        keys: list[int] = phone.run('return crgame.driving.hands.keys')
        return keys

    assert touch('touchStart', throttle) == [1, 0, 0, 0]
    assert touch('touchStart', throttle, left) == [1, 0, 1, 0]
    assert touch('touchEnd', throttle) == [0, 0, 1, 0]
    assert touch('touchEnd', left) == [0, 0, 0, 0]


def test_a_phone_has_the_button_of_the_3d_view(cockpit: Served, phone: Browser) -> None:
    """The page has the button, as a phone has no V; pinching needs no button."""
    if 'stage' in phone.driver.current_url:
        assert phone.run('return document.querySelector(".view3d-buttons") === null')
        return
    assert phone.run('return document.querySelector(".view3d-buttons").checkVisibility()')
    phone.run('document.querySelector(".view3d-buttons button").click()')
    phone.wait('!crgame.view3d.on')
    assert phone.run('return document.querySelector(".view3d-buttons").checkVisibility()')
    assert not phone.run('return document.querySelector(".world-zoom").checkVisibility()')
