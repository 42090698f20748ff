# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Imports of packages by packages that cost more than all else, for functions never called."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
import sys
from types import ModuleType

# What CommonRoad's packages draw with; scipy imports all of numpy, also what compiles Fortran.
UNUSED = ('matplotlib', 'matplotlib.colors', 'matplotlib.pyplot',
          'commonroad.visualization.mp_renderer', 'numpy.f2py')


class _Postponed(ModuleType):
    """Stands for a module: what is taken from it loads the module when it is called."""

    def __getattr__(self, name: str) -> Callable[..., object]:
        if name.startswith('__'):
            raise AttributeError(name)

        def function(*args: object, **options: object) -> object:
            found = getattr(import_module(self.__name__), name)
            return found(*args, **options)
        return function


@contextmanager
def postponed(*names: str) -> Iterator[None]:
    """
    Let modules that are imported within have functions of others without loading these.

    Only for those of which functions are used, such as pyplot; it holds for this import alone.

    :param names: full names of the others; those already loaded are taken as they are.
    """
    absent = [name for name in names if name not in sys.modules]
    # A package has its parts as attributes, too.
    parts: list[tuple[ModuleType, str]] = []
    for name in absent:
        sys.modules[name] = _Postponed(name)
        above, _, part = name.rpartition('.')
        if above in sys.modules:
            setattr(sys.modules[above], part, sys.modules[name])
            parts.append((sys.modules[above], part))
    try:
        yield
    finally:
        for name in absent:
            del sys.modules[name]
        for package, part in parts:
            if not isinstance(package, _Postponed):
                delattr(package, part)
