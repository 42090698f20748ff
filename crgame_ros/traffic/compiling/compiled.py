# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compilation of the loops over agents with numba and a cache on disk."""

from collections.abc import Callable, Iterable
from typing import Any, cast, TypeVar

from crgame_ros.traffic.compiling.kernel_cache import cache_root, digest
import numba
import numpy as np
from numpy.typing import NDArray

Function = TypeVar('Function', bound=Callable[..., object])


def vectorized(function: Callable[..., float]) -> Callable[..., NDArray[np.float64]]:
    """Compile a function of numbers [float64] into one of arrays that broadcast."""
    _choose_cache(function)
    count = function.__code__.co_argcount
    return numba.vectorize([numba.float64(*[numba.float64] * count)], cache=True)(function)


def _choose_cache(function: Callable[..., object]) -> None:
    folder = cache_root() / f'compiled-{digest(function.__module__)}'
    vars(numba.config)['CACHE_DIR'] = str(folder)


def inlined(function: Function) -> Function:
    """
    Compile a function inline into its callers.

    It is meant for small functions in inner loops: a call passes tables by value, which are some
    hundred words.
    """
    _choose_cache(function)
    return cast(Function, numba.njit(error_model='numpy', inline='always')(function))


def compiled(function: Function) -> Function:
    """Compile a function of numbers and arrays; divisions by zero give inf and NaN, as numpy's."""
    _choose_cache(function)
    return _once(numba.njit(cache=True, error_model='numpy')(function))


def bare(function: Function) -> Function:
    """
    Compile a function that makes no arrays, without counting references to its arguments.

    numba counts references to each array of a table wherever the table is used. That takes more
    time than the rest of a short loop.
    """
    _choose_cache(function)
    # numba does not document `_nrt`.
    options: dict[str, Any] = {'cache': True, 'error_model': 'numpy', '_nrt': False}
    return _once(numba.njit(**options)(function))


def _once(dispatcher: Any) -> Any:
    """
    Compile a function that compiled code calls once for all values of a number.

    numba does so once more for each literal that a caller has: for `0` and for `steps`.
    """
    template, plain = dispatcher.get_call_template, numba.types.unliteral

    def of_any_value(args: Iterable[object], options: dict[str, object]) -> object:
        return template(tuple(plain(each) for each in args),
                        {name: plain(each) for name, each in options.items()})
    dispatcher.get_call_template = of_any_value
    return dispatcher
