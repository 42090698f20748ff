# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The options of exchangeable models, as their constructors and docstrings declare them."""

import inspect
from typing import NamedTuple

from crgame_ros.registry import hints_of, ModelRegistry
from crgame_ros.schema.declaration import sentences_of, wanted


class Option(NamedTuple):
    """
    An option of a model.

    :param wanted: kind of value, as text after "give".
    :param default: as in a game file; empty if it is required.
    :param meaning: with its unit.
    """

    name: str
    wanted: str
    default: str
    meaning: str


def options_of(registry: ModelRegistry[object], name: str) -> list[Option]:
    """
    Return the options of a model.

    :raises InputError: if there is no such model, its package is not installed, or its hints
        cannot be read.
    """
    kind = registry.find(name)
    hints, sentences = hints_of(kind, registry.label(name)), sentences_of(kind)
    return [Option(key, wanted(hints.get(key, object)), _written(parameter, registry.left_out),
                   sentences.get(key, ''))
            for key, parameter in inspect.signature(kind).parameters.items()
            if key not in registry.given
            and parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY)]


def _written(parameter: inspect.Parameter, left_out: str) -> str:
    default = parameter.default
    if default is parameter.empty:
        return ''
    return left_out if default is None else str(default).lower() if isinstance(default, bool) \
        else str(default)
