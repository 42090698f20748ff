# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Reactive traffic before its first step, and the world as it sees it.

Driven vehicles are read as the joints that `/vehicles/state` carries.
"""

from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role, whole_id
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.reference_point import shifted, shifted_velocities
from crgame_ros.messages.joints import vehicle_to_joints
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.signs import TrafficLights
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from crgame_ros.traffic.fleet.world_view import WorldView
    from crgame_ros.traffic.traffic import Traffic

# Agents move at this rate, independent of the simulation's rate [Hz] (FS III).
MOTION_RATE = 100.0
FloatArray = NDArray[np.float64]
Joints = Sequence[Sequence[float]] | FloatArray


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


def driven_centers(positions: Joints, velocities: Joints,
                   rear_to_center: Sequence[float]) -> tuple[FloatArray, FloatArray]:
    """
    Return the centres of driven vehicles.

    :param positions: (V, 4) joints of the rear axles
    :param velocities: (V, 4) their derivatives
    :param rear_to_center: (V) from the rear axle to the centre [m]
    :return: poses and velocities, both (V, 3)
    """
    poses, rates = (np.array(rows, dtype=np.float64).reshape(-1, 4)[:, :3]
                    for rows in (positions, velocities))
    distance = np.array(rear_to_center)
    return shifted(poses, distance), shifted_velocities(poses[:, 2], rates, distance)


class WorldReader:
    """
    Builds the agents' view of the world from joints and objects.

    :param descriptions: of everything that can appear: driven vehicles, then objects.
    :param lights: the traffic lights.
    """

    def __init__(self, descriptions: Sequence[ObjectDescription], lights: TrafficLights) -> None:
        driven = [item for item in descriptions if item.role.is_ego]
        objects = [item for item in descriptions if not item.role.is_ego]
        self._ahead = [item.rear_to_center for item in driven]
        self._lights = lights
        self._columns = [column for column, item in enumerate(objects)
                         if item.role is not Role.TRAFFIC]
        self.others: tuple[ObjectDescription, ...] = (
            *driven, *(objects[column] for column in self._columns))

    def view(self, k: int, positions: Joints, velocities: Joints,
             objects: ObjectStates) -> 'WorldView':
        """
        Return what agents react to at tick k.

        :param positions: (V, 4) joints of the driven vehicles
        :param velocities: (V, 4)
        :param objects: all objects.
        """
        # This imports numba, which only runs with agents should wait for.
        from crgame_ros.traffic.fleet.world_view import WorldView
        poses, rates = driven_centers(positions, velocities, self._ahead)
        return WorldView(k, np.concatenate((poses, objects.poses[self._columns])),
                         np.concatenate((rates, objects.velocities[self._columns])),
                         self._lights.states_at(k))


def joints_of(states: Sequence[VehicleState]) -> tuple[Joints, Joints]:
    """Return the joint positions and velocities of driven vehicles, (V, 4) each."""
    joints = [vehicle_to_joints(state) for state in states]
    return [item[0] for item in joints], [item[1] for item in joints]
