# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of nodes: numbers, which accept whole ones too, and what is set at the start only."""

import math
from typing import TypeVar

from crgame_ros.errors import InputError
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

T = TypeVar('T')


def fixed(node: Node, name: str, default: T, description: str) -> T:
    """Declare a parameter that can be set at the start only, and return its value."""
    value: T = node.declare_parameter(name, default, ParameterDescriptor(
        description=description, read_only=True)).value
    return value


def declare_number(node: Node, name: str, default: float, description: str,
                   bounds: tuple[float, float], *, read_only: bool = True) -> float:
    """
    Declare a parameter that accepts `2` as well as `2.0`, and return its value.

    :param bounds: least and greatest value.
    :param read_only: whether it can be set at the start only.
    :raises InputError: if the value at the start is no number within the bounds.
    """
    value = node.declare_parameter(name, default, ParameterDescriptor(
        description=description, read_only=read_only, dynamic_typing=True,
        floating_point_range=[FloatingPointRange(from_value=bounds[0], to_value=bounds[1])])).value
    reason = _reason(value, bounds)
    if reason is not None:
        raise InputError(reason, f'parameter {name}', f'give a number from {bounds[0]:g} to '
                         f'{bounds[1]:g}')

    def check(parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            wrong = _reason(parameter.value, bounds) if parameter.name == name else None
            if wrong is not None:
                return SetParametersResult(successful=False, reason=f'{name}: {wrong}')
        return SetParametersResult(successful=True)

    if not read_only:
        node.add_on_set_parameters_callback(check)
    return float(value)


def _reason(value: object, bounds: tuple[float, float]) -> str | None:
    """Return why a value cannot be used, None if it can."""
    if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
        return f'{str(value)[:40]!r} is no number'
    return None if bounds[0] <= value <= bounds[1] else f'{value:g} is out of its range'
