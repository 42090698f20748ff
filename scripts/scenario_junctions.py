# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Junctions and roundabouts: two-lane arms and what joins them; traffic keeps to the right."""

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np
from scenario_curves import arc, clothoids, connection, Curve
from scenario_maps import Incoming, Intersection, INTERSECTION_ID, Lanelet, RoadMap

SPACING = 1.0
ARM_SPACING = 1.9


@dataclass(frozen=True)
class Arm:
    """
    A road that leads away from the middle of a junction, one lane in each direction.

    :param angle: direction outwards [rad].
    :param segments: (length [m], curvature at its end [1/m]) of each, outwards.
    :param limit: speed limit [m/s].
    :param has_priority: neither yields nor stops.
    """

    angle: float
    segments: tuple[tuple[float, float], ...]
    limit: float
    has_priority: bool = True


def junction(roads: RoadMap, arms: Sequence[Arm], mouth: float, width: float,
             *types: str) -> None:
    """
    Build a junction around the origin with every turn but the U-turn.

    Arm i (from 1) has the incoming lanelet 10 i + 1 and the outgoing 10 i + 2; the way from it to
    the m-th arm after it (counter-clockwise) is lanelet 10 i + 2 + m.

    :param mouth: distance of the arms' inner ends from the origin [m].
    :param width: of each lane [m].
    """
    for number, arm in enumerate(arms, start=1):
        _add_arm(roads, number, arm, mouth, width, types)
        if not arm.has_priority:
            roads.sign_at_end('205', 10 * number + 1, stop_line='dashed')
        elif any(not other.has_priority for other in arms):
            roads.sign_at_end('301', 10 * number + 1)
    count = len(arms)
    turns = []
    for start in range(count):
        by_turn: dict[str, tuple[int, ...]] = {}
        for further in range(1, count):
            end = (start + further) % count
            id_ = 10 * (start + 1) + 2 + further
            _connect(roads, 10 * (start + 1) + 1, id_, 10 * (end + 1) + 2, width, types)
            name = _turn(arms[start].angle, arms[end].angle)
            by_turn[name] = (*by_turn.get(name, ()), id_)
        turns.append(by_turn)
    _face_opposites(roads)
    roads.intersections.append(Intersection(INTERSECTION_ID, tuple(
        Incoming(INTERSECTION_ID + number, (10 * number + 1,), turns[number - 1],
                 _right_of(arms, number - 1)) for number in range(1, count + 1))))


def roundabout(roads: RoadMap, arms: Sequence[Arm], radius: float, mouth: float, width: float,
               merge_angle: float, *types: str) -> None:
    """
    Build a roundabout with one lane around the origin.

    Arm i (from 1) has the incoming lanelet 10 i + 1, the outgoing 10 i + 2, the entry 10 i + 3,
    the exit 10 i + 4, the part of the circle in front of it 10 i + 5 and that up to the next
    arm's exit 10 i + 6.

    :param radius: of the circle's centre line [m].
    :param mouth: distance of the arms' inner ends from the origin [m].
    :param merge_angle: between an arm and the points where its entry and exit touch the
        circle [rad].
    """
    inside = (*types, 'intersection')
    for number, arm in enumerate(arms, start=1):
        following = arms[number % len(arms)].angle
        following += math.tau if following < arm.angle else 0.0
        before, after = arm.angle - merge_angle, arm.angle + merge_angle
        _add_arm(roads, number, arm, mouth, width, types)
        first = arc((0.0, 0.0), radius, before, after, SPACING)
        second = arc((0.0, 0.0), radius, after, following - merge_angle, SPACING)
        roads.add(10 * number + 5, first, width, ('solid', 'no_marking'), *inside)
        roads.add(10 * number + 6, second, width, ('solid', 'solid'), *inside)
        bend = 1.0 / radius
        lane = _lane_pose(roads.lanelets[10 * number + 1], -1)
        roads.add(10 * number + 3,
                  connection(lane, _near(second.pose(0), lane), SPACING, (0.0, bend), 0.9),
                  width, ('solid', 'solid'), *inside)
        lane = _lane_pose(roads.lanelets[10 * number + 2], 0)
        roads.add(10 * number + 4,
                  connection(first.pose(0), _near(lane, first.pose(0)), SPACING, (bend, 0.0),
                             0.9), width, ('solid', 'solid'), *inside)
    for number in range(1, len(arms) + 1):
        previous = 10 * ((number - 2) % len(arms) + 1)
        arm_id = 10 * number
        roads.chain(arm_id + 1, arm_id + 3, arm_id + 6)
        roads.chain(previous + 6, arm_id + 4, arm_id + 2)
        roads.chain(previous + 6, arm_id + 5, arm_id + 6)
        roads.sign_at_end('205', arm_id + 1, stop_line='dashed')
        roads.sign_at_end('215', arm_id + 1)
        roads.speed_limit(arms[number - 1].limit, arm_id + 3, arm_id + 4, arm_id + 5,
                          arm_id + 6)


def _add_arm(roads: RoadMap, number: int, arm: Arm, mouth: float, width: float,
             types: tuple[str, ...]) -> None:
    start = (mouth * math.cos(arm.angle), mouth * math.sin(arm.angle), arm.angle)
    axis = clothoids(start, arm.segments, ARM_SPACING)
    incoming, outgoing = 10 * number + 1, 10 * number + 2
    roads.add(incoming, axis, (width, 0.0), ('dashed', 'solid'), *types, reverse=True)
    roads.add(outgoing, axis, (0.0, -width), ('dashed', 'solid'), *types)
    roads.facing(incoming, outgoing)
    roads.speed_limit(arm.limit, incoming)
    roads.speed_limit(arm.limit, outgoing)


def _lane_pose(lanelet: Lanelet, index: int) -> tuple[float, float, float]:
    # The bounds face each other across the lane, at right angles to its direction.
    across = lanelet.left[index] - lanelet.right[index]
    x, y = lanelet.center[index]
    return float(x), float(y), math.atan2(-across[0], across[1])


def _near(pose: tuple[float, float, float],
          other: tuple[float, float, float]) -> tuple[float, float, float]:
    # Headings are angles of one continuous curve.
    turns = round((other[2] - pose[2]) / math.tau)
    return pose[0], pose[1], pose[2] + turns * math.tau


def _connect(roads: RoadMap, before: int, id_: int, after: int, width: float,
             types: tuple[str, ...]) -> None:
    start = _lane_pose(roads.lanelets[before], -1)
    end = _near(_lane_pose(roads.lanelets[after], 0), start)
    curve: Curve = connection(start, end, SPACING, stretch=1.1)
    lanelet = roads.add(id_, curve, width, ('no_marking', 'no_marking'), *types, 'intersection')
    # The poses were read from rounded bounds: take the neighbours' points themselves.
    for side in ('left', 'right'):
        bound = getattr(lanelet, side)
        bound[0] = getattr(roads.lanelets[before], side)[-1]
        bound[-1] = getattr(roads.lanelets[after], side)[0]
    roads.chain(before, id_, after)


def _turn(incoming: float, outgoing: float) -> str:
    change = math.remainder(outgoing - incoming - math.pi, math.tau)
    if abs(change) < 0.25 * math.pi:
        return 'straight'
    return 'left' if change > 0.0 else 'right'


def _right_of(arms: Sequence[Arm], index: int) -> int | None:
    # The road on a driver's right; that driver comes from the left of its traffic.
    for number, arm in enumerate(arms, start=1):
        if number - 1 != index and _turn(arms[index].angle, arm.angle) == 'right':
            return INTERSECTION_ID + number
    return None


def _face_opposites(roads: RoadMap) -> None:
    inside = [lanelet for lanelet in roads.lanelets.values() if 'intersection' in lanelet.types]
    for one in inside:
        for other in inside:
            if one.id < other.id and one.left.shape == other.left.shape \
                    and np.allclose(one.left, other.left[::-1], atol=1e-3):
                roads.facing(one.id, other.id)
