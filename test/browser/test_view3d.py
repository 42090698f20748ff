# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The 3D view in a real browser: positions in its pictures, and its fallbacks."""

from collections.abc import Iterator
import math
from typing import Any

from browser_support import Browser, skip_without_three
from crgame_ros.cockpit import page_files
from crgame_ros.paths import scenarios_directory
import numpy as np
from numpy.typing import NDArray
import pytest
from world_support import RecordedRun, RunBackend, Served, served

GAME = 'merge.yaml'
WIDTH, HEIGHT = 1920, 1080
POSES = 200
# config/vehicles/bmw_320i.yaml, and the mirrors of docs/driver_view.md.
EYE = np.array([1.25, 0.36, 1.17])
MIRRORS = {
    'left': ((1.78, 0.92, 0.98), 0.19, 0.13, 1.4, -11.0, -3.0),
    'inner': ((1.75, 0.0, 1.26), 0.24, 0.065, math.inf, 0.0, -2.0),
    'right': ((1.78, -0.92, 0.98), 0.19, 0.13, 1.4, 9.0, -3.0)}
# Draws one picture of a vehicle at each pose; returns the place of a map point in it.
PROJECT = """
const [poses, across, width, height] = arguments;
const { Vector3 } = await import('/three/three.module.js');
const { picture } = crgame.view3d;
const size = [picture.stats.width, picture.stats.height];
picture.resize(32, 18);
const shown = { ...crgame.store.displayed(performance.now()) };
shown.vehicles = Float64Array.from(shown.vehicles);
const tall = 2 * Math.atan(Math.tan(across / 2) * height / width);
const local = (point) => new Vector3(
  point[0] - picture.origin.x, point[1] - picture.origin.y, point[2]);
const found = poses.map(({ x, y, yaw, aside, ahead, behind }) => {
  shown.vehicles.set([x, y, yaw]);
  const looks = { viewpoint: 'driver', index: 0, aside, height: tall, mirrors: true,
    plans: false };
  const before = picture.mirrors.drawn;
  while (picture.mirrors.drawn === before) {
    picture.draw(shown, 0, looks);
  }
  const main = local(ahead).project(picture.camera);
  const { camera } = picture.mirrors.all.find(({ name }) => name === picture.mirrors.drawn);
  const glass = local(behind[picture.mirrors.drawn]).project(camera);
  return { main: main.toArray(), mirror: picture.mirrors.drawn, glass: glass.toArray() };
});
picture.resize(...size);
return found;
"""


@pytest.fixture(scope='module')
def run() -> RecordedRun:
    return RecordedRun(scenarios_directory() / GAME, 1.0)


@pytest.fixture(scope='module')
def cockpit(run: RecordedRun) -> Iterator[Served]:
    with served(RunBackend(run)) as running:
        yield running


@pytest.fixture(scope='module')
def page(cockpit: Served, module_browser: Browser) -> Browser:
    """Return a page with an open 3D view, in a small window to save time."""
    skip_without_three()
    module_browser.resize(640, 400)
    module_browser.open(cockpit.address)
    module_browser.wait('crgame.ready && crgame.store.scene && crgame.store.latest')
    assert module_browser.run_async('return await crgame.view3d.show(true)')
    module_browser.wait('crgame.view3d.stats.frames > 3')
    return module_browser


def in_vehicle(pose: NDArray[np.float64], point: Any) -> NDArray[np.float64]:
    """Return a point of the map ahead of a rear axle, to its left and above the road."""
    dx, dy = point[0] - pose[0], point[1] - pose[1]
    return np.array([dx * math.cos(pose[2]) + dy * math.sin(pose[2]),
                     -dx * math.sin(pose[2]) + dy * math.cos(pose[2]), point[2]])


def sight(aside: float, pitch: float) -> tuple[NDArray[np.float64], ...]:
    """Return the directions forwards, left and up for a direction of view [rad]."""
    forwards = np.array([math.cos(pitch) * math.cos(aside), math.cos(pitch) * math.sin(aside),
                         math.sin(pitch)])
    left = np.array([-math.sin(aside), math.cos(aside), 0.0])
    return forwards, left, np.cross(forwards, left)


def pinhole(offset: NDArray[np.float64], aside: float, across: float) -> tuple[float, float]:
    """Return the pixel in which an eye sees a point, by similar triangles alone."""
    forwards, left, up = sight(aside, 0.0)
    scale = 0.5 * WIDTH / math.tan(0.5 * across) / (offset @ forwards)
    return 0.5 * WIDTH - scale * (offset @ left), 0.5 * HEIGHT - scale * (offset @ up)


def on_glass(point: NDArray[np.float64], name: str) -> tuple[float, float]:
    """
    Return the place on a mirror's glass where its driver sees a point, from left and top.

    The line from the eye's image behind the glass to the point passes through it there.

    :return: shares of the glass's width and height.
    """
    middle, width, height, radius, aside, pitch = MIRRORS[name]
    away = float(np.linalg.norm(np.subtract(middle, EYE)))
    backwards, left, up = sight(math.pi + math.radians(aside), math.radians(pitch))
    eye = middle - backwards / (1 / away + 2 / radius)
    along = point - eye
    hit = eye + along * ((middle - eye) @ backwards) / (along @ backwards) - middle
    # The mirror's left in the view ahead is the right in a view back.
    return 0.5 + (hit @ left) / width, 0.5 - (hit @ up) / height


def make_poses(run: RecordedRun) -> list[dict[str, Any]]:
    """Draw random poses on the whole map, each with points that eye and mirrors can see."""
    random = np.random.default_rng(5)
    xmin, ymin, xmax, ymax = run.scene['bounds']
    poses = []
    for _ in range(POSES):
        x, y = random.uniform(xmin, xmax), random.uniform(ymin, ymax)
        yaw, aside = random.uniform(-math.pi, math.pi), random.choice([0.0, -1.0, 1.0, math.pi])

        def place(ahead: float, left: float, height: float) -> list[float]:
            return [x + ahead * math.cos(yaw) - left * math.sin(yaw),  # noqa: B023
                    y + ahead * math.sin(yaw) + left * math.cos(yaw), height]  # noqa: B023

        away, to_left = random.uniform(4.0, 80.0), random.uniform(-0.5, 0.5)
        bearing = aside + math.atan(to_left)
        poses.append({
            'x': x, 'y': y, 'yaw': yaw, 'aside': aside,
            'ahead': place(away * math.cos(bearing), away * math.sin(bearing),
                           random.uniform(0.0, 3.0)),
            'behind': {
                name: place(-away, side + random.uniform(-0.05, 0.05) * away,
                            random.uniform(0.0, 1.5))
                for name, side in (('left', 0.15 * away), ('inner', 0.0),
                                   ('right', -0.15 * away))}})
    return poses


@pytest.mark.exhaustive
def test_points_of_the_map_are_where_a_pinhole_at_the_eye_sees_them(
        page: Browser, run: RecordedRun) -> None:
    """In the driver's view and in side and rear windows, 200 poses agree to a pixel in 1920."""
    poses, across = make_poses(run), math.radians(75.0)
    found = page.run_async(PROJECT, poses, across, WIDTH, HEIGHT)
    assert {item['mirror'] for item in found} == set(MIRRORS)
    for pose, item in zip(poses, found, strict=True):
        stand = np.array([pose['x'], pose['y'], pose['yaw']])
        expected = pinhole(in_vehicle(stand, pose['ahead']) - EYE, pose['aside'], across)
        seen = (0.5 * WIDTH * (1 + item['main'][0]), 0.5 * HEIGHT * (1 - item['main'][1]))
        assert math.dist(seen, expected) < 1.0, pose
        name = item['mirror']
        expected = on_glass(in_vehicle(stand, pose['behind'][name]), name)
        # The rear camera's picture is mirrored on the glass.
        seen = (0.5 * (1 - item['glass'][0]), 0.5 * (1 - item['glass'][1]))
        # A mirror is a fifth to a quarter of the picture's width.
        assert math.dist(seen, expected) * 0.25 * WIDTH < 1.0, (name, pose)


def test_a_car_true_to_scale_subtends_what_it_would(page: Browser) -> None:
    """1.8 m across at 20 m are 5.15 degrees for eyes 0.7 m before a screen of 0.6 m."""
    frames = page.run('return crgame.view3d.stats.frames')
    angle = page.run("""
        const { settings } = crgame.view3d;
        const inputs = [...settings.node.querySelectorAll('input[type=number]')];
        inputs[0].value = '60';
        inputs[1].value = '70';
        const check = settings.node.querySelector('input[type=checkbox]:not([name])');
        check.checked = true;
        check.dispatchEvent(new Event('change'));
        return settings.seat;""")
    assert angle == {'screen_width_m': 0.6, 'eye_distance_m': 0.7}
    page.wait('crgame.view3d.stats.frames > arguments[0] + 1', arguments=(frames,))
    # Focal length of the picture [px], and width of a pixel on the screen [m].
    focal = page.run("""
        const { picture } = crgame.view3d;
        return 0.5 * picture.stats.height * picture.camera.projectionMatrix.elements[5];""")
    pixel_m = 0.6 / page.run('return window.screen.width')
    on_screen_m = focal * 1.8 / 20.0 * pixel_m
    assert math.degrees(2 * math.atan(0.5 * on_screen_m / 0.7)) == pytest.approx(5.15, abs=0.01)
    page.run("""
        const check = crgame.view3d.settings.node.querySelector('input[type=checkbox]');
        check.checked = false;
        check.dispatchEvent(new Event('change'));""")


def test_the_map_rests_while_it_is_covered_and_few_calls_draw_the_view(page: Browser) -> None:
    """Without the small map no part of the map is drawn; V shows the map again."""
    page.run("crgame.view3d.settings.set('inset', false)")
    page.wait('document.querySelector("#world").clientWidth === 0')
    # The frame that hid the map may still have drawn it.
    before = page.run_async("""
        for (let i = 0; i < 3; i += 1) {
          await new Promise((resolve) => requestAnimationFrame(resolve));
        }
        return crgame.world.stats.frames;""")
    page.run('crgame.world.redraw()')
    frames = page.run('return crgame.view3d.stats.frames')
    page.run('crgame.view3d.redraw()')
    page.wait('crgame.view3d.stats.frames > arguments[0] + 1', arguments=(frames,))
    assert page.run('return crgame.world.stats.frames') == before
    stats = page.run('return crgame.view3d.stats')
    assert 0 < stats['draw_calls'] <= 150 and 0 < stats['triangles'] <= 300_000
    page.run("""
        crgame.view3d.settings.set('inset', true);
        window.dispatchEvent(new KeyboardEvent('keydown', { key: 'c' }));""")
    assert page.run('return crgame.view3d.viewpoint') == 'chase'
    page.run("window.dispatchEvent(new KeyboardEvent('keydown', { key: 'v' }))")
    page.wait('!crgame.view3d.on && crgame.world.stats.frames > arguments[0]',
              arguments=(before,))
    assert page.run("""return getComputedStyle(document.querySelector('#view3d')).display""") \
        == 'none'
    page.run("crgame.view3d.viewpoint = 'driver'")
    assert page.run_async('return await crgame.view3d.show(true)')


@pytest.mark.exhaustive
def test_what_a_camera_cannot_see_is_left_out_and_nothing_else(page: Browser) -> None:
    """A fraction of the triangles gives the same pixels as all of them."""
    found = page.run_async("""
        const { Frustum } = await import('/three/three.module.js');
        const { picture } = crgame.view3d;
        const size = [picture.stats.width, picture.stats.height];
        picture.sharp = true;
        picture.resize(320, 180);
        const context = document.querySelector('#view3d').getContext('webgl2');
        const shown = crgame.store.displayed(performance.now());
        const draw = (viewpoint, aside) => {
          const triangles = [];
          // Each mirror once.
          for (let i = 0; i < 3; i += 1) {
            picture.draw(shown, 0, { viewpoint, index: 0, aside, height: 0.8, mirrors: true,
              plans: false });
            triangles.push(picture.stats.triangles);
          }
          const { drawingBufferWidth: width, drawingBufferHeight: height } = context;
          const pixels = new Uint8Array(4 * width * height);
          context.readPixels(0, 0, width, height, context.RGBA, context.UNSIGNED_BYTE, pixels);
          return { pixels, triangles: Math.max(...triangles) };
        };
        const views = [['driver', 0], ['driver', 1.2], ['driver', Math.PI], ['chase', 0],
          ['bird', 0]];
        const chosen = views.map((view) => draw(...view));
        const { setFromProjectionMatrix: original } = Frustum.prototype;
        Frustum.prototype.setFromProjectionMatrix = function everything(...given) {
          original.apply(this, given);
          this.planes.forEach((plane) => { plane.constant = 1e9; });
          return this;
        };
        const all = views.map((view) => draw(...view));
        Frustum.prototype.setFromProjectionMatrix = original;
        picture.sharp = false;
        picture.resize(...size);
        return chosen.map(({ pixels, triangles }, i) => ({
          share: triangles / all[i].triangles,
          other: pixels.filter((value, k) => Math.abs(value - all[i].pixels[k]) > 2).length,
          colors: new Set(pixels.filter((_, k) => k % 4 === 1)).size,
        }));""")
    for view in found:
        assert view['other'] == 0
        assert view['share'] < 0.7
        assert view['colors'] > 10


@pytest.mark.exhaustive
def test_what_is_left_out_of_pictures_is_hardly_seen(page: Browser) -> None:
    """The least detail at the same size has fewer triangles and 97 % of the pixels alike."""
    found = page.run_async("""
        const { DETAILS } = await import('/static/js/view3d/quality.js');
        const { picture } = crgame.view3d;
        const size = [picture.stats.width, picture.stats.height];
        const context = document.querySelector('#view3d').getContext('webgl2');
        const shown = crgame.store.displayed(performance.now());
        const draw = (viewpoint, aside) => {
          // What is chosen anew, and each mirror once.
          picture.sharp = false;
          picture.sharp = true;
          picture.resize(320, 180);
          let triangles = 0;
          for (let i = 0; i < 6; i += 1) {
            picture.draw(shown, 0, { viewpoint, index: 0, aside, height: 0.8, mirrors: true,
              plans: false });
            triangles = Math.max(triangles, picture.stats.triangles);
          }
          const { drawingBufferWidth: width, drawingBufferHeight: height } = context;
          const pixels = new Uint8Array(4 * width * height);
          context.readPixels(0, 0, width, height, context.RGBA, context.UNSIGNED_BYTE, pixels);
          return { pixels, triangles };
        };
        const views = [['driver', 0], ['chase', 0], ['chase', 1.5], ['bird', 0]];
        const all = views.map((view) => draw(...view));
        const [most, least] = [DETAILS[0], DETAILS[DETAILS.length - 1]];
        DETAILS[0] = least;
        const plain = views.map((view) => draw(...view));
        DETAILS[0] = most;
        picture.sharp = false;
        picture.resize(...size);
        return plain.map(({ pixels, triangles }, i) => ({
          share: triangles / all[i].triangles,
          other: pixels.filter((value, k) => Math.abs(value - all[i].pixels[k]) > 24).length
            / pixels.length,
        }));""")
    for view in found:
        assert view['other'] < 0.03
        assert view['share'] < 0.7


def test_a_new_scene_has_the_map_colours_and_frees_the_cabin(page: Browser) -> None:
    """A driven bicycle has its driver's colour, and the cabin before is thrown away once."""
    found = page.run_async("""
        const { Color, DoubleSide, Material } = await import('/three/three.module.js');
        const { Instances } = await import('/static/js/view3d/instances.js');
        const { themeColor } = await import('/static/js/world/palette.js');
        const { store, view3d: { picture } } = crgame;
        const { add } = Instances.prototype;
        const { dispose } = Material.prototype;
        const found = { wanted: new Color(themeColor('human')).getHex(), drawn: [], freed: 0 };
        Instances.prototype.add = function (matrix, color, isOwn) {
          found.drawn.push(...isOwn ? [color] : []);
          return add.call(this, matrix, color, isOwn);
        };
        Material.prototype.dispose = function () {
          found.freed += this.isMeshLambertMaterial && this.side === DoubleSide ? 1 : 0;
          return dispose.call(this);
        };
        const draw = (viewpoint) => picture.draw(store.displayed(performance.now()),
          performance.now(), { viewpoint, index: 0, aside: 0, height: 0.8, mirrors: false,
            plans: false });
        const { scene } = store;
        const [first, ...others] = scene.vehicles;
        draw('driver');
        store.receive({ ...scene, vehicles: [{ ...first, type: 'bicycle' }, ...others] });
        found.drawn.length = 0;
        draw('chase');
        Instances.prototype.add = add;
        store.receive({ ...scene, vehicles: [{ ...first }, ...others] });
        draw('driver');
        Material.prototype.dispose = dispose;
        return found;""")
    # Its wheels are added before it.
    assert found['drawn'][-1] == found['wanted']
    assert found['freed'] == 1


@pytest.mark.clock
def test_a_lost_graphics_context_is_survived(page: Browser) -> None:
    """The page reports it; after the context's return the pictures are as before."""
    page.run("""
        const context = document.querySelector('#view3d').getContext('webgl2');
        window.loss = context.getExtension('WEBGL_lose_context');
        window.loss.loseContext();""")
    page.wait("""[...document.querySelectorAll('#notices *')].some(
        (node) => node.textContent.includes('has lost the graphics card'))""")
    frames = page.run('return crgame.view3d.stats.frames')
    page.run('window.loss.restoreContext()')
    page.wait('!crgame.view3d.picture.lost && crgame.view3d.stats.frames > arguments[0] + 3',
              arguments=(frames,))
    colors = page.run_async("""
        crgame.view3d.redraw();
        await new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve, 500)));
        const { picture } = crgame.view3d;
        picture.draw(crgame.store.displayed(performance.now()), performance.now(), {
          viewpoint: 'chase', index: 0, aside: 0, height: 0.8, mirrors: false, plans: false });
        const context = document.querySelector('#view3d').getContext('webgl2');
        const { drawingBufferWidth: width, drawingBufferHeight: height } = context;
        const pixels = new Uint8Array(4 * width * height);
        context.readPixels(0, 0, width, height, context.RGBA, context.UNSIGNED_BYTE, pixels);
        const seen = new Set();
        for (let i = 0; i < pixels.length; i += 4) {
          seen.add(`${pixels[i] >> 4} ${pixels[i + 1] >> 4} ${pixels[i + 2] >> 4}`);
        }
        return seen.size;""")
    # Sky, road, ground, and a car with its shading.
    assert colors > 5


@pytest.mark.exhaustive
def test_a_side_window_shows_the_time_of_the_first_and_nothing_else(
        page: Browser, cockpit: Served) -> None:
    """It has no panels or instruments and shows the last time of the seat's window."""
    first = page.driver.current_window_handle
    page.driver.switch_to.new_window('window')
    try:
        page.resize(640, 400)
        page.open(f'{cockpit.address}?view=driver&yaw=-60')
        page.wait('crgame.ready && crgame.view3d.on && crgame.view3d.stats.frames > 0')
        assert page.run("""return ['#bar', '#panels', '#hud', '#world', '.world-toolbar'].every(
            (name) => document.querySelector(name).getClientRects().length === 0)""")
        assert page.run('return crgame.view3d.picture.stats.width') == 640
        followed = page.run_async("""
            const channel = new BroadcastChannel('crgame-seat');
            const shown = [];
            for (let i = 0; i < 20; i += 1) {
              channel.postMessage({ t: 0.123, at_ms: performance.timeOrigin + performance.now(),
                rate: 0, epoch: crgame.store.epoch, vehicle: 'av0' });
              await new Promise((resolve) => setTimeout(resolve, 20));
              shown.push([crgame.store.displayed(performance.now()).t, crgame.view3d.vehicle]);
            }
            channel.close();
            return shown;""")
        assert [0.123, 'av0'] in followed
    finally:
        page.driver.close()
        page.driver.switch_to.window(first)


def test_without_the_library_the_map_works_and_a_line_says_so(
        cockpit: Served, browser: Browser, monkeypatch: pytest.MonkeyPatch) -> None:
    """The page keeps its map and logs no error but the missing file."""
    with served(RunBackend(cockpit.backend.run)) as other:
        monkeypatch.setattr(page_files, 'find_libraries', lambda: None)
        browser.open(other.address)
        browser.wait('crgame.ready && crgame.store.scene && crgame.world.stats.frames > 0')
        # Viewpoints can be chosen only in the view; on the map one button opens it.
        assert browser.run("""
            return [...document.querySelectorAll('.view3d-buttons button')].filter(
              (node) => node.getClientRects().length > 0).length""") == 1
        assert browser.run_async('return await crgame.view3d.show(true)') is False
        browser.wait("""[...document.querySelectorAll('#notices *')].some(
            (node) => node.textContent.includes('crgame page-libraries'))""")
        assert browser.run("return document.querySelector('#world').clientWidth > 0")
        assert all('/three/' in error for error in browser.console_errors())
