# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reactive traffic of a run before its first step, for both runners and for traffic_node."""

from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from crgame_ros.game.objects import ObjectDescription, ObjectStates, whole_id
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.signals import TrafficLights
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.simulation.world_reader import joints_of, WorldReader
from crgame_ros.vehicle.state import VehicleState

if TYPE_CHECKING:  # Both import numba: only runs with agents should wait for that.
    from crgame_ros.traffic.fleet.world_view import WorldView
    from crgame_ros.traffic.traffic import Traffic

# Agents move at this rate, independent of the simulation's rate [Hz] (FS III).
MOTION_RATE = 100.0


@dataclass(frozen=True)
class TrafficSetup:
    """
    The agents at the first tick.

    :param descriptions: of all that may appear, adopted obstacles first.
    :param make: builds a new set of agents, the same every time.
    """

    descriptions: tuple[ObjectDescription, ...]
    make: Callable[[], 'Traffic']


def adopted_columns(spec: TrafficSpec | None, obstacles: ScenarioObstacles, network: RoadNetwork,
                    kept: Collection[str] = ()) -> tuple[int, ...]:
    """
    Choose the recorded obstacles that become agents.

    :param kept: ids of obstacles named by events, which stay as recorded, as do those of several
        shapes.
    :return: their columns, in order
    """
    if spec is None or spec.recorded != 'reactive':
        return ()
    from crgame_ros.traffic.fleet.adoption import adoptable
    parts = Counter(map(whole_id, obstacles.ids))
    return tuple(column for column, item in enumerate(obstacles.descriptions)
                 if item.id not in kept and parts[whole_id(item.id)] == 1
                 and adoptable(item, obstacles.track(column)[0], network))


def make_traffic(spec: TrafficSpec, loaded: LoadedScenario, network: RoadNetwork,
                 others: Sequence[ObjectDescription], obstacles: ScenarioObstacles,
                 adopted: Sequence[int], world: 'WorldView', scheduler: ScenarioScheduler,
                 seed: int) -> 'Traffic':
    """
    Build the agents of a run.

    :param others: everything but agents, in the order of `world`.
    :param obstacles: the recorded obstacles.
    :param adopted: columns of those that become agents.
    :param world: everything but agents at the first tick.
    :param seed: of the game; the traffic's own seed takes precedence.
    """
    from crgame_ros.traffic.compiling.kernel_cache import compile_now
    from crgame_ros.traffic.fleet.adoption import Adopted
    from crgame_ros.traffic.traffic import Traffic
    compile_now()
    tracks = [Adopted(obstacles.descriptions[column], obstacles.first_step(column),
                      *obstacles.track(column)) for column in adopted]
    return Traffic(spec, network, loaded.scenario, others, tracks, scheduler.time_step_s,
                   max(1, round(scheduler.time_step_s * MOTION_RATE)), seed, scheduler.k0, world)


def place_traffic(spec: TrafficSpec, loaded: LoadedScenario, network: RoadNetwork,
                  descriptions: Sequence[ObjectDescription], obstacles: ScenarioObstacles,
                  adopted: Sequence[int], vehicles: Sequence[VehicleState],
                  objects: ObjectStates, scheduler: ScenarioScheduler,
                  seed: int) -> TrafficSetup:
    """
    Place the agents of a run around everything else.

    :param descriptions: of driven vehicles and objects; adopted ones are agents already.
    :param obstacles: the recorded obstacles.
    :param adopted: columns of those that become agents.
    :param vehicles: states of the driven vehicles at the first tick.
    :param objects: states of all objects at the first tick.
    """
    reader = WorldReader(descriptions, TrafficLights(loaded.scenario))
    world = reader.view(scheduler.k0, *joints_of(vehicles), objects)

    def fresh() -> 'Traffic':
        return make_traffic(spec, loaded, network, reader.others, obstacles, adopted, world,
                            scheduler, seed)

    # Reading the roads takes seconds on large maps: the first call returns the agents made here.
    made = [fresh()]
    return TrafficSetup(made[0].descriptions, lambda: made.pop() if made else fresh())
