# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Compiling the loops over agents: numba, with a cache on disk.

Compiled code lies in a folder named by the contents of the function's module and of all that it
imports from here: numba itself looks at the function's own file only, not at those of what it
calls, and would run old code after a change.
"""

from collections.abc import Callable
from functools import cache
import hashlib
import os
from pathlib import Path
import re
from typing import Any, cast, TypeVar

import numba
import numpy as np
from numpy.typing import NDArray

Function = TypeVar('Function', bound=Callable[..., Any])

_HERE = Path(__file__).resolve().parent
_IMPORT = re.compile(r'^from crgame_ros\.traffic\.(\w+) import', re.MULTILINE)


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
    """Give a short digest of a module here and of all modules that it builds upon."""
    pending, seen = [module], set[str]()
    while pending:
        name = pending.pop()
        if name not in seen:
            seen.add(name)
            pending += _IMPORT.findall((_HERE / f'{name}.py').read_text(encoding='utf-8'))
    result = hashlib.sha256(numba.__version__.encode())
    for name in sorted(seen):
        result.update((_HERE / f'{name}.py').read_bytes())
    return result.hexdigest()[:12]


def vectorized(function: Callable[..., float]) -> Callable[..., NDArray[np.float64]]:
    """Compile a function of numbers [float64] into one of arrays that broadcast."""
    _choose_cache(function)
    count = function.__code__.co_argcount
    result: Callable[..., NDArray[np.float64]] = numba.vectorize(
        [numba.float64(*[numba.float64] * count)], cache=True)(function)
    return result


def _choose_cache(function: Callable[..., Any]) -> None:
    module = function.__module__.rpartition('.')[2]
    numba.config.CACHE_DIR = str(cache_root() / f'compiled-{digest(module)}')


def compiled(function: Function) -> Function:
    """Compile a function of numbers and arrays; divisions by zero give inf and NaN, as numpy's."""
    _choose_cache(function)
    return cast(Function, numba.njit(cache=True, error_model='numpy')(function))
