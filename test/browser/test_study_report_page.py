# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The report of a study in a browser is readable in both themes, on phones and on paper."""

from collections.abc import Iterator
from pathlib import Path
import sys
from typing import Any

from browser_support import Browser, missing_programs, open_browser
from crgame_ros.cli import main
from crgame_ros.paths import scenarios_directory
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'recording'))

from study_maker import StudyMaker, take_part  # noqa: E402, I100 - importable from here on

pytestmark = pytest.mark.skipif(bool(missing_programs()), reason='no browser and driver')
_OUTSIDE = """
return [...document.querySelectorAll('body *')].filter(
  (each) => each.getBoundingClientRect().right > innerWidth + 1 && !each.closest('.wide, nav'))
  .map((each) => each.outerHTML.slice(0, 80));"""
_SMALLEST = """
const sizes = [...document.querySelectorAll('.conditions text')].map((each) => {
  const svg = each.ownerSVGElement;
  return parseFloat(getComputedStyle(each).fontSize)
    * svg.getBoundingClientRect().width / svg.viewBox.baseVal.width;
});
return [sizes.length, Math.min(...sizes)];"""
_CONTRAST = """
const light = (colour) => {
  const parts = colour.match(/[0-9.]+/g).slice(0, 3).map(Number).map((part) => part / 255)
    .map((part) => part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4);
  return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2];
};
const ground = light(getComputedStyle(document.body).backgroundColor);
return Math.min(...[...document.querySelectorAll('.conditions text')].map((each) => {
  const found = light(getComputedStyle(each).fill);
  return (Math.max(found, ground) + 0.05) / (Math.min(found, ground) + 0.05);
}));"""


class _Unrecorded(StudyMaker):
    """A session whose drives have left only their journal."""

    def record(self, *_: Any, **__: Any) -> Path:
        """Write no files."""
        return self.folder


@pytest.fixture(scope='module')
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Browser, Path]]:
    """Open the report of a study whose scores are known."""
    folder = tmp_path_factory.mktemp('studies') / 'demo'
    take_part(_Unrecorded(None, folder, scenarios_directory() / 'cut_in.yaml'))
    assert main(['study', 'report', str(folder)]) == 0
    with open_browser(tmp_path_factory.mktemp('profile')) as browser:
        yield browser, folder / 'data' / 'report.html'


@pytest.mark.matrix
@pytest.mark.parametrize(('width', 'theme'), [(1280, 'light'), (1280, 'dark'), (390, 'dark')])
def test_it_can_be_read(page: tuple[Browser, Path], width: int, theme: str) -> None:
    browser, path = page
    browser.resize(width, 900)
    browser.prefer(theme)
    browser.open(path.as_uri())
    assert browser.run(_OUTSIDE) == []
    count, smallest = browser.run(_SMALLEST)
    assert count > 10 and smallest >= 12.0
    assert browser.run(_CONTRAST) >= 4.5
    assert browser.console_errors() == []
