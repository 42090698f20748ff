# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Steering wheel to front wheels (CRG 26-27)."""

from dataclasses import replace
import math
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.steering import load_steering_ratio, Steering, steering_rate
import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator
import yaml

VEHICLE = load_vehicle_parameters()
GOOD = {'speed': [0.0, 10.0], 'steering_wheel_angle': [0.0, 4.0],
        'ratio': [[5.0, 4.0], [20.0, 10.0]]}


def write_table(folder: Path, **changes: object) -> str:
    """Write a ratio table with changes and return its path."""
    path = folder / 'ratio.yaml'
    path.write_text(yaml.safe_dump(GOOD | changes), encoding='utf-8')
    return str(path)


def test_ratio_is_bilinear() -> None:
    """Equal to scipy's interpolator inside the grid of the shipped table."""
    table = load_steering_ratio(VEHICLE.steering_ratio)
    reference = RegularGridInterpolator((table.speeds, table.wheel_angles), table.ratios)
    random = np.random.default_rng(21)
    points = np.column_stack((random.uniform(0.0, 50.0, 500), random.uniform(0.0, 7.85, 500)))
    ours = [table.ratio(speed, angle) for speed, angle in points]
    np.testing.assert_allclose(ours, reference(points), rtol=1e-12)
    for row, speed in enumerate(table.speeds):
        for column, angle in enumerate(table.wheel_angles):
            assert table.ratio(speed, angle) == table.ratios[row][column]


def test_ratio_is_even_and_held_beyond_the_grid() -> None:
    """Left equals right, reverse equals forward; outside the grid the last value holds."""
    table = load_steering_ratio(VEHICLE.steering_ratio)
    assert table.ratio(-7.0, -2.0) == table.ratio(7.0, 2.0)
    assert table.ratio(90.0, 9.0) == table.ratios[-1][-1]


def test_target_angle_by_hand(tmp_path: Path) -> None:
    """CRG 26: delta* = s theta_max / R; at 5 m/s and 2 rad R is the mean of the four corners."""
    steering = Steering(replace(VEHICLE, steering_ratio=write_table(tmp_path)))
    wheel_angle = 2.0
    assert steering.target_angle(wheel_angle / 7.85, 5.0) == pytest.approx(2.0 / 9.75)
    assert steering.target_angle(-wheel_angle / 7.85, 5.0) == pytest.approx(-2.0 / 9.75)
    assert steering.target_angle(0.0, 5.0) == 0.0


def test_target_angle_is_limited(tmp_path: Path) -> None:
    """CRG 26: delta_max = 0.91 rad, where 7.85 rad over a ratio of 4 would give 1.96 rad."""
    steering = Steering(replace(VEHICLE, steering_ratio=write_table(tmp_path)))
    assert VEHICLE.max_steering_angle == 0.91
    assert steering.target_angle(1.0, 0.0) == 0.91
    assert steering.target_angle(-1.0, 0.0) == -0.91


def test_steering_grows_less_direct_with_speed() -> None:
    """The same steering wheel angle gives a smaller wheel angle at a higher speed."""
    steering = Steering(VEHICLE)
    angles = [steering.target_angle(0.5, speed) for speed in (0.0, 5.0, 10.0, 20.0, 30.0, 50.0)]
    assert all(b < a for a, b in zip(angles, angles[1:], strict=False))


def test_rate_reaches_the_target_within_the_step() -> None:
    """CRG 27: (delta* - delta) / dt, up to the 0.4 rad/s of vehicle 2."""
    limit = VEHICLE.max_steering_rate
    assert steering_rate(0.102, 0.1, 0.01, limit) == pytest.approx(0.2)
    assert steering_rate(0.098, 0.1, 0.01, limit) == pytest.approx(-0.2)
    assert steering_rate(0.5, 0.1, 0.01, limit) == 0.4
    assert steering_rate(-0.5, 0.1, 0.01, limit) == -0.4


def test_unlimited_rate_is_the_papers() -> None:
    """With `max_steering_rate: .inf` the angle is the target after any step."""
    assert 0.1 + 0.01 * steering_rate(0.5, 0.1, 0.01, math.inf) == pytest.approx(0.5)


@pytest.mark.parametrize(('changes', 'named'), [
    ({'speed': None}, '"speed" is None; give a list of numbers'),
    ({'speed': [10.0, 0.0]}, '"speed" does not ascend'),
    ({'speed': [0.0, math.nan]}, '"speed" holds nan; give a list of numbers'),
    ({'steering_wheel_angle': [0.0]}, '"steering_wheel_angle" does not ascend'),
    ({'steering_wheel_angle': ['left', 'right']}, "holds 'left'"),
    ({'ratio': [[5.0, 4.0]]}, '"ratio" does not fit the grid'),
    ({'ratio': [[5.0], [4.0]]}, '"ratio" does not fit the grid'),
    ({'ratio': 5.0}, '"ratio" is 5.0; give a list of lists of numbers above 0'),
    ({'ratio': [[5.0, 4.0], [0.0, 3.0]]}, 'ratio[1]: holds 0.0; give a list of numbers above 0'),
    ({'ratio': [[5.0, 4.0], [math.inf, 3.0]]}, 'ratio[1]: holds inf; give')])
def test_bad_table_is_refused(tmp_path: Path, changes: dict[str, object], named: str) -> None:
    """The message names the file and the error in it."""
    path = write_table(tmp_path, **changes)
    with pytest.raises(InputError) as caught:
        load_steering_ratio(path)
    assert path in str(caught.value)
    assert named in str(caught.value)


def test_missing_table_is_refused(tmp_path: Path) -> None:
    """A vehicle that names a missing table is refused."""
    with pytest.raises(InputError, match='cannot read the table of steering ratios'):
        load_steering_ratio(str(tmp_path / 'none.yaml'))
