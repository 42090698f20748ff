# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Vehicle parameters, read from `config/vehicles/`."""

from dataclasses import dataclass, replace
import functools
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from crgame_ros.errors import InputError
from crgame_ros.geometry.shape import Shape
from crgame_ros.paths import config_directory
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Named, Within
from crgame_ros.schema.reading import read
from crgame_ros.yaml_text import read_yaml

# The usual vehicle of a map, by the type of vehicle that its lanes are for.
AUTO = 'auto'
USUAL_VEHICLES = {'car': 'bmw_320i', 'bicycle': 'bicycle'}
# No road vehicle has larger values; beyond them arithmetic overflows.
LARGEST, SMALLEST = 1e9, 1e-6
Positive = Annotated[float, Within(SMALLEST, LARGEST)]
Share = Annotated[float, Within(SMALLEST, LARGEST, or_zero=True)]
Length = Annotated[float, Within(SMALLEST, 100.0)]
# A place in the vehicle; 0 for the usual one of its size.
Place = Annotated[float, Within(SMALLEST, 100.0, or_zero=True)]


class _Beside(Named):
    """A file of any name in the folder of the vehicle's file."""

    def resolved(self, name: str, base: Path) -> str:
        return str(base / name)


@dataclass(frozen=True)
class VehicleParameters:
    """
    Parameters of one vehicle type; 0 switches an effect off.

    :param name: of the vehicle type.
    :param length: of its rectangle [m]
    :param width: of its rectangle [m]
    :param wheelbase: between the axles [m]
    :param rear_to_center: from the rear axle forward to the centre [m]
    :param mass: [kg]
    :param max_speed: forwards [m/s]
    :param max_reverse_speed: backwards [m/s]
    :param max_acceleration: a_max of CRG 24 [m/s^2]
    :param switching_speed: above which power limits acceleration [m/s]
    :param max_steering_angle: of the front wheels [rad]
    :param max_steering_rate: of the front wheels; infinite in the paper [rad/s]
    :param max_steering_wheel_angle: to either side [rad]
    :param steering_ratio: file of the ratio table R(v, theta_sw) of CRG 26, beside the vehicle's.
    :param throttle_shape: k_th of CRG 20 [-]
    :param brake_shape: k_br of CRG 20 [-]
    :param max_power: of the engine [W]
    :param speed_regularization: epsilon_v of CRG 21 [m/s]
    :param friction: peak friction of tyres and road [-]
    :param max_brake_force: of all wheels [N]
    :param drag_coefficient: c_w [-]
    :param frontal_area: [m^2]
    :param rolling_resistance: coefficient [-]
    :param air_density: [kg/m^3]
    :param gravity: [m/s^2]
    :param longitudinal_lag: tau_long of CRG 25: drivetrain and brakes [s]
    :param type: of CommonRoad; decides its look, and where it starts.
    :param powertrain: its sound in the cockpit; it does not affect the motion.
    :param height: of the roof; 0 for a usual one of its length [m]
    :param eye_ahead: the driver's eyes ahead of the rear axle; 0 for a usual place [m]
    :param eye_left: the driver's eyes to the left of the middle, negative to the right [m]
    :param eye_height: the driver's eyes above the road; 0 for a usual place [m]
    :param mirror_ahead: the outer mirrors ahead of the rear axle; 0 for a usual place [m]
    :param mirror_left: the left one to the left of the middle; 0 for just outside [m]
    :param mirror_height: the outer mirrors above the road; 0 for a usual place [m]
    :param bonnet_height: its highest line above the road; 0 for a usual one [m]
    """

    FORM: ClassVar[Form] = Form('see config/vehicles/bmw_320i.yaml')

    name: str
    length: Length
    width: Annotated[float, Within(SMALLEST, 20.0)]
    wheelbase: Length
    rear_to_center: Annotated[float, Within(SMALLEST, 100.0, or_zero=True)]
    mass: Positive
    max_speed: Annotated[float, Within(SMALLEST, 200.0)]
    max_reverse_speed: Annotated[float, Within(SMALLEST, 200.0, or_zero=True)]
    max_acceleration: Positive
    switching_speed: Positive
    max_steering_angle: Annotated[float, Within(SMALLEST, 1.5)]
    max_steering_rate: Annotated[float, Within(SMALLEST, endless=True)]
    max_steering_wheel_angle: Positive
    steering_ratio: Annotated[str, _Beside()]
    throttle_shape: Positive
    brake_shape: Positive
    max_power: Positive
    speed_regularization: Positive
    friction: Share
    max_brake_force: Share
    drag_coefficient: Share
    frontal_area: Share
    rolling_resistance: Share
    air_density: Share
    gravity: Positive
    longitudinal_lag: Positive
    type: Literal['car', 'truck', 'bus', 'motorcycle', 'bicycle'] = 'car'  # noqa: A003
    powertrain: Literal['combustion', 'electric', 'muscle'] = 'combustion'
    height: Place = 0.0
    eye_ahead: Place = 0.0
    eye_left: Annotated[float, Within(-10.0, 10.0)] = 0.36
    eye_height: Place = 0.0
    mirror_ahead: Place = 0.0
    mirror_left: Place = 0.0
    mirror_height: Place = 0.0
    bonnet_height: Place = 0.0

    @property
    def shape(self) -> Shape:
        """Return the footprint of the vehicle around its centre."""
        return Shape.rectangle(self.length, self.width)

    @property
    def front(self) -> float:
        """Return the distance from the rear axle forward to the front bumper [m]."""
        return self.rear_to_center + 0.5 * self.length

    @property
    def rear(self) -> float:
        """Return the position of the rear bumper ahead of the rear axle, negative [m]."""
        return self.rear_to_center - 0.5 * self.length

    def on_road(self, friction: float | None) -> 'VehicleParameters':
        """
        Return the vehicle on a road that grips less than its tyres could.

        :param friction: peak friction of the road; None for one as good as the tyres [-]
        """
        if friction is None or 0.0 < self.friction <= friction:
            return self
        most = friction * self.gravity
        return replace(self, friction=friction,
                       max_acceleration=min(self.max_acceleration, most),
                       max_brake_force=min(self.max_brake_force, self.mass * most))


@functools.cache
def load_vehicle_parameters(name: str = AUTO, map_type: str = 'car') -> VehicleParameters:
    """
    Read the parameters of a vehicle type.

    :param name: a name in `config/vehicles/`, the path of a YAML file, or `auto`: the usual one.
    :param map_type: `RoadNetwork.vehicle_type` of the map.
    :raises InputError: if the file is missing or a value is missing, unknown or no number.
    """
    name = USUAL_VEHICLES[map_type] if name == AUTO else name
    path = config_directory() / 'vehicles' / f'{name}.yaml'
    if name.endswith('.yaml'):
        path = Path(name)
    if not path.exists():
        raise InputError('there is no such vehicle', str(path),
                         'name a file of config/vehicles without its ending')
    return read(VehicleParameters, read_yaml(path, 'vehicle'), str(path), path.parent)
