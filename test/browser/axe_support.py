# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Violations that axe finds in a page: barriers of WCAG 2.2, levels A and AA."""

from functools import cache
from pathlib import Path
import sys

from browser_support import Browser

PAGE_TOOLS = Path(__file__).resolve().parents[1] / 'page'
sys.path.insert(0, str(PAGE_TOOLS))

from page_tools import installed_tools  # noqa: E402, I100

TAGS = ('wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa')
_RUN = """
const [tags, within] = arguments;
const found = await axe.run(within ?? document, { runOnly: { type: 'tag', values: tags },
  resultTypes: ['violations'] });
const words = ({ html, any, all, none }) => `${html.slice(0, 200)}: ${
  [...any, ...all, ...none].map(({ message }) => message).join('; ')}`;
return found.violations.map(({ id, nodes }) => [id, nodes.map(words)]);
"""


@cache
def _axe() -> str:
    return (installed_tools() / 'axe-core' / 'axe.min.js').read_text(encoding='utf-8')


def barriers(browser: Browser, within: str | None = None) -> list[str]:
    """Return the barriers of the page in its present state, or of one of its elements."""
    if not browser.run('return "axe" in window'):
        # The page's own policy refuses scripts from elsewhere.
        browser.driver.execute_cdp_cmd('Runtime.evaluate', {'expression': _axe()})
    return [f'{rule}: {node}' for rule, nodes in browser.run_async(_RUN, TAGS, within)
            for node in nodes]
