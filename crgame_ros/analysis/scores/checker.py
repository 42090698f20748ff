# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The solution checks and costs of commonroad-drivability-checker.

Importing them takes a second even without what they draw with, so users of this module import it
where they call it.
"""

from functools import partial
from importlib import import_module

from commonroad.common.solution import vehicle_parameters, VehicleType
from crgame_ros.filters import smoothed
from crgame_ros.postponed import postponed, UNUSED

# The files of the four vehicles are read once, by commonroad-io: again they take 0.2 s.
for kind in VehicleType:
    name = f'parameters_vehicle{kind.value}'
    setattr(import_module(f'vehiclemodels.{name}'), name, partial(vehicle_parameters.get, kind))

with postponed(*UNUSED, 'scipy.signal'):
    from commonroad_dc.costs import route_matcher
    from commonroad_dc.costs.evaluation import (
        CostFunctionEvaluator,
        LaneletRouteMatcher,
        PartialCostFunctionMapping,
    )
    from commonroad_dc.feasibility import feasibility_checker, solution_checker
    from commonroad_dc.feasibility.vehicle_dynamics import VehicleDynamics

# The one function of scipy.signal that is called; to import that takes longer than all the costs.
route_matcher.savgol_filter = smoothed

__all__ = ['CostFunctionEvaluator', 'LaneletRouteMatcher', 'PartialCostFunctionMapping',
           'VehicleDynamics', 'feasibility_checker', 'solution_checker']
