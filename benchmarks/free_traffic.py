# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Long runs of traffic alone, with all that must never happen looked for from outside.

Shapely says at every scenario time step whether two agents overlap, or an agent and anything
else on the map. The exit code is 1 if that happens or a state is not a number.
"""

import argparse
from dataclasses import dataclass, field
import multiprocessing
from pathlib import Path
import sys
import time

import numpy as np
from numpy.typing import NDArray
import shapely

from crgame_ros.paths import scenarios_directory
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
from crgame_ros.scenario.objects import ObjectDescription, Role
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.scenario.road_network import RoadNetwork
from crgame_ros.scenario.signals import TrafficLights
from crgame_ros.traffic.spec import TrafficSpec
from crgame_ros.traffic.traffic import Traffic
from crgame_ros.traffic.world import WorldView

FloatArray = NDArray[np.float64]

# Map, agents at the start, arrivals [1/h] at each lane that begins at the map's edge.
MAPS = (('ZAM_DenseMerge-1_1_T-1', 30, 1000.0), ('ZAM_Intersection-1_1_T-1', 15, 400.0),
        ('ZAM_Roundabout-1_1_T-1', 12, 300.0))
SUBSTEPS = 10
STANDING = 0.1
# Nobody moves for this long: a deadlock [s].
DEADLOCK_S = 60.0
# Gaps are looked for up to this [m].
NEAR = 10.0
# A body that turns by less than this against another's follows or leads it [rad].
ALIGNED = 0.5


@dataclass
class Findings:
    """What one run showed; `at` in seconds since its start."""

    name: str
    seed: int
    seconds: float = 0.0
    overlaps: dict[tuple[str, str], tuple[float, FloatArray, FloatArray]] = field(
        default_factory=dict)
    not_numbers: int = 0
    min_gap: float = np.inf
    min_clearance: float = np.inf
    mean_agents: float = 0.0
    mean_speed: float = 0.0
    throughput: float = 0.0
    lane_changes: int = 0
    hardest: tuple[float, str, float] = (0.0, '', 0.0)
    hard_share: float = 0.0
    longest_standing_s: float = 0.0
    deadlock_s: float = 0.0
    wall_s: float = 0.0

    @property
    def is_bad(self) -> bool:
        """Tell whether something happened that never may."""
        return bool(self.overlaps) or self.not_numbers > 0


class Watcher:
    """
    Looks at the states of all bodies, one scenario time step after the other.

    :param agents: the agents come first in everything watched.
    :param others: bodies that are no agents.
    :param lanes: lanelets and their directions, for lane changes.
    """

    def __init__(self, findings: Findings, agents: tuple[ObjectDescription, ...],
                 others: tuple[ObjectDescription, ...], lanes: RoadNetwork, dt_s: float) -> None:
        self.findings, self._lanes, self._dt_s = findings, lanes, dt_s
        self._ids = [x.id for x in (*agents, *others)]
        self._length = np.array([x.shape.length for x in (*agents, *others)])
        self._width = np.array([x.shape.width for x in (*agents, *others)])
        self._agents = len(agents)
        self._speed = np.full(len(agents), np.nan)
        self._lane = np.full(len(agents), -1)
        self._standing = np.zeros(len(agents))
        self._nobody_moves = 0.0
        self._ticks = self._present = self._gone = self._hard = self._speeds = 0.0
        self._here = np.zeros(len(agents), dtype=bool)
        # Neighbours of one direction, as indices into the network's lanelets.
        index = {x: i for i, x in enumerate(lanes.lanelet_ids)}
        self._beside = [{index[j] for j in (lanes.left_of(i), lanes.right_of(i)) if j is not None}
                        for i in lanes.lanelet_ids]

    def look(self, at_s: float, poses: FloatArray, velocities: FloatArray) -> None:
        """
        Look at one moment.

        :param poses: (agents and others, 3); NaN where absent.
        :param velocities: (agents, 3)
        """
        finite = np.isfinite(poses[:self._agents]).all(axis=1)
        absent = np.isnan(poses[:self._agents]).all(axis=1)
        moving = np.isfinite(velocities).all(axis=1)
        self.findings.not_numbers += int((~finite & ~absent).sum() + (finite & ~moving).sum())
        self._overlaps(at_s, poses)
        speed = np.where(finite, np.hypot(velocities[:, 0], velocities[:, 1]), np.nan)
        self._count(at_s, finite, speed)
        self._changes(finite, poses[:self._agents])
        self._speed, self._here = speed, finite

    def _overlaps(self, at_s: float, poses: FloatArray) -> None:
        here = np.flatnonzero(np.isfinite(poses).all(axis=1))
        boxes = rectangles(poses[here], self._length[here], self._width[here])
        tree = shapely.STRtree(boxes)
        one, other = tree.query(boxes, predicate='dwithin', distance=NEAR)
        pair = (one < other) & (here[one] < self._agents)
        one, other = one[pair], other[pair]
        away = shapely.distance(boxes[one], boxes[other])
        self.findings.min_clearance = min(self.findings.min_clearance,
                                          float(away.min(initial=np.inf)))
        a, b = here[one], here[other]
        turn = np.abs(np.angle(np.exp(1j * (poses[a, 2] - poses[b, 2]))))
        side = np.abs((poses[b, 1] - poses[a, 1]) * np.cos(poses[a, 2])
                      - (poses[b, 0] - poses[a, 0]) * np.sin(poses[a, 2]))
        row = (turn < ALIGNED) & (side < 0.5 * (self._width[a] + self._width[b]))
        if row.any():
            self.findings.min_gap = min(self.findings.min_gap, float(away[row].min()))
        for i in np.flatnonzero(away <= 0.0).tolist():
            ids = (self._ids[a[i]], self._ids[b[i]])
            self.findings.overlaps.setdefault(ids, (at_s, poses[a[i]], poses[b[i]]))

    def _count(self, at_s: float, here: NDArray[np.bool_], speed: FloatArray) -> None:
        found = self.findings
        self._ticks += 1.0
        self._present += float(here.sum())
        self._gone += float((self._here & ~here).sum())
        self._speeds += float(speed[here].sum())
        change = (speed - self._speed) / self._dt_s
        self._hard += float((change < -4.0).sum())
        if np.isfinite(change).any() and np.nanmin(change) < found.hardest[0]:
            worst = int(np.nanargmin(change))
            found.hardest = (float(change[worst]), self._ids[worst], at_s)
        still = here & (speed < STANDING)
        self._standing = np.where(still, self._standing + self._dt_s, 0.0)
        found.longest_standing_s = max(found.longest_standing_s, float(self._standing.max()))
        stuck = bool(here.any()) and bool(still[here].all())
        self._nobody_moves = self._nobody_moves + self._dt_s if stuck else 0.0
        found.deadlock_s = max(found.deadlock_s, self._nobody_moves)

    def _changes(self, here: NDArray[np.bool_], poses: FloatArray) -> None:
        lane = np.full(len(here), -1)
        lane[here] = self._lanes.lanelets_at(poses[here])
        both = np.flatnonzero(here & self._here & (lane != self._lane) & (lane >= 0)
                              & (self._lane >= 0))
        self.findings.lane_changes += sum(
            int(lane[i]) in self._beside[int(self._lane[i])] for i in both.tolist())
        self._lane = lane

    def finish(self) -> None:
        """Fill in the means."""
        found = self.findings
        hours = found.seconds / 3600.0
        found.mean_agents = self._present / max(self._ticks, 1.0)
        found.mean_speed = self._speeds / max(self._present, 1.0)
        found.throughput = self._gone / hours
        found.hard_share = self._hard / max(self._present, 1.0)


def rectangles(poses: FloatArray, length: FloatArray, width: FloatArray) -> NDArray[np.object_]:
    """Give the outlines (N) of boxes around their centres (N, 3)."""
    corners = np.array([[0.5, 0.5], [0.5, -0.5], [-0.5, -0.5], [-0.5, 0.5]])
    along = corners[:, 0] * length[:, None]
    aside = corners[:, 1] * width[:, None]
    cos, sin = np.cos(poses[:, 2:3]), np.sin(poses[:, 2:3])
    x, y = poses[:, 0:1] + along * cos - aside * sin, poses[:, 1:2] + along * sin + aside * cos
    return np.asarray(shapely.polygons(np.stack((x, y), axis=-1)))


def standing_world(scenario: LoadedScenario) -> tuple[tuple[ObjectDescription, ...], WorldView]:
    """Give what stands on the map for good; what drives in the recording is left out."""
    obstacles = ScenarioObstacles(scenario)
    keep = np.array([i for i, x in enumerate(obstacles.descriptions)
                     if x.role is Role.STATIC], dtype=np.int64)
    states = obstacles.states_at(0)
    return (tuple(obstacles.descriptions[i] for i in keep),
            WorldView(0, states.poses[keep], states.velocities[keep]))


def drive(task: tuple[str, int, float, int, float, str]) -> Findings:
    """Run one map with one seed."""
    path, seed, minutes, agents, flow, model = task
    scenario = load_scenario(Path(path))
    network, lights = RoadNetwork(scenario.scenario.lanelet_network), TrafficLights(
        scenario.scenario)
    others, world = standing_world(scenario)
    spec = TrafficSpec(agents=agents, flow=flow, model=model)
    traffic = Traffic(spec, network, scenario.scenario, others, (), scenario.time_step_s,
                      SUBSTEPS, seed, 0, world)
    ticks = round(60.0 * minutes / scenario.time_step_s)
    found = Findings(Path(path).stem, seed, ticks * scenario.time_step_s)
    watcher = Watcher(found, traffic.descriptions, others, network, scenario.time_step_s)
    start = time.perf_counter()
    for k in range(ticks + 1):
        states = traffic.states
        watcher.look(k * scenario.time_step_s, np.concatenate((states.poses, world.poses)),
                     states.velocities)
        traffic.advance(WorldView(k, world.poses, world.velocities, lights.states_at(k)))
    found.wall_s = time.perf_counter() - start
    watcher.finish()
    return found


def row(found: Findings) -> str:
    """Write what a run showed."""
    hard, who, at_s = found.hardest
    stuck = '  DEADLOCK' if found.deadlock_s >= DEADLOCK_S else ''
    return (f'{found.name:28}{found.seed:5}{found.mean_agents:8.1f}{found.mean_speed:8.1f}'
            f'{found.throughput:8.0f}{found.lane_changes:9}{found.min_gap:9.2f}{found.min_clearance:9.2f}{hard:8.1f}'
            f'{1e3 * found.hard_share:8.2f}{found.longest_standing_s:10.1f}'
            f'{found.deadlock_s:9.1f}{len(found.overlaps):10}{found.not_numbers:6}'
            f'{found.seconds / found.wall_s:7.0f}  {who} at {at_s:.1f} s{stuck}')


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--minutes', type=float, default=10.0)
    parser.add_argument('--seeds', type=int, default=5)
    parser.add_argument('--processes', type=int, default=2)
    parser.add_argument('--model', default='acc')
    parser.add_argument('scenarios', nargs='*', type=Path,
                        help='files; 20 agents and 400 arrivals an hour and lane')
    values = parser.parse_args()
    maps = [(str(path), 20, 400.0) for path in values.scenarios] or [
        (str(scenarios_directory() / f'{name}.xml'), agents, flow) for name, agents, flow in MAPS]
    tasks = [(path, seed, values.minutes, agents, flow, values.model)
             for seed in range(values.seeds) for path, agents, flow in maps]
    print(f'{"map":28}{"seed":>5}{"agents":>8}{"m/s":>8}{"left/h":>8}{"changes":>9}'
          f'{"gap m":>9}{"side m":>9}{"m/s^2":>8}{"hard ‰":>8}{"stands s":>10}{"jam s":>9}'
          f'{"overlaps":>10}{"NaN":>6}{"x real":>7}  who braked hardest, when')
    results: list[Findings] = []
    with multiprocessing.get_context('spawn').Pool(values.processes) as pool:
        for found in pool.imap_unordered(drive, tasks):
            results.append(found)
            print(row(found), flush=True)
            for (one, other), (at_s, a, b) in found.overlaps.items():
                print(f'    {one} and {other} touch at {at_s:.1f} s: {a.round(2).tolist()} and '
                      f'{b.round(2).tolist()}', flush=True)
    bad = sum(item.is_bad for item in results)
    seconds = sum(item.mean_agents * item.seconds for item in results)
    print(f'{len(results)} runs, {seconds / 3600.0:.1f} hours of driving: '
          f'{sum(len(item.overlaps) for item in results)} overlaps in {bad} runs; '
          f'{sum(item.deadlock_s >= DEADLOCK_S for item in results)} deadlocks, '
          f'{sum(item.longest_standing_s >= DEADLOCK_S for item in results)} runs in which '
          f'somebody stands for {DEADLOCK_S:.0f} s')
    return 1 if bad else 0


if __name__ == '__main__':
    sys.exit(main())
