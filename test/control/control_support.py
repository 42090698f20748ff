# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plans made from curvature and acceleration, and runs that track them."""

from collections.abc import Callable
import math

from crgame_ros.control.tracked_execution import TrackedExecution
from crgame_ros.control.tracker import Reference, Tracker, TRACKERS
from crgame_ros.vehicle.dynamic_bicycle import DynamicBicycle
from crgame_ros.vehicle.models import VehicleModel
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
VEHICLE = load_vehicle_parameters()
DT, DT_C = 0.01, 0.1


def plan(speed: float, duration_s: float,
         curvature: Callable[[float], float] = lambda s: 0.0,
         acceleration: Callable[[float], float] = lambda t: 0.0,
         start: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
    """Integrate a curve kappa(s) driven with a(t), 20 times finer than the grid of the plan."""
    fine = 20
    rows = [(*start, speed, 0.0, 0.0, 0.0, 0.0)]
    (x, y, yaw), v, s, h = start, speed, 0.0, DT_C / fine
    rests = False
    for i in range(round(duration_s / DT_C) * fine):
        a = acceleration((i + 0.5) * h)
        end = v + a * h
        # A braking plan stays at the place of its stop.
        rests = rests or (v != 0.0 and v * end <= 0.0)
        end = 0.0 if rests else end
        way = 0.5 * (v + end) * h if not rests or v == 0.0 else -0.5 * v * v / a
        bend = curvature(s + 0.5 * abs(way))
        middle = yaw + 0.5 * bend * way
        x, y, yaw = x + way * math.cos(middle), y + way * math.sin(middle), yaw + bend * way
        s, v = s + abs(way), end
        if (i + 1) % fine == 0:
            rows.append((x, y, yaw, v, math.atan(VEHICLE.wheelbase * bend), a if v else 0.0,
                         bend * v, 0.0))
    return np.array(rows)


def circle(radius: float) -> Callable[[float], float]:
    """Return the curvature of a circle to the left."""
    return lambda s: 1.0 / radius


def s_curve(speed: float, lateral_acceleration: float = 2.0,
            period_s: float = 6.0) -> Callable[[float], float]:
    """Return a sinusoidal curvature with a given lateral acceleration [m/s^2]."""
    return lambda s: lateral_acceleration / speed ** 2 \
        * math.sin(2.0 * math.pi * s / (speed * period_s))


def tracker(name: str = 'lqr', **options: object) -> Tracker:
    """Make a tracker as a game does."""
    made: Tracker = TRACKERS.create(name, options, vehicle=VEHICLE, dt_s=DT)
    return made


def track(states: Array, control: Tracker, model: VehicleModel | None = None,
          start: VehicleState | None = None, duration_s: float | None = None,
          pose: Callable[[VehicleState], VehicleState] | None = None,
          ) -> tuple[Array, Array, TrackedExecution]:
    """
    Track a plan from its first state.

    :return: states (n + 1, 8) and errors (n, 4) of every step, NaN where no plan was followed
    """
    execution = TrackedExecution(VEHICLE, control, model or DynamicBicycle(VEHICLE), DT)
    state = start or VehicleState(*states[0].tolist())
    execution.reset(state)
    reference = Reference(states, DT_C)
    steps = round((duration_s or DT_C * (len(states) - 1)) / DT)
    driven, errors = [state], []
    for n in range(steps):
        state = execution.step(state, reference.at(n * DT), pose(state) if pose else None)
        driven.append(state)
        errors.append(execution.errors or (math.nan,) * 4)
    return np.array(driven), np.array(errors), execution
