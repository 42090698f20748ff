# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Perception in the page: of a recording at any time, and its layers pixel by pixel."""

from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
import sys
from typing import Any

from browser_support import Browser
from crgame_ros.cockpit.frames import encode_occupancy, encode_scan, encode_seen, Place
from crgame_ros.cockpit.replay_backend import ReplayBackend
from crgame_ros.paths import scenarios_directory
import numpy as np
from numpy.typing import NDArray
from PIL import Image
import pytest
from world_support import RecordedRun, RunBackend, Served, served

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'cockpit'))

from perception_recording import Perceived, record_perceiving  # noqa: E402, I100 - importable now

pytestmark = pytest.mark.exhaustive

DURATION_S = 12.0
IS_DRAWN = '!crgame.replay.loading && crgame.world.shown?.t === crgame.replay.t'
DRAWN = """
const { hollow, fans, estimate, count } = crgame.perception;
return { hollow, fans, estimate, count };
"""
SENSORS, RAYS = 4, 360


@pytest.fixture(scope='module')
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Perceived, Path]:
    """Record 12 s of a run: three chunks."""
    return record_perceiving(tmp_path_factory.mktemp('perceived') / 'bag', DURATION_S)


def test_a_recording_shows_what_was_perceived(browser: Browser,
                                              recorded: tuple[Perceived, Path]) -> None:
    """At seeded ticks in any order outlines, fans, estimate and count are those of the bag."""
    perceived, bag = recorded
    setup = perceived.result.setup
    ids = [item.id for item in setup.descriptions]
    with served(ReplayBackend(bag)) as server:
        browser.open(server.address)
        browser.wait('window.crgame?.ready && crgame.replay?.info && crgame.world.shown')
        browser.run("crgame.world.follow('av0', true);"
                    "crgame.perception.set('rays', true);"
                    "crgame.perception.set('estimate', true);")
        for k in np.random.default_rng(3).permutation(120)[:8].tolist():
            browser.run_async('await crgame.replay.seek(arguments[0]);', k * 0.1)
            browser.wait(IS_DRAWN)
            drawn = browser.run(DRAWN)
            there = np.isfinite(perceived.result.object_poses[k, :, 0])
            present = {'hv0', *(item for item, here in zip(ids[2:], there, strict=True) if here)}
            assert set(drawn['hollow']) == present - perceived.seen[k]
            assert drawn['fans'] == 2
            estimate = drawn['estimate']
            assert estimate['n'] == 10 * k
            assert [estimate['x'], estimate['y']] == pytest.approx(
                perceived.estimates[10 * k, :2], abs=1e-9)
            av = perceived.result.vehicle_states[10 * k, 1, :2]
            poses = [perceived.result.vehicle_states[10 * k, 0, :2],
                     *perceived.result.object_poses[k, :, :2]]
            near = sum(bool(np.hypot(*(pose - av)) <= 80.0) for pose in poses)
            assert drawn['count']['near'] == near
        # A vehicle that is not followed has no perception here.
        browser.run("crgame.world.follow('hv0', true);")
        browser.wait('crgame.perception.hollow.length === 0 && crgame.perception.fans === 0')
        assert browser.console_errors() == []


@pytest.fixture(scope='module')
def run() -> RecordedRun:
    """Return a run of two vehicles and six obstacles."""
    return RecordedRun(scenarios_directory() / 'traffic.yaml', 1.0)


@pytest.fixture
def page(run: RecordedRun, browser: Browser) -> Iterator[Served]:
    """Open the page before a run that stands still, whose AV has perception and a map."""
    with served(RunBackend(run)) as server:
        browser.open(server.address)
        browser.wait('window.crgame?.ready && crgame.world.shown')
        sensors = [f's{index}' for index in range(SENSORS)]
        vehicles = [vehicle | {'perception': {
            'localisation': True, 'sensors': sensors, 'range': 80.0}}
            if vehicle['role'] == 'autonomous' else vehicle for vehicle in run.scene['vehicles']]
        roles = ('traffic', 'scripted', 'recorded')
        objects = [item | {'role': role, 'type': 'car'} for item, role in zip(
            run.scene['objects'], roles, strict=False)]
        objects += run.scene['objects'][len(objects):]
        server.publish('scene', run.scene | {
            'vehicles': vehicles, 'objects': objects, 'occupancy': True})
        browser.wait('crgame.store.scene.occupancy')
        server.call(server.backend.send_now)
        browser.wait('crgame.store.steps.length > 0')
        browser.run("crgame.world.follow('av0', true); crgame.perception.set('rays', true);")
        yield server
        assert browser.console_errors() == []


def send(page: Served, slot: str, frame: bytes) -> None:
    """Send a frame to the page."""
    page.call(lambda: page.backend.hub.send_frame(slot, frame))


def pixel(browser: Browser, x: float, y: float) -> list[int]:
    """Return the colour of the pixel at a point of the map."""
    px, py = browser.run("""
        const { camera } = crgame.world;
        const box = document.querySelector('#world').getBoundingClientRect();
        return [box.left + camera.toX(...arguments), box.top + camera.toY(...arguments)];""", x, y)
    with Image.open(BytesIO(browser.driver.get_screenshot_as_png())) as image:
        return list(image.convert('RGB').getpixel((round(px), round(py))))


def color(browser: Browser, name: str) -> list[int]:
    """Return a colour of the theme."""
    found: list[int] = browser.run("""
        const probe = document.createElement('span');
        probe.style.color = `var(--${arguments[0]})`;
        document.body.append(probe);
        const rgb = getComputedStyle(probe).color.match(/[0-9]+/g).slice(0, 3).map(Number);
        probe.remove();
        return rgb;""", name)
    return found


def scan(sensor: int, ranges: NDArray[np.float64], n: int = 0) -> bytes:
    """Make a scan of the AV over a full circle."""
    fan = (100.0, 5.0, 0.5, -np.pi, 2.0 * np.pi / len(ranges), 80.0, 0.1)
    return encode_scan(Place(0, n, 0, n * 0.01), 1, sensor, fan, ranges)


def test_frames_are_read_as_they_were_written(page: Served, browser: Browser) -> None:
    """All numbers of a scan, a map and the seen vehicles arrive unchanged."""
    ranges = np.array([3.5, np.inf, 12.25, 0.0])
    occupied = np.random.default_rng(0).random((13, 7)) < 0.5
    legend = '.world-legend [data-layer="unseen"]'
    said = f"return document.querySelector('{legend}').textContent"
    browser.wait(f'(() => {{ {said} }})() === "what av0 sees is not known now"')
    send(page, 'scan:1:2', scan(2, ranges))
    send(page, 'seen:1', encode_seen(Place(0, 0, 0, 0.0), 1, [0, 1, 4]))
    send(page, 'occupancy', encode_occupancy(Place(0, 0, 0, 0.0), (-3.0, 8.5), 0.25, occupied))
    browser.wait('crgame.store.perceived.occupancy && crgame.perception.fans === 1')
    read: dict[str, Any] = browser.run("""
        const { perceived } = crgame.store;
        const [scan] = perceived.scansOf(1, 0);
        const { bits, ...map } = perceived.occupancy;
        return { scan: { ...scan, ranges: [...scan.ranges].map(String) }, map,
          cells: Array.from({ length: map.rows * map.columns }, (_, i) => bits[i >> 3] >> (i & 7)
            & 1), seen: [...perceived.seenBy(1, 0)] };""")
    assert [read['scan'][key] for key in ('index', 'sensor', 'x', 'y', 'yaw', 'longest')] == [
        1, 2, 100.0, 5.0, 0.5, 80.0]
    assert read['scan']['ranges'] == ['3.5', 'Infinity', '12.25', '0']
    assert [read['map'][key] for key in ('x', 'y', 'resolution', 'rows', 'columns')] == [
        -3.0, 8.5, 0.25, 13, 7]
    assert read['cells'] == occupied.ravel().astype(int).tolist()
    assert read['seen'] == [0, 1, 4]
    # A picture of the map rewrites the legend.
    browser.wait(f'(() => {{ {said} }})() === "not seen by av0"')


def test_a_fan_is_built_once_for_each_scan(page: Served, browser: Browser) -> None:
    """With four sensors of 360 rays, frames between scans make no paths and touch no ray."""
    ranges = 40.0 + 30.0 * np.sin(np.linspace(0.0, 20.0, RAYS))
    browser.run("""
        window.lines = 0;
        const { lineTo } = Path2D.prototype;
        Path2D.prototype.lineTo = function count(...place) {
          window.lines += 1;
          return lineTo.apply(this, place);
        };""")
    drawn = """
        for (let i = 0; i < 20; i += 1) {
          const before = crgame.world.stats.frames;
          crgame.world.redraw();
          while (crgame.world.stats.frames === before) {
            await new Promise(requestAnimationFrame);
          }
        }
        return [crgame.perception.fans, window.lines];"""
    for sensor in range(SENSORS):
        send(page, f'scan:1:{sensor}', scan(sensor, ranges))
    browser.wait('crgame.perception.fans === 4')
    assert browser.run_async(drawn)[0] == SENSORS
    built = browser.run('return window.lines')
    assert built >= SENSORS * RAYS
    assert browser.run_async(drawn) == [SENSORS, built]
    send(page, 'scan:1:0', scan(0, ranges, n=1))
    browser.wait('window.lines > arguments[0]', arguments=(built,))
    # One new fan: its rays and at most two strokes for each hit.
    assert RAYS <= browser.run_async(drawn)[1] - built <= 3 * RAYS


def test_thin_walls_are_seen_from_afar(page: Served, browser: Browser) -> None:
    """A wall of one cell, 1/5 of a pixel wide on the whole map, is still visible."""
    xmin, ymin, xmax, ymax = browser.run('return crgame.store.scene.bounds')
    occupied = np.zeros((200, 3000), dtype=bool)
    occupied[57] = True
    x0, y0 = 0.5 * (xmin + xmax) - 150.0, ymax + 20.0
    send(page, 'occupancy', encode_occupancy(Place(0, 0, 0, 0.0), (x0, y0), 0.1, occupied))
    browser.wait('crgame.perception.occupied === 3000')
    browser.run('crgame.world.fit(false);')
    browser.wait('!crgame.world.camera.moves')
    assert browser.run('return crgame.world.camera.scale') * 0.1 < 0.3
    middle = [pixel(browser, x0 + 150.0, y0 + 5.75 + offset) for offset in
              np.arange(-2.0, 2.01, 0.25)]
    assert color(browser, 'map-occupied') in middle
    browser.prefer('dark')
    browser.wait("matchMedia('(prefers-color-scheme: dark)').matches")
    drawn = browser.run('const { frames } = crgame.world.stats; crgame.world.redraw();'
                        'return frames;')
    browser.wait('crgame.world.stats.frames > arguments[0]', arguments=(drawn,))
    middle = [pixel(browser, x0 + 150.0, y0 + 5.75 + offset) for offset in
              np.arange(-2.0, 2.01, 0.25)]
    assert color(browser, 'map-occupied') in middle


@pytest.mark.parametrize('role', ['traffic', 'scripted', 'recorded'])
def test_each_role_has_its_colour(page: Served, browser: Browser, role: str) -> None:
    """Traffic agents, the game's objects and recorded ones differ, near enough to see a roof."""
    index = ('traffic', 'scripted', 'recorded').index(role)
    x, y, yaw, drawn = browser.run("""
        const at = 6 * arguments[0];
        const pose = [...crgame.world.shown.objects.subarray(at, at + 3)];
        crgame.world.follow(null);
        crgame.world.camera.lookAt(pose[0], pose[1], false);
        crgame.world.camera.zoom(3);
        crgame.world.redraw();
        return [...pose, crgame.world.stats.frames];""", index)
    browser.wait('crgame.world.stats.frames > arguments[0]', arguments=(drawn,))
    # There is glass behind the roof and the bonnet ahead of the windscreen.
    bonnet = (x + 1.4 * np.cos(yaw), y + 1.4 * np.sin(yaw))
    assert pixel(browser, *bonnet) == color(browser, role)
