# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A report in a browser, opened from its file without network."""

import base64
from collections.abc import Iterator
from dataclasses import replace
import json
from pathlib import Path
import re
from typing import Any

from browser_support import Browser
from crgame_ros.analysis.report.file import report_html
from crgame_ros.analysis.runs.run import Run
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.recorded_game import recorded_inputs
from crgame_ros.recording.run_record import run_record_of
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
import pytest

TITLE = '<script>window.harmed = 1</script><img src=x onerror="window.harmed = 2"> & more'
DRAWN = 'document.querySelectorAll(".plot .main-svg .scatterlayer .trace path.js-line")'


@pytest.fixture(scope='module')
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write the report of the cut-in, driven offline."""
    game = replace(load_game(scenarios_directory() / 'cut_in.yaml'), title=TITLE)
    setup = build_setup(game)
    drivers, _ = recorded_inputs(setup)
    record = run_record_of(run_offline(setup, drivers=drivers, duration_s=13.0))
    path = tmp_path_factory.mktemp('report') / 'report.html'
    path.write_text(report_html([Run('run', record=record)]), encoding='utf-8')
    return path


@pytest.fixture
def shown(browser: Browser, file: Path) -> Iterator[Browser]:
    """Open the report without network, and check that no error occurred."""
    with browser.offline():
        browser.open(file.as_uri())
        yield browser


def _look_at_all(browser: Browser) -> None:
    """Scroll through the page, as plots are drawn when they become visible."""
    browser.run_async("""
        for (const plot of document.querySelectorAll('.plot')) {
          plot.scrollIntoView({ behavior: 'instant' });
          await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
        }""")
    browser.wait('[...document.querySelectorAll(".plot")].every('
                 '(plot) => plot.querySelector(".main-svg"))', 'all plots')


def test_plots_are_drawn_and_nothing_is_asked_for(shown: Browser) -> None:
    """Every plot has its lines; only data of the file itself is loaded; a title is plain text."""
    _look_at_all(shown)
    lines, plots = shown.run(
        f'return [{DRAWN}.length, document.querySelectorAll(".plot").length]')
    assert plots >= 12 and lines > plots
    loaded = shown.run('return performance.getEntriesByType("resource").map((e) => e.name)')
    assert all(name.startswith('data:') for name in loaded)
    assert shown.run('return document.querySelector("h1").textContent') == TITLE
    assert shown.run('return window.harmed ?? null') is None
    broken = shown.run('return [...document.images].filter((one) => !one.naturalWidth).length')
    assert broken == 0 and shown.run('return document.images.length') >= 4


@pytest.mark.exhaustive
def test_a_worst_moment_leads_to_its_frame(shown: Browser) -> None:
    """A click shows and marks the picture, and marks its time in the plots of the run."""
    _look_at_all(shown)
    shown.run('window.scrollTo({ top: 0, behavior: "instant" })')
    link = shown.driver.find_element('css selector', '.worst a[data-time]')
    address = str(link.get_attribute('href')).partition('#')[2]
    time_s = float(str(link.get_attribute('data-time')))
    shown.run('arguments[0].scrollIntoView({ behavior: "instant" })', link)
    link.click()
    shown.wait('(() => { const box = document.getElementById(arguments[0])'
               '.getBoundingClientRect(); return box.top >= 0 && box.top < innerHeight; })()',
               'the frame', arguments=(address,))
    frame = shown.driver.find_element('id', address)
    assert 'shown' in str(frame.get_attribute('class'))
    assert abs(float(str(frame.get_attribute('data-time'))) - time_s) <= 1.0
    marks = shown.run('return document.getElementById("run1-criticality-ttc").layout.shapes'
                      '.map((shape) => [shape.x0, shape.x1])')
    assert [time_s, time_s] in marks


@pytest.mark.exhaustive
def test_all_plots_of_a_run_show_the_same_time(shown: Browser) -> None:
    """Zooming into one plot zooms the others."""
    _look_at_all(shown)
    shown.run_async('await Plotly.relayout("run1-motion-speed", '
                    '{ "xaxis.range[0]": 2, "xaxis.range[1]": 6 });')
    shown.wait('JSON.stringify(document.getElementById("run1-inputs-brake")'
               '.layout.xaxis.range) === "[2,6]"', 'the same time')


@pytest.mark.matrix
@pytest.mark.parametrize(('width', 'height'), [(1280, 800), (390, 844)])
@pytest.mark.parametrize('scheme', ['light', 'dark'])
def test_it_fits_and_can_be_read(shown: Browser, file: Path, width: int, height: int,
                                 scheme: str) -> None:
    """No element is wider than the window, and text has contrast (WCAG AA: 4.5 to 1)."""
    shown.resize(width, height)
    shown.prefer(scheme)
    shown.open(file.as_uri())
    _look_at_all(shown)
    assert shown.run('return document.documentElement.scrollWidth') <= width
    for selector in ('body', '.lead', '.note', 'a', 'thead th', '.critical'):
        assert shown.contrast(selector) >= 4.5, selector


@pytest.mark.exhaustive
def test_it_prints(shown: Browser) -> None:
    """Every plot is printed, also without scrolling to it, on a light ground."""
    shown.prefer('dark')
    shown.run("""
        window.printed = null;
        window.addEventListener('beforeprint', () => {
          window.printed = {
            plots: document.querySelectorAll('.plot .main-svg .scatterlayer').length,
            all: document.querySelectorAll('.plot').length,
            ground: getComputedStyle(document.body).backgroundColor,
          };
        });""")
    found: dict[str, Any] = shown.driver.execute_cdp_cmd('Page.printToPDF', {
        'printBackground': True, 'preferCSSPageSize': True})
    document = base64.b64decode(found['data'])
    assert document.startswith(b'%PDF-') and len(document) > 20_000
    pages = len(re.findall(rb'/Type\s*/Page\b', document))
    assert 3 <= pages <= 20
    printed = shown.run('return window.printed')
    assert printed['plots'] == printed['all'] >= 12, json.dumps(printed)
    assert printed['ground'] == 'rgb(255, 255, 255)'
