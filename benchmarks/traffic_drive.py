# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Drive a scenario with dense traffic and record the observable states."""

from dataclasses import dataclass, replace
from pathlib import Path

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.outline import outline
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.signs import TrafficLights
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.simulation.traffic_setup import adopted_columns, MOTION_RATE
from crgame_ros.traffic.fleet.adoption import Adopted
from crgame_ros.traffic.fleet.world_view import WorldView
from crgame_ros.traffic.traffic import Traffic
from judge.history import FloatArray, History
import numpy as np

# Of the polygon that stands for a circle: its corners lie on it.
CIRCLE_CORNERS = 16


@dataclass(frozen=True)
class Drive:
    """
    The result of a drive.

    :param history: the observable states.
    :param recording: of all obstacles of the file, as recorded.
    :param scenario: the file.
    """

    history: History
    recording: History | None
    scenario: LoadedScenario


def drive(path: Path, spec: TrafficSpec, seconds: float, seed: int = 0,
          recorded: bool = True) -> Drive:
    """
    Drive a scenario file with traffic alone; recorded vehicles as the spec says.

    Objects that are no agents (pedestrians, parked cars) follow the recording in time.

    :param recorded: False leaves out whatever moves in the recording.
    """
    loaded = load_scenario(path)
    network, lights = RoadNetwork(loaded.scenario.lanelet_network), TrafficLights(loaded.scenario)
    obstacles = ScenarioObstacles(loaded)
    columns = adopted_columns(spec, obstacles, network) if recorded else ()
    rest = np.array([i for i, x in enumerate(obstacles.descriptions) if i not in columns
                     and (recorded or x.role is Role.STATIC)], dtype=np.int64)
    others = tuple(obstacles.descriptions[i] for i in rest)
    adopted = [Adopted(obstacles.descriptions[i], obstacles.first_step(i), *obstacles.track(i))
               for i in columns]

    def world(k: int) -> WorldView:
        states = obstacles.states_at(k)
        return WorldView(k, states.poses[rest], states.velocities[rest], lights.states_at(k))

    dt_s, k0 = loaded.time_step_s, min(0, obstacles.first_k)
    traffic = Traffic(spec, network, loaded.scenario, others, adopted, dt_s,
                      max(1, round(dt_s * MOTION_RATE)), seed, k0, world(k0))
    ticks = range(k0, k0 + round(seconds / dt_s) + 1)
    poses, velocities, shown = [], [], []
    light_ids = tuple(sorted(lights.states_at(k0)))
    for k in ticks:
        seen, states = world(k), traffic.states
        poses.append(np.concatenate((states.poses, seen.poses)))
        velocities.append(np.concatenate((states.velocities, seen.velocities)))
        shown.append([seen.signals[i] for i in light_ids])
        traffic.advance(seen)
    descriptions = (*traffic.descriptions, *others)
    history = _trimmed(_history(dt_s, descriptions, len(traffic.descriptions), np.array(poses),
                                np.array(velocities)))
    return Drive(replace(history, light_ids=light_ids, lights=np.array(shown, dtype=np.str_)),
                 _history(dt_s, obstacles.descriptions, len(obstacles.descriptions),
                          obstacles.poses, obstacles.velocities), loaded)


def _history(dt_s: float, descriptions: tuple[ObjectDescription, ...], agents: int,
             poses: FloatArray, velocities: FloatArray) -> History:
    return History(dt_s, tuple(x.id for x in descriptions), tuple(
        'human' if x.role.is_ego else x.type for x in descriptions), agents,
        tuple(outline(x.shape, CIRCLE_CORNERS, False) for x in descriptions), poses, velocities)


def _trimmed(history: History) -> History:
    """Leave out agents that never came."""
    came = np.flatnonzero(history.present.any(axis=0))
    return replace(
        history, ids=tuple(history.ids[i] for i in came),
        kinds=tuple(history.kinds[i] for i in came), agents=int((came < history.agents).sum()),
        outlines=tuple(history.outlines[i] for i in came), poses=history.poses[:, came],
        velocities=history.velocities[:, came])
