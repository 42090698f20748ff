# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page on all screens and for all people: sizes, touch, colours, alarms, saved files."""

from collections.abc import Iterator
import csv
from pathlib import Path
import time
from typing import Any

from browser_support import Browser
from crgame_ros.paths import scenarios_directory
import pytest
from world_support import RecordedRun, RunBackend, Served, served

SIZES = ((1920, 1080), (1280, 720), (1200, 800), (390, 844), (640, 360))
OVERRIDE = 'abc \u202etxet'
# Among the visible elements: those cut off by the window, and the smallest letters.
CUT_OFF = """
const seen = (node) => node.checkVisibility({ visibilityProperty: true });
return [...document.querySelectorAll(arguments[0])].filter(seen).filter((node) => {
  const { left, top, right, bottom } = node.getBoundingClientRect();
  return left < -0.5 || top < -0.5 || right > innerWidth + 0.5 || bottom > innerHeight + 0.5;
}).map((node) => `${node.tagName} ${node.id} ${node.className} ${node.textContent}`);"""
SMALLEST = """
let least = [99, ''];
for (const node of document.querySelectorAll('body *')) {
  const own = [...node.childNodes].some((child) => child.nodeType === 3 && child.data.trim());
  if (own && node.checkVisibility() && !node.closest('.unseen, svg, canvas, select')) {
    const size = parseFloat(getComputedStyle(node).fontSize);
    least = size < least[0] ? [size, `${node.className} ${node.textContent}`] : least;
  }
}
return least;"""


@pytest.fixture(scope='module')
def run() -> RecordedRun:
    """Return a game with traffic, whose events and title have untrusted texts."""
    recorded = RecordedRun(scenarios_directory() / 'traffic.yaml', 14.0)
    recorded.scene |= {'title': OVERRIDE, 'events': [
        {'name': 'slow', 'label': '', 'when': None, 'kind': 'speed_limit', 'speed': 30 / 3.6,
         'lanelets': []}]}
    return recorded


@pytest.fixture(scope='module')
def server(run: RecordedRun, module_browser: Browser) -> Iterator[Served]:
    """Serve the run to one page that drives hv0."""
    with served(RunBackend(run, every=2)) as running:
        module_browser.open(running.address)
        module_browser.wait('window.crgame?.ready && crgame.world.shown && crgame.store.me.id')
        # Hands can be on the controls only if the page has the focus.
        module_browser.driver.find_element('css selector', '#world').click()
        drive(running, module_browser)
        yield running


@pytest.fixture
def page(server: Served, module_browser: Browser) -> Iterator[Browser]:
    """Return the page in its usual size; check afterwards that it logged no error."""
    module_browser.resize(1280, 720)
    yield module_browser
    assert module_browser.console_errors() == []


def drive(server: Served, browser: Browser, holder: str | None = None) -> None:
    """Make the page, or another client, hold the seat of hv0."""
    me = holder or browser.run('return crgame.store.me.id')
    server.publish('seats', {'seats': {'hv0': {
        'source': 'cockpit', 'driver': 'cockpit', 'holder': me, 'holder_name': 'Me'}}})
    browser.wait('crgame.store.seats.hv0?.holder === arguments[0]', arguments=(me,))


def alarm(kind: str, subject: str) -> dict[str, Any]:
    return {'id': f'{kind}:{subject}', 'kind': kind, 'subject': subject, 'text': 'so',
            'since_t': 1.0}


@pytest.mark.matrix
@pytest.mark.parametrize('size', SIZES, ids=lambda size: f'{size[0]}x{size[1]}')
def test_nothing_is_cut_off_and_the_road_is_free(
        page: Browser, size: tuple[int, int]) -> None:
    """Header, tabs, view buttons and instruments fit on screens from phone to desktop."""
    page.resize(*size)
    page.wait('innerWidth === arguments[0] && crgame.world.camera.width > 1', arguments=(size[0],))
    page.wait_for_frame()
    assert page.run(CUT_OFF, '#bar *, #tabs button, .world-toolbar button, .hud-board, .hud-board '
                             '.hud-kmh, .hud-limit, .cap') == []
    free = page.run("""
        const stage = document.querySelector('#stage').getBoundingClientRect();
        const area = (name) => {
          const box = document.querySelector(name).getBoundingClientRect();
          return box.width * box.height;
        };
        return 1 - (area('.hud-board') + area('.world-toolbar')) / (stage.width * stage.height);
        """)
    assert free > 0.7
    size_px, where = page.run(SMALLEST)
    assert size_px >= 12.0, where
    # Every key is readable and does not cover other texts.
    assert page.run("""
        const told = [...document.querySelectorAll('.hud-kmh, .hud-limit, .hud-gear, .hud-pedals, '
          + '.hud-steering')].filter((node) => node.checkVisibility());
        const caps = [...document.querySelectorAll('.cap')];
        const covers = (one, other) => one !== other && !one.contains(other) && (() => {
          const [a, b] = [one, other].map((node) => node.getBoundingClientRect());
          return a.left < b.right - 0.5 && b.left < a.right - 0.5 && a.top < b.bottom - 0.5
            && b.top < a.bottom - 0.5;
        })();
        return [caps.length, caps.filter((cap) => !cap.checkVisibility()
          || cap.scrollWidth > cap.clientWidth + 1 || cap.scrollHeight > cap.clientHeight + 1
          || [...told, ...caps].some((other) => covers(cap, other)))
          .map((node) => node.className)];""") == [10, []]


def test_fingers_drive(page: Browser) -> None:
    """A touch on a key of the page acts as that key, also two at once; a tap on R is the gear."""
    page.wait('crgame.driving.away === null', 'hands on the controls')
    page.run("""
        window.touch = (code, type, pointerId) => document.querySelector(`.cap-${code}`)
          .dispatchEvent(new PointerEvent(type, { pointerId, bubbles: true, cancelable: true }));
        Element.prototype.setPointerCapture = () => {};""")
    try:
        assert page.run("""touch('KeyW', 'pointerdown', 1); touch('KeyA', 'pointerdown', 2);
            return crgame.driving.hands.keys;""") == [1, 0, 1, 0]
        assert page.run("""touch('KeyW', 'pointerup', 1); return crgame.driving.hands.keys;
            """) == [0, 0, 1, 0]
        assert page.run("""touch('KeyA', 'pointercancel', 2);
            touch('KeyR', 'pointerdown', 3); touch('KeyR', 'pointerup', 3);
            return [crgame.driving.hands.keys, crgame.driving.hands.reverse];
            """) == [[0, 0, 0, 0], 1]
        page.driver.execute_cdp_cmd('Emulation.setTouchEmulationEnabled', {'enabled': True})
        page.driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {
            'features': [{'name': 'pointer', 'value': 'coarse'}]})
        page.resize(390, 844)
        boxes = page.run("""return ['KeyA', 'KeyD', 'KeyS', 'KeyW', 'KeyR'].map((code) => {
            const box = document.querySelector(`.cap-${code}`).getBoundingClientRect();
            return [box.left, box.right, box.width, box.height]; });""")
        # A touch target has at least 44 px, by the guidelines of the platforms.
        assert min(min(box[2:]) for box in boxes[:4]) >= 44
        assert boxes[1][1] < boxes[2][0]
        assert page.run(CUT_OFF, '.cap') == []
    finally:
        page.driver.execute_cdp_cmd('Emulation.setTouchEmulationEnabled', {'enabled': False})
        page.driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {'features': []})


@pytest.mark.exhaustive
def test_the_sign_shows_the_limit_that_an_event_has_set(server: Served, page: Browser) -> None:
    page.wait('document.querySelector(".hud-limit[data-on]")?.textContent > 0')
    usual = page.run('return document.querySelector(".hud-limit").textContent')
    assert usual != '30'
    server.publish('events', {'fired': [{'name': 'slow', 'n': 1, 'k': 0, 'by': 'trigger'}]})
    page.wait('document.querySelector(".hud-limit").textContent === "30"')
    server.publish('events', {'fired': []})
    page.wait('document.querySelector(".hud-limit").textContent === arguments[0]',
              arguments=(usual,))


@pytest.mark.exhaustive
def test_only_own_alarms_frame_the_screen_until_acknowledged(
        server: Served, page: Browser) -> None:
    """An own alarm frames the screen until acknowledged; an AV's is a word in the header."""
    framed = 'return !document.querySelector("#alarm-frame").hidden'
    server.publish('alarms', {'active': [alarm('collision', 'av0')]})
    page.wait('document.querySelector("#alarms [data-kind=collision]")')
    assert page.run(framed) is False
    server.publish('alarms', {'active': [alarm('collision', 'av0'), alarm('off_road', 'hv0')]})
    page.wait('!document.querySelector("#alarm-frame").hidden')
    page.run('document.querySelector("#alarms [data-kind=off_road]").click()')
    assert page.run(framed) is False
    assert page.run('return document.querySelector("#alarms [data-kind=off_road]").className'
                    ).endswith('known')
    # In a pause no agent is late.
    server.publish('alarms', {'active': [alarm('late', 'simulation')]})
    page.wait('crgame.store.alarms[0].kind === "late"')
    assert page.run('return document.querySelector("#alarms [data-kind=late]")') is None
    server.publish('alarms', {'active': []})


def test_the_title_stays_readable_beside_alarms(server: Served, page: Browser) -> None:
    """A title of the usual length is there as a whole, on one line or two."""
    usual = page.run('const n = document.querySelector("#title"), { textContent } = n;'
                     'n.textContent = "Two people in one lane"; return textContent;')
    server.publish('alarms', {'active': [
        alarm(kind, seat) for seat in ('hv0', 'av0') for kind in ('collision', 'off_road')]})
    page.wait('document.querySelectorAll("#alarms .alarm").length >= 2')
    for width in (1920, 1280, 1000):
        page.resize(width, 720)
        page.wait_for_frame()
        assert page.run('const n = document.querySelector("#title");'
                        'return n.scrollHeight <= n.clientHeight + 1'), width
        assert page.run('return document.querySelector("#bar").scrollWidth') <= width
    page.run('document.querySelector("#title").textContent = arguments[0]', usual)
    server.publish('alarms', {'active': []})


def test_what_is_around_is_said_in_words(page: Browser, run: RecordedRun) -> None:
    page.wait('document.querySelector("#around").textContent.startsWith("You drive hv0")')
    text = page.run('return crgame.around.describe()')
    own, other = run.states[0, 0, :3], run.states[0, 1, :2]
    away = round(float(((other - own[:2]) ** 2).sum() ** 0.5))
    assert f'av0 {away} m ' in text or away > 100
    assert page.run('return document.querySelector("#around").ariaLive') == 'off'
    page.run('document.querySelector("#announce").click()')
    assert page.run('return document.querySelector("#around").ariaLive') == 'polite'
    page.run('document.querySelector("#announce").click()')


def test_text_that_turns_others_around_is_isolated(page: Browser) -> None:
    wanted = f'\u2068{OVERRIDE}\u2069'
    title, tab, tip = page.run("""const node = document.querySelector('#title');
        return [node.textContent, document.title, node.title];""")
    assert title == wanted and tab.startswith(wanted) and tip.startswith(wanted)
    # Neighbouring elements that do not shrink keep their space.
    assert page.run('const n = document.querySelector("#title");'
                    'return n.scrollWidth <= n.clientWidth')


def test_forced_colours_leave_the_map_its_own(page: Browser) -> None:
    colours = """const { data } = document.querySelector('#world').getContext('2d')
        .getImageData(0, 0, 600, 400);
        const found = new Set();
        for (let i = 0; i < data.length; i += 4) found.add(data.slice(i, i + 3).join());
        return found.size;"""
    page.driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {
        'features': [{'name': 'forced-colors', 'value': 'active'}]})
    try:
        page.resize(1281, 720)
        page.wait('crgame.world.camera.width > 1')
        page.wait_for_frame()
        assert page.run(colours) > 8
    finally:
        page.driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {'features': []})


def test_the_map_shows_that_it_has_the_focus(page: Browser) -> None:
    assert page.run("""document.querySelector('#world').focus({ focusVisible: true });
        const style = getComputedStyle(document.querySelector('#world'));
        return [style.outlineStyle, parseFloat(style.outlineWidth) >= 2];""") == ['solid', True]
    page.run('document.activeElement.blur()')


@pytest.mark.parametrize('theme', ['light', 'dark'])
def test_green_can_be_read(page: Browser, theme: str) -> None:
    """Its contrast is at least the 4.5 to 1 of WCAG, in words and marks."""
    page.run('document.documentElement.dataset.theme = arguments[0]', theme)
    ratio = page.run("""
        const colour = (name) => {
          const probe = document.body.appendChild(document.createElement('i'));
          probe.style.color = `var(--${name})`;
          const [r, g, b] = getComputedStyle(probe).color.match(/[\\d.]+/g).map((v) => v / 255)
            .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
          probe.remove();
          return 0.2126 * r + 0.7152 * g + 0.0722 * b;
        };
        const [high, low] = [colour(arguments[0]), colour('surface')].sort((a, b) => b - a);
        return (high + 0.05) / (low + 0.05);""", 'ok')
    page.run('delete document.documentElement.dataset.theme')
    assert ratio >= 4.5


def test_plots_map_and_tables_are_saved(
        server: Served, page: Browser, tmp_path: Path) -> None:
    """The browser stores the files; Plotly's styles come from no inline sheet."""
    page.driver.execute_cdp_cmd('Browser.setDownloadBehavior', {
        'behavior': 'allow', 'downloadPath': str(tmp_path)})
    server.control('start')
    page.wait('crgame.store.latest.t > 1.5')
    server.control('pause')
    page.run('document.querySelector("#tab-history").click()')
    page.wait('crgame.history.charts.length > 2', 'plots')
    for form in ('csv', 'svg', 'png'):
        page.run_async('await crgame.saving.savePlots("history", arguments[0]);', form)
    assert page.run('return document.querySelector("[data-action=save-view]").checkVisibility()')
    page.run('document.querySelector("[data-action=save-view]").click()')
    page.run('document.querySelector("#panel-timing [data-action=save-tables]").click()')
    end = time.monotonic() + 20.0
    while len(found := {path.name.split('_T-1_')[-1].split('_')[0] + path.suffix: path
                        for path in tmp_path.glob('*.*[gv]')}) < 5:
        assert time.monotonic() < end, found
        time.sleep(0.1)
    with found['history.csv'].open(newline='') as stream:
        rows = list(csv.reader(stream))
    assert rows[0] == ['quantity', 'unit', 'line', 'time_s', 'value']
    assert {'Speed'} <= {row[0] for row in rows} and len(rows) > 50
    assert all(float(row[3]) >= 0.0 for row in rows[1:])
    assert found['history.svg'].read_text().count('<svg') > 2
    for name in ('history.png', 'map.png'):
        assert found[name].read_bytes().startswith(b'\x89PNG')
    assert page.run('return document.querySelectorAll("style").length') == 0


def test_the_last_seconds_are_shown_again_and_slower(
        server: Served, page: Browser, run: RecordedRun) -> None:
    """The replay uses the states kept by the page, at the recording's times."""
    # Looked at frame by frame, as it plays on; the run may have gone on for long.
    first = page.run_async("""crgame.lastSeconds.open();
        const first = crgame.lastSeconds.t;
        await new Promise((done) => {
          const look = () => (crgame.world.shown.t > first + 0.3
            && crgame.world.shown.t < first + 1.2 ? done() : requestAnimationFrame(look));
          look();
        });
        return first;""")
    assert page.run('return crgame.lastSeconds.isOpen')
    at = first + 1.0
    page.run("""const bar = document.querySelector('#last-seconds');
        const slider = bar.querySelector('input');
        slider.value = arguments[0];
        slider.dispatchEvent(new Event('input'));""", at)
    page.wait('Math.abs(crgame.world.shown.t - arguments[0]) < 1e-6', arguments=(at,))
    x, y = page.run('return [...crgame.world.shown.vehicles.subarray(0, 2)]')
    assert [x, y] == pytest.approx(run.states[round(at / run.dt_s), 0, :2].tolist(), abs=1e-6)
    page.run("""const speed = document.querySelector('#last-seconds select');
        speed.value = '0.1';
        speed.dispatchEvent(new Event('change'));
        document.querySelector('#last-seconds [data-action=play]').click();""")
    before, began_ms = page.run('return [crgame.lastSeconds.t, performance.now()]')
    time.sleep(1.0)
    after, ended_ms = page.run('return [crgame.lastSeconds.t, performance.now()]')
    assert 0.0 < after - before <= 0.1 * (ended_ms - began_ms) / 1000 + 0.02
    page.run('document.querySelector("#last-seconds [data-action=end]").click()')
    page.wait('crgame.world.shown.t === crgame.store.latest.t')
    server.control('start')
    page.wait('crgame.store.status.run === "running"')
    assert page.run('crgame.lastSeconds.open(); return crgame.lastSeconds.isOpen') is False


@pytest.mark.exhaustive
def test_r_held_begins_anew_and_tapped_does_not(server: Served, page: Browser) -> None:
    epoch = page.run('return crgame.store.epoch')
    press = "window.dispatchEvent(new KeyboardEvent(arguments[0], { code: 'KeyR' }));"
    # In one script: between two calls the key may be held for long.
    page.run(f'{press}{press.replace("[0]", "[1]")}', 'keydown', 'keyup')
    time.sleep(1.0)
    assert page.run('return crgame.store.epoch') == epoch
    page.run("""window.hinted = false;
        const hint = document.querySelector('.restart-hint');
        new MutationObserver(() => { window.hinted ||= !hint.hidden; }).observe(
          hint, { attributes: true });""")
    page.run(press, 'keydown')
    page.wait('window.hinted', 'the hint')
    page.wait('crgame.store.epoch > arguments[0]', arguments=(epoch,))
    page.run(press, 'keyup')
    assert page.run('return document.querySelector(".restart-hint").hidden')
