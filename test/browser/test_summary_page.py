# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The summary of an evaluation in a browser, opened from its file without network."""

from collections.abc import Iterator
from pathlib import Path
import sys

from browser_support import Browser
from crgame_ros.evaluation.summary.html_page import write_summary_page
from crgame_ros.evaluation.summary.summarise import summarise
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'evaluation' / 'summary'))

from evaluation_rows import many  # noqa: E402, I100


@pytest.fixture(scope='module')
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write the page of an evaluation whose worst cell has a report."""
    rows = many(240, 12, ('idm', 'mine', 'a planner whose name is longer than its column'))
    folder = rows.write(tmp_path_factory.mktemp('evaluation') / 'rows', 3)
    summary = summarise(folder)
    (folder / 'reports').mkdir()
    (folder / 'reports' / f'{summary.worst[0].key}.html').write_text('<title>one cell</title>')
    write_summary_page(summary, folder / 'summary.html')
    return folder / 'summary.html'


@pytest.fixture
def offline(browser: Browser) -> Iterator[Browser]:
    """Return a browser without network."""
    with browser.offline():
        yield browser


def test_it_fits_can_be_read_and_leads_to_reports(offline: Browser, page: Path) -> None:
    """It works on wide and narrow screens, light and dark (WCAG AA: 4.5 to 1; pictures 3 to 1)."""
    for width, scheme in ((1280, 'light'), (1280, 'dark'), (390, 'light'), (390, 'dark')):
        offline.resize(width, 844)
        offline.prefer(scheme)
        offline.open(page.as_uri())
        assert offline.run('return document.documentElement.scrollWidth') <= width
        for selector, least in (('.note', 4.5), ('td small', 4.5), ('.better', 4.5),
                                ('.commands', 4.5), ('.intervals text', 4.5),
                                ('.intervals .tick', 4.5), ('.intervals circle.better', 3.0),
                                ('.intervals circle.estimate', 3.0)):
            assert offline.contrast(selector) >= least, (scheme, selector)
    assert offline.run('return performance.getEntriesByType("resource").length') == 0
    link = offline.driver.find_element('css selector', '#worst a')
    offline.run('arguments[0].scrollIntoView({ behavior: "instant", block: "center" })', link)
    link.click()
    offline.wait('document.title === "one cell"', 'the report of the worst cell')
