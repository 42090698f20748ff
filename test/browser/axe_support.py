# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""What axe finds in a page: barriers that WCAG 2.2 names, of levels A and AA."""

from functools import cache
from pathlib import Path
import sys

from browser_support import Browser

PAGE_TOOLS = Path(__file__).resolve().parents[1] / 'page'
sys.path.insert(0, str(PAGE_TOOLS))

from page_tools import installed_tools  # noqa: E402, I100

TAGS = ('wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa')
_RUN = """
const found = await axe.run(document, { runOnly: { type: 'tag', values: arguments[0] },
  resultTypes: ['violations'] });
const words = ({ html, any, all, none }) => `${html.slice(0, 200)}: ${
  [...any, ...all, ...none].map(({ message }) => message).join('; ')}`;
return found.violations.map(({ id, nodes }) => [id, nodes.map(words)]);
"""


@cache
def _axe() -> str:
    return (installed_tools() / 'axe-core' / 'axe.min.js').read_text(encoding='utf-8')


def barriers(browser: Browser) -> list[str]:
    """Give what stands in the way of somebody who reads the page as it is now."""
    if not browser.run('return "axe" in window'):
        # The page's own policy refuses scripts from elsewhere.
        browser.driver.execute_cdp_cmd('Runtime.evaluate', {'expression': _axe()})
    return [f'{rule}: {node}' for rule, nodes in browser.run_async(_RUN, TAGS) for node in nodes]
