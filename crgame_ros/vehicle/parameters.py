# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Vehicle parameters, read from `config/vehicles/`."""

from dataclasses import dataclass, fields
import functools
import math
from pathlib import Path
import sys
from typing import Any

import yaml

from crgame_ros.errors import InputError
from crgame_ros.geometry.shape import Shape
from crgame_ros.paths import config_directory

DEFAULT_VEHICLE = 'bmw_320i'
# Switched off by 0, and without a limit, respectively; all others divide or bound something.
MAY_BE_ZERO = {'rear_to_center', 'max_reverse_speed', 'drag_coefficient', 'frontal_area',
               'rolling_resistance', 'air_density', 'friction', 'max_brake_force'}
MAY_BE_INFINITE = {'max_steering_rate'}


@dataclass(frozen=True)
class VehicleParameters:
    """
    Parameters of one vehicle type; units and sources stand in its file in `config/vehicles/`.

    Lengths [m], speeds [m/s], accelerations [m/s^2], angles [rad], forces [N], power [W].
    """

    name: str
    length: float
    width: float
    wheelbase: float
    rear_to_center: float
    mass: float
    max_speed: float
    max_reverse_speed: float
    max_acceleration: float
    switching_speed: float
    max_steering_angle: float
    max_steering_rate: float
    max_steering_wheel_angle: float
    steering_ratio: str
    throttle_shape: float
    brake_shape: float
    max_power: float
    speed_regularization: float
    friction: float
    max_brake_force: float
    drag_coefficient: float
    frontal_area: float
    rolling_resistance: float
    air_density: float
    gravity: float
    longitudinal_lag: float

    @property
    def shape(self) -> Shape:
        """Footprint of the vehicle around its centre."""
        return Shape.rectangle(self.length, self.width)


@functools.cache
def load_vehicle_parameters(name: str = DEFAULT_VEHICLE) -> VehicleParameters:
    """
    Read the parameters of a vehicle type.

    :param name: a name in `config/vehicles/`, or the path of a YAML file.
    :raises InputError: if the file is missing or a value is missing, unknown or no number.
    """
    path = config_directory() / 'vehicles' / f'{name}.yaml'
    if name.endswith('.yaml'):
        path = Path(name)
    try:
        values = yaml.safe_load(path.read_text(encoding='utf-8'))
    except OSError as error:
        raise InputError(f'cannot read the vehicle ({error.strerror})', str(path),
                         'name a file of config/vehicles without its ending') from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f'is no YAML ({error})', str(path), 'mend the file') from error
    if not isinstance(values, dict):
        raise InputError('is no mapping', str(path), 'see config/vehicles/bmw_320i.yaml')
    return VehicleParameters(**_checked(values, path))


def _checked(values: dict[str, Any], path: Path) -> dict[str, Any]:
    texts = {'name', 'steering_ratio'}
    known = {field.name for field in fields(VehicleParameters)}
    for key in sorted(known - values.keys()):
        raise InputError(f'"{key}" is missing', str(path), 'see config/vehicles/bmw_320i.yaml')
    for key in sorted(values.keys() - known):
        raise InputError(f'"{key}" is unknown', str(path), 'remove it')
    checked: dict[str, Any] = {}
    for key, value in values.items():
        if key in texts:
            checked[key] = str(value)
            continue
        checked[key] = _number(key, value, path)
    table = Path(checked['steering_ratio'])
    checked['steering_ratio'] = str(table if table.is_absolute() else path.parent / table)
    return checked


def _number(key: str, value: Any, path: Path) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f'"{key}" is {value!r}', str(path), 'give a number')
    largest = math.inf if key in MAY_BE_INFINITE else sys.float_info.max
    if key in MAY_BE_ZERO and value == 0:
        return 0.0
    if not 0 < value <= largest:
        least = 'at least 0' if key in MAY_BE_ZERO else 'above 0'
        raise InputError(f'"{key}" is {value!r}', str(path), f'give a finite number {least}')
    return float(value)
