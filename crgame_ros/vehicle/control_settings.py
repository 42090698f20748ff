# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Gains and lags of `config/control.yaml`, checked; options of a game override them."""

from dataclasses import dataclass
import functools
from pathlib import Path
from typing import Annotated, TypeVar

from crgame_ros.paths import config_directory
from crgame_ros.schema.marks import Called, Within
from crgame_ros.schema.reading import read
from crgame_ros.yaml_text import read_yaml

T = TypeVar('T')
# A shorter lag is negligible in a step of 10 ms, and makes the lag's equations stiff [s].
SHORTEST_LAG_S = 0.001


@dataclass(frozen=True)
class DynamicBicycleSettings:
    """
    The parameters that FS equation 2 leaves open.

    :param slip: slipping coefficient G_s in [0, 1], 1 without slip [-]
    :param steering_lag: T_delta [s]
    :param acceleration_lag: T_a [s]
    """

    slip: Annotated[float, Within(0.0, 1.0)]
    steering_lag: Annotated[float, Within(SHORTEST_LAG_S, 5.0)]
    acceleration_lag: Annotated[float, Within(SHORTEST_LAG_S, 5.0)]


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

    speed_gain: Annotated[float, Within(0.01, 20.0)]
    integral_gain: Annotated[float, Within(0.0, 20.0)]
    position_gain: Annotated[float, Within(0.0, 20.0)]
    integral_limit: Annotated[float, Within(0.0, 20.0)]
    correction_limit: Annotated[float, Within(0.0, 20.0)]


@dataclass(frozen=True)
class PurePursuitSettings:
    """
    Look-ahead distance l_d = k v of pure pursuit, between its bounds (Snider 2009, section 2.2).

    :param look_ahead_time: look-ahead distance over speed, k [s]
    :param shortest_look_ahead: shortest look-ahead distance [m]
    :param longest_look_ahead: longest look-ahead distance [m]
    """

    look_ahead_time: Annotated[float, Within(0.05, 10.0)]
    shortest_look_ahead: Annotated[float, Within(0.1, 100.0)]
    longest_look_ahead: Annotated[float, Within(0.1, 1000.0)]


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
    lateral_error: Annotated[float, Within(0.001, 100.0)]
    heading_error: Annotated[float, Within(0.001, 10.0)]
    correction: Annotated[float, Within(0.001, 100.0)]
    steering_correction: Annotated[float, Within(0.001, 10.0)]


@dataclass(frozen=True)
class ControlSettings:
    """
    The sections of `config/control.yaml`.

    :param dynamic_bicycle: slip and lags of the vehicle.
    :param speed_control: gains of speed control, of both trackers.
    :param pure_pursuit: look-ahead of pure pursuit.
    :param lqr: weights of the LQR.
    """

    dynamic_bicycle: Annotated[DynamicBicycleSettings, Called('dynamic-bicycle')]
    speed_control: Annotated[SpeedSettings, Called('speed-control')]
    pure_pursuit: Annotated[PurePursuitSettings, Called('pure-pursuit')]
    lqr: LqrSettings


def load_control_settings(path: Path) -> ControlSettings:
    """
    Read a file of gains and lags.

    :raises InputError: if it cannot be read, or a value is missing, unknown or out of bounds.
    """
    return read(ControlSettings, read_yaml(path, 'file of gains'), str(path))


@functools.cache
def control_settings() -> ControlSettings:
    """
    Return the package's own gains and lags.

    :raises InputError: if `config/control.yaml` cannot be used.
    """
    return load_control_settings(config_directory() / 'control.yaml')


def with_options(settings: T, where: str, **options: float | bool | None) -> T:
    """
    Return settings with the options of a game.

    :param where: the owner of the options, for messages
    :param options: values by name; None keeps the setting
    :raises InputError: if a value is out of bounds.
    """
    given = {key: value for key, value in options.items() if value is not None}
    return read(type(settings), {**vars(settings), **given}, where)
