# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Make the pictures of a report for the documentation: of the cut-in, driven offline.

Needs what the tests of the page need: chromium, chromedriver and selenium.
"""

from pathlib import Path
import tempfile

from cockpit_person import Browser, open_browser
from crgame_ros.analysis.report.file import report_html
from crgame_ros.analysis.runs.run import Run
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory, share_directory
from crgame_ros.recording.recorded_game import recorded_inputs
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from PIL import Image

FOLDER = share_directory() / 'docs' / 'images'
# Of the page [px].
WIDTH, HEIGHT = 1280, 1170
COLOURS = 64
DRAWN = ('[...document.querySelectorAll(".criticality .plot")].every('
         '(plot) => plot.querySelector(".main-svg"))')


def main() -> None:
    """Drive, write and photograph."""
    setup = build_setup(load_game(scenarios_directory() / 'cut_in.yaml'))
    drivers, _ = recorded_inputs(setup)
    run = Run('cut_in', result=run_offline(setup, drivers=drivers))
    with tempfile.TemporaryDirectory() as folder:
        page, profile = Path(folder) / 'report.html', Path(folder) / 'profile'
        page.write_text(report_html([run]), encoding='utf-8')
        profile.mkdir()
        with open_browser(profile, WIDTH, HEIGHT) as browser:
            browser.prefer('light')
            browser.open(page.as_uri())
            photograph(browser, 'report')
            browser.prefer('dark')
            browser.run('document.querySelector(".criticality .plots").scrollIntoView('
                        '{ behavior: "instant" })')
            browser.wait(DRAWN, 'the plots')
            photograph(browser, 'report_plots')


def photograph(browser: Browser, name: str) -> None:
    """Save the browser's picture, in few colours."""
    path = browser.screenshot(FOLDER / f'{name}.png')
    with Image.open(path) as image:
        image.convert('RGB').quantize(COLOURS).save(path, optimize=True)
    print(path)


if __name__ == '__main__':
    main()
