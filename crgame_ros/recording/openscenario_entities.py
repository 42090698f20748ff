# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Describes vehicles and objects of a run as entities of OpenSCENARIO.

A vehicle's reference point there is the middle of its rear axle on the ground, that of anything
else the middle of its box on the ground.
"""

from collections import defaultdict
from dataclasses import dataclass
from typing import Any

from crgame_ros.game.object_spec import MOVER_TYPES
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.geometry.shape import Shape
from crgame_ros.vehicle.parameters import VehicleParameters
from scenariogeneration import xosc

# By CommonRoad's type.
VEHICLES = {
    'car': xosc.VehicleCategory.car, 'parkedVehicle': xosc.VehicleCategory.car,
    'taxi': xosc.VehicleCategory.car, 'priorityVehicle': xosc.VehicleCategory.car,
    'truck': xosc.VehicleCategory.truck, 'bus': xosc.VehicleCategory.bus,
    'motorcycle': xosc.VehicleCategory.motorbike, 'bicycle': xosc.VehicleCategory.bicycle,
    'train': xosc.VehicleCategory.train}
THINGS = {
    'building': xosc.MiscObjectCategory.building, 'pillar': xosc.MiscObjectCategory.pole,
    'roadBoundary': xosc.MiscObjectCategory.barrier,
    'constructionZone': xosc.MiscObjectCategory.obstacle}
PEDESTRIAN = 'pedestrian'
# Types without a category of their own, by the category that is written.
_REPLACED = {'taxi': 'car', 'priorityVehicle': 'car', 'median_strip': 'obstacle',
             'unknown': 'obstacle'}
# Required by the schema and unknown for recorded objects. No limit of theirs may restrict a
# trajectory.
_PEDESTRIAN_MASS, _THING_MASS = 75.0, 500.0
_TOP_SPEED, _ACCELERATION = 100.0, 10.0
_WHEEL_DIAMETERS = {'truck': 1.0, 'bus': 1.0, 'train': 0.9}
_WHEEL_DIAMETER = 0.65
# Of the width, between the middles of two wheels.
_TRACK = 0.85


@dataclass(frozen=True)
class Body:
    """
    A vehicle or object in OpenSCENARIO.

    :param entity: its description: a `Vehicle`, `Pedestrian` or `MiscObject` of the library.
    :param ahead: from the reference point of its recorded poses forward to that of the entity [m]
    """

    entity: Any
    ahead: float


def body_of(item: ObjectDescription, parameters: VehicleParameters | None) -> Body:
    """
    Describe a vehicle or object.

    The rear axle of a vehicle that is not driven is unknown. It is assumed in the same share of
    the length as that of the games' own objects of its type.

    :param parameters: of a driven vehicle, None for everything else.
    """
    if item.type == PEDESTRIAN:
        entity = xosc.Pedestrian(item.id, _PEDESTRIAN_MASS, xosc.PedestrianCategory.pedestrian,
                                 _box(item.shape, item.height, 0.0))
        ahead = 0.0
    elif item.type not in VEHICLES:
        category = THINGS.get(item.type, xosc.MiscObjectCategory.obstacle)
        entity = xosc.MiscObject(item.id, _THING_MASS, category,
                                 _box(item.shape, item.height, 0.0))
        ahead = 0.0
    elif parameters is not None:
        entity = _driven(item, parameters)
        ahead = 0.0
    else:
        entity, ahead = _other_vehicle(item)
    entity.add_property('role', item.role.value)
    # esmini turns an entity between two vertices, not only around them.
    entity.add_property('plineInterpolation', 'segment')
    return Body(entity, ahead)


def body_notices(items: list[ObjectDescription]) -> list[str]:
    """Return a line for each kind of shape and type that OpenSCENARIO does not have."""
    shapes, types = defaultdict(list), defaultdict(list)
    for item in items:
        if item.shape.kind != 'rectangle':
            shapes[item.shape.kind].append(item.id)
        if item.type in _REPLACED:
            types[item.type].append(item.id)
    return [*(f'each {kind} is written as the box around it: {", ".join(names)}'
              for kind, names in shapes.items()),
            *(f'OpenSCENARIO has no type {kind}; written as {_REPLACED[kind]}: {", ".join(names)}'
              for kind, names in types.items())]


def _driven(item: ObjectDescription, parameters: VehicleParameters) -> Any:
    braking = min(parameters.max_brake_force / parameters.mass,
                  parameters.friction * parameters.gravity) or _ACCELERATION
    return _vehicle(item, parameters.height or item.height, parameters.rear_to_center,
                    parameters.wheelbase, parameters.max_steering_angle,
                    (parameters.max_speed, parameters.max_acceleration, braking),
                    parameters.mass)


def _other_vehicle(item: ObjectDescription) -> tuple[Any, float]:
    usual = MOVER_TYPES.get(item.type, MOVER_TYPES['car'])
    scale = item.shape.length / usual.shape.length
    rear_to_center = usual.rear_to_center * scale
    entity = _vehicle(item, item.height, rear_to_center, usual.wheelbase * scale, usual.steering,
                      (_TOP_SPEED, _ACCELERATION, _ACCELERATION), None)
    return entity, -rear_to_center


def _vehicle(item: ObjectDescription, height: float, rear_to_center: float, wheelbase: float,
             steering: float, limits: tuple[float, float, float], mass: float | None) -> Any:
    """
    Describe a vehicle.

    :param limits: highest speed [m/s], acceleration and deceleration [m/s^2].
    """
    wheel = _WHEEL_DIAMETERS.get(item.type, _WHEEL_DIAMETER)
    track = _TRACK * item.shape.width
    front, rear = (xosc.Axle(angle, wheel, _number(track), _number(place), 0.5 * wheel)
                   for angle, place in ((steering, wheelbase), (0.0, 0.0)))
    return xosc.Vehicle(item.id, VEHICLES[item.type], _box(item.shape, height, rear_to_center),
                        front, rear, *map(_number, limits), mass)


def _box(shape: Shape, height: float, ahead: float) -> Any:
    """
    Return the box around a footprint.

    :param ahead: from the reference point forward to the footprint's own centre [m]
    """
    x = y = 0.0
    if shape.kind == 'polygon':
        xs, ys = zip(*shape.vertices, strict=True)
        x, y = 0.5 * (min(xs) + max(xs)), 0.5 * (min(ys) + max(ys))
    return xosc.BoundingBox(_number(shape.width), _number(shape.length), height,
                            _number(ahead + x), _number(y), 0.5 * height)


def _number(value: float) -> float:
    """Round to what is written [0.1 mm], without a negative zero."""
    return round(value, 4) + 0.0
