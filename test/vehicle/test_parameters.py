# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Vehicle parameters: the shipped car against its sources, and refusals."""

import math
from pathlib import Path
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.paths import config_directory
from crgame_ros.vehicle.parameters import load_vehicle_parameters
import pytest
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
import yaml

SHIPPED = config_directory() / 'vehicles' / 'bmw_320i.yaml'


def write_vehicle(folder: Path, changes: dict[str, Any]) -> str:
    """Write the shipped car with changes (None removes a key) and return the file's path."""
    values = yaml.safe_load(SHIPPED.read_text(encoding='utf-8')) | changes
    path = folder / 'car.yaml'
    path.write_text(yaml.safe_dump({key: value for key, value in values.items()
                                    if value is not None}), encoding='utf-8')
    return str(path)


def test_shipped_car_is_commonroad_vehicle_2() -> None:
    """The values that the file attributes to commonroad-vehicle-models come from there."""
    ours, theirs = load_vehicle_parameters(), parameters_vehicle2()
    assert ours.name == 'bmw_320i'
    assert (ours.length, ours.width, ours.mass) == pytest.approx((theirs.l, theirs.w, theirs.m))
    assert ours.wheelbase == pytest.approx(theirs.a + theirs.b, abs=1e-6)
    assert ours.rear_to_center == pytest.approx(theirs.b, abs=1e-6)
    assert ours.max_speed == theirs.longitudinal.v_max
    assert ours.max_reverse_speed == pytest.approx(-theirs.longitudinal.v_min, abs=0.1)
    assert ours.max_acceleration == theirs.longitudinal.a_max
    assert ours.max_steering_rate == theirs.steering.v_max
    assert ours.friction == pytest.approx(theirs.tire.p_dy1, abs=1e-4)


def test_constants_of_the_paper() -> None:
    """CRG 20 (k_th, k_br) and CRG 26 (450 degrees of steering wheel, 0.91 rad at the wheels)."""
    car = load_vehicle_parameters()
    assert (car.throttle_shape, car.brake_shape, car.max_steering_angle) == (4.0, 3.0, 0.91)
    assert math.degrees(car.max_steering_wheel_angle) == pytest.approx(450.0, abs=0.5)


def test_reference_point_is_not_half_the_wheelbase() -> None:
    """The centre is l_r = 1.4227 m ahead of the rear axle, not L / 2 = 1.2895 m."""
    assert load_vehicle_parameters().rear_to_center == pytest.approx(1.4227, abs=1e-4)
    assert load_vehicle_parameters().shape.length == 4.508


def test_file_of_the_users_own(tmp_path: Path) -> None:
    """A path works as a name, its ratio table is beside it, infinity lifts the rate limit."""
    (tmp_path / 'steering_ratio.yaml').write_text('{}', encoding='utf-8')
    changes = {'name': 'mine', 'mass': 2000, 'max_steering_rate': math.inf, 'drag_coefficient': 0}
    car = load_vehicle_parameters(write_vehicle(tmp_path, changes))
    assert (car.name, car.mass, car.max_steering_rate) == ('mine', 2000.0, math.inf)
    assert car.drag_coefficient == 0.0
    assert car.steering_ratio == str(tmp_path / 'steering_ratio.yaml')


@pytest.mark.parametrize(('changes', 'named'), [
    ({'mass': None}, '"mass" is missing'), ({'colour': 'red'}, '"colour" is unknown'),
    ({'mass': 'heavy'}, '"mass" is \'heavy\''), ({'mass': True}, '"mass" is True'),
    ({'mass': math.nan}, '"mass" is nan'), ({'mass': -1.0}, '"mass" is -1.0'),
    ({'mass': 0.0}, '"mass" is 0.0'), ({'mass': math.inf}, '"mass" is inf'),
    ({'mass': 10**400}, 'is no YAML (a number has 401 digits'),
    ({'rear_to_center': 1e308}, '"rear_to_center" is 1e+308'),
    ({'length': 101}, '"length" is 101'),
    ({'wheelbase': 0}, '"wheelbase" is 0'), ({'mass': 1e-300}, '"mass" is 1e-300'),
    ({'longitudinal_lag': 0.0}, '"longitudinal_lag" is 0.0'),
    ({'max_steering_rate': -0.4}, '"max_steering_rate" is -0.4'),
    ({'rolling_resistance': -0.1}, '"rolling_resistance" is -0.1')])
def test_bad_value_is_refused(tmp_path: Path, changes: dict[str, Any], named: str) -> None:
    """The message names the file and the key."""
    path = write_vehicle(tmp_path, changes)
    with pytest.raises(InputError) as caught:
        load_vehicle_parameters(path)
    assert str(caught.value).startswith(f'{path}: {named}')


@pytest.mark.parametrize(('content', 'named'), [
    (b'- 1\n', 'is no mapping'), (b'mass: [1', 'is no YAML'), (b'\xff\xfe\x00', 'is no YAML'),
    (b'', 'is no mapping')])
def test_other_content_is_refused(tmp_path: Path, content: bytes, named: str) -> None:
    """Files without a vehicle are refused."""
    path = tmp_path / 'car.yaml'
    path.write_bytes(content)
    with pytest.raises(InputError, match=named):
        load_vehicle_parameters(str(path))


def test_unknown_name_is_refused() -> None:
    """The remedy says where to find the names."""
    with pytest.raises(InputError, match='trabant.yaml: there is no such vehicle; name a file'):
        load_vehicle_parameters('trabant')
