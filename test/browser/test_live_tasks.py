# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A driver answers lights and a request to take over, in a browser on a running graph."""

from collections.abc import Iterator
import math
import time

from browser_support import Browser
from crgame_ros.analysis.behaviour.task_events import task_events, TaskEvent
from crgame_ros.recording.run_folder import run_folder
from crgame_ros.recording.run_record import read_run_record
from live_browser_support import Graph, live_graph, LivePage, SCENARIOS
import pytest
from selenium.webdriver.common.keys import Keys

pytestmark = pytest.mark.clock

GAME = f"""
scenario: {SCENARIOS / 'ZAM_Crossing-1_1_T-1.xml'}
duration: 3600
seed: 5
language: de
humans:
  - {{id: hv0, driver: cockpit, spawn: {{lanelet: 22, s: 40.0, d: 0.0, speed: 0.0}}}}
avs:
  - {{id: av0, planning_problem: 100, planner: idm}}
tasks:
  - {{name: light, detection_response: {{interval: [2.6, 3.0]}}, when: {{time: 0}}}}
  - {{name: call, take_over: {{lead: 2, shown: 30}}, seat: av0, label: Baustelle}}
  - {{name: radio, secondary_task: {{show: true}}, label: Radio}}
"""
# Reference for the page: an independent observer of the light and the keys of the same page.
WATCH = """
window.seen = [];
window.pressed = [];
const light = document.querySelector('.task-light');
new MutationObserver(() => {
  if (!light.hidden) {
    const entry = {changed: performance.now(), next: null};
    window.seen.push(entry);
    requestAnimationFrame(() => { entry.next = performance.now(); });
  }
}).observe(light, {attributes: true, attributeFilter: ['hidden']});
window.addEventListener('keydown', (event) => {
  if (event.key === 'Enter') window.pressed.push(event.timeStamp);
}, {capture: true});
"""


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph]:
    """Keep one graph, whose run waits for a driver in a browser."""
    folder = tmp_path_factory.mktemp('tasks')
    (folder / 'game.yaml').write_text(GAME)
    with live_graph(folder / 'game.yaml', folder / 'run') as running:
        yield running


# Another client on the same graph has no seat, but answers for hv0.
STRANGER = """
const socket = new WebSocket(`ws://${location.host}/ws`);
await new Promise((resolve) => socket.addEventListener('open', resolve));
const [prompt] = crgame.store.tasks.open;
socket.send(JSON.stringify({type: 'task', seat: 'hv0', task: 'light', number: prompt.number,
  what: 'answer', response_ms: 222}));
await new Promise((resolve) => setTimeout(resolve, 150));
const stays = crgame.store.tasks.open.some((each) => each.number === prompt.number);
socket.close();
return stays;
"""


def press(page: LivePage) -> None:
    """Answer by the key."""
    page.hold(Keys.ENTER)
    page.release(Keys.ENTER)


def rows_of(graph: Graph) -> list[TaskEvent]:
    """Read the tasks of the run that has ended."""
    bag = run_folder(graph.launcher.out, 0) / 'bag'
    graph.launcher.wait_for(f'messages in .*{bag.parent.name}/bag')
    return task_events(read_run_record(bag))


def test_lights_requests_and_notes_are_shown_answered_and_recorded(
        graph: Graph, module_browser: Browser) -> None:
    """The page times each answer, and the recording has it with its outcome."""
    page = LivePage(graph, module_browser)
    page.run(WATCH)
    page.claim('hv0')
    page.order('start')
    page.wait_for_run('running')
    for number, wait_s in enumerate((0.15, 0.4, 0.8)):
        page.wait('window.seen.length > arguments[0]', 'a light', number)
        if number == 1:
            assert page.run_async(STRANGER) is True
        time.sleep(wait_s)
        press(page)
        page.wait('document.querySelector(".task-light").hidden', 'the light to go out')
    press(page)  # An answer without a light.
    page.tab('events')
    page.click('.task-panel [data-name="radio"] button')
    page.wait_for_text('.task-note', 'Aufgabe: Radio')
    page.wait('window.seen.length > 3', 'a light that nobody answers')
    page.wait('window.seen.length > 4', 'a light that a pause interrupts')
    page.order('pause')
    page.wait_for_run('paused')
    page.wait('document.querySelector(".task-light").hidden', 'no light in a pause')
    time.sleep(3.0)
    page.order('start')
    page.wait_for_run('running')
    press(page)
    seen, pressed = page.run('return [window.seen, window.pressed]')
    page.wait('crgame.store.tasks.open[0]?.number > 5 && crgame.store.tasks.open[0].seen',
              'a light that a reload interrupts')
    reloaded = page.run('return crgame.store.tasks.open[0].number')
    page.open()
    page.wait('crgame.driving.seat === "hv0"', 'the seat again')
    assert page.run('return crgame.tasks.prompts.every((prompt) => prompt.answered'
                    ' || prompt.open.number !== arguments[0])', reloaded)
    page.wait('crgame.store.tasks.open.every((each) => each.number !== arguments[0])',
              'the end of the light that a reload interrupted', reloaded)
    page.give_back('hv0')
    page.tab('events')
    page.click('.task-panel [data-name="call"] button')
    page.wait('!document.querySelector(".task-request").hidden', 'the request')
    assert 'Übernehmen' in page.text('.task-request')
    assert 'Baustelle' in page.text('.task-request')
    press(page)
    page.wait('crgame.driving.seat === "av0"', 'the seat of the AV')
    page.wait('document.querySelector(".task-request").hidden', 'the request to go')
    page.hold('w')
    graph.wait_for_command('av0', 0, 0.2, 1.0)
    page.release('w')
    assert page.browser.console_errors() == []
    page.order('stop')
    rows = rows_of(graph)
    lights = [row for row in rows if row.what == 'stimulus']
    assert [row.outcome for row in lights[:5]] == ['hit', 'hit', 'hit', 'missed', 'hit']
    for number in range(3):
        times = lights[number].times
        assert times.response_ms is not None
        # The light was drawn after its change and before the next picture began.
        entry = seen[number]
        assert pressed[number] - entry['next'] - 1.0 <= times.response_ms
        assert times.response_ms <= pressed[number] - entry['changed'] + 1.0
        assert times.delay_ms is not None and 0.0 <= times.delay_ms < 2000.0
        assert times.picture_ms is not None and times.picture_ms > 0.0
        # Both clocks are of this machine: the picture is later than the onset's cycle, and no
        # later than the page heard of it and drew, up to the error of the relation.
        assert times.clock_error_ms is not None and times.clock_error_ms >= 0.0
        delay_ms = 1e3 * (lights[number].shown_s - lights[number].onset_s)
        assert -times.clock_error_ms <= delay_ms < 2000.0
        assert lights[number].response_time_s == pytest.approx(times.response_ms / 1e3)
    assert [row.outcome for row in rows if row.what == 'unrequested'] == ['unrequested']
    assert lights[reloaded - 1].outcome == 'missed'
    assert lights[-1].outcome in ('unseen', 'open')
    paused = lights[4].times
    assert paused.paused_ms is not None and paused.paused_ms > 3000.0
    assert paused.response_ms is not None and paused.response_ms < 2500.0
    request = next(row for row in rows if row.kind == 'take_over')
    assert request.outcome == 'taken'
    assert 0.0 < request.response_time_s < 30.0
    assert request.times.delay_ms is not None and request.times.delay_ms > 0.0
    radio = next(row for row in rows if row.name == 'radio')
    assert radio.duration_s > 3.0 and math.isnan(radio.response_time_s)
