# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What others show and sound, in a plan request: one joint `<v>/lights` for each driven vehicle.

They stand behind all others, so that who does not ask for them passes over them by their names.
"""

from collections.abc import Mapping
import math

from crgame_ros.messages.joints import JointSeries
from crgame_ros.vehicle.lights import ALL_LIGHTS, Light
import numpy as np

_JOINT = '/lights'


def with_lights(series: JointSeries, lights: Mapping[str, float]) -> JointSeries:
    """
    Add what vehicles show now: nobody's future lights are known, which is NaN.

    :param series: a request without lights.
    :param lights: bits of `Light` by vehicle; NaN where they are not seen.
    """
    shape = (len(series.positions), len(lights))
    shown, nothing = np.full(shape, math.nan), np.full(shape, math.nan)
    shown[0] = [*lights.values()]
    return JointSeries(
        series.stamp_ns, (*series.names, *(name + _JOINT for name in lights)), series.times_ns,
        *(np.concatenate((array, new), axis=1) for array, new in (
            (series.positions, shown), (series.velocities, nothing),
            (series.accelerations, nothing))))


def without_lights(series: JointSeries) -> tuple[JointSeries, dict[str, float]]:
    """Take a request apart: what `with_lights` was given."""
    columns = light_columns(series.names)
    if not columns:
        return series, {}
    lights = {name: float(series.positions[0, column]) for name, column in columns.items()}
    kept = [column for column in range(len(series.names)) if column not in columns.values()]
    return JointSeries(
        series.stamp_ns, tuple(series.names[column] for column in kept), series.times_ns,
        *(array[:, kept] for array in (
            series.positions, series.velocities, series.accelerations))), lights


def light_columns(names: tuple[str, ...]) -> dict[str, int]:
    """Find the columns that hold lights, by vehicle."""
    return {name.removesuffix(_JOINT): column for column, name in enumerate(names)
            if name.endswith(_JOINT)}


def light_of(value: float) -> Light | None:
    """Read a position of such a joint, whoever sent it; None if it tells nothing."""
    return Light(int(value) & ALL_LIGHTS) if math.isfinite(value) else None
