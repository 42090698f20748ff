# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The kinematics of all samples at once, beside the package's own, sample by sample."""

from copy import deepcopy

from commonroad_rp.reactive_planner import ReactivePlanner
from commonroad_rp.trajectories import TrajectoryBundle, TrajectorySample
from crgame_ros.planner import reactive_core
from crgame_ros.planner.registry import create_planner
from crgame_ros.planner.sample_kinematics import feasible, place
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import planner_support as support
import pytest

CARTESIAN = ('x', 'y', 'theta', 'v', 'a', 'kappa', 'kappa_dot')
CURVILINEAR = ('s', 'd', 'theta', 's_dot', 's_ddot', 'd_dot', 'd_ddot')


def bundles(start: VehicleState, monkeypatch: pytest.MonkeyPatch,
            ) -> list[tuple[ReactivePlanner, list[TrajectorySample]]]:
    """Return the samples of which a plan from a state is chosen, all levels of sampling."""
    found: list[tuple[ReactivePlanner, list[TrajectorySample]]] = []
    original = reactive_core._Planner._create_trajectory_bundle

    def kept(self: ReactivePlanner, *given: object, **named: object) -> TrajectoryBundle:
        for level in range(self.sampling_level):
            found.append((self, deepcopy(original(
                self, *given, **{**named, 'samp_level': level}).trajectories)))
        return original(self, *given, **named)

    monkeypatch.setattr(reactive_core._Planner, '_create_trajectory_bundle', kept)
    s = np.linspace(-50.0, 600.0, 400)
    line = np.column_stack((s, 12.0 * (1.0 - np.cos(s / 40.0))))
    planner = create_planner('reactive', {})
    planner.setup(support.context(support.road([support.strip(line, 3.5, 1)]),
                                  support.problem(start.speed)))
    planner.plan(support.request(start))
    return found


@pytest.mark.parametrize('start', [
    VehicleState(0.0, 0.0, 0.0, 12.0), VehicleState(0.0, 0.6, 0.08, 8.0, 0.05),
    VehicleState(0.0, -0.4, -0.1, 2.0, -0.1), VehicleState(0.0, 0.3, 0.0, 0.0),
    VehicleState(0.0, 0.0, 0.0, 30.0)])
def test_states_and_verdicts_are_the_packages(start: VehicleState,
                                              monkeypatch: pytest.MonkeyPatch) -> None:
    seen = 0
    for planner, samples in bundles(start, monkeypatch):
        theirs = deepcopy(samples)
        expected, _ = ReactivePlanner._check_kinematics(planner, theirs)
        for sample in feasible(planner, samples):
            twin = theirs[next(i for i, x in enumerate(samples) if x is sample)]
            assert place(planner, sample)
            assert any(twin is x for x in expected)
            for name in CARTESIAN:
                np.testing.assert_allclose(getattr(sample.cartesian, name),
                                           getattr(twin.cartesian, name), atol=1e-12)
            for name in CURVILINEAR:
                np.testing.assert_allclose(getattr(sample.curvilinear, name),
                                           getattr(twin.curvilinear, name), atol=1e-12)
            seen += 1
        assert [x.feasibility_label for x in samples] == [x.feasibility_label for x in theirs]
        assert len(expected) == sum(x.cartesian is not None for x in samples)
    assert seen
