# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a game file says of an AV's perception (FS II-B)."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
import math
from pathlib import Path
import re
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.scenario.checked_values import build, named_file, short

DEFAULT_SENSOR_MODEL = 'ray-caster'
MAX_SENSORS = 32
_NAME = re.compile(r'[a-z][a-z0-9_]{0,31}')
# A filter's gain needs some noise in every measurement.
_LEAST_NOISE = 1e-6
BOUNDS: dict[str, tuple[float, float]] = {
    'position_noise': (_LEAST_NOISE, 100.0), 'yaw_noise': (_LEAST_NOISE, math.pi),
    'speed_noise': (_LEAST_NOISE, 100.0), 'yaw_bias': (-math.pi, math.pi),
    'bias_walk': (0.0, 100.0), 'rate': (0.01, 10000.0), 'acceleration_noise': (0.0, 100.0),
    'yaw_rate_noise': (0.0, 100.0), 'motion_noise': (0.0, 100.0), 'dropout_rate': (0.0, 1000.0),
    'dropout_duration': (0.0, 3600.0), 'field_of_view': (1e-3, 2.0 * math.pi),
    'horizon': (0.1, 1000.0), 'rays': (1, 10000), 'latency': (0.0, 10.0),
    'range_noise': (0.0, 100.0), 'velocity_noise': (0.0, 100.0), 'min_rays': (1, 10000),
    'memory': (0.0, 3600.0), 'x': (-50.0, 50.0), 'y': (-50.0, 50.0),
    'yaw': (-2.0 * math.pi, 2.0 * math.pi), 'seed': (0, 2**63 - 1)}
# What a sensor says of objects may be exact.
_SENSOR_BOUNDS = BOUNDS | {'position_noise': (0.0, 100.0), 'yaw_noise': (0.0, math.pi)}
_MAX_BIAS = 1000.0


@dataclass(frozen=True)
class LocalisationSpec:
    """
    Biased white noise on the true pose, and what the filter is fed with besides (FS II-B1).

    The pose is measured at `rate`, as by satellite receiver and compass; speed at `rate` by wheel
    encoders, also in dropouts; changes of speed and heading at each simulation step by an inertial
    unit. Defaults: a differential receiver with 10 Hz, and inertial sensors of the grade built
    into cars. The filter knows every noise but no bias.

    :param position_noise: standard deviation of a measured x or y [m]
    :param yaw_noise: of a measured heading [rad]
    :param speed_noise: of a measured speed [m/s]; of a standing vehicle 0.01 m/s at most
    :param position_bias: constant error (x, y) of measured positions, in frame map [m]
    :param yaw_bias: constant error of measured headings [rad]
    :param bias_walk: random walk of the position's bias [m/sqrt(s)]
    :param rate: of measurements [Hz]
    :param acceleration_noise: velocity random walk of the inertial unit [m/s/sqrt(s)]
    :param yaw_rate_noise: angle random walk of the inertial unit [rad/sqrt(s)]
    :param motion_noise: how far the filter takes the vehicle to move off its kinematic model; not
        injected [m/sqrt(s)]
    :param dropout_rate: how often the pose gets lost, as in an urban canyon [1/s]
    :param dropout_duration: how long it stays lost [s]
    """

    position_noise: float = 0.1
    yaw_noise: float = 0.01
    speed_noise: float = 0.1
    position_bias: tuple[float, float] = (0.0, 0.0)
    yaw_bias: float = 0.0
    bias_walk: float = 0.0
    rate: float = 10.0
    acceleration_noise: float = 0.02
    yaw_rate_noise: float = 0.002
    motion_noise: float = 0.0
    dropout_rate: float = 0.0
    dropout_duration: float = 2.0


@dataclass(frozen=True)
class SensorSpec:
    """
    A ranger on the vehicle (FS II-B2). The defaults are a scanning lidar in the front bumper.

    :param name: unique on its vehicle
    :param model: a registered sensor, `module:Class` or `file.py:Class`
    :param x: mounting point ahead of the rear axle [m]; None is the front bumper
    :param y: to the left of it [m]
    :param yaw: mounting direction, counter-clockwise from ahead [rad]
    :param field_of_view: full angle, around the mounting direction [rad]
    :param horizon: range [m]
    :param rays: number of rays over the field of view
    :param rate: of scans [Hz]
    :param latency: from a scan to its objects being known [s]
    :param range_noise: standard deviation of a ray's range, for display and recording [m]
    :param position_noise: of an object's x or y, once for each scan [m]
    :param yaw_noise: of its heading [rad]
    :param velocity_noise: of each component of its velocity; static objects have none [m/s]
    :param min_rays: rays that have to reach an object for it to be seen
    :param options: further constructor arguments of a model of the user's own
    """

    name: str
    model: str = DEFAULT_SENSOR_MODEL
    x: float | None = None
    y: float = 0.0
    yaw: float = 0.0
    field_of_view: float = math.radians(120.0)
    horizon: float = 80.0
    rays: int = 361
    rate: float = 10.0
    latency: float = 0.0
    range_noise: float = 0.03
    position_noise: float = 0.05
    yaw_noise: float = 0.01
    velocity_noise: float = 0.2
    min_rays: int = 1
    options: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class PerceptionSpec:
    """
    An AV's perception.

    :param localisation: None knows the true pose
    :param sensors: an empty tuple sees everything, as it is
    :param memory: how long an object is remembered after the first scan that misses it [s]
    :param seed: of all its noise; None takes the game's
    """

    localisation: LocalisationSpec | None = LocalisationSpec()
    sensors: tuple[SensorSpec, ...] = (SensorSpec('front'),)
    memory: float = 1.0
    seed: int | None = None


def parse_perception(values: Any, where: str, base: Path) -> PerceptionSpec:
    """
    Check the key `perception` of a game file.

    :param values: what YAML gave
    :param where: file and key for messages
    :param base: directory against which its file names are resolved
    :raises InputError: naming the key and the remedy.
    """
    if not isinstance(values, Mapping):
        raise InputError('is no mapping', where,
                         'give {} for a front lidar and a noisy pose, or see docs/perception.md')
    table = dict(values)
    if table.get('localisation') is not None:
        table['localisation'] = _localisation(
            table['localisation'], f'{where}: localisation')
    if 'sensors' in table:
        table['sensors'] = _sensors(table['sensors'], where, base)
    return build(PerceptionSpec, table, where, BOUNDS)


def perception_entry(spec: PerceptionSpec) -> dict[str, Any]:
    """Give the YAML values that `parse_perception` makes the same specification of."""
    values = asdict(spec)
    values['sensors'] = list(values['sensors'])
    if values['localisation'] is not None:
        values['localisation']['position_bias'] = list(values['localisation']['position_bias'])
    return values


def _localisation(values: Any, where: str) -> LocalisationSpec:
    if not isinstance(values, Mapping):
        raise InputError('is no mapping', where, 'give {} for a noisy pose, null for the true one')
    table = dict(values)
    if 'position_bias' in table:
        bias = table['position_bias']
        if not (isinstance(bias, list | tuple) and len(bias) == 2 and all(map(_is_bias, bias))):
            raise InputError(f'"position_bias" is {short(bias)}', where,
                             f'give two numbers [x, y] of at most {_MAX_BIAS:g} m')
        table['position_bias'] = (float(bias[0]), float(bias[1]))
    return build(LocalisationSpec, table, where, BOUNDS)


def _is_bias(value: Any) -> bool:
    return (isinstance(value, int | float) and not isinstance(value, bool)
            and abs(value) <= _MAX_BIAS)


def _sensors(values: Any, where: str, base: Path) -> tuple[SensorSpec, ...]:
    if not isinstance(values, list):
        raise InputError('"sensors" is no list', where,
                         'give one entry for each sensor, [] to see everything')
    if len(values) > MAX_SENSORS:
        raise InputError(f'"sensors" has {len(values)} entries', where,
                         f'give {MAX_SENSORS} at most')
    specs: list[SensorSpec] = []
    for index, entry in enumerate(values):
        place = f'{where}: sensors[{index}]'
        if not isinstance(entry, Mapping):
            raise InputError('is no mapping', place, 'see docs/perception.md for the keys')
        table = {'name': f'sensor{index}', **entry}
        if isinstance(table.get('model'), str):
            table['model'] = named_file(table['model'], base)
        spec = build(SensorSpec, table, place, _SENSOR_BOUNDS)
        if not _NAME.fullmatch(spec.name):
            raise InputError(f'"name" is {short(spec.name)}', place,
                             'begin with a-z and use a-z, 0-9 and _ only, 32 at most')
        if spec.name in {other.name for other in specs}:
            raise InputError(f'"{spec.name}" is there already', place,
                             'give each sensor its own name')
        specs.append(spec)
    return tuple(specs)
