# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Collisions as nuPlan's closed-loop score classifies them: by kind and by fault."""

from dataclasses import dataclass
import math

from crgame_ros.analysis.scores.route_progress import LanesDriven
from crgame_ros.analysis.scores.scored_drive import ScoredDrive, Track, TrackKind
from crgame_ros.drivability.contact import Kind
from crgame_ros.geometry.outline import outline, placed
from crgame_ros.geometry.reference_point import seen_from
from crgame_ros.geometry.shape import Shape
from crgame_ros.vehicle.state import REST
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]
# Another is ahead of the rear axle if its centre is at an angle to the heading below the first,
# and behind if above the second (nuplan-devkit, observation/idm/utils.py) [rad].
AHEAD, BEHIND = math.radians(30.0), math.radians(150.0)


@dataclass(frozen=True)
class JudgedCollision:
    """
    The first contact of the vehicle with another.

    :param step: time step, counted from the drive's first.
    :param time_s: the same as a time [s]
    :param at_fault: whether it counts as the vehicle's fault.
    """

    other_id: str
    other_kind: TrackKind
    step: int
    time_s: float
    kind: Kind
    at_fault: bool

    def as_dict(self) -> dict[str, object]:
        """Return the fields as a JSON-compatible dictionary."""
        return {'with': self.other_id, 'group': self.other_kind, 'time_s': self.time_s,
                'kind': self.kind, 'at_fault': self.at_fault}


def find_collisions(drive: ScoredDrive, lanes: LanesDriven) -> tuple[JudgedCollision, ...]:
    """
    Find the first contact with each of the others, in order of time.

    The vehicle is not at fault if it stands, is hit from behind, or is hit at the side within its
    lane. It is at fault if it hits a standing obstacle, or hits with its front.
    """
    found = []
    for track in drive.tracks:
        step = first_contact(drive.shape, drive.poses, track.shape, track.poses)
        if step is None:
            continue
        kind = _kind(drive, track, step)
        at_fault = kind in ('stopped track', 'active front') \
            or kind == 'lateral' and not lanes.in_one_lane[step]
        found.append(JudgedCollision(track.id, track.kind, step, step * drive.dt_s, kind,
                                     bool(at_fault)))
    return tuple(sorted(found, key=lambda each: (each.step, each.other_id)))


def angle_to(rear_axles: FloatArray, points: FloatArray) -> FloatArray:
    """
    Return the angles (...) between headings and the directions to points, 0 straight ahead [rad].

    :param rear_axles: (..., 3)
    :param points: (..., 2)
    """
    along, across = seen_from(rear_axles, points)
    return np.abs(np.arctan2(across, along))


def first_contact(shape: Shape, poses: FloatArray, other: Shape,
                  other_poses: FloatArray) -> int | None:
    """Return the first row at which two shapes at poses (K, 3) touch; None without one."""
    apart = np.hypot(*(other_poses - poses)[:, :2].T)
    near = np.flatnonzero(apart <= shape.radius + other.radius)
    if not len(near):
        return None
    touching = near[shapely.intersects(
        shapely.polygons(placed(outline(shape), poses[near])),
        shapely.polygons(placed(outline(other), other_poses[near])))]
    return int(touching[0]) if len(touching) else None


def _kind(drive: ScoredDrive, track: Track, step: int) -> Kind:
    if abs(drive.speeds[step]) <= REST:
        return 'stopped ego'
    if track.speeds[step] <= REST:
        return 'stopped track'
    if float(angle_to(drive.rear_axles[step], track.poses[step, :2])) > BEHIND:
        return 'rear'
    # The first and the last corner of a rectangle are its front corners.
    front = shapely.linestrings(drive.outlines[step][[0, -1]])
    body = shapely.polygons(placed(outline(track.shape), track.poses[step]))
    return 'active front' if shapely.intersects(front, body) else 'lateral'
