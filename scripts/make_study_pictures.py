# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Make the pictures of a study for the documentation: the shipped example, in real browsers.

Needs what the tests of the page need. The report's picture is of a study that has been conducted,
such as benchmarks/study_sessions.py leaves: `--conducted FOLDER`.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
import subprocess
import sys
import tempfile
import time

from cockpit_person import Browser, open_browser
from crgame_ros.paths import share_directory
from PIL import Image, ImageOps

sys.path.insert(0, str(share_directory() / 'test' / 'browser'))

from study_people import study_session, StudySession  # noqa: E402, I100 - importable from here on

FOLDER = share_directory() / 'docs' / 'images'
PORT, PATIENCE_S = 8400, 300.0
# Into the drive of the picture [s].
DRIVEN_S = 6.0
SETTLES_S = 1.0


def shoot(browser: Browser, name: str) -> None:
    """Save the visible picture, with so many colours that no difference is visible."""
    path, seen = FOLDER / f'study_{name}.png', FOLDER / f'.study_{name}.png'
    try:
        browser.screenshot(seen)
        with Image.open(seen) as picture:
            ImageOps.posterize(picture.convert('RGB'), 6).save(path, optimize=True)
    finally:
        seen.unlink(missing_ok=True)
    print(f'{path}: {path.stat().st_size / 1e3:.0f} kB', flush=True)


def take_session(folder: Path) -> None:
    """Go through the example up to its second drive."""
    command = [sys.executable, '-m', 'crgame_ros.cli', 'study', 'new', str(folder / 'study')]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    with study_session(folder / 'study' / 'study.yaml', folder / 'data', 'P01', PORT) as session, \
            open_browser(folder / 'profile') as browser:
        # A participant that is known already: the link itself was valid only once.
        page = session.link.partition('?')[0]
        browser.open(page)
        name, _, value = session.experimenter.cookie.partition('=')
        browser.driver.add_cookie({'name': name, 'value': value})
        browser.open(page)
        until(session, lambda: ready(session))
        shoot(session.browser, 'ready')
        until(session, lambda: (session.time_s() or 0.0) > DRIVEN_S)
        session.mark('brakes late')
        time.sleep(SETTLES_S)
        shoot(session.browser, 'drive')
        shoot(browser, 'experimenter')
        until(session, lambda: 'demand' in session.browser.run('return document.body.innerText'))
        shoot(session.browser, 'questions')


def ready(session: StudySession) -> bool:
    """Return whether the page waits for the participant's confirmation before a trial."""
    return bool(session.browser.run(
        'const button = document.querySelector(".gate:not([hidden]) button.primary");'
        'return button && !button.disabled'
        ' && document.querySelector("#drive h2").textContent.includes("1 of")'))


def until(session: StudySession, condition: Callable[[], bool]) -> None:
    """Continue until an element is visible."""
    until_s = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > until_s:
            sys.exit(f'waited {PATIENCE_S:g} s in vain')
        session.act()
        time.sleep(0.1)


def take_report(conducted: Path, folder: Path) -> None:
    """Show the measures of the report."""
    with open_browser(folder / 'profile') as browser:
        browser.open((conducted / 'data' / 'report.html').resolve().as_uri())
        browser.run('document.querySelector("select, .measure, figure")?.scrollIntoView();')
        time.sleep(SETTLES_S)
        shoot(browser, 'report')


def main() -> None:
    """Make the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--conducted', type=Path, help='folder of a study with data, for the '
                        'picture of the report; that alone is taken then')
    conducted = parser.parse_args().conducted
    with tempfile.TemporaryDirectory() as folder:
        if conducted is None:
            take_session(Path(folder))
        else:
            take_report(conducted, Path(folder))


if __name__ == '__main__':
    main()
