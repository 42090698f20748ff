# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command `crgame models`: the exchangeable parts that a game may name, and their options."""

import argparse
from collections.abc import Iterator
import importlib
import inspect
import textwrap
from typing import TYPE_CHECKING

from crgame_ros.errors import InputError

if TYPE_CHECKING:
    from crgame_ros.registry import ModelRegistry
    from crgame_ros.schema.model_options import Option

DESCRIPTION = """\
List the exchangeable parts that a game file may name, with their options: what ships, what other
packages register (entry points), and your own.

  crgame models
  crgame models planner
  crgame models planner reactive
  crgame models tracker my_tracker.py:Mine

An option is written beside the name in a game file; planners also take --option NAME=VALUE."""
# Module and name of each registry.
REGISTRIES = {
    'planner': ('crgame_ros.planner.registry', 'PLANNERS'),
    'tracker': ('crgame_ros.control.tracker', 'TRACKERS'),
    'vehicle-model': ('crgame_ros.vehicle.models', 'VEHICLE_MODELS'),
    'sensor': ('crgame_ros.perception.sensors', 'SENSORS'),
    'car-following': ('crgame_ros.traffic.following.car_following', 'CAR_FOLLOWING')}
_WIDTH = 99


def registry_of(kind: str) -> 'ModelRegistry[object]':
    """Return the registry of a kind of model."""
    module, name = REGISTRIES[kind]
    return getattr(importlib.import_module(module), name)


def purpose_of(kind: type[object]) -> str:
    """Return the first sentence of a class's docstring."""
    return inspect.cleandoc(kind.__doc__ or '').split('\n')[0]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument('kind', nargs='?', choices=tuple(REGISTRIES),
                        help='kind of model (default: all)')
    parser.add_argument('name', nargs='?', help='model, whose options are listed')
    parser.set_defaults(command=run)


def run(values: argparse.Namespace) -> int:
    """
    Print models, or the options of one.

    :raises InputError: if there is no such model.
    """
    if values.name is not None:
        from crgame_ros.schema.model_options import options_of
        registry = registry_of(values.kind)
        print(f'{values.name}: {purpose_of(registry.find(values.name))}')
        print('\n'.join(_option_lines(options_of(registry, values.name))))
        return 0
    for kind in REGISTRIES if values.kind is None else (values.kind,):
        registry = registry_of(kind)
        print(f'{kind} ({registry.document})')
        for name in registry.names():
            print('\n'.join(_model_lines(registry, name)))
    return 0


def _model_lines(registry: 'ModelRegistry[object]', name: str) -> list[str]:
    try:
        text = purpose_of(registry.find(name))
    except InputError as error:
        text = f'not available: {error.what}'
    return textwrap.wrap(text, _WIDTH, initial_indent=f'  {name:<18} ',
                         subsequent_indent=' ' * 21)


def _option_lines(options: 'list[Option]') -> Iterator[str]:
    if not options:
        yield '  no options'
    width = max((len(option.name) for option in options), default=0)
    for option in options:
        default = f' (default: {option.default})' if option.default else ' (required)'
        yield from textwrap.wrap(
            f'{option.meaning}; {option.wanted}{default}', _WIDTH,
            initial_indent=f'  {option.name:<{width}}  ', subsequent_indent=' ' * (width + 4))
