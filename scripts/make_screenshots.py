# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Make the pictures of the cockpit for the documentation: real runs, seen in a real browser.

Needs what the tests of the page need: chromium, chromedriver and selenium.
"""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time

from cockpit_person import Browser, open_browser, Person
from crgame_ros.paths import scenarios_directory, share_directory
from PIL import Image, ImageOps

EXAMPLES = Path(__file__).resolve().parents[1] / 'examples'
FOLDER = share_directory() / 'docs' / 'images'
START_LIMIT_S, END_LIMIT_S = 60.0, 30.0
ATTEMPTS = 4
# Pictures from this width on would be large files with colours of 24 bits [px].
WIDE_PX = 2000
# Until the camera, the plots and the messages about what was clicked have come to rest [s].
SETTLES_S = 1.0
# A new alarm flashes for this long [s].
PULSES_S = 2.5
# Time until the others have come near [s].
DRIVEN_S = 3.0
HAS_BEGUN = 'window.crgame?.ready && crgame.world.shown && crgame.store.status'
ALARMS = 'return crgame.alarms.kinds()'
HIDDEN = Path(__file__).with_name('hidden_pedestrian.yaml')
# The page tells as if the game had named a stream of gaze; the server has nobody to tell.
TELLS = """
const send = crgame.connection.send.bind(crgame.connection);
crgame.connection.send = (message) => {
  if (message.type === 'picture') { window.told = message.picture.shown; return true; }
  return send(message);
};
crgame.store.scene.gaze = ['hv0'];
"""
BOXES = """
const stage = document.querySelector('#stage');
for (const [kind, id, left, top, right, bottom, , mirror] of window.told) {
  const box = document.createElement('div');
  const color = { vehicle: '#ff2d6f', mirror: '#00c2ff', sign: '#ffd400', traffic_light: '#ffd400',
    instrument: '#39e600' }[kind] ?? '#ff8a00';
  const at = (value) => `${100 * value}%`;
  box.style = `position: absolute; z-index: 99; left: ${at(left)}; top: ${at(top)};
    width: ${at(right - left)}; height: ${at(bottom - top)}; border: 2px solid ${color};
    pointer-events: none; box-sizing: border-box`;
  if (mirror === null && right - left > 0.015) {
    const name = document.createElement('span');
    name.textContent = id;
    name.style = `position: absolute; left: -2px; ${top < 0.05 ? 'top' : 'bottom'}: 100%;
      color: #000; background: ${color}; font: 11px sans-serif; padding: 0 3px`;
    box.append(name);
  }
  stage.append(box);
}
"""
SHARP = "crgame.view3d.settings.set('sharp', true)"
PAUSE = 'document.querySelector(\'[data-action="pause"]:enabled\')?.click()'


class Unlucky(Exception):
    """A run during which this machine was too slow, or that took another course."""


@contextmanager
def launched(folder: Path, *arguments: str) -> Iterator[str]:
    """
    Start the launcher in a ROS domain of its own, and end it with all its nodes.

    :param folder: for its output.
    :return: address of the page.
    """
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        port = str(probe.getsockname()[1])
    # Without a domain in its environment the launcher finds a free one.
    environment = {key: value for key, value in os.environ.items() if key != 'ROS_DOMAIN_ID'}
    log = folder / f'launcher{port}.log'
    with log.open('wb') as stream:
        process = subprocess.Popen(
            [sys.executable, '-m', 'crgame_ros.launcher.main', '--port', port, *arguments],
            stdout=stream, stderr=subprocess.STDOUT, env=environment, start_new_session=True,
            cwd=folder)
    try:
        yield address(process, log)
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(END_LIMIT_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)


def address(process: 'subprocess.Popen[bytes]', log: Path) -> str:
    """Wait until the launcher has printed the address of the page."""
    until_s = time.monotonic() + START_LIMIT_S
    while process.poll() is None and time.monotonic() < until_s:
        if (found := re.search(r'http://127\S+', log.read_text(errors='replace'))) is not None:
            return found[0]
        time.sleep(0.1)
    sys.exit(f'the cockpit did not start:\n{log.read_text(errors="replace")}')


@contextmanager
def page(folder: Path, theme: str, *arguments: str) -> Iterator[Person]:
    """Open the page of a run, dark or light, with some arguments of the launcher."""
    profile = Path(tempfile.mkdtemp(dir=folder))
    with launched(folder, *arguments) as where, open_browser(profile) as browser:
        browser.prefer(theme)
        browser.open(where)
        browser.wait(HAS_BEGUN, 'the page', START_LIMIT_S)
        yield Person(browser)


def game(name: str, *arguments: str) -> tuple[str, ...]:
    """Return the launcher's arguments for a game of ours that does not end by itself."""
    return (str(scenarios_directory() / f'{name}.yaml'), '--duration', '100000', *arguments)


def waiting(folder: Path, name: str) -> tuple[str, ...]:
    """Return the launcher's arguments for a game that waits for a person."""
    return game(name, '--driver', 'cockpit', '--out', str(folder / 'run'))


def shoot(browser: Browser, name: str, meant: tuple[str, ...] = ()) -> None:
    """
    Save the visible picture.

    :param meant: kinds of alarms that belong into the picture.
    :raises Unlucky: if the page shows others, or lacks those.
    """
    path = FOLDER / f'cockpit_{name}.png'
    seen = FOLDER / f'.{path.name}'
    # Drawing for a browser makes a small machine late: in a pause that alarm goes away.
    if 'late' in browser.run(ALARMS):
        browser.run(PAUSE)
        browser.wait("!crgame.alarms.kinds().includes('late')", 'the end of an alarm')
        time.sleep(SETTLES_S)
    try:
        browser.screenshot(seen)
        alarms = set(browser.run(ALARMS))
        if alarms != set(meant):
            raise Unlucky(f'{path.name}: alarms {sorted(alarms)}')
        # Fewer colours would do away with those of the smallest things, such as pedestrians.
        with Image.open(seen) as picture:
            bits = 8 if picture.width < WIDE_PX else 6
            ImageOps.posterize(picture.convert('RGB'), bits).save(path, optimize=True)
    finally:
        seen.unlink(missing_ok=True)
    print(f'{path}: {path.stat().st_size / 1e3:.0f} kB', flush=True)


def show_3d(browser: Browser) -> None:
    """Show the 3D view, and wait for its first picture."""
    browser.run_async('return await crgame.view3d.show(true)')
    browser.wait('crgame.view3d.stats.frames > 0', 'the 3D view', 60.0)


def look_from(browser: Browser, viewpoint: str) -> None:
    """Look from a viewpoint of the 3D view, and wait until every mirror has been drawn."""
    frames = browser.run('crgame.view3d.viewpoint = arguments[0];'
                         'return crgame.view3d.stats.frames', viewpoint)
    browser.wait('crgame.view3d.stats.frames >= arguments[0] + 6', 'the pictures', 60.0,
                 arguments=(frames,))
    time.sleep(SETTLES_S)


def take_driving(folder: Path) -> None:
    """Overtake in dense traffic and cut in."""
    with page(folder, 'dark', *waiting(folder, 'traffic')) as person:
        person.take_seat('hv0')
        person.click('[data-action="start"]')
        person.drive((13, 23), 29.0, 2.4)
        person.drive((12, 22), 29.0, 3.3)
        shoot(person.browser, 'driving')


def take_light(folder: Path) -> None:
    """Drive around in front of an AV."""
    with page(folder, 'light', *waiting(folder, 'roundabout')) as person:
        person.take_seat('hv0')
        person.click('[data-action="start"]')
        person.drive((43, 46, 15, 16, 25, 26), 6.0, 5.0)
        shoot(person.browser, 'light')


def take_people(folder: Path) -> None:
    """Two people are ready, each in a browser of their own, and the countdown runs."""
    game_file = str(EXAMPLES / 'two_humans.yaml')
    with launched(folder, game_file, '--out', str(folder / 'run')) as where, \
            open_browser(folder / 'anna') as anna, open_browser(folder / 'bert') as bert:
        for browser, name, seat in ((bert, 'Bert', 'hv1'), (anna, 'Anna', 'hv0')):
            browser.prefer('light')
            browser.open(where)
            browser.wait(HAS_BEGUN, 'the page', START_LIMIT_S)
            browser.run('const field = document.querySelector("#my-name");'
                        'field.value = arguments[0]; field.dispatchEvent(new Event("change"));',
                        name)
            person = Person(browser)
            person.take_seat(seat)
            person.click('.lobby .primary')
        anna.wait('crgame.store.status.countdown_s > 0', 'the countdown')
        shoot(anna, 'people')


def take_4k(folder: Path) -> None:
    """Drive past parked cars, followed by an AV; a large screen."""
    with page(folder, 'dark', *waiting(folder, 'parked_cars')) as person:
        person.take_seat('hv0')
        person.click('[data-action="start"]')
        person.drive((11, 21), 10.5, 4.5)
        # Drawn without a graphics card, so large a picture would hold the run up.
        person.click('[data-action="pause"]')
        person.browser.resize(3840, 2160)
        person.click('.followed')
        time.sleep(2.0 * SETTLES_S)
        shoot(person.browser, '4k')


def take_figures(folder: Path) -> None:
    """Watch two AVs behind a script: the plots, and table I."""
    with page(folder, 'light', *game('two_avs', '--out', str(folder / 'run'))) as person:
        person.click('#tab-history')
        person.click('.chip[data-id="av0"]')
        person.wait_until(16.0)
        shoot(person.browser, 'history')
        person.browser.run("crgame.settings.setTheme('dark')")
        person.click('#tab-timing')
        time.sleep(SETTLES_S)
        shoot(person.browser, 'timing')


def take_events(folder: Path) -> None:
    """Release the pedestrian in front of the AV; then open the list of scenarios."""
    with page(folder, 'light', *game('crossing', '--out', str(folder / 'run'))) as person:
        person.click('#tab-events')
        person.browser.run("crgame.world.follow('av0', true)")
        person.wait_until(9.0)
        person.click('[aria-label="Trigger Let the pedestrian cross"]')
        person.wait_until(12.0)
        shoot(person.browser, 'events')
        person.browser.run("crgame.settings.setTheme('dark')")
        person.click('#tab-scenario')
        person.click('.scenario[title^="intersection"]')
        person.browser.wait("!document.querySelector('.preview-card').hidden", 'the preview')
        time.sleep(SETTLES_S)
        shoot(person.browser, 'scenario')


def take_alarm(folder: Path) -> None:
    """Run into a leader that brakes; then look at it again in the recording."""
    with page(folder, 'dark', *waiting(folder, 'crossing')) as person:
        person.take_seat('hv0')
        person.click('[data-action="start"]')
        person.drive((11, 21), 12.5, 2.0)
        person.browser.run("crgame.connection.request({type: 'trigger', event: 'leader-brakes'})")
        person.drive((11, 21), 12.0, 5.0)
        person.browser.wait("crgame.alarms.kinds().includes('collision')", 'the collision')
        person.click('[data-action="pause"]')
        time.sleep(PULSES_S)
        shoot(person.browser, 'alarm', ('collision',))
    with page(folder, 'light', '--replay', str(folder / 'run' / 'bag')) as person:
        person.browser.wait('crgame.replay?.info', 'the recording')
        person.click('#tab-history')
        person.browser.run('crgame.replay.seek(7.0)')
        person.browser.wait('!crgame.replay.loading'
                            ' && crgame.world.shown.t === crgame.replay.t', 'the chunk')
        time.sleep(SETTLES_S)
        shoot(person.browser, 'replay')


def take_perception(folder: Path) -> None:
    """Follow an AV that does not see the pedestrian behind a van."""
    with page(folder, 'dark', str(HIDDEN), '--out', str(folder / 'run')) as person:
        person.browser.run("crgame.world.follow('av0', true);"
                           "crgame.perception.set('rays', true);"
                           "crgame.perception.set('estimate', true);")
        person.wait_until(6.5)
        person.click('[data-action="pause"]')
        person.browser.wait("crgame.perception.hollow.includes('o201')"
                            ' && crgame.perception.fans === 2', 'what the AV perceives')
        person.browser.run('crgame.world.camera.zoom(1.5)')
        time.sleep(SETTLES_S)
        shoot(person.browser, 'perception')


def take_3d(folder: Path) -> None:
    """Show the view from the seat beside parked cars, and from behind."""
    with page(folder, 'light', *waiting(folder, 'parked_cars')) as person:
        person.take_seat('hv0')
        show_3d(person.browser)
        person.click('[data-action="start"]')
        time.sleep(DRIVEN_S)
        person.click('[data-action="pause"]')
        person.browser.run(SHARP)
        for viewpoint in ('driver', 'chase'):
            look_from(person.browser, viewpoint)
            shoot(person.browser, viewpoint)


def take_gaze(folder: Path) -> None:
    """Drive in dense traffic, and draw over the view what the page tells of it."""
    with page(folder, 'light', *waiting(folder, 'traffic')) as person:
        browser = person.browser
        person.take_seat('hv0')
        show_3d(browser)
        browser.run(TELLS)
        person.click('[data-action="start"]')
        time.sleep(DRIVEN_S)
        browser.wait('window.told?.some(([, , , , , , , mirror]) => mirror !== null)',
                     'what is in a mirror')
        person.click('[data-action="pause"]')
        browser.run(SHARP)
        time.sleep(SETTLES_S)
        browser.run(BOXES)
        shoot(browser, 'gaze')


def take_over(folder: Path) -> None:
    """Run a script to the end of its game, and show the page then."""
    # The picture shows the folder of its files, too: as with run.sh.
    with page(folder, 'light', str(scenarios_directory() / 'merge.yaml')) as person:
        person.browser.wait("document.querySelector('.outcome-files[data-complete]')",
                            'the end of the run', START_LIMIT_S)
        time.sleep(SETTLES_S)
        shoot(person.browser, 'over')


# The pictures of each run, and what takes them; it gets a folder for its files.
SESSIONS: dict[tuple[str, ...], Callable[[Path], None]] = {
    ('driving',): take_driving, ('light',): take_light, ('4k',): take_4k,
    ('history', 'timing'): take_figures, ('events', 'scenario'): take_events,
    ('alarm', 'replay'): take_alarm, ('perception',): take_perception,
    ('driver', 'chase'): take_3d, ('gaze',): take_gaze, ('over',): take_over,
    ('people',): take_people}


def main() -> None:
    """Make the pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--only', choices=[name for names in SESSIONS for name in names],
                        help='the runs of this picture alone')
    only = parser.parse_args().only
    FOLDER.mkdir(parents=True, exist_ok=True)
    for names, take in SESSIONS.items():
        if only is None or only in names:
            insist(', '.join(names), take)


def insist(names: str, take: Callable[[Path], None]) -> None:
    """Make the pictures of a run, again if it was unlucky."""
    for attempt in range(1, ATTEMPTS + 1):
        print(f'{names}: run {attempt} …', flush=True)
        with tempfile.TemporaryDirectory() as folder:
            try:
                take(Path(folder))
                return
            except Unlucky as error:
                print(error, flush=True)
    sys.exit(f'{names}: {ATTEMPTS} runs in vain')


if __name__ == '__main__':
    main()
