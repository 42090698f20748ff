# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plans of an external planner, which pass no adapter, are held to the road by the simulation."""

from pathlib import Path
import statistics
import time

from crgame_ros.game.game import DrivabilitySpec, Game
from crgame_ros.messages.joints import JointSeries, plan_to_joints
from crgame_ros.messages.plan import Plan
from crgame_ros.planner.plan_check import RoadLimit
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import pytest
from simulation_support import arc, av_of, ego_of, HandDriven, setup_of

STEP_NS = 100_000_000


def leaving(request: JointSeries, curvature: float) -> JointSeries:
    """Answer with 4 s of a circle at constant speed."""
    plan = Plan(request.stamp_ns, arc(ego_of(request), curvature=curvature))
    return plan_to_joints(plan, 'av0', STEP_NS)


def test_plan_that_leaves_the_road_is_refused(cut_in: LoadedScenario) -> None:
    """
    The right edge of the road is 1.75 m beside the AV at 20 m/s, which is 1.61 m wide.

    A circle of 500 m takes the whole car past it: 80 m ahead it is 6.4 m to the right. The plan
    before stays in force, and the refusal is counted like any other.
    """
    run = HandDriven(setup_of(cut_in, avs=av_of('external')))
    av = run.simulation.avs[0]
    assert run.simulation.offer_plan('av0', leaving(run.result.requests['av0'], 0.0)) is None
    run.drive(10, plans=False)
    followed = av.plan
    reason = run.simulation.offer_plan('av0', leaving(run.result.requests['av0'], -0.002))
    assert reason is not None and reason.startswith('the plan leaves the road by 0.2')
    assert (av.counters.accepted, av.counters.refused) == (1, 1)
    assert av.counters.last_refusal == reason
    assert av.plan is followed and not av.busy


@pytest.mark.parametrize('spec', [DrivabilitySpec(road=False), DrivabilitySpec()])
def test_road_is_free_where_the_game_says_so(cut_in: LoadedScenario,
                                             spec: DrivabilitySpec) -> None:
    run = HandDriven(setup_of(cut_in, avs=av_of('external'), drivability=spec))
    reason = run.simulation.offer_plan('av0', leaving(run.result.requests['av0'], -0.002))
    assert (reason is None) is not spec.road


def test_planners_behind_an_adapter_are_not_checked_twice(cut_in: LoadedScenario) -> None:
    run = HandDriven(setup_of(cut_in, avs=av_of('idm')))
    assert run.simulation.offer_plan('av0', leaving(run.result.requests['av0'], -0.002)) is None


@pytest.mark.slow
def test_every_lanelet_of_published_maps_may_be_planned_along(shared_scenarios: Path) -> None:
    """A plan along a lanelet's centre is on the road, for vehicles of its width."""
    loaded = load_scenario(shared_scenarios / 'USA_Lanker-1_3_T-1.xml')
    setup = build_setup(Game(shared_scenarios / 'USA_Lanker-1_3_T-1.xml', avs=av_of('external')),
                        loaded)
    limit = RoadLimit(setup.road, setup.avs[0].vehicle)
    network = RoadNetwork(loaded.scenario.lanelet_network)
    checked = 0
    for lanelet in loaded.scenario.lanelet_network.lanelets:
        points = lanelet.center_vertices
        if lanelet.lanelet_id not in network.lanelet_ids or len(points) < 2:
            continue
        yaw = np.arctan2(*np.gradient(points, axis=0).T[::-1])
        states = np.zeros((len(points), 8))
        states[:, :3] = np.column_stack((points, yaw))
        # The bodies at both ends may reach beyond the map.
        assert limit.refusal(states[2:-2]) is None or len(points) < 8
        checked += 1
    assert checked > 20


@pytest.mark.clock
def test_check_takes_less_than_a_millisecond(shared_scenarios: Path) -> None:
    """It is part of a cycle of 10 ms: 0.1 ms for a plan on the road, 0.4 ms for one off it."""
    path = shared_scenarios / 'more' / 'HRV_Pula-27_3_T-1.xml'
    setup = build_setup(Game(path, avs=av_of('external')))
    limit = RoadLimit(setup.road, setup.avs[0].vehicle)
    ego = setup.avs[0].state
    limit.rehearse(ego)
    for curvature in (0.0, 0.05):
        states = arc(VehicleState(*ego)._replace(speed=10.0), curvature=curvature, count=31)
        took_s = []
        for _ in range(100):
            start_s = time.perf_counter()
            limit.refusal(states)
            took_s.append(time.perf_counter() - start_s)
        # Other load on this machine only adds to the time.
        assert min(took_s) < 1e-3 and statistics.median(took_s) < 2e-3
