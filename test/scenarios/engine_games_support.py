# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Play the games with objects, traffic and perception, changed or not, and measure the runs."""

from collections.abc import Callable
import functools
from typing import Any

from crgame_ros.game.game import parse_game
from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.paths import scenarios_directory
from crgame_ros.planner.idm import IdmPlanner
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
from numpy.typing import NDArray
import shapely
import yaml

Array = NDArray[np.float64]
Change = Callable[[dict[str, Any]], object]
STEPS_PER_TICK = 10
TICK_S = 0.1


class ListeningIdm(IdmPlanner):
    """The planner idm, which also keeps every request that it gets."""

    requests: list[PlanRequest] = []

    def plan(self, request: PlanRequest) -> Plan:
        """Keep the request and plan."""
        self.requests.append(request)
        return super().plan(request)


def play(name: str, *changes: Change) -> OfflineResult:
    """Run a game of the folder `scenarios`, after changes to the values of its file."""
    path = scenarios_directory() / f'{name}.yaml'
    values = yaml.safe_load(path.read_text(encoding='utf-8'))
    for change in changes:
        change(values)
    return run_offline(build_setup(parse_game(values, str(path), path.parent)))


@functools.cache
def played(name: str) -> OfflineResult:
    """Run a game as it is, once."""
    return play(name)


def without_human(values: dict[str, Any]) -> None:
    """Remove the human from a game."""
    values['humans'] = []


def speeds(result: OfflineResult, vehicle_id: str) -> Array:
    """Return a driven vehicle's speed at every tick [m/s]."""
    states: Array = result.states_of(vehicle_id)[::STEPS_PER_TICK, 3]
    return states


def strongest_braking(result: OfflineResult, vehicle_id: str) -> float:
    """Return the greatest deceleration between two ticks [m/s^2]."""
    return float(-np.diff(speeds(result, vehicle_id)).min() / TICK_S)


def column(result: OfflineResult, object_id: str) -> int:
    """Return the column of an object."""
    return result.setup.obstacles.ids.index(object_id)


def agents(result: OfflineResult) -> tuple[Array, Array]:
    """Return poses (ticks, A, 3) and speeds (ticks, A) of the agents; NaN where absent."""
    columns = result.setup.agent_columns
    velocities = result.object_velocities[:, columns]
    return result.object_poses[:, columns], np.hypot(velocities[..., 0], velocities[..., 1])


def bodies(result: OfflineResult, id_: str) -> Array:
    """Return the body of any object as shapes (ticks,); empty where it is absent."""
    descriptions = {item.id: item for item in result.setup.descriptions}
    shape = descriptions[id_].shape
    if id_ in result.setup.vehicle_ids:
        poses = result.states_of(id_)[::STEPS_PER_TICK, :3].copy()
        ahead = descriptions[id_].rear_to_center
        poses[:, 0] += ahead * np.cos(poses[:, 2])
        poses[:, 1] += ahead * np.sin(poses[:, 2])
    else:
        poses = result.object_poses[:, column(result, id_)]
    there = np.isfinite(poses[:, 0])
    made = np.full(len(poses), shapely.Point(), dtype=object)
    if shape.kind == 'circle':
        made[there] = shapely.buffer(shapely.points(poses[there, :2]), shape.radius)
        return made
    cos, sin = np.cos(poses[there, 2]), np.sin(poses[there, 2])
    corners = [(poses[there, 0] + a * shape.length * cos - b * shape.width * sin,
                poses[there, 1] + a * shape.length * sin + b * shape.width * cos)
               for a, b in ((.5, .5), (.5, -.5), (-.5, -.5), (-.5, .5))]
    made[there] = shapely.polygons(np.stack([np.stack(c, axis=-1) for c in corners], axis=1))
    return made


def distances(result: OfflineResult, one: str, other: str) -> Array:
    """Return the distance between two bodies at every tick; NaN where one is absent [m]."""
    measured: Array = shapely.distance(bodies(result, one), bodies(result, other))
    return measured


def touching(result: OfflineResult) -> list[tuple[str, str]]:
    """List the pairs of objects that ever touch."""
    ids = [item.id for item in result.setup.descriptions]
    all_bodies = np.stack([bodies(result, id_) for id_ in ids], axis=1)
    found = set()
    for row in all_bodies:
        first, second = shapely.STRtree(row).query(row, predicate='intersects')
        found |= {(ids[a], ids[b]) for a, b in zip(first, second, strict=True) if a < b}
    return sorted(found)
