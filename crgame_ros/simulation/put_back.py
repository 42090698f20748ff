# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Putting a vehicle back on its lane after a contact, where its driver asks for it."""

from collections.abc import Iterator, Sequence
import math

from crgame_ros.game.objects import ObjectStates
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.geometry.outline import placed_polygon
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.geometry.shape import Shape
from crgame_ros.simulation.setup import Setup
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray
import shapely

# Places are looked for every metre, this far behind the contact, then as far ahead of it [m].
STEP, FARTHEST = 1.0, 50.0
# What stays free ahead of the bumper, so that one can drive off, and all around [m].
ROOM_AHEAD, ROOM_AROUND = 5.0, 0.5
# Nobody who goes on as they do gets there before [s].
UNTOUCHED_S = 2.0
# Who presses on against somebody has one contact with them [m].
SAME_CONTACT = 1.0
# After so much of a way from the contact the vehicle has driven on by itself [m].
LEFT_BEHIND = 20.0

FloatArray = NDArray[np.float64]
Place = tuple[float, float, float]


class PutBack:
    """
    Knows which vehicles a contact has stopped, and where each can be put back.

    A vehicle may be put back from its contact on until it has been, or is `LEFT_BEHIND` away.
    The place is on the middle of the lane of its driving direction, along it, at rest: the
    nearest free one behind the contact, else ahead.

    :param setup: the run.
    """

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._stopped: dict[int, VehicleState] = {}
        shapes = [vehicle.vehicle.shape for vehicle in setup.vehicles]
        self._shapes = shapes + [item.shape for item in setup.obstacles.descriptions]

    def note(self, index: int, state: VehicleState) -> bool:
        """Remember where a contact has stopped a vehicle; tell whether it is another contact."""
        before = self._stopped.get(index)
        self._stopped[index] = state
        return before is None or math.dist(before[:2], state[:2]) > SAME_CONTACT

    def place(self, index: int, since_tick_s: float, states: Sequence[VehicleState],
              objects: ObjectStates) -> VehicleState | None:
        """
        Find where a vehicle whose driver asks for it is put back.

        :param since_tick_s: from the objects' tick to the states [s]
        :param states: (V) of the driven vehicles, simulation coordinates.
        :param objects: (M) at the tick.
        :return: its state there; None if no contact has stopped it, or no place is free.
        """
        stopped, now = self._stopped.get(index), states[index]
        if stopped is None or not self._setup.network.lanelet_ids:
            return None
        if math.dist(stopped[:2], now[:2]) > LEFT_BEHIND:
            del self._stopped[index]
            return None
        taken = shapely.STRtree(self._taken(index, since_tick_s, states, objects))
        for place in self._places(index, now):
            room = self._room(index, place)
            if not len(taken.query(room, predicate='dwithin', distance=ROOM_AROUND)):
                del self._stopped[index]
                return VehicleState(*place, 0.0)
        return None

    def _transform(self, index: int) -> RigidTransform:
        """Choose through which transform the vehicle is on the road (CRG 28)."""
        avs, humans = self._setup.avs, len(self._setup.humans)
        if index >= humans:
            return avs[index - humans].transform
        return avs[0].transform if avs else RigidTransform()

    def _places(self, index: int, now: VehicleState) -> Iterator[Place]:
        """Yield poses of the rear axle on the lane, in simulation coordinates, best first."""
        network, transform = self._setup.network, self._transform(index)
        x, y, yaw = transform.to_scenario(np.array(now[:3])).tolist()
        lane = self._lane(x, y, yaw)
        s = min(max(network.locate(lane, x, y)[0], 0.0), network.line(lane).length)
        ways = np.arange(0.0, FARTHEST + STEP, STEP)
        for way in (*-ways, *ways[1:]):
            found = network.advance(lane, s, float(way))
            if found is None:
                continue
            pose = network.pose_on(*found)
            if network.covers(self._footprint(index, pose)):
                x, y, yaw = transform.to_simulation(np.array(pose)).tolist()
                yield x, y, wrap_pi(yaw)

    def _lane(self, x: float, y: float, yaw: float) -> int:
        """Find the lane: beside the oncoming one that of the vehicle's own direction."""
        network = self._setup.network
        lane = network.nearest_lanelet(x, y, yaw)
        beside = network.opposite_of(lane)
        if beside is None or self._agrees(lane, x, y, yaw) \
                or not self._agrees(beside, x, y, yaw):
            return lane
        return beside

    def _agrees(self, lane: int, x: float, y: float, yaw: float) -> bool:
        network = self._setup.network
        heading = network.pose_on(lane, network.locate(lane, x, y)[0])[2]
        return math.cos(heading - yaw) >= 0.0

    def _footprint(self, index: int, pose: Place, ahead: float = 0.0) -> shapely.Polygon:
        """Draw a vehicle with its rear axle at a pose, longer at its front by some metres."""
        vehicle = self._setup.vehicles[index].vehicle
        shape = Shape.rectangle(vehicle.shape.length + ahead, vehicle.shape.width)
        x, y = VehicleState(*pose, 0.0).center(vehicle.rear_to_center + 0.5 * ahead)
        return placed_polygon(shape, x, y, pose[2])

    def _room(self, index: int, place: Place) -> shapely.Polygon:
        return self._footprint(index, place, ROOM_AHEAD)

    def _taken(self, index: int, since_tick_s: float, states: Sequence[VehicleState],
               objects: ObjectStates) -> list[shapely.Geometry]:
        """Draw what everybody else near covers from now on until `UNTOUCHED_S`."""
        x, y, _ = objects.poses.T
        near = np.hypot(x - states[index].x, y - states[index].y) < 3.0 * FARTHEST
        taken = []
        for other, state in enumerate(states):
            if other != index:
                offset = self._setup.vehicles[other].vehicle.rear_to_center
                velocity = state.speed * np.array([math.cos(state.yaw), math.sin(state.yaw), 0.0])
                taken.append(_swept(self._shapes[other], np.array(
                    [*state.center(offset), state.yaw]), velocity))
        for other in np.flatnonzero(near).tolist():
            velocity = objects.velocities[other]
            taken.append(_swept(self._shapes[len(states) + other],
                                objects.poses[other] + since_tick_s * velocity, velocity))
        return taken


def _swept(shape: Shape, pose: FloatArray, velocity: FloatArray) -> shapely.Geometry:
    """Draw what a body covers that goes straight on at its velocity, centre poses."""
    x, y, yaw = pose.tolist()
    later_x, later_y = (pose[:2] + UNTOUCHED_S * velocity[:2]).tolist()
    return shapely.union(placed_polygon(shape, x, y, yaw),
                         placed_polygon(shape, later_x, later_y, yaw)).convex_hull
