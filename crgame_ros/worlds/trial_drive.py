# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Drives on an imported map before it counts as imported: an AV, in dense traffic."""

from collections.abc import Callable
from dataclasses import dataclass
import math
from pathlib import Path

from crgame_ros.game.game import AvSpec, Game
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
import shapely

DURATION_S = 60.0
# A lane of so many metres has one agent at the start; more agents enter at the edges.
_SPACING, _MOST_AGENTS, _FLOW = 60.0, 200, 600.0
# An agent whose centre is farther off the road than this has left it [m].
_TOLERANCE = 0.2
# Beyond the end of a lane agents are taken off once they are out of sight: within this [m].
_EXIT = 30.0


@dataclass(frozen=True)
class TrialDrive:
    """
    The drive of an AV on a map in traffic.

    :param distance: that the AV drove [m]
    :param faults: what happened to it, in words; empty if it neither touched anything nor left
        the road.
    :param agents: of the traffic, in all.
    :param agents_distance: that they drove together [m]
    :param off_road: number of agents that left the road.
    :param taken_off: number of agents that were removed because they blocked each other.
    """

    distance: float
    faults: tuple[str, ...]
    agents: int
    agents_distance: float
    off_road: int
    taken_off: int

    def told(self) -> str:
        """Return the drive in a line."""
        own = ' and '.join(self.faults) or 'touched nothing and stayed on the road'
        traffic = f'{self.off_road or "none"} of {self.agents} agents left the road'
        stuck = f', {self.taken_off} blocked each other' if self.taken_off else ''
        return (f'trial drive of {DURATION_S:g} s: an AV drove {self.distance:.0f} m, {own}; '
                f'{traffic} on {self.agents_distance / 1e3:.1f} km{stuck}')


def trial_drive(loaded: LoadedScenario, length: float,
                progress: Callable[[float], object]) -> TrialDrive:
    """
    Drive on a map for a minute, offline.

    :param loaded: with one planning problem.
    :param length: of all lanes for cars [m]
    :param progress: called with the share that is done.
    :raises InputError: if nobody can drive there.
    """
    agents = max(2, min(_MOST_AGENTS, math.ceil(length / _SPACING)))
    game = Game(Path(loaded.source), humans=(), avs=(AvSpec(
        'av0', 'idm', planning_problem=loaded.planning_problems[0].planning_problem_id),),
        duration=DURATION_S, traffic=TrafficSpec(agents=agents, flow=_FLOW))
    setup = build_setup(game, loaded)
    result = run_offline(setup, progress=progress)
    states = result.states_of('av0')[:, :2]
    poses = result.object_poses[:, setup.agent_columns]
    # Those that are not on the road are NaN.
    steps = np.hypot(*np.moveaxis(np.diff(poses[:, :, :2], axis=0), -1, 0))
    there = np.isfinite(poses).all(axis=2)
    network = RoadNetwork(loaded.scenario.lanelet_network)
    # Beyond the end of a lane at the edge of the map agents leave it.
    ends = [network.line(lanelet).points[-1] for lanelet in network.lanelet_ids
            if not network.successors(lanelet)]
    road = shapely.union_all([shapely.buffer(network.road_area(), _TOLERANCE),
                              *shapely.buffer(shapely.points(np.reshape(ends, (-1, 2))), _EXIT)])
    shapely.prepare(road)
    off = np.zeros(there.shape, dtype=bool)
    off[there] = ~shapely.contains_xy(road, poses[there][:, :2])
    violations = [each for each in result.violations if each.vehicle_id == 'av0']
    faults = [words for words, happened in (
        ('touched another vehicle', any(each.collision for each in violations)),
        ('left the road', any(each.off_road for each in violations))) if happened]
    return TrialDrive(float(np.hypot(*np.diff(states, axis=0).T).sum()), tuple(faults),
                      int(there.any(axis=0).sum()), float(np.nansum(steps)),
                      int(off.any(axis=0).sum()), result.taken_off)
