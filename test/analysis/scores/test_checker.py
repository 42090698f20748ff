# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What CommonRoad's checker calls in place of scipy gives the same bits."""

import subprocess
import sys

from crgame_ros.analysis.scores.checker import Bounds, linear
import numpy as np
import pytest
from scipy.interpolate import interp1d
from scipy.optimize import Bounds as TheirBounds
from scipy.optimize import minimize

# Scores before and after all of scipy is loaded, in one process.
SCRIPT = """
import sys
import numpy as np
from crgame_ros.analysis.scores import checker
from commonroad.common.solution import VehicleModel, VehicleType
from commonroad.scenario.state import KSState
dynamics = checker.VehicleDynamics.from_model(VehicleModel.KS, VehicleType.BMW_320i)
def states(k, x, speed):
    return KSState(time_step=k, position=np.array([x, 0.0]), steering_angle=0.0, velocity=speed,
                   orientation=0.0)
def check():
    return [checker.feasibility_checker.state_transition_feasibility(
        states(0, 0.0, 10.0), states(1, x, speed), dynamics, 0.1) for x, speed in (
            (1.0, 10.1), (1.3, 10.0))]
first = check()
alone = {'scipy.stats', 'scipy.interpolate', 'scipy.optimize', 'scipy.integrate'} & {*sys.modules}
import scipy.stats
assert scipy.integrate.quad(np.cos, 0.0, 1.0)[0] and scipy.optimize.linprog([1.0]).x is not None
print(sorted(alone), [feasible for feasible, _ in first], str(first) == str(check()))
"""


def test_interpolation_is_that_of_scipy() -> None:
    random = np.random.default_rng(7)
    s = np.cumsum(random.uniform(0.01, 3.0, 50))
    values = random.normal(size=50)
    at = np.linspace(s[0], s[-1], 333)
    assert linear(s, values)(at).tobytes() == interp1d(s, values)(at).tobytes()


@pytest.mark.parametrize('target', [(0.2, -0.1), (3.0, 0.3), (-5.0, 9.0)])
def test_inputs_that_fit_best_are_those_of_scipy(target: tuple[float, float]) -> None:
    def distance(u: np.ndarray) -> float:
        return float((u[0] - target[0]) ** 2 + (u[1] - u[0] * target[1]) ** 2)
    found = [minimize(distance, np.zeros(2), method='SLSQP', bounds=kind([-1.0, -2.0], [1.0, 2.0])
                      ).x for kind in (Bounds, TheirBounds)]
    assert found[0].tobytes() == found[1].tobytes()


def test_the_rest_of_scipy_is_there_for_others() -> None:
    done = subprocess.run([sys.executable, '-c', SCRIPT], capture_output=True, text=True,
                          check=True)
    assert done.stdout == '[] [True, False] True\n'
