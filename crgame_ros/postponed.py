# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Imports of packages by packages that cost more than all else, for functions never called."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
import sys
from types import MappingProxyType, ModuleType

# What CommonRoad's packages draw with, and packages of scipy of which they call a function or
# none. scipy imports all of numpy, also what compiles Fortran.
UNUSED = ('matplotlib', 'matplotlib.colors', 'matplotlib.pyplot',
          'commonroad.visualization.mp_renderer', 'numpy.f2py', 'scipy.integrate',
          'scipy.interpolate', 'scipy.optimize', 'scipy.signal')


class _Postponed(ModuleType):
    """
    Stands for a module: what is taken from it loads the module when it is called.

    :param parts: modules of a package, by the functions in them that are called.
    :param others: modules that are postponed while one of these parts is loaded.
    """

    def __init__(self, name: str, parts: Mapping[str, str], others: Sequence[str]) -> None:
        super().__init__(name)
        self._parts, self._others = parts, others
        self._found: dict[str, Callable[..., object]] = {}

    def __getattr__(self, name: str) -> Callable[..., object]:
        if name.startswith('_'):
            raise AttributeError(name)

        def function(*args: object, **options: object) -> object:
            if name not in self._found:
                self._found[name] = getattr(self._module_of(name), name)
            return self._found[name](*args, **options)
        return function

    def _module_of(self, name: str) -> ModuleType:
        """Load the module with a function: a part of a package without the package's own code."""
        package, part = self.__name__, self._parts.get(name)
        if part is None or package in sys.modules:
            return import_module(package)
        spec = find_spec(package)
        assert spec is not None
        vars(self)['__path__'] = spec.submodule_search_locations
        sys.modules[package] = self
        try:
            with postponed(*self._others):
                return import_module(f'{package}.{part}')
        finally:
            del sys.modules[package]


@contextmanager
def postponed(*names: str, parts: Mapping[str, str] = MappingProxyType({})) -> Iterator[None]:
    """
    Let modules that are imported within have functions of others without loading these.

    Only for those of which functions are used, such as pyplot; it holds for this import alone.

    :param names: full names of the others; those already loaded are taken as they are.
    :param parts: by function, the module of its package that has it: this alone is loaded, and
        without what is postponed, too.
    """
    absent = [name for name in names if name not in sys.modules]
    # A package has its parts as attributes, too.
    attributes: list[tuple[ModuleType, str]] = []
    for name in absent:
        sys.modules[name] = _Postponed(name, parts, [each for each in names if each != name])
        above, _, part = name.rpartition('.')
        if above in sys.modules:
            setattr(sys.modules[above], part, sys.modules[name])
            attributes.append((sys.modules[above], part))
    try:
        yield
    finally:
        for name in absent:
            del sys.modules[name]
        for package, part in attributes:
            if not isinstance(package, _Postponed):
                delattr(package, part)
