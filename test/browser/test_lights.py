# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Indicators and horn in the page: sent keys, blinking corners, signs."""

from collections.abc import Iterator
import os
from pathlib import Path
import time
from typing import Any

from browser_support import Browser, PATIENCE_S
from crgame_ros.paths import scenarios_directory
import numpy as np
import pytest
from selenium.webdriver.common.action_chains import ActionChains
from world_support import RecordedRun, RunBackend, Served, served

# The left front and the right rear lamp of the BMW 320i, from the centre [m].
LEFT_FRONT, RIGHT_REAR = (1.9, 0.87), (-1.9, -0.87)
LIGHTS = 12


@pytest.fixture(scope='module')
def page(module_browser: Browser) -> Iterator[Served]:
    """Open the page before a run that stands at its start, with a free seat."""
    with served(RunBackend(RecordedRun(scenarios_directory() / 'cut_in.yaml', 7.0))) as server:
        module_browser.open(server.address)
        module_browser.wait('window.crgame?.ready && crgame.world.shown && crgame.world.followed')
        ActionChains(module_browser.driver).send_keys('+' * 6).perform()
        module_browser.wait('crgame.world.camera.scale > 15 && !crgame.world.camera.moves',
                            'the camera to arrive')
        yield server


def show(page: Served, browser: Browser, lights: int, n: int) -> None:
    """Show the vehicles at the step n, hv0 with lights."""
    backend = page.backend
    backend.run.states[:, 0, LIGHTS] = lights
    backend.n = n
    page.call(backend.send_now)
    browser.wait(f'crgame.world.shown.n === {n} && crgame.world.shown.vehicles[12] === {lights}')
    browser.wait_for_frame()
    if 'CRGAME_SCREENSHOTS' in os.environ:
        browser.screenshot(Path(os.environ['CRGAME_SCREENSHOTS']) / f'lights_{lights}_{n}.png')


def amber(browser: Browser, at: tuple[float, float]) -> bool:
    """Return whether the map is amber at a place of hv0, in its own coordinates [m]."""
    red, green, blue = browser.run("""
        const { camera, shown } = crgame.world;
        const [x0, y0, yaw] = shown.vehicles;
        const along = arguments[0] + crgame.store.scene.vehicles[0].rear_to_center;
        const x = x0 + along * Math.cos(yaw) - arguments[1] * Math.sin(yaw);
        const y = y0 + along * Math.sin(yaw) + arguments[1] * Math.cos(yaw);
        const canvas = document.querySelector('#world');
        const ratio = canvas.width / canvas.clientWidth;
        return [...canvas.getContext('2d').getImageData(
          ratio * camera.toX(x, y), ratio * camera.toY(x, y), 1, 1).data].slice(0, 3);""", *at)
    return bool(np.allclose((red, green, blue), (0xff, 0xd0, 0x00), atol=24))


def sign(browser: Browser, name: str) -> tuple[bool, str]:
    """Return whether a sign over the speed is lit, and its name."""
    lit, label = browser.run("""
        const sign = document.querySelector(`.sign-${arguments[0]}`);
        return [sign.hasAttribute('data-on'), sign.getAttribute('aria-label')];""", name)
    return bool(lit), str(label)


@pytest.mark.parametrize(('start', 'lights', 'left', 'right'), [
    (0, 0, False, False), (200, 1, True, False), (400, 2, False, True), (600, 7, True, True)])
def test_corners_blink_in_simulation_time(page: Served, module_browser: Browser, start: int,
                                          lights: int, left: bool, right: bool) -> None:
    """Of 3 periods in 2 s corners are lit after 0.1 s, dark after 0.5 s; the name is constant."""
    for n, shining in ((start + 10, True), (start + 50, False)):
        show(page, module_browser, lights, n)
        assert amber(module_browser, LEFT_FRONT) == (left and shining)
        assert amber(module_browser, RIGHT_REAR) == (right and shining)
        assert sign(module_browser, 'left') == (
            left and shining, f'Left indicator {"on" if left else "off"}')
        assert sign(module_browser, 'right')[0] == (right and shining)
        assert sign(module_browser, 'horn')[0] == (lights == 7)


def test_keys_of_the_lever_are_sent_and_do_not_drive(page: Served,
                                                     module_browser: Browser) -> None:
    """Comma, period, J and G are sent on press and release, without a driving key."""
    me = module_browser.run('return crgame.store.me.id')
    page.publish('seats', {'seats': {'hv0': {
        'source': 'cockpit', 'driver': 'cockpit', 'holder': me, 'holder_name': 'A',
        'requests': [], 'others': [], 'lost': False}}})
    module_browser.wait("crgame.driving.seat === 'hv0'")
    page.backend.messages.clear()
    for key in ',.jg':
        ActionChains(module_browser.driver).key_down(key).pause(0.1).key_up(key).perform()
    none = [False] * 4

    def inputs() -> list[dict[str, Any]]:
        return [message for message in page.backend.messages if message['type'] == 'input']
    end = time.monotonic() + PATIENCE_S
    while not (told := [message['lights'] for message in inputs()]) or told[-1] != none \
            or [False, False, False, True] not in told:
        assert time.monotonic() < end, told
        time.sleep(0.02)
    if 'CRGAME_SCREENSHOTS' in os.environ:
        module_browser.screenshot(Path(os.environ['CRGAME_SCREENSHOTS']) / 'driving.png')
    hands = inputs()
    assert all(message['keys'] == [False] * 4 for message in hands)
    changes = [held for before, held in zip(
        [None, *(message['lights'] for message in hands)], [m['lights'] for m in hands],
        strict=False) if held != before]
    pressed = [held for held in changes if held != none]
    assert pressed == [[i == j for j in range(4)] for i in range(4)]
    assert module_browser.console_errors() == []
