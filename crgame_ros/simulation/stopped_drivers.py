# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Stops driven vehicles at contacts, and puts them back on their lane."""

from collections.abc import Iterable, Iterator, Sequence
import math
from typing import TypeGuard

from crgame_ros.drivability.collision import CollisionDetector
from crgame_ros.game.events import FiredEvent
from crgame_ros.game.objects import ObjectStates
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.geometry.outline import placed_polygon
from crgame_ros.geometry.rigid_transform import Pose
from crgame_ros.geometry.shape import Shape
from crgame_ros.simulation.autonomous_vehicle import AutonomousVehicle
from crgame_ros.simulation.setup import Setup
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.human_vehicle import HumanVehicle, TracedVehicle
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray
import shapely

# Step and range of the search for places, first behind the contact, then ahead of it [m].
STEP, FARTHEST = 1.0, 50.0
# Free space needed ahead of the bumper, so that the driver can drive off, and all around [m].
ROOM_AHEAD, ROOM_AROUND = 5.0, 0.5
# No other vehicle may reach the place within this time at its present velocity [s].
UNTOUCHED_S = 2.0
# Contacts of one vehicle within this distance count as the same contact [m].
SAME_CONTACT = 1.0
# Beyond this distance from the contact the vehicle has left it without being put back [m].
LEFT_BEHIND = 20.0

FloatArray = NDArray[np.float64]
Place = tuple[float, float, float]
_Candidate = tuple[Place, shapely.Polygon]


class PutBack:
    """
    The vehicles that a contact has stopped, and the places where each can be put back.

    A vehicle may be put back once after its contact, while it is within `LEFT_BEHIND` of it.
    It then stands at rest on the centre line of the lane in its driving direction, at the
    nearest free place behind it, else ahead.

    :param setup: the run.
    """

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._stopped: dict[int, VehicleState] = {}
        # Where each was when none of its places was free, and the places: a driver keeps asking.
        self._tried: dict[int, tuple[Place, list[_Candidate]]] = {}
        shapes = [vehicle.vehicle.shape for vehicle in setup.vehicles]
        self._shapes = shapes + [item.shape for item in setup.obstacles.descriptions]

    def note(self, index: int, state: VehicleState) -> bool:
        """Store where a contact stopped a vehicle; return whether it is a new contact."""
        before = self._stopped.get(index)
        self._stopped[index] = state
        return before is None or math.dist(before[:2], state[:2]) > SAME_CONTACT

    def place(self, index: int, since_tick_s: float, states: Sequence[VehicleState],
              objects: ObjectStates) -> VehicleState | None:
        """
        Find the place for a vehicle whose driver asks to be put back.

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
        tried: list[_Candidate] = []
        for place, room in self._candidates(index, now):
            if not len(taken.query(room, predicate='dwithin', distance=ROOM_AROUND)):
                del self._stopped[index]
                return VehicleState(*place, 0.0)
            tried.append((place, room))
        self._tried[index] = now[:3], tried
        return None

    def _candidates(self, index: int, now: VehicleState) -> Iterable[_Candidate]:
        """Return the places on the lane with the room that each needs, best first."""
        if index in self._tried and self._tried[index][0] == now[:3]:
            return self._tried[index][1]
        return ((place, self._footprint(index, place, ROOM_AHEAD))
                for place in self._places(index, now))

    def _places(self, index: int, now: VehicleState) -> Iterator[Place]:
        """Yield poses of the rear axle on the lane, in simulation coordinates, best first."""
        network, transform = self._setup.network, self._setup.road_transforms[index]
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
        """Find the nearest lane; prefer the vehicle's own direction to the oncoming one."""
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
        """Return the outline of a vehicle with its rear axle at a pose, extended `ahead` [m]."""
        vehicle = self._setup.vehicles[index].vehicle
        shape = Shape.rectangle(vehicle.shape.length + ahead, vehicle.shape.width)
        x, y = VehicleState(*pose, 0.0).center(vehicle.rear_to_center + 0.5 * ahead)
        return placed_polygon(shape, x, y, pose[2])

    def _taken(self, index: int, since_tick_s: float, states: Sequence[VehicleState],
               objects: ObjectStates) -> list[shapely.Geometry]:
        """Return the areas that other vehicles and near objects cover within `UNTOUCHED_S`."""
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
    """Return the area that a body covers at constant velocity, from its centre pose."""
    x, y, yaw = pose.tolist()
    later_x, later_y = (pose[:2] + UNTOUCHED_S * velocity[:2]).tolist()
    return shapely.union(placed_polygon(shape, x, y, yaw),
                         placed_polygon(shape, later_x, later_y, yaw)).convex_hull


class ContactStop:
    """
    Finds vehicles whose last step led into, or deeper into, another vehicle or object.

    Deeper means that the centres come closer: a vehicle in contact can still drive away, mostly
    backwards. Only the vehicle that moved is stopped: one that stands and is hit stays in place.

    :param setup: the run.
    """

    def __init__(self, setup: Setup) -> None:
        self._detector = CollisionDetector(
            [vehicle.vehicle.shape for vehicle in setup.vehicles],
            [item.shape for item in setup.obstacles.descriptions])
        self._vehicle_ids = setup.vehicle_ids
        self._object_ids = [item.id for item in setup.obstacles.descriptions]
        self._rear_to_center = [vehicle.vehicle.rear_to_center for vehicle in setup.vehicles]

    def set_objects(self, objects: ObjectStates) -> None:
        """Store the objects of a tick."""
        self._objects = objects
        self._detector.set_objects(objects)

    def stopped(self, since_tick_s: float, before: Sequence[VehicleState],
                after: Sequence[VehicleState]) -> list[tuple[int, str]]:
        """
        Find the vehicles whose last step has to be undone.

        :param since_tick_s: from the objects' tick to the states after the step [s]
        :param before: (V) states of the driven vehicles before the step.
        :param after: (V) their states after it.
        :return: indices of vehicles, in order, each with the id of what it touched.
        """
        self._detector.move(since_tick_s)
        centers = [self._center(index, state) for index, state in enumerate(after)]
        among, with_objects = self._detector.hits(centers)
        found = []
        for index, (vehicles, objects) in enumerate(zip(among, with_objects, strict=True)):
            touched = [(self._vehicle_ids[other], centers[other]) for other in vehicles]
            touched += [(self._object_ids[other], self._object_center(other, since_tick_s))
                        for other in objects]
            was = self._center(index, before[index])
            closer = [name for name, other in touched if math.dist(centers[index][:2], other[:2])
                      < math.dist(was[:2], other[:2])]
            found += [(index, closer[0])] if closer else []
        return found

    def _center(self, index: int, state: VehicleState) -> Pose:
        x, y = state.center(self._rear_to_center[index])
        return x, y, state.yaw

    def _object_center(self, index: int, since_tick_s: float) -> Pose:
        x, y, yaw = self._objects.poses[index] + since_tick_s * self._objects.velocities[index]
        return float(x), float(y), float(yaw)


def at_rest(before: VehicleState, after: VehicleState) -> VehicleState:
    """Return the state of a vehicle stopped where it was, with its front wheels turned."""
    return before._replace(speed=0.0, steering_angle=after.steering_angle, acceleration=0.0,
                           yaw_rate=0.0, steering_rate=after.steering_rate)


Driven = HumanVehicle | TracedVehicle | AutonomousVehicle


class StoppedDrivers:
    """
    Stops drivers at contacts, where the game asks for it.

    :param setup: the run.
    :param driven: its driven vehicles, humans first.
    :ivar events: the events so far.
    """

    def __init__(self, setup: Setup, driven: Sequence[Driven]) -> None:
        self._driven = driven
        self._ids = setup.vehicle_ids
        self._scheduler = setup.scheduler
        self._contacts = ContactStop(setup)
        self._put_back = PutBack(setup)
        self.events: tuple[FiredEvent, ...] = ()

    def events_at(self, n: int) -> tuple[FiredEvent, ...]:
        """Return the events of a step."""
        return tuple(event for event in self.events if event.n == n)

    def act(self, n: int, before: Sequence[VehicleState],
            commands: Sequence[DriverCommand | None], objects: ObjectStates) -> None:
        """
        Stop vehicles that have driven into something, and put back those whose drivers ask for it.

        :param n: the step just made.
        :param before: their states before it.
        :param commands: those of this step.
        :param objects: at the last scenario step.
        """
        scheduler = self._scheduler
        since_tick = (n - 1) % scheduler.steps_per_tick + 1
        since_tick_s = since_tick * scheduler.dt_s
        if since_tick == 1:
            self._contacts.set_objects(objects)
        states = [driven.state for driven in self._driven]
        for index, other in self._contacts.stopped(since_tick_s, before, states):
            driven = self._driven[index]
            if _has_driver(driven):
                driven.stand(at_rest(before[index], driven.state))
                if self._put_back.note(index, driven.state):
                    self.events += (FiredEvent.contact(
                        self._ids[index], other, n, scheduler.k(n)),)
        for index, command in enumerate(commands):
            if command is not None and command.put_back:
                self._put_on_lane(index, n, since_tick_s, objects)

    def _put_on_lane(self, index: int, n: int, since_tick_s: float,
                     objects: ObjectStates) -> None:
        """Put a vehicle that a contact has stopped back on its lane, if there is room."""
        driven = self._driven[index]
        if not _has_driver(driven):
            return
        place = self._put_back.place(
            index, since_tick_s, [each.state for each in self._driven], objects)
        if place is not None:
            driven.stand(place)
            self.events += (FiredEvent.put_back(
                self._ids[index], n, self._scheduler.k(n)),)


def _has_driver(driven: Driven) -> TypeGuard[HumanVehicle | AutonomousVehicle]:
    """Return whether a driver has the vehicle now; traces and plans are never stopped."""
    return isinstance(driven, HumanVehicle) or (
        isinstance(driven, AutonomousVehicle) and driven.driven)
