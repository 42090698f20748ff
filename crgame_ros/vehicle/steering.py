# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Steering from wheel to front wheels: CRG equations 26-27 with the ratio table R(v, theta_sw)."""

from bisect import bisect_right
from dataclasses import dataclass
import functools
import json
from pathlib import Path
from typing import Annotated, ClassVar

from crgame_ros.errors import InputError
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Called, Within
from crgame_ros.schema.reading import read
from crgame_ros.schema.writing import write
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.yaml_text import read_yaml


@dataclass(frozen=True)
class SteeringRatioTable:
    """
    The steering ratio R(v, theta_sw), bilinear between its grid points and held beyond them.

    :param speeds: grid of absolute speeds, ascending [m/s]
    :param wheel_angles: grid of absolute steering-wheel angles, ascending [rad]
    :param ratios: R at each speed and steering-wheel angle [-]
    """

    FORM: ClassVar[Form] = Form('see config/vehicles/steering_ratio.yaml')

    speeds: Annotated[tuple[float, ...], Called('speed')]
    wheel_angles: Annotated[tuple[float, ...], Called('steering_wheel_angle')]
    ratios: Annotated[tuple[tuple[Annotated[float, Within(0.0, above=True)], ...], ...],
                      Called('ratio')]

    def ratio(self, speed: float, wheel_angle: float) -> float:
        """Return the ratio at a signed speed [m/s] and steering-wheel angle [rad]."""
        row, row_share = _cell(self.speeds, abs(speed))
        column, column_share = _cell(self.wheel_angles, abs(wheel_angle))
        low, high = self.ratios[row], self.ratios[row + 1]
        at_low = low[column] + column_share * (low[column + 1] - low[column])
        at_high = high[column] + column_share * (high[column + 1] - high[column])
        return at_low + row_share * (at_high - at_low)


def _cell(grid: tuple[float, ...], value: float) -> tuple[int, float]:
    index = min(max(bisect_right(grid, value) - 1, 0), len(grid) - 2)
    share = (value - grid[index]) / (grid[index + 1] - grid[index])
    return index, min(1.0, max(0.0, share))


@functools.cache
def load_steering_ratio(path: str) -> SteeringRatioTable:
    """
    Read a ratio table.

    :param path: of its file; or the table itself, as text from `table_text`.
    :raises InputError: if the file is missing or is no ascending grid of positive ratios.
    """
    if path.startswith('{'):
        text, path = path, 'table of steering ratios'
        try:
            values = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise InputError('is no JSON', path, 'send it whole') from error
    else:
        values = read_yaml(Path(path), 'table of steering ratios')
    table = read(SteeringRatioTable, values, path)
    for name, grid in (('speed', table.speeds), ('steering_wheel_angle', table.wheel_angles)):
        if len(grid) < 2 or any(not b > a for a, b in zip(grid, grid[1:], strict=False)):
            raise InputError(f'"{name}" does not ascend', path, 'give at least two grid points')
    if len(table.ratios) != len(table.speeds) or any(
            len(row) != len(table.wheel_angles) for row in table.ratios):
        raise InputError('"ratio" does not fit the grid', path,
                         'give one row for each speed, one column for each angle')
    return table


def table_text(path: str) -> str:
    """Return the text of a ratio table, for a program without its file."""
    return json.dumps(write(load_steering_ratio(path)))


class Steering:
    """Lateral control of a human's vehicle."""

    def __init__(self, vehicle: VehicleParameters) -> None:
        self._vehicle = vehicle
        self._table = load_steering_ratio(vehicle.steering_ratio)

    def target_angle(self, steering: float, speed: float) -> float:
        """
        Compute the target front-wheel angle delta* (CRG 26).

        :param steering: normalised steering s in [-1, 1], positive to the left
        :param speed: signed speed [m/s]
        :return: delta* [rad]
        """
        wheel_angle = steering * self._vehicle.max_steering_wheel_angle
        limit = self._vehicle.max_steering_angle
        angle = wheel_angle / self._table.ratio(speed, wheel_angle)
        return min(limit, max(-limit, angle))


def steering_rate(target_angle: float, angle: float, dt_s: float, limit: float) -> float:
    """
    Compute the steering rate that reaches the target within the step (CRG 27), within a limit.

    :param target_angle: delta* [rad]
    :param angle: delta [rad]
    :param dt_s: Delta t_eff [s]
    :param limit: the vehicle's largest steering rate; infinite in the paper [rad/s]
    :return: steering rate [rad/s]
    """
    return min(limit, max(-limit, (target_angle - angle) / dt_s))
