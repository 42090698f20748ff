# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The small map beside the driver's view: AVs, and vehicles hidden by fog."""

from collections.abc import Iterator
import math
from typing import Any

from browser_support import Browser, skip_without_three
from crgame_ros.cockpit.frames import encode_seen, Place
from crgame_ros.paths import scenarios_directory
import numpy as np
import pytest
from world_support import RecordedRun, RunBackend, Served, served

pytestmark = pytest.mark.exhaustive

# Range of sight from the human's vehicle in these tests [m].
VISIBILITY_M = 30.0
# A point on the plan's band, ahead of the AV and beside its line, on the small map.
PIXEL = """
const { camera } = crgame.world;
const canvas = document.querySelector('#world');
const ratio = canvas.width / canvas.clientWidth;
return [...canvas.getContext('2d').getImageData(Math.round(camera.toX(...arguments) * ratio),
  Math.round(camera.toY(...arguments) * ratio), 1, 1).data].slice(0, 3);"""
THERE = """
const { vehicles, objects } = crgame.world.shown;
const at = (rows, width) => [...rows].filter((_, i) => i % width === 0).map(Number.isFinite);
return [...at(vehicles, 13), ...at(objects, 6)];"""


@pytest.fixture(scope='module')
def run() -> RecordedRun:
    """Return a run of two vehicles and six obstacles, in which the AV perceives."""
    recorded = RecordedRun(scenarios_directory() / 'traffic.yaml', 1.0)
    recorded.scene |= {'vehicles': [
        vehicle | {'perception': {'localisation': True, 'sensors': [], 'range': 80.0}}
        if vehicle['role'] == 'autonomous' else vehicle for vehicle in recorded.scene['vehicles']]}
    return recorded


@pytest.fixture
def cockpit(run: RecordedRun) -> Iterator[Served]:
    with served(RunBackend(run)) as running:
        yield running


@pytest.fixture
def page(cockpit: Served, browser: Browser) -> Browser:
    """Open the page, and keep its messages to the server about its picture."""
    skip_without_three()
    browser.open(cockpit.address)
    browser.wait('window.crgame?.ready && crgame.world.shown && crgame.store.me.id')
    browser.run("""
        window.told = [];
        const send = crgame.connection.send.bind(crgame.connection);
        crgame.connection.send = (message) => {
          window.told.push(message);
          return send(message);
        };""")
    return browser


def drawn(page: Browser) -> None:
    """Wait until the small map has been drawn in its present state."""
    page.run_async("""
        for (let i = 0; i < 4; i += 1) {
          await new Promise(requestAnimationFrame);
        }""")
    page.wait('!crgame.world.camera.moves && document.querySelector("#world").clientWidth > 0')


def told_plans(page: Browser, shown: str) -> int:
    """Return the number of plans in the last message about this picture."""
    page.run('window.told.length = 0')
    page.wait('window.told.some(({ type, shown }) => type === "view" && shown === arguments[0])',
              arguments=(shown,))
    plans: int = page.run('return window.told.findLast(({ type }) => type === "view").plans')
    return plans


def test_the_small_map_shows_plans_and_perception_when_asked_in_the_3d_view(
        cockpit: Served, run: RecordedRun, page: Browser) -> None:
    """One switch of that view shows them, for any layers of the map; the recording agrees."""
    x, y, yaw = run.states[0, 1, :3]
    times = 0.1 * np.arange(31)
    plan = np.column_stack([x + 8.0 * times * math.cos(yaw), y + 8.0 * times * math.sin(yaw),
                            np.full(31, yaw), np.full(31, 8.0), times])
    beside = (float(x + 14.6 * math.cos(yaw) - 0.6 * math.sin(yaw)),
              float(y + 14.6 * math.sin(yaw) + 0.6 * math.cos(yaw)))
    page.run("crgame.world.follow('av0', true)")
    assert page.run_async('return await crgame.view3d.show(true)')
    drawn(page)
    road = page.run(PIXEL, *beside)
    cockpit.call(cockpit.backend.send_plan, 1, plan)
    # Its planner's request has no other vehicle: on the map all others are outlines.
    cockpit.call(cockpit.backend.hub.send_frame, 'seen:1', encode_seen(Place(0, 0, 0, 0.0), 1, []))
    page.wait('crgame.store.plans.size === 1 && crgame.store.perceived.seenBy(1, 0) !== null')
    found = []
    for switched in (False, True, False):
        page.run("crgame.view3d.settings.set('plans', arguments[0])", switched)
        drawn(page)
        covered = np.abs(np.subtract(page.run(PIXEL, *beside), road)).max() > 24
        found.append((bool(covered), page.run('return crgame.perception.hollow.includes("hv0")'),
                      told_plans(page, 'driver')))
        page.wait('document.querySelector(".hud-seen").hidden !== arguments[0]',
                  arguments=(switched,))
    assert found == [(False, False, 0), (True, True, 1), (False, False, 0)]
    # The map itself has the layers of its buttons.
    assert not page.run_async('return await crgame.view3d.show(false)')
    drawn(page)
    assert page.run('return crgame.perception.hollow.includes("hv0")')
    assert told_plans(page, 'map') == 1


def test_fog_limits_the_drivers_sight_and_a_director_sees_all(
        cockpit: Served, run: RecordedRun, page: Browser) -> None:
    """The limit holds on the map, on the small map of the driver's view, and in words."""
    poses = np.concatenate([run.states[0, :, :2], run.objects[0, :, :2]])
    away = np.hypot(*(poses - poses[0]).T)
    present = np.isfinite(away)
    seen = present & (away <= VISIBILITY_M)
    assert 1 < seen.sum() < present.sum()
    cockpit.publish('scene', run.scene | {
        'environment': {'light': 'day', 'visibility': VISIBILITY_M}})
    page.wait('crgame.store.scene.environment.visibility === arguments[0]',
              arguments=(VISIBILITY_M,))
    page.run("crgame.world.follow('hv0', true)")
    drawn(page)
    # No seat is taken, so the map shows everything.
    assert page.run(THERE) == present.tolist()
    assert page.run_async('return await crgame.view3d.show(true)')
    drawn(page)
    assert page.run(THERE) == seen.tolist()
    assert named(page, run) == ids(run, seen)
    page.run("crgame.view3d.viewpoint = 'bird'")
    drawn(page)
    assert page.run(THERE) == present.tolist()
    assert not page.run_async('return await crgame.view3d.show(false)')
    me = page.run('return crgame.store.me.id')
    cockpit.publish('seats', {'seats': {'hv0': {
        'source': 'cockpit', 'driver': 'cockpit', 'holder': me, 'holder_name': 'Me'}}})
    page.wait("crgame.driving.seat === 'hv0'")
    drawn(page)
    assert page.run(THERE) == seen.tolist()
    assert named(page, run) == ids(run, seen)
    assert page.console_errors() == []


def ids(run: RecordedRun, wanted: Any) -> set[str]:
    """Return the ids of the wanted vehicles, without the own one."""
    every = [item['id'] for item in (*run.scene['vehicles'], *run.scene['objects'])]
    return {name for name, take in list(zip(every, wanted, strict=True))[1:] if take}


def named(page: Browser, run: RecordedRun) -> set[str]:
    """Return the vehicles that the words beside the map name, without the own one."""
    words = page.run('return crgame.around.describe()').replace(',', ' ').split()
    return ids(run, np.ones(len(run.states[0]) + len(run.objects[0]), dtype=bool)) & set(words)
