# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Free traffic on maps of every kind: agents hit nothing on any of them."""

from pathlib import Path

from crgame_ros.game.objects import Role
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.traffic.fleet.world_view import WorldView
from crgame_ros.traffic.traffic import Traffic
import numpy as np
import pytest
import traffic_support as support

MAPS = ('ZAM_Merge-1_1_T-1.xml', 'ZAM_Intersection-1_1_T-1.xml', 'ZAM_Roundabout-1_1_T-1.xml')


@pytest.mark.exhaustive
@pytest.mark.parametrize('name', MAPS)
@pytest.mark.parametrize('seed', [0, 1])
def test_no_agent_hits_another_in_dense_traffic(maps: Path, name: str, seed: int) -> None:
    run = support.Run(maps / name, TrafficSpec(agents=25, flow=500.0), seed).ticks(400)
    assert run.overlaps() == []
    present = np.isfinite(np.array(run.poses)[:, :, 0])
    assert present.sum(axis=1).min() >= 8
    speeds = np.array(run.speeds)
    assert np.nanmax(speeds) < 45.0 and np.nanmean(speeds) > 3.0


def every_map() -> list[Path]:
    root = Path(__file__).resolve().parents[2]
    own = sorted((root / 'scenarios').glob('*.xml'))
    return own + sorted((root.parent / 'shared' / 'scenarios').glob('*.xml'))


@pytest.mark.matrix('ZAM_Roundabout-1_1_T-1', 'ZAM_Tjunction-1_42_T-1')
@pytest.mark.slow
@pytest.mark.parametrize('path', every_map(), ids=lambda path: path.name.split('.')[0])
def test_every_map_carries_traffic(path: Path) -> None:
    loaded = load_scenario(path)
    obstacles = ScenarioObstacles(loaded)
    ticks = round(30.0 / loaded.time_step_s)

    def world(k: int) -> WorldView:
        states = obstacles.states_at(k)
        return WorldView(k, states.poses, states.velocities)

    traffic = Traffic(TrafficSpec(agents=20), RoadNetwork(loaded.scenario.lanelet_network),
                      loaded.scenario, obstacles.descriptions, (), loaded.time_step_s,
                      support.SUBSTEPS, 1, 0, world(0))
    here = np.isfinite(traffic.states.poses[:, 0])
    assert here.sum() >= 2
    outlines = [support.rectangle(pose, d.shape.length, d.shape.width) for d, pose, there in zip(
        traffic.descriptions, traffic.states.poses, here, strict=True) if there]
    assert not any(a.intersects(b) for i, a in enumerate(outlines) for b in outlines[:i])
    for k in range(ticks):
        traffic.advance(world(k))
        states = traffic.states
        absent = np.isnan(states.poses)
        assert (absent.all(axis=1) == absent.any(axis=1)).all()
        assert (absent == np.isnan(states.velocities)).all()
        assert np.nanmax(np.abs(states.velocities[:, :2]), initial=0.0) < 60.0
    assert all(d.role is Role.TRAFFIC for d in traffic.descriptions)
