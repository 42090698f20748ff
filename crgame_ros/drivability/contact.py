# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Classifies a contact of two bodies: the side touched, the kind, and whether it was avoidable.

The kinds are those of nuPlan's closed-loop score. A contact is avoidable by a body if the motion,
computed again, has no contact when the body brakes with its full deceleration from the moment
the other was in its way. The other body moves as it did.
"""

from dataclasses import dataclass, replace
import math
from typing import Literal, TypeAlias

from crgame_ros.geometry.curve import arc_length
from crgame_ros.geometry.outline import placed_polygon
from crgame_ros.geometry.shape import Shape
from crgame_ros.vehicle.state import REST
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray: TypeAlias = NDArray[np.float64]
Side: TypeAlias = Literal['front', 'rear', 'left', 'right']
Kind: TypeAlias = Literal['stopped ego', 'stopped track', 'active front', 'rear', 'lateral']

# Times before and after the contact that are examined, and their sampling [s].
_BEFORE_S, _AFTER_S, _STRIDE_S = 10.0, 3.0, 0.02
# A body's swept area reaches this far beyond its last footprint [m].
_BEYOND = 0.5


@dataclass(frozen=True)
class Course:
    """
    The motion of a body.

    :param shape: its footprint around the centre.
    :param poses: (n, 3) its centre's x [m], y [m], yaw [rad] at each step; NaN where absent.
    :param speeds: (n) [m/s]
    :param braking: its greatest deceleration; 0 if it cannot brake [m/s^2]
    :param reaction_s: reaction time until it brakes [s]
    """

    shape: Shape
    poses: FloatArray
    speeds: FloatArray
    braking: float
    reaction_s: float


def touched_side(mine: Course, other: Course, step: int) -> Side:
    """
    Return the side of a body that another touched.

    It is the side beyond which the whole other body was one step before, by the largest distance.
    If they overlapped from the start, it is the side through which the way out is shortest.

    :param step: the first at which they touch.
    """
    before = max(step - 1, 0)
    if not np.isfinite((mine.poses[before], other.poses[before])).all():
        before = step
    x, y, yaw = mine.poses[before].tolist()
    corners = shapely.get_coordinates(_placed(other, before)) - (x, y)
    cos, sin = math.cos(yaw), math.sin(yaw)
    along, across = corners @ (cos, sin), corners @ (-sin, cos)
    half_length, half_width = 0.5 * mine.shape.length, 0.5 * mine.shape.width
    gaps: dict[Side, float] = {
        'front': float(along.min()) - half_length, 'rear': -half_length - float(along.max()),
        'left': float(across.min()) - half_width, 'right': -half_width - float(across.max())}
    return max(gaps, key=lambda side: gaps[side])


def kind_of(speed: float, other_speed: float, side: Side) -> Kind:
    """
    Return the kind of a contact as nuPlan defines it.

    :param speed: speed of the vehicle that is judged (the ego) [m/s]
    :param other_speed: speed of the body that it touches (the track) [m/s]
    :param side: side touched of the vehicle that is judged.
    """
    if abs(speed) <= REST:
        return 'stopped ego'
    if abs(other_speed) <= REST:
        return 'stopped track'
    return 'active front' if side == 'front' else 'rear' if side == 'rear' else 'lateral'


def could_avoid(mine: Course, other: Course, step: int, dt_s: float) -> bool:
    """
    Return whether a body could have avoided the contact by braking when the other was in its way.

    The other is in its way once it came into the path ahead, up to the place of contact, and
    stayed there. After its reaction time the body brakes along the path that it took, and is then
    never faster than it was. The result is False for a body that cannot brake, and where the
    other was never in its way: braking does not help against a hit from behind or from the side.
    Steering is not considered.

    :param step: the first at which they touch.
    :param dt_s: time between the steps [s]
    """
    stride = _stride(dt_s)
    start = in_the_way_since(mine, other, step, dt_s)
    if start is None or mine.braking <= 0.0:
        return False
    end = min(len(mine.poses), step + round(_AFTER_S / dt_s) + 1)
    driven = mine.poses[start:end]
    moved = arc_length(driven[:, :2])
    time = dt_s * np.arange(len(driven))
    speed = abs(float(mine.speeds[start]))
    braked = np.clip(time - mine.reaction_s, 0.0, speed / mine.braking)
    held = np.minimum(time, mine.reaction_s)
    way = np.minimum(speed * (held + braked) - 0.5 * mine.braking * braked ** 2, moved)
    yaws = np.unwrap(driven[:, 2])
    poses = np.column_stack([np.interp(way, moved, column)
                             for column in (driven[:, 0], driven[:, 1], yaws)])
    again = replace(mine, poses=poses)
    there = replace(other, poses=other.poses[start:end])
    return not any(_touch(again, there, index) for index in range(0, len(poses), stride))


def stood_in_the_way(mine: Course, other: Course, step: int, dt_s: float) -> bool:
    """
    Return whether the other was in the body's way ever since both were there, or for 10 s.

    Parameters as in `could_avoid`.
    """
    since = in_the_way_since(mine, other, step, dt_s)
    before = -1 if since is None else since - _stride(dt_s)
    return since is not None and (
        before < max(step - round(_BEFORE_S / dt_s), 0)
        or not np.isfinite((mine.poses[before], other.poses[before])).all())


def in_the_way_since(mine: Course, other: Course, step: int, dt_s: float) -> int | None:
    """
    Find the first step of the last interval before the contact with the other in the way.

    Parameters as in `could_avoid`; None if it never was.
    """
    stride, most = _stride(dt_s), round(_BEFORE_S / dt_s)
    since = None
    for index in range(step - stride, max(step - most, 0) - 1, -stride):
        if not np.isfinite((mine.poses[index], other.poses[index])).all() \
                or not shapely.intersects(_way(mine, index, step, stride), _placed(other, index)):
            break
        since = index
    return since


def _stride(dt_s: float) -> int:
    return max(1, round(_STRIDE_S / dt_s))


def _way(mine: Course, first: int, last: int, stride: int) -> shapely.Geometry:
    """Return the area that a body sweeps from its centre at one step to its front at another."""
    centers = mine.poses[[*range(first, last, stride), last]]
    yaw = float(centers[-1, 2])
    reach = 0.5 * mine.shape.length + _BEYOND
    line = np.vstack((centers[:, :2],
                      centers[-1, :2] + reach * np.array((math.cos(yaw), math.sin(yaw)))))
    return shapely.LineString(line).buffer(0.5 * mine.shape.width, cap_style='flat')


def _touch(mine: Course, other: Course, index: int) -> bool:
    poses = mine.poses[index], other.poses[index]
    if not np.isfinite(poses).all():
        return False
    reach = mine.shape.radius + other.shape.radius
    return math.dist(poses[0][:2], poses[1][:2]) <= reach \
        and bool(shapely.intersects(_placed(mine, index), _placed(other, index)))


def _placed(course: Course, index: int) -> shapely.Polygon:
    return placed_polygon(course.shape, *course.poses[index].tolist())
