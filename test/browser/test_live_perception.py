# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An AV's perception in the page of a running graph: a van hides a waiting pedestrian."""

from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

from browser_support import Browser
from crgame_ros.ros.messages import from_time
from live_browser_support import Graph, live_graph, LivePage, SCENARIOS
from live_peer import Peer
import numpy as np
from numpy.typing import NDArray
from PIL import Image
import pytest

pytestmark = pytest.mark.exhaustive

# The pedestrian of the scenario stands at (170, -4.9) until an event starts him. Seen from the
# lane at y = -1.75, a van from x = 161 to 167 m whose left side is at y = -3.5 covers that place
# until the front of the AV, which begins at x = 47 m with 12.5 m/s, has come to 163 m; after that
# nothing hides him. The wall is beside the road.
GAME = """
scenario: {scenario}
duration: 3600
timing: {{frame_skipping: false}}
drivability: {{stop: false}}
occupancy: map.yaml
objects:
  - {{id: van, kind: static, type: parkedVehicle, at: [164.0, -4.6, 0.0], size: [6.0, 2.2]}}
events:
  - {{name: pedestrian, release: {{object: 201}}}}
humans:
  - {{id: hv0, driver: cockpit, spawn: {{lanelet: 22, s: 100.0, d: 0.0, speed: 0.0}}}}
avs:
  - id: av0
    planning_problem: 100
    planner: constant-velocity
    perception:
      memory: 0.2
      localisation: {{position_noise: 1.0, position_bias: [0.0, 2.0]}}
      sensors: [{{name: front, field_of_view: 6.2831, rays: 721}}]
"""
PERSON, VAN = 'o201', 'van'
WALL, CELL_M = (130.0, 160.0, 10.0, 13.0), 0.25
# The run is held here: the AV is 35 m before the van.
HELD_S = 6.0
# Here the AV's rear axle is past the van, and its front short of the person.
PAST_VAN_M = 165.0
# True when the page shows all data of the last step.
SHOWN = ('!crgame.world.camera.moves && crgame.world.shown.n === crgame.store.status.n'
         ' && crgame.perception.estimate?.n === crgame.world.shown.n'
         ' && crgame.perception.fans === 1')
# Colours of the theme and drawn colours agree to rounding.
SAME_COLOR = 6


def write_game(folder: Path) -> Path:
    """Write the game and its map: one wall, in a map_server's files."""
    x0, x1, y0, y1 = WALL
    cells = np.full((80, 240), 254, dtype=np.uint8)
    # The lower left corner of the map is at (110, 0); the first row of the image is the top.
    left, right = (round((x - 110.0) / CELL_M) for x in (x0, x1))
    low, high = (round(y / CELL_M) for y in (y0, y1))
    cells[80 - high:80 - low, left:right] = 0
    Image.fromarray(cells).save(folder / 'map.pgm')
    (folder / 'map.yaml').write_text(
        f'image: map.pgm\nresolution: {CELL_M}\norigin: [110.0, 0.0, 0.0]\nnegate: 0\n'
        'occupied_thresh: 0.65\nfree_thresh: 0.25\nmode: trinary\n')
    path = folder / 'game.yaml'
    path.write_text(GAME.format(scenario=SCENARIOS / 'ZAM_Crossing-1_1_T-1.xml'))
    return path


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph]:
    """Keep one graph for all tests; the last one resumes its run."""
    folder = tmp_path_factory.mktemp('perception')
    with live_graph(write_game(folder), folder / 'run') as running:
        yield running


@pytest.fixture(scope='module')
def listener(graph: Graph) -> Iterator[Peer]:
    """Subscribe to the AV's perception."""
    with Peer(graph.launcher.domain, '/scenario/game', ('/<av>/plan_request', 'av0'),
              ('/<av>/localization', 'av0')) as peer:
        peer.wait_until(lambda: peer.games, 'the game')
        yield peer


@pytest.fixture(scope='module')
def page(graph: Graph, listener: Peer, module_browser: Browser) -> LivePage:
    """Open the page, follow the AV, and hold the run before the van."""
    opened = LivePage(graph, module_browser)
    # The run waits for a driver in the seat.
    opened.claim('hv0')
    opened.run("crgame.world.follow('av0', true);"
               "crgame.perception.set('rays', true); crgame.perception.set('estimate', true);")
    go_until(opened, f'crgame.world.shown.t > {HELD_S}')
    return opened


def go_until(page: LivePage, condition: str) -> None:
    """Run until an expression of the page is true, and pause there."""
    page.run_async(f"""
      const order = (action) => crgame.connection.request({{ type: 'control', action }});
      await order('start');
      const look = () => (({condition}) ? order('pause') : requestAnimationFrame(look));
      look();""")
    page.wait(f'({condition}) && crgame.store.status.run === "paused"', condition)
    page.wait(SHOWN, 'everything of the last step')


def show(page: LivePage, layer: str, on: bool) -> None:
    """Show or hide a layer by its button, and wait until that has been drawn."""
    button = f'.world-toolbar [data-layer="{layer}"]'
    if page.run(f"return document.querySelector('{button}').ariaPressed === 'true'") != on:
        frames = page.run('return crgame.world.stats.frames')
        page.click(button)
        page.wait('crgame.world.stats.frames > arguments[0]', 'a frame', frames)


def pixels(page: LivePage, x: float, y: float, half_px: int = 1) -> NDArray[np.int64]:
    """Return a screenshot around a point of the map, (2 half + 1, 2 half + 1, 3)."""
    px, py = page.run("""
        const { camera } = crgame.world;
        const box = document.querySelector('#world').getBoundingClientRect();
        return [box.left + camera.toX(...arguments), box.top + camera.toY(...arguments)];""", x, y)
    with Image.open(BytesIO(page.driver.get_screenshot_as_png())) as image:
        left, top = round(px) - half_px, round(py) - half_px
        size = 2 * half_px + 1
        return np.asarray(image.convert('RGB').crop((left, top, left + size, top + size)),
                          dtype=np.int64)


def share_of(picture: NDArray[np.int64], page: LivePage, color: str) -> float:
    """Return the share of a picture with a colour of the theme."""
    wanted = page.run("""
        const probe = document.createElement('span');
        probe.style.color = `var(--${arguments[0]})`;
        document.body.append(probe);
        const found = getComputedStyle(probe).color.match(/[0-9]+/g).slice(0, 3).map(Number);
        probe.remove();
        return found;""", color)
    return float((np.abs(picture - wanted).max(axis=2) <= SAME_COLOR).mean())


def place_of(page: LivePage, name: str) -> tuple[float, float]:
    """Return the place at which an object is drawn."""
    x, y = page.run("""
        const at = 6 * crgame.store.scene.objects.findIndex(({ id }) => id === arguments[0]);
        return [...crgame.world.shown.objects.subarray(at, at + 2)];""", name)
    return x, y


def told(listener: Peer, page: LivePage, name: str) -> bool:
    """Return whether the planner's newest request at the shown time has an object."""
    scheduler = listener.games[-1].scheduler
    n = page.run('return crgame.world.shown.n')
    request = next((message for message in reversed(listener.messages['/<av>/plan_request'])
                    if scheduler.step_of_stamp(from_time(message.header.stamp)) <= n), None)
    return request is not None and f'{name}/x' in request.joint_names


def test_a_hidden_pedestrian_is_an_outline(page: LivePage, listener: Peer) -> None:
    """The request has the van only; without the layer the person is drawn normally."""
    listener.wait_until(lambda: told(listener, page, VAN), 'a request with the van')
    assert not told(listener, page, PERSON)
    hollow = page.run('return crgame.perception.hollow')
    assert PERSON in hollow and VAN not in hollow and 'av0' not in hollow
    assert page.run('return document.querySelector(\'[data-layer="unseen"]\').hidden') is False
    person = place_of(page, PERSON)
    assert share_of(pixels(page, *person), page, 'vulnerable') == 0.0
    # The ring around the person is visible, though.
    assert 0.02 < share_of(pixels(page, *person, 14), page, 'vulnerable') < 0.4
    show(page, 'unseen', False)
    assert page.run('return crgame.perception.hollow') == []
    assert share_of(pixels(page, *person), page, 'vulnerable') == 1.0
    show(page, 'unseen', True)
    assert share_of(pixels(page, *person), page, 'vulnerable') == 0.0


def test_the_instruments_count_seen_objects(page: LivePage) -> None:
    """Of the van and the person within the sensor's range the AV sees the van."""
    page.wait('crgame.perception.count', 'what the AV knows of')
    count = page.run('return crgame.perception.count')
    near = page.run("""
        const { vehicles, objects } = crgame.world.shown;
        const [x, y] = vehicles.subarray(13, 15);
        const others = [[...vehicles.subarray(0, 2)]];
        for (let at = 0; at < objects.length; at += 6) {
          others.push([...objects.subarray(at, at + 2)]);
        }
        return others.filter(([a, b]) => Math.hypot(a - x, b - y) <= 80).length;""")
    assert count['near'] == near and count['range'] == 80 and (count['seen'], near) == (1, 2)
    text = f'sees {count["seen"]} of {near} within 80 m'
    page.wait_for_text('.hud-seen', text)
    page.tab('timing')
    page.wait_for_text('[data-av="av0"] .seen', text)
    page.tab('drive')


def test_the_estimate_is_that_of_the_message(page: LivePage, listener: Peer) -> None:
    """Pose and ellipse are those of /localization at the shown step, 2 m off the truth."""
    shown = page.run('return crgame.perception.estimate')
    scheduler = listener.games[-1].scheduler
    message, = listener.wait_until(lambda: [
        item for item in listener.messages['/<av>/localization']
        if scheduler.step_of_stamp(from_time(item.header.stamp)) == shown['n']], 'the estimate')
    pose = message.pose.pose
    assert [shown['x'], shown['y']] == pytest.approx([pose.position.x, pose.position.y], abs=1e-6)
    assert np.sin(0.5 * shown['yaw']) == pytest.approx(pose.orientation.z, abs=1e-6)
    covariance = np.array(message.pose.covariance).reshape(6, 6)[:2, :2]
    assert [shown['minor'], shown['major']] == pytest.approx(
        2.0 * np.sqrt(np.linalg.eigvalsh(covariance)), abs=1e-9)
    truth = page.vehicle(1)
    assert 0.8 < shown['y'] - truth[1] < 3.2
    # The cross is in the middle of the ellipse.
    assert share_of(pixels(page, shown['x'], shown['y'], 2), page, 'map-estimate') > 0.1
    show(page, 'estimate', False)
    assert share_of(pixels(page, shown['x'], shown['y'], 2), page, 'map-estimate') == 0.0
    show(page, 'estimate', True)


def test_rays_are_drawn_and_switched_off(page: LivePage) -> None:
    """Free road ahead is tinted up to the van, and no road behind it."""
    x = page.vehicle(1)[0]
    ahead, behind_van = (x + 12.0, 3.0), (168.5, -4.0)
    on = [pixels(page, *point) for point in (ahead, behind_van)]
    show(page, 'rays', False)
    assert page.run('return crgame.perception.fans') == 0
    off = [pixels(page, *point) for point in (ahead, behind_van)]
    changed = [np.abs(with_rays - without).max() for with_rays, without in
               zip(on, off, strict=True)]
    assert changed[0] > 6 and changed[1] == 0
    show(page, 'rays', True)


def test_walls_of_the_map_are_drawn(page: LivePage) -> None:
    """Occupied cells of the map are drawn in their colour, unless switched off."""
    page.wait('crgame.perception.occupied > 0', 'the map')
    x0, x1, y0, y1 = WALL
    assert page.run('return crgame.perception.occupied') == \
        round((x1 - x0) * (y1 - y0) / CELL_M ** 2)
    inside, beside = (x0 + 12.0, 0.5 * (y0 + y1)), (x0 + 12.0, y1 + 2.0)
    assert share_of(pixels(page, *inside), page, 'map-occupied') == 1.0
    assert share_of(pixels(page, *beside), page, 'map-occupied') == 0.0
    show(page, 'occupancy', False)
    assert share_of(pixels(page, *inside), page, 'map-occupied') == 0.0
    show(page, 'occupancy', True)


def test_a_pedestrian_in_view_is_solid(page: LivePage, listener: Peer) -> None:
    """Past the van the request has the person, and the page draws no outline."""
    # By single steps, as the AV could pass the person before a pause on a busy machine; there, it
    # may also have braked for want of a plan.
    solid = f'!crgame.perception.hollow.includes("{PERSON}")'
    for _ in range(300):
        if page.vehicle(1)[0] > PAST_VAN_M or page.run(
                f'return crgame.world.shown.t > 8 && {solid}'):
            break
        n = page.run('return crgame.store.status.n')
        page.run("crgame.connection.request({ type: 'control', action: 'step' })")
        page.wait('crgame.store.status.n > arguments[0] && crgame.store.status.run === "paused"',
                  'a step', n)
        page.wait(SHOWN, 'everything of the step')
    assert page.run(f'return {solid}')
    listener.wait_until(lambda: told(listener, page, PERSON), 'a request with the person')
    assert share_of(pixels(page, *place_of(page, PERSON)), page, 'vulnerable') == 1.0


def test_choices_are_remembered_and_cost_no_other_page(page: LivePage) -> None:
    """A reloaded page keeps its layers; one that follows a human gets no scans."""
    page.open()
    page.run("crgame.world.follow('hv0', true);")
    page.wait('crgame.perception.fans === 0 && crgame.perception.hollow.length === 0'
              ' && document.querySelector(".hud-seen").hidden', 'nothing of perception')
    pressed = page.run("return [...document.querySelectorAll('.world-toolbar [data-layer]')]"
                       '.map((item) => item.ariaPressed)')
    assert pressed == ['true'] * 4
    page.run("crgame.world.follow('av0', true);")
    page.wait('crgame.perception.fans === 1 && crgame.perception.estimate',
              'the scan and the estimate, though the run stands still')
    assert page.browser.console_errors() == []
