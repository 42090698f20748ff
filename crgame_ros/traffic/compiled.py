# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compiling the loops over agents: numba, with a cache on disk."""

from collections.abc import Callable
from functools import cache
import hashlib
from importlib.metadata import version
import os
from pathlib import Path
import re
import subprocess
import sys
from typing import Any, cast, TypeVar

import numba
import numpy as np
from numpy.typing import NDArray

_HERE = Path(__file__).resolve().parent
_IMPORT = re.compile(r'^from crgame_ros\.((?:traffic|vehicle)\.\w+) import', re.MULTILINE)


@cache
def cache_root() -> Path:
    """Choose the folder of all compiled code: beside the sources, or else the user's cache."""
    chosen = os.environ.get('NUMBA_CACHE_DIR')
    if chosen:
        return Path(chosen)
    beside = _HERE / '__pycache__'
    if os.access(beside if beside.exists() else _HERE, os.W_OK):
        return beside
    return Path(os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache') / 'crgame_ros'


@cache
def digest(module: str) -> str:
    """Return a short digest of a module here and of all modules that it builds upon."""
    pending, seen = [f'traffic.{module}'], dict[str, bytes]()
    while pending:
        name = pending.pop()
        if name not in seen:
            seen[name] = _HERE.parent.joinpath(*name.split('.')).with_suffix('.py').read_bytes()
            pending += _IMPORT.findall(seen[name].decode('utf-8'))
    result = hashlib.sha256(version('numba').encode())
    for name in sorted(seen):
        result.update(seen[name])
    return result.hexdigest()[:12]


def marker() -> Path:
    """Return which file says that everything is compiled."""
    return cache_root() / f'compiled-{digest("warm_up")}.done'


def compile_now() -> None:
    """Compile what is not compiled yet, in a process of its own, which says so."""
    if not marker().exists():
        subprocess.run([sys.executable, '-m', 'crgame_ros.traffic.warm_up'], check=False)


Function = TypeVar('Function', bound=Callable[..., Any])


def vectorized(function: Callable[..., float]) -> Callable[..., NDArray[np.float64]]:
    """Compile a function of numbers [float64] into one of arrays that broadcast."""
    _choose_cache(function)
    count = function.__code__.co_argcount
    result: Callable[..., NDArray[np.float64]] = numba.vectorize(
        [numba.float64(*[numba.float64] * count)], cache=True)(function)
    return result


def _choose_cache(function: Callable[..., Any]) -> None:
    module = function.__module__.rpartition('.')[2]
    vars(numba.config)['CACHE_DIR'] = str(cache_root() / f'compiled-{digest(module)}')


def inlined(function: Function) -> Function:
    """
    Compile a function into those that call it.

    For small ones in inner loops: tables are passed by value, some hundred words of them.
    """
    _choose_cache(function)
    return cast(Function, numba.njit(error_model='numpy', inline='always')(function))


def compiled(function: Function) -> Function:
    """Compile a function of numbers and arrays; divisions by zero give inf and NaN, as numpy's."""
    _choose_cache(function)
    return cast(Function, numba.njit(cache=True, error_model='numpy')(function))


def bare(function: Function) -> Function:
    """
    Compile a function that makes no arrays, without counting the references to those it is given.

    numba counts each array of a table wherever some of it is looked at, which takes more time than
    all the rest of a short loop.
    """
    _choose_cache(function)
    # Not among numba's documented options.
    options: dict[str, Any] = {'cache': True, 'error_model': 'numpy', '_nrt': False}
    return cast(Function, numba.njit(**options)(function))
