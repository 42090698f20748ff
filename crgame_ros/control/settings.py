# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Gains and lags of `config/control.yaml`, checked; options of a game come before them."""

from dataclasses import dataclass, field, fields, replace
import functools
from pathlib import Path
from typing import Any, TypeVar

import yaml

from crgame_ros.errors import InputError
from crgame_ros.paths import config_directory
from crgame_ros.scenario.checked_values import build

T = TypeVar('T')
# A lag below this is none to a step of 10 ms, and makes the lag's equations stiff [s].
SHORTEST_LAG_S = 0.001


def _within(low: float, high: float) -> Any:
    return field(metadata={'bounds': (low, high)})


@dataclass(frozen=True)
class DynamicBicycleSettings:
    """
    What FS equation 2 leaves open.

    :param slip: slipping coefficient G_s in [0, 1], 1 without slip [-]
    :param steering_lag: T_delta [s]
    :param acceleration_lag: T_a [s]
    """

    slip: float = _within(0.0, 1.0)
    steering_lag: float = _within(SHORTEST_LAG_S, 5.0)
    acceleration_lag: float = _within(SHORTEST_LAG_S, 5.0)


@dataclass(frozen=True)
class SpeedSettings:
    """
    Gains of speed control.

    :param speed_gain: k_v [1/s]
    :param integral_gain: k_i [1/s^2]
    :param position_gain: k_s [1/s]
    :param integral_limit: largest contribution of the integral [m/s^2]
    :param correction_limit: largest deviation from the planned acceleration [m/s^2]
    """

    speed_gain: float = _within(0.01, 20.0)
    integral_gain: float = _within(0.0, 20.0)
    position_gain: float = _within(0.0, 20.0)
    integral_limit: float = _within(0.0, 20.0)
    correction_limit: float = _within(0.0, 20.0)


@dataclass(frozen=True)
class PurePursuitSettings:
    """
    Look-ahead distance l_d = k v of pure pursuit, between its bounds (Snider 2009, section 2.2).

    :param look_ahead_time: k [s]
    :param shortest_look_ahead: [m]
    :param longest_look_ahead: [m]
    """

    look_ahead_time: float = _within(0.05, 10.0)
    shortest_look_ahead: float = _within(0.1, 100.0)
    longest_look_ahead: float = _within(0.1, 1000.0)


@dataclass(frozen=True)
class LqrSettings:
    """
    Weights of the LQR by Bryson's rule: each term costs 1 where it reaches the value given.

    :param feed_forward: whether the plan's curvature is steered ahead of any error
    :param lateral_error: [m]
    :param heading_error: [rad]
    :param correction: lateral acceleration of the steering correction [m/s^2]
    :param steering_correction: its steering angle, the bound at low speed [rad]
    """

    feed_forward: bool
    lateral_error: float = _within(0.001, 100.0)
    heading_error: float = _within(0.001, 10.0)
    correction: float = _within(0.001, 100.0)
    steering_correction: float = _within(0.001, 10.0)


@dataclass(frozen=True)
class ControlSettings:
    """The sections of `config/control.yaml`."""

    dynamic_bicycle: DynamicBicycleSettings
    speed_control: SpeedSettings
    pure_pursuit: PurePursuitSettings
    lqr: LqrSettings


def load_control_settings(path: Path) -> ControlSettings:
    """
    Read a file of gains and lags.

    :raises InputError: if it cannot be read, or a value is missing, unknown or out of bounds.
    """
    try:
        values = yaml.safe_load(path.read_text(encoding='utf-8'))
    except OSError as error:
        raise InputError(f'cannot read the gains ({error.strerror})', str(path)) from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f'is no YAML ({error})', str(path), 'mend the file') from error
    kinds: dict[str, type[Any]] = {
        'dynamic-bicycle': DynamicBicycleSettings, 'speed-control': SpeedSettings,
        'pure-pursuit': PurePursuitSettings, 'lqr': LqrSettings}
    if not isinstance(values, dict) or values.keys() != kinds.keys():
        raise InputError('has other sections', str(path), f'give {", ".join(kinds)}')
    sections = {}
    for name, kind in kinds.items():
        where = f'{path}: {name}'
        sections[name.replace('-', '_')] = _checked(build(kind, values[name], where), where)
    return ControlSettings(**sections)


@functools.cache
def control_settings() -> ControlSettings:
    """
    Give the package's own gains and lags.

    :raises InputError: if `config/control.yaml` cannot be used.
    """
    return load_control_settings(config_directory() / 'control.yaml')


def with_options(settings: T, where: str, **options: float | bool | None) -> T:
    """
    Put options of a game before settings.

    :param where: what the options belong to, for messages
    :param options: values by name; None leaves the setting
    :raises InputError: if a value is out of bounds.
    """
    given = {key: value for key, value in options.items() if value is not None}
    return _checked(replace(settings, **given), where)  # type: ignore[type-var]


def _checked(settings: T, where: str) -> T:
    for item in fields(settings):  # type: ignore[arg-type]
        if 'bounds' not in item.metadata:
            continue
        low, high = item.metadata['bounds']
        value = getattr(settings, item.name)
        if not low <= value <= high:
            raise InputError(f'"{item.name}" is {value!r}', where,
                             f'give a number from {low:g} to {high:g}')
    return settings
