# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The solution checks and costs of commonroad-drivability-checker.

Importing them takes a second even without what they draw with, so users of this module import it
where they call it.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib import import_module

from commonroad.common.solution import vehicle_parameters, VehicleType
from crgame_ros.filters import smoothed
from crgame_ros.postponed import postponed, UNUSED
import numpy as np
from numpy.typing import NDArray

# The files of the four vehicles are read once, by commonroad-io: again they take 0.2 s.
for kind in VehicleType:
    name = f'parameters_vehicle{kind.value}'
    setattr(import_module(f'vehiclemodels.{name}'), name, partial(vehicle_parameters.get, kind))

# Of scipy, costs and feasibility call three functions; what is imported with them takes 0.4 s.
with postponed(*UNUSED, 'scipy.special', parts={
        'odeint': '_odepack_py', 'simpson': '_quadrature', 'minimize': '_minimize'}):
    from commonroad_clcs.helper.interpolation import Interpolator
    from commonroad_dc.costs import route_matcher
    from commonroad_dc.costs.evaluation import (
        CostFunctionEvaluator,
        LaneletRouteMatcher,
        PartialCostFunctionMapping,
    )
    from commonroad_dc.feasibility import (
        feasibility_checker,
        solution_checker,
        vehicle_dynamics,
    )
    from commonroad_dc.feasibility.vehicle_dynamics import VehicleDynamics

# The one function of scipy.signal that is called; to import that takes longer than all the costs.
route_matcher.savgol_filter = smoothed


def linear(s: NDArray[np.float64], values: NDArray[np.float64]
           ) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Return a function that interpolates between points, as scipy's interp1d does by numpy."""
    return lambda at: np.interp(at, s, values)


Interpolator._dict_interp_functions['linear'] = linear


class Bounds:
    """Bounds of inputs as in scipy.optimize, whose `minimize` takes pairs of them, too."""

    def __init__(self, lb: Sequence[float], ub: Sequence[float]) -> None:
        self.lb, self.ub = lb, ub

    def __iter__(self) -> Iterator[tuple[float, float]]:
        """Yield the least and the greatest value of each input."""
        return zip(self.lb, self.ub, strict=True)


vehicle_dynamics.Bounds = Bounds

__all__ = ['CostFunctionEvaluator', 'LaneletRouteMatcher', 'PartialCostFunctionMapping',
           'VehicleDynamics', 'feasibility_checker', 'solution_checker']
