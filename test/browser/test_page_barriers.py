# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""axe finds no barriers in the cockpit's page: WCAG 2.2, levels A and AA."""

from axe_support import barriers
from browser_support import Browser
from crgame_ros.paths import scenarios_directory
import pytest
from world_support import RecordedRun, RunBackend, served

ALARMS = [{'id': f'{kind}:{subject}', 'kind': kind, 'subject': subject, 'text': 'so',
           'since_t': 1.0} for kind, subject in (('collision', 'hv0'), ('off_road', 'hv0'))]


@pytest.mark.matrix
@pytest.mark.parametrize('theme', ['light', 'dark'])
def test_every_tab(browser: Browser, theme: str) -> None:
    """No tab has barriers, also with the alarms of a driven vehicle."""
    found = []
    with served(RunBackend(RecordedRun(scenarios_directory() / 'traffic.yaml', 4.0),
                           every=2)) as server:
        browser.open(server.address)
        browser.wait('window.crgame?.ready && crgame.world.shown && crgame.store.me.id')
        browser.run('document.documentElement.dataset.theme = arguments[0]', theme)
        server.publish('alarms', {'active': ALARMS})
        browser.wait('document.querySelectorAll(".alarm").length >= 2')
        # One alarm is acknowledged, and then both end: each state has another look.
        browser.run('document.querySelector(".alarm").click()')
        found += barriers(browser)
        server.publish('alarms', {'active': []})
        browser.wait('document.querySelectorAll(".alarm.ended").length')
        found += barriers(browser)
        for tab in browser.run(
                'return [...document.querySelectorAll("[role=tab]")].map(({id}) => id)'):
            browser.run('document.getElementById(arguments[0]).click()', tab)
            found += [f'{tab}: {text}' for text in barriers(browser, '#panels')]
    assert not found, '\n'.join(found)
