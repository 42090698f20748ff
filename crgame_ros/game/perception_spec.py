# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The perception of an AV in a game file (FS II-B)."""

from dataclasses import dataclass, field
import math
from typing import Annotated, ClassVar

from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Listed, Named, Numbered, Parts, Within, Wording

DEFAULT_SENSOR_MODEL = 'ray-caster'
MAX_SENSORS = 32
# A filter's gain needs some noise in every measurement.
_LEAST_NOISE = 1e-6
Name = Annotated[str, Numbered('sensor'), Wording(
    '[a-z][a-z0-9_]{0,31}', 'begin with a-z and use a-z, 0-9 and _ only, 32 at most')]
Metres = Annotated[float, Within(-50.0, 50.0)]
Noise = Annotated[float, Within(0.0, 100.0)]
SomeNoise = Annotated[float, Within(_LEAST_NOISE, 100.0)]
Rate = Annotated[float, Within(0.01, 10000.0)]
Seed = Annotated[int, Within(0, 2**63 - 1)]


@dataclass(frozen=True)
class LocalisationSpec:
    """
    Biased white noise on the true pose, and the further inputs of the filter (FS II-B1).

    The pose is measured at `rate`, as by satellite receiver and compass; speed at `rate` by wheel
    encoders, also in dropouts; changes of speed and heading at each simulation step by an inertial
    unit. Defaults: a differential receiver with 10 Hz, and inertial sensors of automotive grade.
    The filter knows every noise but no bias.

    :param position_noise: standard deviation of a measured x or y [m]
    :param yaw_noise: of a measured heading [rad]
    :param speed_noise: of a measured speed [m/s]; of a standing vehicle 0.01 m/s at most
    :param position_bias: constant error (x, y) of measured positions, in frame map [m]
    :param yaw_bias: constant error of measured headings [rad]
    :param bias_walk: random walk of the position's bias [m/sqrt(s)]
    :param rate: of measurements [Hz]
    :param acceleration_noise: velocity random walk of the inertial unit [m/s/sqrt(s)]
    :param yaw_rate_noise: angle random walk of the inertial unit [rad/sqrt(s)]
    :param motion_noise: deviation from the kinematic model that the filter assumes; not injected
        [m/sqrt(s)]
    :param dropout_rate: frequency of pose dropouts, as in an urban canyon [1/s]
    :param dropout_duration: their duration [s]
    """

    FORM: ClassVar[Form] = Form('give {} for a noisy pose, null for the true one')

    position_noise: SomeNoise = 0.1
    yaw_noise: Annotated[float, Within(_LEAST_NOISE, math.pi)] = 0.01
    speed_noise: SomeNoise = 0.1
    position_bias: Annotated[tuple[float, float], Parts(('x', 'y')),
                             Within(-1000.0, 1000.0)] = (0.0, 0.0)
    yaw_bias: Annotated[float, Within(-math.pi, math.pi)] = 0.0
    bias_walk: Noise = 0.0
    rate: Rate = 10.0
    acceleration_noise: Noise = 0.02
    yaw_rate_noise: Noise = 0.002
    motion_noise: Noise = 0.0
    dropout_rate: Annotated[float, Within(0.0, 1000.0)] = 0.0
    dropout_duration: Annotated[float, Within(0.0, 3600.0)] = 2.0


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
    :param latency: from a scan to the output of its objects [s]
    :param range_noise: standard deviation of a ray's range, for display and recording [m]
    :param position_noise: of an object's x or y, once for each scan [m]
    :param yaw_noise: of its heading [rad]
    :param velocity_noise: of each component of its velocity; static objects have none [m/s]
    :param min_rays: number of rays that have to hit an object for its detection
    :param options: further constructor arguments of a model of the user's own
    """

    FORM: ClassVar[Form] = Form('see docs/perception.md for the keys', written='all')

    name: Name
    model: Annotated[str, Named()] = DEFAULT_SENSOR_MODEL
    x: Metres | None = None
    y: Metres = 0.0
    yaw: Annotated[float, Within(-2.0 * math.pi, 2.0 * math.pi)] = 0.0
    field_of_view: Annotated[float, Within(1e-3, 2.0 * math.pi)] = math.radians(120.0)
    horizon: Annotated[float, Within(0.1, 1000.0)] = 80.0
    rays: Annotated[int, Within(1, 10000)] = 361
    rate: Rate = 10.0
    latency: Annotated[float, Within(0.0, 10.0)] = 0.0
    range_noise: Noise = 0.03
    position_noise: Noise = 0.05
    yaw_noise: Annotated[float, Within(0.0, math.pi)] = 0.01
    velocity_noise: Noise = 0.2
    min_rays: Annotated[int, Within(1, 10000)] = 1
    options: dict[str, object] = field(default_factory=dict)

    def mount(self, rear_to_center: float, length: float) -> tuple[float, float, float]:
        """
        Return its x, y [m] and yaw [rad] on the rear axle of a vehicle.

        :param rear_to_center: from the vehicle's rear axle to its centre [m]
        :param length: of the vehicle, for a place in its front bumper [m]
        """
        return (rear_to_center + 0.5 * length if self.x is None else self.x, self.y, self.yaw)


@dataclass(frozen=True)
class PerceptionSpec:
    """
    An AV's perception.

    :param localisation: None gives the true pose
    :param sensors: an empty list gives the true states of all objects
    :param memory: how long an object is kept after the first scan that misses it [s]
    :param seed: of all its noise; None takes the game's
    """

    FORM: ClassVar[Form] = Form(
        'give {} for a front lidar and a noisy pose, or see docs/perception.md', written='all')

    localisation: LocalisationSpec | None = LocalisationSpec()
    sensors: Annotated[tuple[SensorSpec, ...], Listed(0, MAX_SENSORS, 'sensor', 'name')] = (
        SensorSpec('front'),)
    memory: Annotated[float, Within(0.0, 3600.0)] = 1.0
    seed: Seed | None = None
