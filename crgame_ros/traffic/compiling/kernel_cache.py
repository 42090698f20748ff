# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cache of compiled loops over agents; this module loads no compiler."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
import hashlib
from importlib.metadata import version
import os
from pathlib import Path
import platform
import re
import subprocess
import sys

from crgame_ros.paths import user_directory

_PACKAGE = Path(__file__).resolve().parents[2]
_HERE = _PACKAGE / 'traffic'
_IMPORT = re.compile(r'^from (crgame_ros\.(?:traffic|vehicle)(?:\.\w+)+) import', re.MULTILINE)


@cache
def cache_root() -> Path:
    """Return the folder of all compiled code: beside the sources, or else the user's cache."""
    chosen = os.environ.get('NUMBA_CACHE_DIR')
    if chosen:
        return Path(chosen)
    beside = _HERE / '__pycache__'
    if os.access(beside if beside.exists() else _HERE, os.W_OK):
        return beside
    return user_directory('cache')


@cache
def digest(module: str) -> str:
    """Return a short digest of a module and of all modules of agents that it builds upon."""
    pending, seen = [module], dict[str, bytes]()
    while pending:
        name = pending.pop()
        if name not in seen:
            path = _PACKAGE.joinpath(*name.split('.')[1:])
            seen[name] = path.with_suffix('.py').read_bytes()
            pending += _IMPORT.findall(seen[name].decode('utf-8'))
    result = hashlib.sha256('\n'.join((version('numba'), sys.version, _cpu())).encode())
    for name in sorted(seen):
        result.update(seen[name])
    return result.hexdigest()[:12]


@cache
def _cpu() -> str:
    """Return the processor's model and features: others do not load code compiled for it."""
    try:
        lines = Path('/proc/cpuinfo').read_text().splitlines()
    except OSError:
        lines = []
    return '\n'.join(sorted({line for line in lines if line.startswith(
        ('model name', 'flags', 'Features'))})
                     ) or platform.machine()


def marker() -> Path:
    """Return the file that marks that everything is compiled."""
    return cache_root() / f'compiled-{digest("crgame_ros.traffic.warm_up")}.done'


_COMPILE = (sys.executable, '-m', 'crgame_ros.traffic.warm_up')


def compile_now() -> None:
    """Compile what is not compiled yet, in a process of its own, which prints messages."""
    if not marker().exists():
        # A session of its own: Ctrl-C ends it through this process, without a traceback.
        subprocess.run(_COMPILE, check=False, start_new_session=True)


@contextmanager
def compiling_when_idle() -> Iterator[None]:
    """Compile what is not compiled yet, in idle processor time and without output."""
    if marker().exists():
        yield
        return
    process = subprocess.Popen(
        [*_COMPILE, '--idle'], start_new_session=True, stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.terminate()
        process.wait()
