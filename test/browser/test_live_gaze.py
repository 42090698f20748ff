# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Made gaze, as a real stream of LSL, on the real page of a running graph: the tables know it."""

from collections.abc import Iterator
import math
from pathlib import Path
import threading

from browser_support import Browser, skip_without_three
from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.run_tables import tables_of
from crgame_ros.game.view_documents import VIEW_PICTURE
from crgame_ros.instruments.outlets import CONFIGURATION
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_folder import run_folder
from live_browser_support import Graph, live_graph, LivePage, SCENARIOS
import pandas as pd
import pytest
from selenium.webdriver.common.action_chains import ActionChains

pylsl = pytest.importorskip('pylsl', reason='the extra `instruments` is not installed')

GAME = f"""
scenario: {SCENARIOS / 'ZAM_CutIn-1_1_T-1.xml'}
duration: 3600
humans:
  - id: hv0
    driver: cockpit
    spawn: {{lanelet: 13, s: 215.0, d: 0.0, speed: 0.0}}
avs:
  - {{id: av0, planning_problem: 100, planner: idm}}
objects:
  - {{id: lead, kind: bicycle, type: car, lanelet: 13, s: 228.0, speed: 0.5}}
instruments:
  gaze: [{{stream: Eyes, x: gaze_x, y: gaze_y, confidence: sure}}]
"""
RATE_HZ = 50.0
# Pictures of a phase, and known samples that it needs at least.
PICTURES, ENOUGH = 12, 10
# Where a person would look on the screen: at the middle of a vehicle, projected by three.js, or at
# that of a mirror, by its place in docs/driver_view.md's picture; after the number of pictures.
AIM = """
const [target] = arguments;
const { picture } = crgame.view3d;
const stage = document.querySelector('#stage').getBoundingClientRect();
const onScreen = (x, y) => [(window.corner[0] + stage.left + x * stage.width) / screen.width,
  (window.corner[1] + stage.top + y * stage.height) / screen.height];
const { frames } = crgame.view3d.stats;
if (target === 'mirror') {
  return [frames, onScreen(0.105, 1 - 0.47)];
}
const index = crgame.store.scene.objects.findIndex(({ id }) => id === 'lead');
const [x, y] = crgame.store.displayed(performance.now()).objects.subarray(6 * index);
const point = picture.camera.position.clone().set(
  x - picture.origin.x, y - picture.origin.y, 0.7).project(picture.camera);
return [frames, onScreen(0.5 * (1 + point.x), 0.5 * (1 - point.y))];
"""
# Where the page is on the screen, as the browser tells it with a mouse.
CORNER = """
window.addEventListener('mousemove', (event) => {
  window.corner = [event.screenX - event.clientX, event.screenY - event.clientY];
});
"""
# A second page, without the seat, says that the view was full of mirrors.
STRANGER = """
const told = [];
const socket = new WebSocket(`ws://${location.host}/ws`);
await new Promise((resolve) => socket.addEventListener('open', resolve));
const now = crgame.store.serverClock.at(performance.now());
for (let i = 0; i < 5; i += 1) {
  socket.send(JSON.stringify({type: 'picture', picture: {seat: 'hv0', epoch: crgame.store.epoch,
    steady_s: now.steady_s, clock_error_ms: 1, place: [0, 0, 1, 1, 1, 1, 1],
    eye: [0, 0, 0, 1, 0, 1, 1], shown: [['mirror', 'of_a_stranger', 0, 0, 1, 1]]}}));
}
await new Promise((resolve) => setTimeout(resolve, 150));
socket.close();
"""


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph]:
    """Keep one graph, whose run waits for a driver in a browser."""
    skip_without_three()
    pylsl.set_config_content(CONFIGURATION)
    folder = tmp_path_factory.mktemp('gaze')
    (folder / 'game.yaml').write_text(GAME)
    with live_graph(folder / 'game.yaml', folder / 'run') as running:
        yield running


class Eyes:
    """A device that sends where a person looks on the screen, or that it knows no gaze."""

    def __init__(self) -> None:
        info = pylsl.StreamInfo('Eyes', 'Gaze', 3, RATE_HZ, pylsl.cf_float32, 'made eyes')
        info.set_channel_labels(['gaze_x', 'gaze_y', 'sure'])
        self._outlet = pylsl.StreamOutlet(info)
        self.aim = (math.nan, math.nan)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._send)
        self._thread.start()

    def _send(self) -> None:
        while not self._ended.wait(1.0 / RATE_HZ):
            self._outlet.push_sample([*self.aim, 0.9], pylsl.local_clock())

    def end(self) -> None:
        """Stop sending."""
        self._ended.set()
        self._thread.join()


def look(page: LivePage, eyes: Eyes, target: str) -> tuple[float, float]:
    """Look somewhere until the page has shown some pictures; return from when until when."""
    fixed = {'beside': (1.4, 0.5), 'nowhere': (math.nan, math.nan)}

    def aim() -> int:
        frames, place = page.run(AIM, target)
        eyes.aim = fixed.get(target) or tuple(place)
        return int(frames)

    last = aim() + PICTURES
    begin_s = pylsl.local_clock()
    while aim() < last:
        pass
    return begin_s, pylsl.local_clock()


def bag_of(graph: Graph) -> Path:
    """Return the recording of the run that has ended."""
    bag = run_folder(graph.launcher.out, 0) / 'bag'
    graph.launcher.wait_for(f'messages in .*{bag.parent.name}/bag')
    return bag


def test_gaze_on_the_screen_is_on_what_was_there(
        graph: Graph, module_browser: Browser, request: pytest.FixtureRequest) -> None:
    """A vehicle is followed, then a mirror; then the gaze is beside the view, then lost."""
    eyes = Eyes()
    request.addfinalizer(eyes.end)
    page = LivePage(graph, module_browser)
    page.claim('hv0')
    # Small, because the processor draws.
    module_browser.resize(640, 400)
    page.run(f"{CORNER}; crgame.view3d.settings.set('inset', false)")
    ActionChains(page.driver).move_by_offset(200, 150).perform()
    page.wait('window.corner')
    assert page.run_async('return await crgame.view3d.show(true)')
    graph.launcher.wait_for('recording the stream Eyes')
    page.order('start')
    page.wait_for_run('running')
    page.wait('crgame.view3d.stats.frames > 3')
    page.run_async(STRANGER)
    phases = {target: look(page, eyes, target)
              for target in ('vehicle', 'mirror', 'beside', 'nowhere')}
    page.order('stop')
    bag = bag_of(graph)
    tables = {name: table.to_pandas() for name, table in tables_of(
        [Run.of_recording(bag)]).items()}
    gaze = tables['gaze'].merge(tables['instrument_samples'].query('channel == "gaze_x"')[
        ['number', 'steady_s']], on='number')
    print(gaze.groupby(['kind', 'object'], dropna=False).size(), tables['glances'],
          tables['glance_sums'], gaze.between_s.describe())
    for target, (begin_s, end_s) in phases.items():
        mine = gaze[(gaze.steady_s > begin_s) & (gaze.steady_s < end_s)]
        # A page on a busy machine draws too seldom now and then.
        mine = mine[mine.kind != 'unknown']
        assert len(mine) >= ENOUGH, target
        told = mine[['kind', 'object']].apply(tuple, axis=1) if target in ('vehicle', 'mirror') \
            else mine.kind
        wanted = {'vehicle': ('vehicle', 'lead'), 'mirror': ('mirror', 'mirror_left'),
                  'beside': 'off_view', 'nowhere': 'lost'}[target]
        assert (told == wanted).mean() > 0.95, (target, mine)
    areas = list(tables['glances'][['kind', 'object']].itertuples(index=False, name=None))
    assert list(dict.fromkeys(areas)) == [
        ('vehicle', 'lead'), ('mirror', 'mirror_left'), ('off_view', 'off_view')]
    with BagReader(bag, parts=True) as reader:
        told_ = [VIEW_PICTURE.read(message.data) for _, _, _, message in reader.readable(
            [VIEW_PICTURE.topic])]
        size = sum(len(data) for _, _, _, data in reader.messages([VIEW_PICTURE.topic]))
    print(len(told_), 'pictures', size / len(told_), 'bytes each', told_[len(told_) // 2])
    assert not any(thing.id == 'of_a_stranger' for item in told_ for thing in item.shown)
    assert pd.notna(gaze[gaze.kind == 'vehicle'].distance_m).all()
