# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Headlights in a real picture: on at dusk and in fog, off by day."""

from collections.abc import Iterator
from typing import Any

from browser_support import Browser, skip_without_three
from crgame_ros.paths import scenarios_directory
import pytest
from world_support import RecordedRun, RunBackend, Served, served

pytestmark = pytest.mark.exhaustive

# The road from the driver's seat, and the number of tail lamp pixels seen from behind.
PICTURE = """
const [ahead] = arguments;
const { picture } = crgame.view3d;
const { Vector3 } = await import('/three/three.module.js');
const looks = { viewpoint: 'driver', index: 0, aside: 0, height: 0.6, mirrors: false,
  plans: false };
const now = performance.now();
const shown = crgame.store.displayed(now);
const context = document.querySelector('#view3d').getContext('webgl2');
const { drawingBufferWidth: width, drawingBufferHeight: height } = context;
const pixels = new Uint8Array(4 * width * height);
const draw = (viewpoint) => {
  picture.draw(shown, now, { ...looks, viewpoint });
  context.readPixels(0, 0, width, height, context.RGBA, context.UNSIGNED_BYTE, pixels);
};
draw('driver');
const { draw_calls: calls } = picture.stats;
const [x, y, yaw] = shown.vehicles;
const road = ahead.map((away) => {
  const { x: u, y: v } = new Vector3(x + away * Math.cos(yaw) - picture.origin.x,
    y + away * Math.sin(yaw) - picture.origin.y, 0).project(picture.camera);
  const [column, row] = [Math.round((u + 1) / 2 * width), Math.round((v + 1) / 2 * height)];
  let sum = 0;
  for (let i = -6; i <= 6; i += 1) {
    sum += pixels[4 * (row * width + column + i)] / 13;
  }
  return sum;
});
draw('chase');
let red = 0;
for (let i = 0; i < pixels.length; i += 4) {
  red += pixels[i] > 180 && pixels[i] - Math.max(pixels[i + 1], pixels[i + 2]) > 100;
}
return { road, red, calls };
"""
# On the empty lane ahead of the bonnet: within the beam, and beyond it [m].
NEAR, FAR = 12.0, 45.0


@pytest.fixture(scope='module')
def cockpit() -> Iterator[Served]:
    with served(RunBackend(RecordedRun(scenarios_directory() / 'merge.yaml', 1.0))) as running:
        yield running


@pytest.fixture(scope='module')
def pictures(cockpit: Served, module_browser: Browser) -> dict[str, Any]:
    """Return the measurements by day, at dusk and in fog."""
    skip_without_three()
    page = module_browser
    page.resize(640, 400)
    page.open(cockpit.address)
    page.wait('crgame.ready && crgame.store.scene && crgame.store.latest')
    assert page.run_async('return await crgame.view3d.show(true)')
    page.run("crgame.view3d.settings.set('sharp', true)")
    seen = {}
    for name, light, visibility in (('day', 'day', 30000.0), ('dusk', 'dusk', 30000.0),
                                    ('fog', 'day', 120.0)):
        # A key that the page does not know tells it from the scene before, which may be the same.
        cockpit.publish('scene', cockpit.backend.run.scene | {
            'picture': name, 'environment': {'light': light, 'visibility': visibility}})
        cockpit.call(cockpit.backend.send_now)
        page.wait(f"crgame.store.scene.picture === '{name}' && crgame.store.latest")
        seen[name] = page.run_async(PICTURE, [NEAR, FAR])
    return seen


def test_the_own_light_lies_on_the_road_ahead(pictures: dict[str, Any]) -> None:
    """At dusk the road in the beam is brighter than farther on; by day it is one grey."""
    dusk, day = (pictures[name]['road'] for name in ('dusk', 'day'))
    assert day[0] / day[1] == pytest.approx(1.0, abs=0.15)
    assert dusk[0] / dusk[1] > 1.25 * day[0] / day[1]
    assert dusk[1] < day[1]


def test_tail_lamps_shine_at_dusk_and_in_fog(pictures: dict[str, Any]) -> None:
    red = {name: picture['red'] for name, picture in pictures.items()}
    assert min(red['dusk'], red['fog']) > 20 > red['day']


def test_lights_cost_three_calls_a_picture(pictures: dict[str, Any]) -> None:
    """Lamps, glow and beams of all vehicles take one call each."""
    calls = {name: picture['calls'] for name, picture in pictures.items()}
    assert calls['day'] < calls['dusk'] <= calls['day'] + 3
    assert max(calls.values()) <= 150
