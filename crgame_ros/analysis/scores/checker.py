# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The solution checks and costs of commonroad-drivability-checker.

Importing them takes a second even without what they draw with, so users of this module import it
where they call it.
"""

from crgame_ros.filters import smoothed
from crgame_ros.postponed import DRAWING, postponed

with postponed(*DRAWING, 'scipy.signal'):
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
