# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Take pictures of the 3D view on any roads: all viewpoints, lights and sizes, with their costs.

    scripts/look_3d.py pictures scenarios/*.xml --light day dusk fog --size 1280x720 390x844

A line is printed for each picture. Nothing is judged: people look at the pictures.
"""

import argparse
from itertools import product
from pathlib import Path
import sys
import tempfile
import time

from cockpit_person import Person
from make_screenshots import look_from, page, SHARP, show_3d
import yaml

VIEWPOINTS = ('driver', 'chase', 'bird')
LIGHTS = {'day': {'light': 'day'}, 'dusk': {'light': 'dusk'},
          'fog': {'light': 'day', 'visibility': 80.0}}
# Until the others have come near [s].
DRIVEN_S = 2.0
COST = 'const { draw_calls, triangles } = crgame.view3d.stats; return [draw_calls, triangles];'


def look(person: Person, where: Path, size: str) -> None:
    """Save a picture from each viewpoint, and print their times."""
    width, height = map(int, size.split('x'))
    browser = person.browser
    browser.resize(width, height)
    for viewpoint in VIEWPOINTS:
        look_from(browser, viewpoint)
        path = where.with_name(f'{where.name}_{size}_{viewpoint}.png')
        browser.screenshot(path)
        calls, triangles = browser.run(COST)
        print(f'{path}: {calls} draw calls, {triangles} triangles', flush=True)


def visit(roads: Path, light: str, sizes: list[str], folder: Path) -> list[str]:
    """Claim a seat in a scenario for a moment; return the messages of the browser's console."""
    with tempfile.TemporaryDirectory() as temporary:
        game = Path(temporary) / 'game.yaml'
        game.write_text(yaml.safe_dump({
            'scenario': str(roads.resolve()), 'environment': LIGHTS[light],
            'humans': [{'id': 'hv0', 'driver': 'cockpit'}]}))
        with page(Path(temporary), 'light', str(game), '--duration', '100000') as person:
            person.take_seat('hv0')
            show_3d(person.browser)
            person.click('[data-action="start"]')
            time.sleep(DRIVEN_S)
            person.click('[data-action="pause"]')
            person.browser.run(SHARP)
            for size in sizes:
                look(person, folder / f'{roads.stem}_{light}', size)
            return list(person.browser.console_errors())


def main() -> int:
    """Photograph all scenarios of the command line."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('folder', type=Path, help='for the pictures')
    parser.add_argument('roads', type=Path, nargs='+', metavar='FILE.xml')
    parser.add_argument('--light', nargs='+', choices=LIGHTS, default=['day'])
    parser.add_argument('--size', nargs='+', default=['1280x720'], metavar='WxH')
    values = parser.parse_args()
    values.folder.mkdir(parents=True, exist_ok=True)
    wrong = 0
    for roads, light in product(values.roads, values.light):
        try:
            errors = visit(roads, light, values.size, values.folder)
        except (RuntimeError, SystemExit) as error:
            errors = [f'{error}']
        for error in errors:
            print(f'{roads.stem}, {light}: {error}', file=sys.stderr, flush=True)
        wrong += len(errors)
    return int(wrong > 0)


if __name__ == '__main__':
    sys.exit(main())
