# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finds the start poses of driven vehicles."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import math

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.errors import InputError
from crgame_ros.game.game import HumanSpec, LaneletSpawn, PoseSpawn
from crgame_ros.game.objects import ObjectDescription, ObjectStates
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.geometry.curve import Curve
from crgame_ros.geometry.outline import placed_polygon
from crgame_ros.geometry.reference_point import ahead
from crgame_ros.geometry.shape import Shape
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.exact_values import exact_position, exact_value
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray
import shapely

# Least distance behind the AV's rear axle, in vehicle lengths.
_CLOSEST = 1.5
# Margin around the footprint [m], headway behind the AV [s], and the deceleration [m/s^2] and
# reaction time [s] with which gaps are judged.
_MARGIN = 0.5
_HEADWAY_S = 2.0
_BRAKING = 4.0
_REACTION_S = 1.0
_SIGHT = 120.0
_NEAR = 250.0
_MAX_NEAR = 600
# Below this speed a yaw rate does not determine the steering angle [m/s].
_MIN_STEERING_SPEED = 0.5


def problem_pose(problem: PlanningProblem, rear_to_center: float,
                 wheelbase: float | None = None) -> VehicleState:
    """
    Return the initial state of a planning problem as a rear-axle state.

    The position of a CommonRoad state is the centre of the vehicle: the state classes of the KS
    model document it so, and the reactive planner shifts it to the rear axle. Here it is moved
    back along the heading in the same way.

    :param problem: its initial state is exact (`LoadedScenario.planning_problems`)
    :param rear_to_center: distance l_r from the rear axle to the centre [m]
    :param wheelbase: L [m], with which a given yaw rate becomes the steering angle
        atan(L yaw_rate / v) of the KS model; None starts with straight wheels
    """
    state = problem.initial_state
    x, y = exact_position(state.position)
    yaw, speed = wrap_pi(exact_value(state.orientation)), exact_value(state.velocity)
    yaw_rate = exact_value(getattr(state, 'yaw_rate', None))
    steering = 0.0
    if wheelbase is None or abs(speed) < _MIN_STEERING_SPEED:
        yaw_rate = 0.0
    else:
        steering = math.atan(wheelbase * yaw_rate / speed)
    return VehicleState(*ahead(float(x), float(y), yaw, -rear_to_center), yaw, speed, steering,
                        exact_value(getattr(state, 'acceleration', None)), yaw_rate)


def lanelet_pose(network: RoadNetwork, state: VehicleState) -> VehicleState:
    """
    Return the simulator-side initial pose of an AV from lanelet geometry (CRG III-A1).

    :param state: the planner-side state of the rear axle
    :return: the same at the nearest point of the centre line, with the lane's heading
    """
    lanelet = network.nearest_lanelet(state.x, state.y, state.yaw)
    s, _ = network.locate(lanelet, state.x, state.y)
    x, y, yaw = network.pose_on(lanelet, min(max(s, 0.0), network.line(lanelet).length))
    return state._replace(x=x, y=y, yaw=yaw)


def place_human(network: RoadNetwork, spec: HumanSpec, parameters: VehicleParameters,
                avs: Sequence[VehicleState], obstacles: Sequence[ObjectDescription],
                obstacle_states: ObjectStates, others: Sequence[VehicleState] = (),
                vehicles: Sequence[VehicleParameters] | None = None) -> VehicleState:
    """
    Place a human's vehicle at the start.

    If `spec.spawn` is given, the vehicle starts exactly there. Otherwise places are tried in this
    order: on the lane beside the first AV and slightly behind it; behind it in its lane by 2 s,
    or less where the road begins; level with it; ahead of it; elsewhere on a lane near it.
    Without an AV it is the start of a long road. A searched place is on the road, in the lane's
    heading, and at least 0.5 m from everything. Its speed is the AV's, limited so that the vehicle
    can brake behind its leader.

    :param avs: rear-axle states of the AVs
    :param obstacles: (M) descriptions of the obstacles
    :param obstacle_states: (M) their states at k0
    :param others: rear-axle states of humans already placed
    :param vehicles: parameters of `avs`, then of `others`; None: equal to the human's
    :raises InputError: if the spawn is not on the map, or there is no free place.
    """
    if isinstance(spec.spawn, PoseSpawn):
        return VehicleState(spec.spawn.x, spec.spawn.y, spec.spawn.yaw, spec.spawn.speed)
    if isinstance(spec.spawn, LaneletSpawn):
        return _on_lanelet(network, spec.spawn, spec.id)
    states = [*avs, *others]
    known = [parameters] * len(states) if vehicles is None else list(vehicles)
    scene = _Scene.from_states(states, known, obstacles, obstacle_states)
    places = _near_av(network, parameters, avs[0]) if avs else _road_starts(network, parameters)
    wanted = avs[0].speed if avs else 0.0
    second_best: VehicleState | None = None
    for lanelet, s in places:
        state = _try(network, parameters, scene, lanelet, s)
        if state is None:
            continue
        speed, safe_behind = _fit_speed(network, parameters, scene, lanelet, s, wanted)
        state = state._replace(speed=speed)
        if safe_behind:
            return state
        second_best = second_best or state
    if second_best is None:
        raise InputError('there is no free place on the road', f'spawn of {spec.id}',
                         'give its spawn in the game file')
    return second_best


@dataclass(frozen=True)
class _Scene:
    """All bodies at k0: outlines, centres (n, 2), velocities, sizes."""

    outlines: NDArray[np.object_]
    centers: NDArray[np.float64]
    velocities: NDArray[np.float64]
    lengths: NDArray[np.float64]
    widths: NDArray[np.float64]

    @classmethod
    def from_states(cls, states: Sequence[VehicleState], vehicles: Sequence[VehicleParameters],
                    obstacles: Sequence[ObjectDescription], at_k0: ObjectStates) -> '_Scene':
        shapes: list[Shape] = []
        rows: list[tuple[float, ...]] = []
        for state, vehicle in zip(states, vehicles, strict=True):
            shapes.append(vehicle.shape)
            rows.append((*state.center(vehicle.rear_to_center), state.yaw,
                         state.speed * math.cos(state.yaw), state.speed * math.sin(state.yaw)))
        for description, pose, velocity in zip(obstacles, at_k0.poses, at_k0.velocities,
                                               strict=True):
            if np.isfinite(pose).all():
                shapes.append(description.shape)
                rows.append((*pose, *velocity[:2]))
        table = np.array(rows, dtype=np.float64).reshape(-1, 5)
        outlines = [placed_polygon(s, *row[:3]) for s, row in zip(shapes, rows, strict=True)]
        return cls(np.array(outlines, dtype=object), table[:, :2], table[:, 3:],
                   np.array([s.length for s in shapes]), np.array([s.width for s in shapes]))


def _on_lanelet(network: RoadNetwork, spawn: LaneletSpawn, vehicle_id: str) -> VehicleState:
    where = f'spawn of {vehicle_id}'
    if spawn.lanelet not in network.lanelet_ids:
        raise InputError(f'there is no lanelet {spawn.lanelet}', where,
                         'name a lanelet of the scenario')
    length = network.line(spawn.lanelet).length
    if not 0.0 <= spawn.s <= length:
        raise InputError(f's = {spawn.s} m is not on lanelet {spawn.lanelet}', where,
                         f'give 0 to {length:.1f} m')
    return VehicleState(*network.pose_on(spawn.lanelet, spawn.s, spawn.d), spawn.speed)


def _near_av(network: RoadNetwork, parameters: VehicleParameters,
             av: VehicleState) -> Iterator[tuple[int, float]]:
    """Yield places in the order of preference: beside, behind, level, ahead, anywhere near."""
    lane = network.nearest_lanelet(av.x, av.y, av.yaw)
    s_av, _ = network.locate(lane, av.x, av.y)
    length = parameters.length
    beside: list[tuple[int, float]] = []
    for neighbour in (network.left_of(lane), network.right_of(lane)):
        if neighbour is None or neighbour not in network.lanelet_ids:
            continue
        s, d = network.locate(neighbour, av.x, av.y)
        if abs(d) > network.width_at(neighbour, s) + network.width_at(lane, s_av):
            continue
        beside.append((neighbour, s))
    gap = _HEADWAY_S * abs(av.speed) + 2.0 * length
    further = [gap + extra for extra in np.arange(0.0, 41.0, 5.0).tolist()]
    # If the road begins shortly before the AV: closer behind it, then level with it.
    closer = np.arange(gap, _CLOSEST * length, -0.5 * length)[1:].tolist()
    preferred = [
        *((*place, -back * length) for place in beside for back in (1.2, 1.6, 2.0, 3.0, 4.0)),
        *((lane, s_av, -distance) for distance in (*further, *closer)),
        *((*place, ahead * length) for place in beside for ahead in (0.0, 0.4, 0.8, 1.2)),
        *((lane, s_av, distance) for distance in further)]
    for start, s, distance in preferred:
        place = network.advance(start, s, distance)
        if place is not None:
            yield place
    everywhere = [(math.dist((x, y), (av.x, av.y)), lanelet, s)
                  for lanelet in network.lanelet_ids
                  for s, (x, y) in _grid(network, parameters, lanelet)]
    near = sorted(place for place in everywhere if place[0] <= _NEAR)
    for _, lanelet, s in near[:_MAX_NEAR]:
        yield lanelet, s


def _road_starts(network: RoadNetwork,
                 parameters: VehicleParameters) -> Iterator[tuple[int, float]]:
    """
    Yield places without an AV: starts of roads, the longest first, then everywhere.

    A bicycle starts on a lane that cars don't use, if there is one.
    """
    reach: list[tuple[bool, float, int]] = []
    for lanelet in network.lanelet_ids:
        if network.is_drivable(lanelet, parameters.type) and \
                network.straightest_predecessor(lanelet) is None:
            line = Curve.from_polyline(network.lane_path(lanelet, 1000.0))
            shared = parameters.type != network.vehicle_type and network.is_drivable(lanelet)
            reach.append((shared, -line.length, lanelet))
    for _, _, lanelet in sorted(reach):
        yield from ((lanelet, s) for s in np.arange(0.5 * parameters.length + _MARGIN, min(
            50.0, network.line(lanelet).length), 5.0).tolist())
    longest = sorted(network.lanelet_ids, key=lambda x: -network.line(x).length)
    for lanelet in longest[:_MAX_NEAR]:
        yield from ((lanelet, s) for s, _ in _grid(network, parameters, lanelet))


def _grid(network: RoadNetwork, parameters: VehicleParameters,
          lanelet: int) -> list[tuple[float, NDArray[np.float64]]]:
    line = network.line(lanelet)
    if not network.is_drivable(lanelet, parameters.type):
        return []
    s = np.arange(0.0, line.length, 5.0)
    return list(zip(s.tolist(), line.pose_at(s)[:, :2], strict=True))


def _try(network: RoadNetwork, parameters: VehicleParameters, scene: _Scene, lanelet: int,
         s: float) -> VehicleState | None:
    """Return the state on the centre line at s; None off the road or too close to a body."""
    if not network.is_drivable(lanelet, parameters.type):
        return None
    state = VehicleState(*network.pose_on(lanelet, s), 0.0)
    pose = (*state.center(parameters.rear_to_center), state.yaw)
    if not network.covers(placed_polygon(parameters.shape, *pose)):
        return None
    guarded = Shape.rectangle(parameters.length + 2.0 * _MARGIN, parameters.width + 2.0 * _MARGIN)
    touched = shapely.intersects(placed_polygon(guarded, *pose), scene.outlines)
    return None if touched.any() else state


def _fit_speed(network: RoadNetwork, parameters: VehicleParameters, scene: _Scene, lanelet: int,
               s: float, wanted: float) -> tuple[float, bool]:
    """
    Limit a speed by leader, lane and vehicle, and judge the followers.

    :return: speed [m/s], and whether each follower is slower or can brake behind it
    """
    back, parts = 0.0, [network.lane_path(lanelet, _SIGHT)]
    before = network.straightest_predecessor(lanelet)
    while before is not None and back < _SIGHT:
        points = network.line(before).points
        # The line closes the gap between two lanelets.
        back += network.line(before).length + math.dist(points[-1], parts[0][0])
        parts.insert(0, points)
        before = network.straightest_predecessor(before)
    line = Curve.from_polyline(np.concatenate(parts))
    s_obj, d_obj = line.project(scene.centers)
    yaw = line.heading_at(s_obj)
    along = scene.velocities[:, 0] * np.cos(yaw) + scene.velocities[:, 1] * np.sin(yaw)
    ahead = s_obj - (s + back + parameters.rear_to_center)
    gaps = np.abs(ahead) - 0.5 * (scene.lengths + parameters.length)
    on_lane = (np.abs(d_obj) < 0.5 * (scene.widths + parameters.width) + 0.3) & (gaps < _SIGHT)
    speed = min(max(wanted, 0.0), parameters.max_speed,
                network.speed_limit(lanelet) or math.inf)
    for leader in np.flatnonzero(on_lane & (ahead > 0.0)):
        speed = min(speed, _safe_speed(gaps[leader], along[leader]))
    followers = np.flatnonzero(on_lane & (ahead <= 0.0))
    # A recorded follower does not react: a slower one is harmless at any distance.
    return speed, all(along[f] <= max(speed, _safe_speed(gaps[f], speed)) for f in followers)


def _safe_speed(gap: float, leader_speed: float) -> float:
    """Return the speed from which a driver can stop behind a braking leader (Krauss' model)."""
    reaction = _BRAKING * _REACTION_S
    root = math.sqrt(reaction ** 2 + max(leader_speed, 0.0) ** 2
                     + 2.0 * _BRAKING * max(float(gap), 0.0))
    return root - reaction
