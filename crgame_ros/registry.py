# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finding exchangeable classes by name, entry point, module or file; checking their options."""

from collections.abc import Mapping
from contextlib import suppress
import importlib
from importlib.metadata import entry_points
import importlib.util
import inspect
import math
from pathlib import Path
import sys
import types
from typing import Any, Generic, get_args, get_origin, get_type_hints, Literal, TypeVar, Union

from crgame_ros.errors import InputError, short
from crgame_ros.paths import share_directory

# From requirements-planners.txt: pip does not install them with this package.
PACKAGES = {'commonroad_idm_planner': 'commonroad-idm-planner',
            'commonroad_rp': 'commonroad-reactive-planner'}
# Prefix of FILE.py:load in the name of a planner or driver: a trained policy drives.
POLICY = 'policy:'
# Kinds of values, as text after "give".
VALUE_WORDS: dict[object, str] = {float: 'a number', int: 'a whole number', bool: 'true or false',
                                  str: 'a text', types.NoneType: 'null'}
# Hints of a value of any kind.
ANY_VALUE = (object, Any)
Model = TypeVar('Model', covariant=True)


class ModelRegistry(Generic[Model]):
    """
    The classes of one kind that a game may name.

    A name is a built-in one, one of the entry-point group `crgame_ros.<group>`, `module:Class` or
    `path/to/file.py:Class`. Built-in classes are imported at their use: the packages of some take
    seconds to load.

    :param group: last part of the entry-point group, e.g. `planners`
    :param kind: their name in messages, e.g. `planner`
    :param built_in: `module:Class` by name
    :param base: the class that all of them derive from
    :param document: the page of the documentation on writing one
    :param given: arguments of constructors from the program, which are no options
    :param left_out: where an option that is None comes from
    """

    def __init__(self, group: str, kind: str, built_in: Mapping[str, str], base: type[Model],
                 document: str = '', given: tuple[str, ...] = (),
                 left_out: str = 'none') -> None:
        self.entry_point_group = f'crgame_ros.{group}'
        self.kind = kind
        self.built_in = dict(built_in)
        self._base = base
        self.document, self.given, self.left_out = document, given, left_out
        self._remedy = f'see {document}' if document else 'define it'

    def names(self) -> tuple[str, ...]:
        """Return the registered names: built-in ones first, then those of entry points."""
        others = {point.name for point in entry_points(group=self.entry_point_group)}
        return (*self.built_in, *sorted(others - self.built_in.keys()))

    def create(self, name: str, options: Mapping[str, object] | None = None, where: str = '',
               **given: object) -> Model:
        """
        Create an object of a named class.

        :param name: a registered name, `module:Class` or `path/to/file.py:Class`
        :param options: keyword arguments of its constructor, from the user
        :param where: the file and key that named it, for messages
        :param given: keyword arguments from the program, not options of the user
        :raises InputError: if there is no class of that name, or an option is unknown, missing or
            of the wrong type.
        """
        found = self.find(name, where)
        label = self.label(name, where)
        options_label = f'options of {self.kind} {name}'
        checked = _checked_options(
            found, options or {}, given,
            f'{where}: {options_label}' if where else options_label, label)
        try:
            return found(**given, **checked)
        except InputError as error:
            if not where:
                raise
            raise InputError(error.what, f'{where}: {error.where}' if error.where else where,
                             error.remedy) from error
        except Exception as error:
            raise InputError(f'cannot be made ({type(error).__name__}: {error})', label,
                             'check its options') from error

    def find(self, name: str, where: str = '') -> type[Model]:
        """
        Find a class.

        :param where: the file and key that named it, for messages
        :raises InputError: if there is none of that name, or it is not of this kind.
        """
        label = self.label(name, where)
        found = self.resolve(name, where)
        if not (inspect.isclass(found) and issubclass(found, self._base)):
            raise InputError(f'is no {self.kind}', label, 'derive the class from '
                             f'{self._base.__module__}.{self._base.__qualname__}')
        if inspect.isabstract(found):
            missing = ', '.join(sorted(getattr(found, '__abstractmethods__', ())))
            raise InputError(f'does not define {missing}', label, self._remedy)
        return found

    def resolve(self, name: str, where: str) -> object:
        """
        Return the object that a name stands for, of any kind.

        :param where: as for `find`.
        :raises InputError: if there is none of that name.
        """
        label = self.label(name, where)
        if name in self.built_in:
            return _from_module(self.built_in[name], label)
        if ':' in name:
            source, _, attribute = name.rpartition(':')
            return (self._from_file(Path(source), attribute, label) if source.endswith('.py')
                    else _from_module(name, label))
        for point in entry_points(group=self.entry_point_group):
            if point.name == name:
                return _from_module(point.value, label)
        raise InputError(f'there is no {self.kind} "{name}"', where or self.kind,
                         f'known are {", ".join(self.names())}, or give module:Class or '
                         'file.py:Class')

    def label(self, name: str, where: str = '') -> str:
        """Return the description of an object in messages, with the place that names it."""
        return f'{where}: {self.kind} {name}' if where else f'{self.kind} {name}'

    def _from_file(self, path: Path, attribute: str, label: str) -> object:
        if not path.is_file():
            raise InputError(f'there is no file {path}', label, 'check the path')
        try:
            module = module_of_file(
                path, f'crgame_ros_user_{self.kind.replace(" ", "_")}_{path.stem}')
        except Exception as error:
            raise InputError(f'cannot be read ({type(error).__name__}: {error})', label,
                             'correct the file') from error
        return _attribute(module, attribute, label)


def module_of_file(path: Path, name: str) -> types.ModuleType:
    """
    Run a file as a module; it finds modules beside itself first, as a script does.

    These stay its own: another file gets those beside it, even if they have the same names.

    :param name: of the module.
    :raises Exception: any exception of the file; the module is then removed.
    """
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Dataclasses and pickling find their module by name.
    sys.modules[name] = module
    before = set(sys.modules)
    folder = path.resolve().parent
    sys.path.insert(0, str(folder))
    try:
        spec.loader.exec_module(module)
    except Exception:
        del sys.modules[name]
        raise
    finally:
        with suppress(ValueError):
            sys.path.remove(str(folder))
        beside = {found for found in sys.modules.keys() - before
                  if '.' not in found and _is_beside(sys.modules[found], folder)}
        for found in sys.modules.keys() - before:
            if found.partition('.')[0] in beside:
                del sys.modules[found]
    return module


def _is_beside(module: types.ModuleType, folder: Path) -> bool:
    """Return whether a module is a file of a folder, or a package in it."""
    file = getattr(module, '__file__', None)
    if file is None:
        return False
    path = Path(file).resolve()
    return folder in (path.parent, path.parent.parent if path.name == '__init__.py' else None)


def _from_module(target: str, label: str) -> object:
    module_name, _, attribute = target.partition(':')
    try:
        module = importlib.import_module(module_name)
    except Exception as error:
        if isinstance(error, ImportError) and error.name == 'Polygon':
            # The packages of two planners import it; it has no wheels.
            raise InputError('needs the package polygon3, which did not compile', label,
                             'apt install gcc python3-dev, then delete .venv') from error
        package = isinstance(error, ImportError) and PACKAGES.get((error.name or '').split('.')[0])
        if package:
            raise InputError(f'needs the package {package}, which crgame_ros does not install',
                             label, planner_packages_install()) from error
        raise InputError(f'cannot import {module_name} ({type(error).__name__}: {error})',
                         label, 'check the name and what it imports') from error
    return _attribute(module, attribute, label)


def planner_packages_install() -> str:
    """Return the command that installs the packages of some planners."""
    return ('pip install --no-deps --ignore-requires-python -r '
            f'{share_directory() / "requirements-planners.txt"}')


def _attribute(module: types.ModuleType, attribute: str, label: str) -> object:
    found = getattr(module, attribute, None) if attribute else None
    if found is None:
        raise InputError(f'{module.__name__} has no class "{attribute}"', label,
                         'name the class behind the colon')
    return found


def _checked_options(found: type[object], options: Mapping[str, object],
                     given: Mapping[str, object], where: str, label: str) -> dict[str, object]:
    signature = inspect.signature(found).parameters
    named = {key: parameter for key, parameter in signature.items()
             if parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY)}
    if not any(parameter.kind is parameter.VAR_KEYWORD for parameter in signature.values()):
        for key in given:
            if key not in named:
                raise InputError(f'its constructor does not take "{key}"', label,
                                 'take ' + ', '.join(given) + ' beside its options')
    parameters = {key: parameter for key, parameter in named.items() if key not in given}
    allowed = ', '.join(parameters) or 'none'
    hints = hints_of(found, label)
    checked = {}
    for key, value in options.items():
        if key not in parameters:
            raise InputError(f'"{key}" is unknown', where, f'allowed are: {allowed}')
        checked[key] = _checked(value, hints.get(key, object), key, where, allowed)
    for key, parameter in parameters.items():
        if parameter.default is parameter.empty and key not in checked:
            raise InputError(f'"{key}" is missing', where, f'allowed are: {allowed}')
    return checked


def hints_of(found: type[object], label: str) -> dict[str, object]:
    """
    Return the hints of a constructor, by argument.

    :param label: description of the class in messages.
    :raises InputError: if they name what is not there, such as an import for type checkers alone.
    """
    try:
        return get_type_hints(found.__init__)
    except Exception as error:
        raise InputError(f'its hints cannot be read ({type(error).__name__}: {error})', label,
                         'import at run time what they name') from error


def _checked(value: object, hint: object, key: str, where: str, allowed: str) -> object:
    choices = get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)
    for choice in choices:
        if choice in ANY_VALUE or (choice is types.NoneType and value is None):
            return value
        if get_origin(choice) is Literal:
            if value in get_args(choice):
                return value
            continue
        plain = get_origin(choice) or choice
        if isinstance(value, bool) and plain is not bool:
            continue
        if plain is float and isinstance(value, int | float) and not math.isnan(value):
            return float(value)
        if isinstance(plain, type) and plain is not types.NoneType and isinstance(value, plain):
            return value
    wanted = ' or '.join(_name(choice) for choice in choices)
    raise InputError(f'"{key}" is {short(value)}', where,
                     f'give {wanted}; allowed options are: {allowed}')


def _name(hint: object) -> str:
    if get_origin(hint) is Literal:
        return ' or '.join(repr(value) for value in get_args(hint))
    return VALUE_WORDS.get(hint, getattr(hint, '__name__', str(hint)))
