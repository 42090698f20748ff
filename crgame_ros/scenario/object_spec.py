# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The objects that a game adds to its scenario (FS II-A3), and what each type is like."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
import math
from types import MappingProxyType
from typing import Literal

from crgame_ros.geometry.shape import Shape

ObjectKind = Literal['static', 'particle', 'bicycle']
Point = tuple[float, float]
# Time since the start of the object [s], centre x [m], y [m], yaw [rad].
TrajectoryRow = tuple[float, float, float, float]

STATIC_TYPES = ('unknown', 'parkedVehicle', 'constructionZone', 'roadBoundary', 'building',
                'pillar', 'median_strip')


@dataclass(frozen=True)
class MoverType:
    """
    How things of one type look and move, unless a game says otherwise.

    :param shape: around the centre.
    :param speed: [m/s]
    :param acceleration: that it likes to have at most; of a particle the hardest, in any
        direction [m/s^2]
    :param deceleration: comfortable [m/s^2]
    :param hardest: deceleration [m/s^2]
    :param headway: time gap behind what is ahead, the T of the IDM; of a particle the time gap in
        the traffic that it accepts to cross [s]
    :param distance: gap at standstill, the s0 of the IDM [m]
    :param wheelbase: [m]
    :param steering: largest angle [rad]
    :param rear_to_center: from the rear axle forward to the centre [m]
    :param lateral: acceleration in bends [m/s^2]
    """

    shape: Shape
    speed: float
    acceleration: float
    deceleration: float
    hardest: float
    headway: float
    distance: float
    wheelbase: float = 0.0
    steering: float = 0.0
    rear_to_center: float = 0.0
    lateral: float = 2.5

    @property
    def sharpest(self) -> float:
        """Largest curvature of the rear axle's path, tan(steering) / wheelbase [1/m]."""
        return 0.0 if self.wheelbase == 0.0 else math.tan(self.steering) / self.wheelbase


# The car is CommonRoad's vehicle 2, with a turning circle of 11 m; a, b, T and s0 of motor
# vehicles are those of the planner idm. Circles of 0.35 m are the pedestrians of our scenarios,
# 1.34 m/s their mean speed (Weidmann 1993), 2 m/s^2 about what the relaxation time of 0.5 s of
# Helbing and Molnár (1995) means from standstill; 3 s is the start-up and end clearance time of
# the critical gap in the Highway Capacity Manual. The size of bicycles is that of recorded ones
# (DEU_Guetersloh-36); everything else is ours.
_CAR = MoverType(Shape.rectangle(4.508, 1.61), 13.9, 1.5, 2.0, 8.0, 1.5, 2.0, 2.579, 0.56, 1.4227)
MOVER_TYPES: Mapping[str, MoverType] = MappingProxyType({
    'pedestrian': MoverType(Shape.circle(0.35), 1.34, 2.0, 1.0, 2.0, 3.0, 0.5),
    'bicycle': MoverType(Shape.rectangle(1.9, 0.7), 4.2, 1.0, 1.5, 4.0, 1.0, 1.0, 1.05, 0.6,
                         0.525, 2.0),
    'motorcycle': MoverType(Shape.rectangle(2.2, 0.8), 13.9, 2.0, 2.5, 8.0, 1.5, 2.0, 1.4, 0.5,
                            0.7),
    'car': _CAR, 'taxi': _CAR, 'priorityVehicle': _CAR,
    'truck': MoverType(Shape.rectangle(8.4, 2.5), 11.1, 1.0, 1.5, 6.0, 1.5, 2.0, 4.8, 0.6, 2.4,
                       1.5),
    'bus': MoverType(Shape.rectangle(12.0, 2.55), 11.1, 1.0, 1.5, 6.0, 1.5, 2.0, 6.0, 0.65, 3.0,
                     1.5),
    'unknown': MoverType(Shape.circle(0.35), 1.34, 2.0, 1.0, 2.0, 3.0, 0.5)})
PARTICLE_TYPES = ('pedestrian', 'unknown')
BICYCLE_TYPES = tuple(name for name in MOVER_TYPES if name not in PARTICLE_TYPES)


@dataclass(frozen=True)
class ObjectSpec:
    """
    One object of a game; what is None is taken from its type (`MOVER_TYPES`).

    Exactly one of `at`, `path`, `lanelet` and `trajectory` says where it is.

    :param id: unique name, b0, b1, … by default.
    :param kind: movement model: `static`, `particle` (omnidirectional), `bicycle` (kinematic).
    :param type: CommonRoad's name of what it is.
    :param at: pose of a static object: centre x [m], y [m], yaw [rad].
    :param path: way-points of the centre [m].
    :param lanelet: where it starts; it follows the straightest successors.
    :param s: station of its centre on that lanelet [m]
    :param trajectory: predetermined states: t [s], x [m], y [m], yaw [rad].
    :param speed: that it wants [m/s]
    :param speeds: that it wants at each way-point, linear in between [m/s]
    :param start: time since the start of the run at which it sets off [s]; one that starts at 0
        moves at its speed already.
    :param end: what it does at its end: `stay` or `vanish`.
    :param reactive: whether it minds others.
    :param length: of its rectangle [m]
    :param width: of its rectangle [m]
    :param radius: of its circle [m]
    :param acceleration: [m/s^2]
    :param deceleration: comfortable [m/s^2]
    :param headway: T of the IDM, or the time gap that a particle accepts [s]
    :param distance: s0 of the IDM, or the distance that a particle keeps from vehicles [m]
    """

    id: str
    kind: ObjectKind
    type: str
    at: tuple[float, float, float] | None = None
    path: tuple[Point, ...] = ()
    lanelet: int | None = None
    s: float = 0.0
    trajectory: tuple[TrajectoryRow, ...] = ()
    speed: float | None = None
    speeds: tuple[float, ...] = ()
    start: float = 0.0
    end: Literal['stay', 'vanish'] = 'stay'
    reactive: bool = False
    length: float | None = None
    width: float | None = None
    radius: float | None = None
    acceleration: float | None = None
    deceleration: float | None = None
    headway: float | None = None
    distance: float | None = None

    @property
    def shape(self) -> Shape:
        """Footprint around its centre; a static one of unknown size measures 1 m by 1 m."""
        if self.radius is not None:
            return Shape.circle(self.radius)
        if self.length is not None and self.width is not None:
            return Shape.rectangle(self.length, self.width)
        if self.kind != 'static':
            return MOVER_TYPES[self.type].shape
        return MOVER_TYPES['car'].shape if self.type == 'parkedVehicle' \
            else Shape.rectangle(1.0, 1.0)

    @property
    def mover(self) -> MoverType:
        """What its type is like, with everything that the game says otherwise."""
        base = MOVER_TYPES[self.type]
        own = {name: getattr(self, name) for name in
               ('speed', 'acceleration', 'deceleration', 'headway', 'distance')}
        return replace(base, shape=self.shape,
                       **{name: value for name, value in own.items() if value is not None})
