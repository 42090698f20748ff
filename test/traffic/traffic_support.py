# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Run traffic in tests, and find overlaps independently of its own geometry."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from pathlib import Path

from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.scenario import Scenario
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.shape import Shape
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.signs import TrafficLights
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.traffic.fleet.adoption import Adopted
from crgame_ros.traffic.fleet.world_view import WorldView
from crgame_ros.traffic.traffic import Traffic
import numpy as np
import shapely
from shapely import affinity

CAR = Shape.rectangle(4.5, 1.8)
SUBSTEPS = 10


@dataclass
class Actor:
    """Another road user that drives straight on from a pose at a given speed, or stands."""

    description: ObjectDescription
    pose: tuple[float, float, float]
    speed: float = 0.0
    since: int = 0
    until: int = 10**9

    def at(self, k: int, dt: float) -> tuple[list[float], list[float]]:
        if not self.since <= k < self.until:
            return [math.nan] * 3, [math.nan] * 3
        x, y, yaw = self.pose
        way = self.speed * dt * (k - self.since)
        return ([x + way * math.cos(yaw), y + way * math.sin(yaw), yaw],
                [self.speed * math.cos(yaw), self.speed * math.sin(yaw), 0.0])


def human(x: float, y: float, yaw: float, speed: float = 0.0, since: int = 0,
          until: int = 10**9, kind: str = 'car', shape: Shape = CAR) -> Actor:
    role = Role.HUMAN if kind == 'car' else Role.STATIC if kind == 'parkedVehicle' \
        else Role.RECORDED
    return Actor(ObjectDescription('hv0', kind, role, shape), (x, y, yaw), speed, since, until)


class Run:
    """Traffic on a map, with its history."""

    def __init__(self, scenario: Scenario | Path, spec: TrafficSpec, seed: int = 0,
                 actors: Sequence[Actor] = (), adopted: Sequence = ()) -> None:
        if isinstance(scenario, Path):
            scenario = load_scenario(scenario).scenario
        self.dt = float(scenario.dt)
        self.network = RoadNetwork(scenario.lanelet_network)
        self.actors = list(actors)
        self.lights = TrafficLights(scenario)
        self.k = 0
        self.traffic = Traffic(spec, self.network, scenario,
                               [a.description for a in actors], adopted, self.dt, SUBSTEPS, seed,
                               0, self.world())
        self.descriptions = self.traffic.descriptions
        self.poses: list[np.ndarray] = []
        self.speeds: list[np.ndarray] = []
        self.note()

    def world(self) -> WorldView:
        at = [actor.at(self.k, self.dt) for actor in self.actors]
        rows = np.array(at, dtype=float).reshape(-1, 2, 3)
        return WorldView(self.k, rows[:, 0], rows[:, 1], self.lights.states_at(self.k))

    def note(self) -> None:
        states = self.traffic.states
        self.poses.append(states.poses)
        self.speeds.append(np.hypot(states.velocities[:, 0], states.velocities[:, 1]))

    def ticks(self, count: int) -> 'Run':
        for _ in range(count):
            self.traffic.advance(self.world())
            self.k += 1
            self.note()
        return self

    def outline(self, number: int, pose: np.ndarray) -> shapely.Polygon:
        shape = self.descriptions[number].shape
        return rectangle(pose, shape.length, shape.width)

    def overlaps(self) -> list[tuple[int, str, str]]:
        """List every tick at which two agents, or an agent and an actor, overlap."""
        found = []
        for k, poses in enumerate(self.poses):
            here = np.flatnonzero(np.isfinite(poses[:, 0]))
            shapes = [self.outline(int(i), poses[i]) for i in here]
            names = [self.descriptions[i].id for i in here]
            for actor in self.actors:
                pose = np.array(actor.at(k, self.dt)[0])
                if np.isfinite(pose[0]):
                    size = actor.description.shape
                    shapes.append(rectangle(pose, size.length, size.width))
                    names.append(actor.description.id)
            if not shapes:
                continue
            tree = shapely.STRtree(shapes)
            pairs = tree.query(shapes, predicate='intersects').T
            found += [(k, names[i], names[j]) for i, j in pairs if i < j]
        return found

    def series(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        """Return poses and speeds of one agent over time."""
        return (np.array([p[number] for p in self.poses]),
                np.array([s[number] for s in self.speeds]))


def rectangle(pose: np.ndarray, length: float, width: float) -> shapely.Polygon:
    """Make an outline with shapely's own rotation."""
    box = shapely.box(-0.5 * length, -0.5 * width, 0.5 * length, 0.5 * width)
    turned = affinity.rotate(box, float(pose[2]), origin=(0.0, 0.0), use_radians=True)
    return affinity.translate(turned, float(pose[0]), float(pose[1]))


def driving(number: int, poses: Sequence[tuple[float, float, float]], speed: float,
            first_k: int = 0, kind: str = 'car', shape: Shape = CAR) -> Adopted:
    """Make a recording that begins at the first pose at a speed and ends at the last pose."""
    rows = np.array(poses, dtype=float)
    velocity = speed * np.stack((np.cos(rows[:, 2]), np.sin(rows[:, 2]), 0.0 * rows[:, 2]),
                                axis=-1)
    return Adopted(ObjectDescription(f'o{number}', kind, Role.RECORDED, shape), first_k, rows,
                   velocity)


def lane_strip(number: int, line: Sequence[tuple[float, float]], width: float = 3.5,
               **links: object) -> Lanelet:
    """Make a lanelet around a polyline."""
    points = np.array(line, dtype=float)
    tangent = np.gradient(points, axis=0)
    normal = np.column_stack((-tangent[:, 1], tangent[:, 0]))
    normal *= 0.5 * width / np.hypot(*tangent.T)[:, None]
    return Lanelet(points + normal, points, points - normal, number, **links)


def straight_lane(number: int, y: float, start: float, end: float, **links: object) -> Lanelet:
    """Make a lane along x."""
    return lane_strip(number, [(x, y) for x in np.linspace(start, end, 30)], **links)


def roads(*lanelets: Lanelet) -> Scenario:
    """Make a scenario of lanelets, with a time step of 0.1 s."""
    scenario = Scenario(0.1)
    scenario.add_objects(list(lanelets))
    return scenario
