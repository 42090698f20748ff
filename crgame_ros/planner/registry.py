# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finding planners by name, entry point, module or file, and checking their options."""

from collections.abc import Mapping
import importlib
from importlib.metadata import entry_points
import importlib.util
import inspect
import math
from pathlib import Path
import sys
import types
from typing import Any, get_args, get_origin, get_type_hints, Literal, Union

from crgame_ros.errors import InputError
from crgame_ros.planner.interface import Planner

# As a planner's name: a process of the user's own answers (docs/external_planners.md).
EXTERNAL = 'external'
ENTRY_POINTS = 'crgame_ros.planners'
# Imported when asked for: the packages behind two of them cost seconds.
BUILT_IN = {
    'idm': 'crgame_ros.planner.idm:IdmPlanner',
    'idm-package': 'crgame_ros.planner.idm_package:IdmPackagePlanner',
    'reactive': 'crgame_ros.planner.reactive:ReactivePlanner',
    'constant-velocity': 'crgame_ros.planner.constant_velocity:ConstantVelocityPlanner',
}


def planner_names() -> tuple[str, ...]:
    """List the registered names: those of the package first, then those of entry points."""
    others = {point.name for point in entry_points(group=ENTRY_POINTS)} - BUILT_IN.keys()
    return (*BUILT_IN, *sorted(others))


def create_planner(name: str, options: Mapping[str, Any] | None = None) -> Planner:
    """
    Make a planner.

    :param name: a registered name, `module:Class` or `path/to/file.py:Class`.
    :param options: keyword arguments of its constructor.
    :raises InputError: if there is no such planner, or an option is unknown, missing or of the
        wrong type.
    """
    kind = planner_class(name)
    checked = _checked_options(kind, name, options or {})
    try:
        return kind(**checked)
    except InputError:
        raise
    except Exception as error:
        raise InputError(f'cannot be made ({type(error).__name__}: {error})', f'planner {name}',
                         'check its options') from error


def planner_class(name: str) -> type[Planner]:
    """
    Find the class of a planner.

    :raises InputError: if there is none of that name, or it is no `Planner`.
    """
    if name in BUILT_IN:
        kind = _from_module(BUILT_IN[name], name)
    elif ':' in name:
        source, _, attribute = name.rpartition(':')
        kind = (_from_file(Path(source), attribute, name) if source.endswith('.py')
                else _from_module(name, name))
    else:
        points = [point for point in entry_points(group=ENTRY_POINTS) if point.name == name]
        if not points and name == EXTERNAL:
            raise InputError('an external planner answers live runs only', 'planner',
                             'start the run with ./run.sh, or name a planner')
        if not points:
            raise InputError(f'there is no planner "{name}"', 'planner',
                             f'known are {", ".join(planner_names())}, or give module:Class or '
                             'file.py:Class')
        kind = _from_module(points[0].value, name)
    if not (inspect.isclass(kind) and issubclass(kind, Planner)):
        raise InputError('is no planner', f'planner {name}',
                         'derive the class from crgame_ros.planner.interface.Planner')
    if inspect.isabstract(kind):
        missing = ', '.join(sorted(kind.__abstractmethods__))
        raise InputError(f'does not define {missing}', f'planner {name}', 'see docs/planners.md')
    if not isinstance(getattr(kind, 'name', None), str):
        raise InputError('has no name', f'planner {name}', 'give the class an attribute `name`')
    return kind


def _from_module(target: str, name: str) -> Any:
    module_name, _, attribute = target.partition(':')
    try:
        module = importlib.import_module(module_name)
    except Exception as error:
        if isinstance(error, ImportError) and error.name == 'Polygon':
            # The packages behind two planners import it; it has no wheels.
            raise InputError('needs the package polygon3, which did not compile',
                             f'planner {name}',
                             'apt install gcc python3-dev, then delete .venv') from error
        raise InputError(f'cannot import {module_name} ({type(error).__name__}: {error})',
                         f'planner {name}', 'check the name and what it imports') from error
    return _attribute(module, attribute, name)


def _from_file(path: Path, attribute: str, name: str) -> Any:
    if not path.is_file():
        raise InputError(f'there is no file {path}', f'planner {name}', 'check the path')
    module_name = f'crgame_ros_user_planner_{path.stem}'
    spec = importlib.util.spec_from_file_location(module_name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Dataclasses and pickling look their module up by name.
    sys.modules[module_name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[module_name]
        raise InputError(f'cannot be read ({type(error).__name__}: {error})', f'planner {name}',
                         'mend the file') from error
    return _attribute(module, attribute, name)


def _attribute(module: types.ModuleType, attribute: str, name: str) -> Any:
    kind = getattr(module, attribute, None) if attribute else None
    if kind is None:
        raise InputError(f'{module.__name__} has no class "{attribute}"', f'planner {name}',
                         'name the class behind the colon')
    return kind


def _checked_options(kind: type[Planner], name: str,
                     options: Mapping[str, Any]) -> dict[str, Any]:
    where = f'options of planner {name}'
    parameters = {
        key: parameter for key, parameter in inspect.signature(kind).parameters.items()
        if parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY)}
    allowed = ', '.join(parameters) or 'none'
    hints = get_type_hints(kind.__init__)
    checked = {}
    for key, value in options.items():
        if key not in parameters:
            raise InputError(f'"{key}" is unknown', where, f'allowed are: {allowed}')
        checked[key] = _checked(value, hints.get(key, Any), key, where, allowed)
    for key, parameter in parameters.items():
        if parameter.default is parameter.empty and key not in checked:
            raise InputError(f'"{key}" is missing', where, f'allowed are: {allowed}')
    return checked


def _checked(value: Any, hint: Any, key: str, where: str, allowed: str) -> Any:
    choices = get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)
    for choice in choices:
        if choice is Any or (choice is types.NoneType and value is None):
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
    raise InputError(f'"{key}" is {value!r}', where,
                     f'give {wanted}; allowed options are: {allowed}')


def _name(hint: Any) -> str:
    if get_origin(hint) is Literal:
        return ' or '.join(repr(value) for value in get_args(hint))
    return 'None' if hint is types.NoneType else getattr(hint, '__name__', str(hint))
