# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The environments of converters.

Converters need other versions of packages than this project, and some have licences that would
extend to a program which imports them. Each lives in an environment of its own and is called as a
program; nothing of it is imported.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import fcntl
import hashlib
import os
from pathlib import Path
import shutil
import subprocess
import sys

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.paths import config_directory, user_directory

# Of a converter and of the making of its environment [s]: a town takes minutes, 1 GB as well.
_MAKE_S = 3600.0
_STAMP = 'complete'
_LAST_WORDS = 3


@dataclass(frozen=True)
class Converter:
    """
    A package with converters.

    :param name: of the list of its packages, `config/converters/NAME.txt`, and of its environment.
    :param title: package and version, for people.
    :param licence: of the package.
    :param size: of the environment on disk, for people.
    """

    name: str
    title: str
    licence: str
    size: str

    def program(self, name: str, say: Callable[[str], object]) -> Path:
        """
        Return a program of the package, whose environment is made if it is not there yet.

        :param say: called with a line when the environment is made.
        :raises CrgameError: if it cannot be made, with the reason.
        """
        pins = config_directory() / 'converters' / f'{self.name}.txt'
        digest = hashlib.sha256(pins.read_bytes()).hexdigest()[:12]
        folder = user_directory('cache') / 'converters' / f'{self.name}-{digest}'
        if not (folder / _STAMP).is_file():
            self._make(folder, pins, say)
        return folder / 'bin' / name

    def _make(self, folder: Path, pins: Path, say: Callable[[str], object]) -> None:
        try:
            folder.parent.mkdir(parents=True, exist_ok=True)
            lock = folder.with_suffix('.lock').open('w')
        except OSError as error:
            raise CrgameError(f'{folder}: cannot be made ({error.strerror}); choose another place '
                              'with XDG_CACHE_HOME') from error
        with lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if (folder / _STAMP).is_file():
                return
            say(f'installing {self.title} ({self.licence}, {self.size} on disk) once, into an '
                f'environment of its own: {folder}')
            shutil.rmtree(folder, ignore_errors=True)
            uv = find_uv()
            python = str(folder / 'bin' / 'python')
            for words in (['venv', '--python', '3.11', str(folder)],
                          ['pip', 'install', '--no-deps', '--python', python,
                           '--requirements', str(pins)]):
                _run_quietly([uv, '--quiet', *words], f'{self.title} cannot be installed', _MAKE_S,
                             'try again with a faster connection')
            (folder / _STAMP).touch()


DESIGNER = Converter('designer', 'commonroad-scenario-designer 0.8.5', 'GPL-3.0-or-later', '1 GB')
DATA_SET_CONVERTER = Converter('dataset_converter', 'commonroad-dataset-converter 2025.1.0',
                               'BSD-3-Clause', '0.6 GB')
SUMO_TOOLS = Converter('sumo', "SUMO's netconvert 1.28.0", 'EPL-2.0', '0.5 GB')


def find_uv() -> str:
    """
    Return the program uv: that of this environment, or the one on the PATH.

    :raises CrgameError: if there is none.
    """
    own = Path(sys.prefix) / 'bin' / 'uv'
    found = str(own) if own.exists() else shutil.which('uv')
    if found is None:
        raise CrgameError('uv, which installs converters, is missing; install it: pip install uv')
    return found


def run_converter(words: Sequence[str], folder: Path, what: str, timeout_s: float) -> str:
    """
    Run a program of a converter, without a screen and with nothing of this environment.

    :param folder: where it runs.
    :param what: what it shall do, for the message of a failure.
    :return: what it printed.
    :raises InputError: if it fails or takes too long; its last line says why.
    """
    return _run_quietly(
        words, what, timeout_s, 'give a smaller map, or more time with --timeout', folder,
        converter_variables() | {
            'QT_QPA_PLATFORM': 'offscreen', 'MPLBACKEND': 'Agg', 'NO_COLOR': '1'})


def converter_variables() -> dict[str, str]:
    """Return the environment variables of a converter: nothing of this Python environment."""
    return {name: value for name, value in os.environ.items()
            if name not in ('PYTHONPATH', 'PYTHONHOME', 'VIRTUAL_ENV')}


def _run_quietly(words: Sequence[str], what: str, timeout_s: float, remedy: str,
                 folder: Path | None = None, environment: dict[str, str] | None = None) -> str:
    try:
        done = subprocess.run(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, timeout=timeout_s, cwd=folder,
                              env=environment, check=False)
    except subprocess.TimeoutExpired as error:
        raise InputError(f'took longer than {timeout_s:.0f} s', what, remedy) from error
    except OSError as error:
        raise CrgameError(f'{what}: {words[0]} cannot be run ({error.strerror})') from error
    text = done.stdout.decode(errors='replace')
    if done.returncode:
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        said = ' / '.join(lines[-_LAST_WORDS:])[-300:]
        raise InputError(said or f'it ended with code {done.returncode}', what)
    return text
