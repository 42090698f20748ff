# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Exports a run as OpenSCENARIO XML 1.2: what moved, along trajectories with times.

A vehicle's reference point there is the middle of its rear axle on the ground, that of anything
else the middle of its box on the ground.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime, time
from importlib.metadata import distribution
from io import BytesIO
from xml.etree import ElementTree

from crgame_ros.errors import CrgameError, InputError, one_line
from crgame_ros.game.object_spec import MOVER_TYPES
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.geometry.shape import Shape
from crgame_ros.recording.export_objects import present_pieces
from crgame_ros.recording.resampling import states_at
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.scenario import guard
from crgame_ros.scenario.loading import SOURCE_MARK
from crgame_ros.timing.cycle_rows import COMMAND_COLUMNS
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import pose_rates, StateColumn
from lxml import etree
import numpy as np
from numpy.typing import NDArray
from scenariogeneration import xosc

FloatArray = NDArray[np.float64]
_MINOR_VERSION = 2
_SCHEMA = 'schemas/OpenSCENARIO_1_2.xsd'
_LIGHTS = COMMAND_COLUMNS.index('lights')
# What moves less than this [m, rad] stands, and has no trajectory.
_STANDING = 1e-4
# Between two vertices, the way of a driven vehicle differs at most by this from a line [m].
_SAG = 2e-3
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
class _Track:
    """
    The motion of an entity at M times.

    :param times_s: (M) increasing [s]
    :param poses: (M, 3) x [m], y [m], yaw [rad] of its reference point; NaN where absent.
    :param speed: at the first of them [m/s]
    """

    name: str
    times_s: FloatArray
    poses: FloatArray
    speed: float


def export_openscenario(log: RunTrajectories, benchmark_id: str, *, day: date | None = None,
                        road: str | None = None) -> tuple[str, tuple[str, ...]]:
    """
    Convert a run to OpenSCENARIO.

    Time 0 is the first step of the log. Each vehicle and object is an entity with a polyline whose
    vertices are its poses at the scenario steps; a driven vehicle has some between these where it
    brakes, accelerates or turns hard. What is there from the beginning is placed at the beginning;
    what appears later is added then, and what vanishes is deleted.

    :param benchmark_id: of the scenario in which it took place.
    :param day: date of the run; that of the original if None.
    :param road: path of an OpenDRIVE file, as it is written; None for no road.
    :return: the content of the file, valid by the schema of version 1.2, and the parts that it
        does not express, one line each.
    :raises InputError: if the run has no step.
    :raises CrgameError: if the result violates the schema.
    """
    if len(log.ks) < 2:
        raise InputError('the run has no scenario step', 'the run',
                         'let it last for a time step or more')
    original = guard.parse_hardened(log.xml_text, '/scenario/xml')
    notices = [*log.notices, *_omissions(log, original, road)]
    times_s = np.round(np.arange(len(log.ks)) * log.game.scheduler.time_step_s, 9)
    entities, init = xosc.Entities(), xosc.Init()
    act = xosc.Act('run', _at('start of the run', 0.0))
    for track, entity in _tracks(log, times_s, notices):
        entities.add_scenario_object(track.name, entity)
        events = _write_track(track, init)
        if events:
            maneuver = xosc.Maneuver(f'{track.name} moves')
            for event in events:
                maneuver.add_event(event)
            group = xosc.ManeuverGroup(track.name)
            group.add_actor(track.name)
            group.add_maneuver(maneuver)
            act.add_maneuver_group(group)
    storyboard = xosc.StoryBoard(init, _at('end of the run', times_s[-1], kind='stop'))
    if act.maneuvergroup:
        storyboard.add_act(act)
    when = day.isoformat() if day is not None else original.get('date', '')
    scenario = xosc.Scenario(
        f'{benchmark_id} {SOURCE_MARK}', original.get('author', ''),
        xosc.ParameterDeclarations(), entities, storyboard, xosc.RoadNetwork(road),
        xosc.Catalog(), osc_minor_version=_MINOR_VERSION,
        creation_date=datetime.combine(
            date.fromisoformat(when if guard.is_date(when) else '1970-01-01'), time()))
    return _document(scenario), tuple(map(one_line, notices))


def _omissions(log: RunTrajectories, original: etree._Element, road: str | None) -> list[str]:
    """Return notices on what of a run and its scenario is not written."""
    told = []
    if shift := int(log.ks[0]):
        told.append(f'time 0 is scenario step {shift} of the original')
    if road is None:
        told.append('the roads are left out: crgame convert --road names an OpenDRIVE file')
    if original.find('trafficLight') is not None:
        told.append('traffic lights are left out: OpenSCENARIO has them in a road network only')
    if original.find('planningProblem') is not None:
        told.append('planning problems are left out: OpenSCENARIO has none')
    if log.commands is not None and np.nan_to_num(log.commands[:, :, _LIGHTS]).any():
        told.append('indicators and horns are left out')
    return told


def _tracks(log: RunTrajectories, times_s: FloatArray,
            notices: list[str]) -> list[tuple[_Track, object]]:
    """Return the motion and the entity of each vehicle and of each object that appeared."""
    states = log.finite_vehicle_states
    seen = np.isfinite(log.object_poses).all(axis=2).any(axis=0)
    columns = np.flatnonzero(seen).tolist()
    found = []
    for column, driven in enumerate(log.game.vehicles):
        entity, _ = _body_of(log.vehicles[column], driven.vehicle)
        found.append((_driven_track(driven.id, times_s, states[:, column]), entity))
    for column in columns:
        item, poses = log.objects[column], log.object_poses[:, column]
        entity, ahead = _body_of(item, None)
        x, y, _ = log.object_velocities[0, column]
        speed = float(np.nan_to_num(x * np.cos(poses[0, 2]) + y * np.sin(poses[0, 2])))
        found.append((_Track(item.id, times_s, shifted(poses, ahead), speed), entity))
    notices += _body_notices([*log.vehicles, *(log.objects[column] for column in columns)])
    if missing := len(log.objects) - len(columns):
        notices.append(f'{missing} objects never appeared in the run and are left out')
    return found


def _driven_track(name: str, times_s: FloatArray, states: FloatArray) -> _Track:
    """Return a vehicle's motion, with as many times between its states as `_SAG` asks for."""
    length = np.diff(times_s)
    # That of a parabola with these velocities at its ends.
    sags = 0.125 * length * np.hypot(*np.diff(pose_rates(states)[:, :2], axis=0).T)
    counts = np.maximum(np.ceil(np.sqrt(sags / _SAG)), 1.0)
    wanted_s = np.concatenate([
        *(start + step * np.arange(count) / count
          for start, step, count in zip(times_s[:-1], length, counts, strict=True)),
        times_s[-1:]])
    return _Track(name, np.round(wanted_s, 9), states_at(states, times_s, wanted_s)[:, :3],
                  float(states[0, StateColumn.SPEED]))


def _write_track(track: _Track, init: xosc.Init) -> list[xosc.Event]:
    """Place an entity that is there from the beginning; return the events of its motion."""
    events = []
    for number, (first, end) in enumerate(present_pieces(track.poses), 1):
        poses = np.round(track.poses[first:end], 4) + 0.0
        # A turn across half a circle would look like one to the other side.
        poses[:, 2] = np.round(np.unwrap(track.poses[first:end, 2]), 4) + 0.0
        places = [xosc.WorldPosition(x, y, h=yaw) for x, y, yaw in poses.tolist()]
        actions = []
        if first == 0:
            init.add_init_action(track.name, xosc.TeleportAction(places[0]))
            init.add_init_action(track.name, xosc.AbsoluteSpeedAction(
                round(track.speed, 4) + 0.0, xosc.TransitionDynamics(
                    xosc.DynamicsShapes.step, xosc.DynamicsDimension.time, 0.0)))
        else:
            actions.append(('appears', xosc.AddEntityAction(track.name, places[0])))
        if np.ptp(poses, axis=0).max() > _STANDING:
            actions.append(('follows its trajectory', _follow(
                f'{track.name} {number}', track.times_s[first:end], places)))
        if actions:
            events.append(_event(f'{track.name} drives {number}', actions,
                                 _at('its first time', track.times_s[first])))
        if end < len(track.times_s):
            actions = [('vanishes', xosc.DeleteEntityAction(track.name))]
            events.append(_event(f'{track.name} vanishes {number}', actions, _at(
                'after its last time', track.times_s[end - 1], xosc.Rule.greaterThan)))
    return events


def _follow(name: str, times_s: FloatArray, places: Sequence[xosc.WorldPosition]
            ) -> xosc.FollowTrajectoryAction:
    trajectory = xosc.Trajectory(name, False)
    trajectory.add_shape(xosc.Polyline(times_s.tolist(), list(places)))
    return xosc.FollowTrajectoryAction(trajectory, xosc.FollowingMode.position,
                                       xosc.ReferenceContext.absolute, 1.0, 0.0)


def _event(name: str, actions: Sequence[tuple[str, object]],
           trigger: xosc.ValueTrigger) -> xosc.Event:
    event = xosc.Event(name, xosc.Priority.parallel)
    for what, action in actions:
        event.add_action(what, action)
    event.add_trigger(trigger)
    return event


def _at(name: str, time_s: float, rule: xosc.Rule = xosc.Rule.greaterOrEqual,
        kind: str = 'start') -> xosc.ValueTrigger:
    """Return a trigger at a time of the simulation."""
    return xosc.ValueTrigger(name, 0.0, xosc.ConditionEdge.none,
                             xosc.SimulationTimeCondition(float(time_s), rule), kind)


def _document(scenario: xosc.Scenario) -> str:
    """
    Return the file's text.

    :raises CrgameError: if it violates the schema.
    """
    element = scenario.get_element()
    ElementTree.indent(element)
    # One line for each vertex: indented as all else, they would make the file twice as large.
    for vertex in element.iter('Vertex'):
        vertex.text = None
        for part in vertex[0].iter():
            part.text = part.tail = None
    text = ("<?xml version='1.0' encoding='UTF-8'?>\n"
            + ElementTree.tostring(element, encoding='unicode') + '\n')
    schema = etree.XMLSchema(etree.parse(
        str(distribution('scenariogeneration').locate_file(_SCHEMA))))
    try:
        for _, part in etree.iterparse(BytesIO(text.encode('utf-8')), tag='Vertex', schema=schema,
                                       huge_tree=True):
            part.clear()
    except etree.XMLSyntaxError as error:
        raise CrgameError('the exported file would break the schema of OpenSCENARIO: '
                          f'{error}') from error
    return text


def _body_of(item: ObjectDescription, parameters: VehicleParameters | None,
             ) -> tuple[xosc.Vehicle | xosc.Pedestrian | xosc.MiscObject, float]:
    """
    Describe a vehicle or object.

    The rear axle of a vehicle that is not driven is unknown. It is assumed in the same share of
    the length as that of the games' own objects of its type.

    :param parameters: of a driven vehicle, None for everything else.
    :return: its description, and the distance from the reference point of its recorded poses
        forward to that of the description [m]
    """
    ahead = 0.0
    if item.type == PEDESTRIAN:
        entity = xosc.Pedestrian(item.id, _PEDESTRIAN_MASS, xosc.PedestrianCategory.pedestrian,
                                 _box(item.shape, item.height, 0.0))
    elif item.type not in VEHICLES:
        category = THINGS.get(item.type, xosc.MiscObjectCategory.obstacle)
        entity = xosc.MiscObject(item.id, _THING_MASS, category,
                                 _box(item.shape, item.height, 0.0))
    elif parameters is not None:
        entity = _driven(item, parameters)
    else:
        entity, ahead = _other_vehicle(item)
    entity.add_property('role', item.role.value)
    # esmini turns an entity between two vertices, not only around them.
    entity.add_property('plineInterpolation', 'segment')
    return entity, ahead


def _body_notices(items: list[ObjectDescription]) -> list[str]:
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


def _driven(item: ObjectDescription, parameters: VehicleParameters) -> xosc.Vehicle:
    braking = min(parameters.max_brake_force / parameters.mass,
                  parameters.friction * parameters.gravity) or _ACCELERATION
    return _vehicle(item, parameters.height or item.height, parameters.rear_to_center,
                    parameters.wheelbase, parameters.max_steering_angle,
                    (parameters.max_speed, parameters.max_acceleration, braking),
                    parameters.mass)


def _other_vehicle(item: ObjectDescription) -> tuple[xosc.Vehicle, float]:
    usual = MOVER_TYPES.get(item.type, MOVER_TYPES['car'])
    scale = item.shape.length / usual.shape.length
    rear_to_center = usual.rear_to_center * scale
    entity = _vehicle(item, item.height, rear_to_center, usual.wheelbase * scale, usual.steering,
                      (_TOP_SPEED, _ACCELERATION, _ACCELERATION), None)
    return entity, -rear_to_center


def _vehicle(item: ObjectDescription, height: float, rear_to_center: float, wheelbase: float,
             steering: float, limits: tuple[float, float, float],
             mass: float | None) -> xosc.Vehicle:
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


def _box(shape: Shape, height: float, ahead: float) -> xosc.BoundingBox:
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
