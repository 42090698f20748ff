# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Real browsers for the tests of the page, which are skipped if there is none."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
import sys

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from browser_support import (  # noqa: E402, I100
    Browser,
    HEIGHT,
    missing_programs,
    open_browser,
    OpenBrowser,
    WIDTH,
)


def _opener(factory: pytest.TempPathFactory) -> Iterator[OpenBrowser]:
    missing = missing_programs()
    if missing:
        pytest.skip(f'no browser for this test: {", ".join(missing)} is missing')
    with ExitStack() as stack:
        def make(width: int = WIDTH, height: int = HEIGHT, **more: bool) -> Browser:
            profile = factory.mktemp('profile')
            return stack.enter_context(open_browser(profile, width, height, **more))
        yield make


@pytest.fixture
def new_browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[OpenBrowser]:
    """Return a function that opens another browser, one for each person of a test."""
    yield from _opener(tmp_path_factory)


@pytest.fixture(scope='session')
def only_browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Open the one browser that tests share in turn, as a start takes two seconds."""
    for open_another in _opener(tmp_path_factory):
        yield open_another()


@pytest.fixture
def browser(only_browser: Browser) -> Iterator[Browser]:
    """Return a browser of 1280x720 in the state of a new start."""
    yield from _renewed(only_browser)


@pytest.fixture(scope='module')
def module_browser(only_browser: Browser) -> Iterator[Browser]:
    """Return such a browser once, for all tests of a module."""
    yield from _renewed(only_browser)


def _renewed(browser: Browser) -> Iterator[Browser]:
    yield browser
    # Now rather than before the next use: an open page goes on drawing beside other tests.
    browser.renew()
