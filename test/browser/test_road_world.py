# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The world of the 3D view as a browser draws it: pixels of roads, lights and fog."""

from collections.abc import Iterator
import json
import math
from pathlib import Path
from typing import Any

from browser_support import Browser, skip_without_three
from crgame_ros.cockpit.scene import scene_document
from crgame_ros.game.documents import GAME
from crgame_ros.game.game import load_game
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import build_setup
import numpy as np
from numpy.typing import NDArray
import pytest
from world_support import RecordedRun, RunBackend, served

Scene = dict[str, Any]
Pixels = NDArray[np.int_]

SIZE_PX = 96
# Maps with their own lines: two junctions and a ramp.
MARKED = ('USA_Lanker-1_3_T-1', 'ZAM-Ramp-1_1-T-1',
          'more/DEU_TestIntersectionInteract-3_1_T-1')
# The largest one, with a motorway's signs, and two of towns.
PUBLISHED = ('more/OSC_Overtake-1_1_T-1', 'more/DEU_Starnberg-1_1_T-1', 'USA_Lanker-1_3_T-1')
# One renderer for all scenes, separate from the page's own.
PREPARE = """
const three = await import('/static/js/view3d/three.js');
const { createRoadWorld } = await import('/static/js/view3d/road/road_world.js');
const { localOrigin } = await import('/static/js/view3d/local_origin.js');
const canvas = document.createElement('canvas');
const renderer = new three.WebGLRenderer({ canvas });
renderer.setSize(arguments[0], arguments[0], false);
const camera = new three.PerspectiveCamera(40, 1, 0.2, 3000);
camera.rotation.order = 'ZXY';
window.roadTest = { three, createRoadWorld, localOrigin, renderer, camera, world: null };
"""
SHOW = """
const test = window.roadTest;
test.world?.dispose();
test.stage = new test.three.Scene();
test.origin = test.localOrigin(arguments[0]);
test.world = test.createRoadWorld(test.three, arguments[0]);
test.stage.add(test.world.group);
test.stage.fog = test.world.fog;
return { triangles: test.world.triangles, drawCalls: test.world.drawCalls };
"""
LOOK = """
const { stage, world, camera, renderer, origin } = window.roadTest;
const [x, y, z, yaw, pitch, states] = arguments;
camera.position.set(x - origin.x, y - origin.y, z);
camera.rotation.set(Math.PI / 2 + pitch, 0, yaw - Math.PI / 2);
world.update({ signals: { states }, perceived: { occupancy: null } }, camera.position);
renderer.render(stage, camera);
const gl = renderer.getContext();
const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
const pixels = new Uint8Array(4 * width * height);
gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
return [...pixels];
"""


@pytest.fixture(scope='module')
def page(module_browser: Browser) -> Iterator[Browser]:
    """Open a page, and make a renderer in it."""
    skip_without_three()
    run = RecordedRun(scenarios_directory() / 'cut_in.yaml', 0.1)
    with served(RunBackend(run)) as server:
        module_browser.open(server.address)
        module_browser.wait('window.crgame?.ready')
        module_browser.run_async(PREPARE, SIZE_PX)
        yield module_browser
        assert module_browser.console_errors() == []


def scene_of(path: Path) -> Scene:
    """Describe a game, or a scenario alone, as pages get it."""
    game = load_game(path) if path.suffix == '.yaml' else effective_game(
        RunRequest(scenario=path, driver='idle'))
    setup = build_setup(game)
    text = GAME.write(describe_game(setup))
    scene: Scene = json.loads(json.dumps(scene_document(
        setup.loaded, setup.descriptions, GAME.read(text))))
    return scene


def show(page: Browser, scene: Scene) -> dict[str, float]:
    """Make the world of a scene; return its drawing costs."""
    cost: dict[str, float] = page.run(SHOW, scene)
    return cost


def look(page: Browser, x: float, y: float, z: float, *, yaw: float = 0.0, pitch: float = 0.0,
         states: dict[str, str] | None = None) -> Pixels:
    """Return a picture (rows from below, columns, RGB) from a point of the map."""
    pixels = page.run(LOOK, x, y, z, yaw, pitch, states or {})
    return np.array(pixels).reshape(SIZE_PX, SIZE_PX, 4)[:, :, :3]


def straight_bounds(scene: Scene, marking: str) -> list[tuple[NDArray[np.float64], float]]:
    """Return middles (2) and headings [rad] of straight parts of bounds with a marking."""
    found = []
    for lanelet in scene['lanelets']:
        for side in ('left', 'right'):
            points = np.reshape(lanelet[side], (-1, 2))
            steps = np.diff(points, axis=0)
            longest = int(np.argmax(np.hypot(*steps.T)))
            if lanelet[f'{side}_line'] == marking and np.hypot(*steps[longest]) > 8.0 \
                    and not lanelet['intersection']:
                found.append((points[longest:longest + 2].mean(axis=0),
                              math.atan2(steps[longest][1], steps[longest][0])))
    return found


@pytest.mark.matrix
@pytest.mark.parametrize('name', MARKED)
def test_lines_are_where_the_map_has_them(page: Browser, shared_scenarios: Path,
                                          name: str) -> None:
    """From above the line is white and of the right width, and the lane beside it grey."""
    scene = scene_of(shared_scenarios / f'{name}.xml')
    show(page, scene)
    bounds = straight_bounds(scene, 'solid')
    assert len(bounds) >= 2
    for (x, y), yaw in bounds[::max(len(bounds) // 3, 1)][:3]:
        picture = look(page, x, y, 3.0, yaw=yaw, pitch=-math.pi / 2)
        # Across the line, which runs upwards: at a distance of 3 m, 40 deg show 2.18 m.
        across = picture[SIZE_PX // 2 - 4:SIZE_PX // 2 + 4].mean(axis=0)
        # Yellow ones lack blue.
        painted = across[:, :2].min(axis=1) > 150
        middle = slice(SIZE_PX // 2 - 2, SIZE_PX // 2 + 2)
        assert painted[middle].all(), across[middle]
        columns = np.flatnonzero(painted)
        own = columns[abs(columns - SIZE_PX / 2) < 12]
        width_m = len(own) * 2 * 3.0 * math.tan(math.radians(20)) / SIZE_PX
        assert 0.07 < width_m < 0.22
        beside = [side for side in (across[:30], across[-30:])
                  if np.ptp(side.mean(axis=0)) < 25 and 60 < side.mean() < 150]
        assert beside, 'no asphalt on either side of the line'


@pytest.mark.exhaustive
@pytest.mark.parametrize('name', PUBLISHED)
def test_published_maps_are_cheap(page: Browser, shared_scenarios: Path, name: str) -> None:
    scene = scene_of(shared_scenarios / f'{name}.xml')
    cost = show(page, scene)
    assert cost['drawCalls'] <= 60 and cost['triangles'] <= 150_000
    xmin, ymin, xmax, ymax = scene['bounds']
    picture = look(page, (xmin + xmax) / 2, (ymin + ymax) / 2,
                   min(max(xmax - xmin, ymax - ymin), 1500.0), pitch=-math.pi / 2)
    # From high above the picture shows roads in green land.
    red, green, blue = np.moveaxis(picture, 2, 0)
    assert ((green > red + 4) & (green > blue + 15)).mean() > 0.3
    assert (np.ptp(picture, axis=2) < 14).sum() > 15


@pytest.mark.exhaustive
def test_lights_show_the_signals(page: Browser, shared_scenarios: Path) -> None:
    scene = scene_of(shared_scenarios / 'USA_Lanker-1_3_T-1.xml')
    show(page, scene)
    light = next(light for light in scene['lights'] if light['direction'] == 'all')
    yaw = light['yaw']

    def seen(state: str) -> dict[str, int]:
        picture = look(page, light['x'] - 7 * math.cos(yaw), light['y'] - 7 * math.sin(yaw), 2.7,
                       yaw=yaw, states={str(other['id']): state for other in scene['lights']})
        red, green, blue = np.moveaxis(picture, 2, 0)
        return {'red': int(((red > 190) & (green < 110) & (blue < 110)).sum()),
                'yellow': int(((red > 190) & (green > 150) & (blue < 120)).sum()),
                'green': int(((red < 110) & (green > 160) & (blue < 190)).sum())}

    dark = seen('inactive')
    for state, lit in (('red', ['red']), ('redYellow', ['red', 'yellow']),
                       ('yellow', ['yellow']), ('green', ['green']), ('inactive', [])):
        counts = seen(state)
        for color, count in counts.items():
            assert (count > dark[color] + 4) == (color in lit), (state, counts, dark)


@pytest.mark.exhaustive
@pytest.mark.parametrize(('light', 'visibility'), [('day', 120.0), ('dusk', 60.0)])
def test_fog_leaves_the_contrast_that_it_should(page: Browser, light: str,
                                                visibility: float) -> None:
    """By Koschmieder a black board keeps the contrast exp(-3 d / V) to the sky, as light."""
    scene = scene_of(scenarios_directory() / 'fog.yaml')
    show(page, scene)
    page.run('roadTest.world.setEnvironment({ light: arguments[0], visibility: arguments[1] });',
             light, visibility)
    x, y = scene['bounds'][:2]
    # Far outside the map, beside the trees around it, looking away from it.
    x, y = x - 700, y - 700
    for distance in (10.0, 30.0, 55.0):
        page.run("""
            const { three, stage, origin } = roadTest;
            const [x, y, half] = arguments;
            roadTest.board = new three.Mesh(new three.PlaneGeometry(2 * half, 2 * half),
              new three.MeshBasicMaterial({ color: 0, side: three.DoubleSide }));
            roadTest.board.rotation.y = Math.PI / 2;
            roadTest.board.position.set(x - origin.x, y - origin.y, 300);
            stage.add(roadTest.board);""", x - distance, y, 0.15 * distance)
        picture = look(page, x, y, 300.0, yaw=math.pi)
        page.run('roadTest.stage.remove(roadTest.board); roadTest.board.geometry.dispose(); '
                 'roadTest.board.material.dispose();')
        middle = SIZE_PX // 2
        board = as_light(picture[middle - 3:middle + 3, middle - 3:middle + 3])
        sky = as_light(picture[middle - 3:middle + 3, :6])
        left = 1.0 - board / sky
        # Bytes of the screen are steps of about 1 % of the fog's light.
        assert left == pytest.approx(math.exp(-3.0 * distance / visibility), abs=0.025)


def as_light(pixels: Pixels) -> float:
    """Return the mean green light of pixels in sRGB encoding."""
    value = pixels[:, :, 1].mean() / 255.0
    return float(((value + 0.055) / 1.055) ** 2.4)


def test_the_game_says_light_and_air(page: Browser) -> None:
    """The environment of a scene document is shown at once; dusk is darker than day."""
    scene = scene_of(scenarios_directory() / 'intersection.yaml')
    lanelet = np.reshape(scene['lanelets'][0]['center'], (-1, 2))
    means = {}
    for light in ('day', 'dusk'):
        for visibility in (30_000.0, 40.0):
            scene['environment'] = {'light': light, 'visibility': visibility}
            show(page, scene)
            along = lanelet[1] - lanelet[0]
            picture = look(page, *lanelet[0], 1.2, yaw=math.atan2(along[1], along[0]))
            means[light, visibility] = picture.mean(axis=(0, 1))
    assert (means['dusk', 30_000.0] < 0.8 * means['day', 30_000.0]).all()
    # Fog has no colour.
    assert np.ptp(means['day', 40.0]) < 12 < np.ptp(means['day', 30_000.0])


@pytest.mark.exhaustive
def test_what_was_shown_is_freed(page: Browser) -> None:
    scene = scene_of(scenarios_directory() / 'roundabout.yaml')
    show(page, scene)
    xmin, ymin, xmax, ymax = scene['bounds']
    look(page, (xmin + xmax) / 2, (ymin + ymax) / 2, 250.0, pitch=-math.pi / 2)
    geometries, textures = page.run('const { geometries, textures } = '
                                    'roadTest.renderer.info.memory; '
                                    'return [geometries, textures];')
    assert geometries > 5 and textures >= 2
    page.run('roadTest.world.dispose(); roadTest.world = null;')
    assert page.run('const { geometries, textures } = roadTest.renderer.info.memory; '
                    'return [geometries, textures];') == [0, 0]
