# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compilation of the loops over agents with numba and a cache on disk."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, cast, TypeVar

from crgame_ros.traffic.compiling.kernel_cache import cache_root, digest
import numba
from numba.core.caching import UserProvidedCacheLocator
import numpy as np
from numpy.typing import NDArray

Function = TypeVar('Function', bound=Callable[..., object])


class InDigestFolder(UserProvidedCacheLocator):
    """
    A cache whose files have no path in their names, unlike numba's own.

    Checkouts, installed copies, and folders that are moved share what is compiled.
    """

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        """Return the folder of a file's code within the cache: the cache itself."""
        return ''


@contextmanager
def _cached(function: Callable[..., object]) -> Iterator[None]:
    """Choose the cache of a function. It stays as it was for those of others."""
    config = vars(numba.config)
    ours = {'CACHE_DIR': str(cache_root() / f'compiled-{digest(function.__module__)}'),
            'CACHE_LOCATOR_CLASSES': f'{__name__}.{InDigestFolder.__name__}'}
    before = {name: config[name] for name in ours}
    config.update(ours)
    try:
        yield
    finally:
        config.update(before)


def vectorized(function: Callable[..., float]) -> Callable[..., NDArray[np.float64]]:
    """Compile a function of numbers [float64] into one of arrays that broadcast."""
    count = function.__code__.co_argcount
    with _cached(function):
        return numba.vectorize([numba.float64(*[numba.float64] * count)], cache=True)(function)


def inlined(function: Function) -> Function:
    """
    Compile a function inline into its callers.

    It is meant for small functions in inner loops: a call passes tables by value, which are some
    hundred words.
    """
    return cast(Function, numba.njit(error_model='numpy', inline='always')(function))


def compiled(function: Function) -> Function:
    """Compile a function of numbers and arrays; divisions by zero give inf and NaN, as numpy's."""
    with _cached(function):
        return _once(numba.njit(cache=True, error_model='numpy')(function))


def bare(function: Function) -> Function:
    """
    Compile a function that makes no arrays, without counting references to its arguments.

    numba counts references to each array of a table wherever the table is used. That takes more
    time than the rest of a short loop.
    """
    # numba does not document `_nrt`.
    options: dict[str, Any] = {'cache': True, 'error_model': 'numpy', '_nrt': False}
    with _cached(function):
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
