# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Real browsers for the tests of the page; skipped, saying so, where there is none."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
import sys

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from browser_support import Browser, missing_programs, open_browser  # noqa: E402

OpenBrowser = Callable[..., Browser]


@pytest.fixture
def new_browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[OpenBrowser]:
    """Give a function that opens a browser of its own: as many people as a test needs."""
    missing = missing_programs()
    if missing:
        pytest.skip(f'no browser for this test: {", ".join(missing)} is missing')
    with ExitStack() as stack:
        def make(width: int = 1280, height: int = 720, **more: bool) -> Browser:
            profile = tmp_path_factory.mktemp('profile')
            return stack.enter_context(open_browser(profile, width, height, **more))
        yield make


@pytest.fixture
def browser(new_browser: OpenBrowser) -> Browser:
    """Open one browser of 1280x720."""
    return new_browser()
