# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Comfort as nuPlan's score bounds it: accelerations, jerks and yaw of the centre."""

from typing import Any, NamedTuple

from crgame_ros.analysis.scores.scored_drive import ScoredDrive
import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

FloatArray = NDArray[np.float64]

# nuPlan smooths over so many samples of 0.1 s: accelerations and yaw, and jerks.
_SAMPLE_S, _SHORT, _LONG = 0.1, 5, 15
# Fewer steps have no jerk.
LEAST_STEPS = 5


class Bound(NamedTuple):
    """Between what values a quantity is comfortable, and its unit."""

    lowest: float
    highest: float
    unit: str


# nuplan-devkit, docs/metrics_description.md, "Comfort".
BOUNDS = {
    'longitudinal_acceleration': Bound(-4.05, 2.40, 'm/s^2'),
    'lateral_acceleration': Bound(-4.89, 4.89, 'm/s^2'),
    'jerk': Bound(-8.37, 8.37, 'm/s^3'),
    'longitudinal_jerk': Bound(-4.13, 4.13, 'm/s^3'),
    'yaw_rate': Bound(-0.95, 0.95, 'rad/s'),
    'yaw_acceleration': Bound(-1.93, 1.93, 'rad/s^2'),
}


class DriveComfort(NamedTuple):
    """
    The extremes of a drive.

    :param lowest: smallest value by name of `BOUNDS`.
    :param highest: largest value.
    """

    lowest: dict[str, float]
    highest: dict[str, float]

    @property
    def exceeded(self) -> tuple[str, ...]:
        """Name what is beyond its bounds."""
        return tuple(name for name, bound in BOUNDS.items()
                     if self.lowest[name] < bound.lowest or self.highest[name] > bound.highest)

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        return {name: {'lowest': self.lowest[name], 'highest': self.highest[name],
                       'unit': bound.unit, 'comfortable': name not in self.exceeded}
                for name, bound in BOUNDS.items()}


def measure_comfort(drive: ScoredDrive) -> DriveComfort | None:
    """
    Find the extremes; None of fewer than `LEAST_STEPS` steps.

    Speed v of the rear axle and yaw are smoothed and differentiated by Savitzky and Golay's filter
    of order 2 over 0.5 s; the centre, r ahead, has the acceleration v' - r w^2 along and
    v w + r w' across, w being the yaw rate. Jerk is the derivative of their length, longitudinal
    jerk that of the first, over 1.5 s.
    """
    if len(drive.poses) < LEAST_STEPS:
        return None
    yaw = np.unwrap(drive.poses[:, 2])
    speed = _filtered(drive.speeds, drive.dt_s, _SHORT, 0)
    rate = _filtered(yaw, drive.dt_s, _SHORT, 1)
    bend = _filtered(yaw, drive.dt_s, _SHORT, 2)
    along = _filtered(drive.speeds, drive.dt_s, _SHORT, 1) - drive.rear_to_center * rate ** 2
    across = speed * rate + drive.rear_to_center * bend
    values = {
        'longitudinal_acceleration': along, 'lateral_acceleration': across,
        'jerk': _filtered(np.hypot(along, across), drive.dt_s, _LONG, 1),
        'longitudinal_jerk': _filtered(along, drive.dt_s, _LONG, 1),
        'yaw_rate': rate, 'yaw_acceleration': bend}
    return DriveComfort({name: float(values[name].min()) for name in BOUNDS},
                        {name: float(values[name].max()) for name in BOUNDS})


def _filtered(values: FloatArray, dt_s: float, samples: int, order: int) -> FloatArray:
    """Differentiate so many times over a window of so many samples of 0.1 s."""
    window = max(LEAST_STEPS, round(samples * _SAMPLE_S / dt_s))
    window = min(window, len(values))
    window -= window % 2 == 0
    return np.asarray(savgol_filter(values, window, 2, deriv=order, delta=dt_s))
