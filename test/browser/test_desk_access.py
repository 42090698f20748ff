# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Participants' and experimenters' pages are accessible: WCAG 2.2, AA."""

from pathlib import Path

from axe_support import barriers
from browser_support import Browser, OpenBrowser
from desk_page_support import running
import pytest
from study_robot import StudyRobot

LIMIT = 200
SIZES = {'1280x720': (1280, 720), 'phone': (390, 844)}
THEMES = ('light', 'dark')
HEADING = """
return [document.body.dataset.show ?? '', document.querySelector('#step')?.textContent ?? '',
  document.querySelector('h1, h2')?.textContent ?? ''].join(' / ');
"""


def found_in(browser: Browser, where: str) -> list[str]:
    """Check the page in both themes."""
    found = []
    for theme in THEMES:
        browser.prefer(theme)
        found += [f'{where}, {theme}: {text}' for text in barriers(browser)]
    return found


@pytest.mark.exhaustive
@pytest.mark.parametrize('size', SIZES)
def test_every_page_of_a_session(new_browser: OpenBrowser, tmp_path: Path, size: str) -> None:
    browser = new_browser(*SIZES[size])
    seen: list[str] = []
    found: list[str] = []
    with running(tmp_path) as desk:
        browser.open(desk.participant)
        # The robot must not finish a page before its check.
        browser.wait('document.body.dataset.show')
        robot = StudyRobot(browser, 'a few words')
        for _ in range(LIMIT):
            where = browser.run(HEADING)
            if where.startswith(' '):
                continue
            if where not in seen:
                seen.append(where)
                found += found_in(browser, where)
            if robot.act() == 'over':
                found += found_in(browser, 'over')
                break
    kinds = {where.partition(' ')[0] for where in seen}
    assert kinds >= {'language', 'questions', 'page', 'device', 'drive'}, seen
    assert not found, '\n'.join(found)


@pytest.mark.exhaustive
@pytest.mark.parametrize('size', SIZES)
def test_the_experimenters_page(new_browser: OpenBrowser, tmp_path: Path, size: str) -> None:
    browser = new_browser(*SIZES[size])
    with running(tmp_path, languages=[]) as desk:
        browser.open(desk.experimenter)
        browser.wait('document.querySelectorAll("#items tr").length > 3')
        found = found_in(browser, 'experimenter')
        browser.run('[...document.querySelectorAll("#orders button")].at(-1).click()')
        browser.wait('document.querySelector("dialog[open]")')
        found += found_in(browser, 'reason')
    assert not found, '\n'.join(found)


@pytest.mark.exhaustive
def test_what_cannot_be_read_is_found(browser: Browser, tmp_path: Path) -> None:
    page = tmp_path / 'grey.html'
    page.write_text('<!DOCTYPE html><html lang="en"><title>grey</title><main><h1>Grey</h1>'
                    '<p style="color:#aaa;background:#fff">Who reads this?</p>'
                    '<input type="text"></main></html>', encoding='utf-8')
    browser.open(page.as_uri())
    rules = {text.partition(':')[0] for text in barriers(browser)}
    assert rules == {'color-contrast', 'label'}
