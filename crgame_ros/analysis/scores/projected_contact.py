# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""nuPlan's time to collision: footprints moved straight on, sampled each tenth of a second."""

from collections.abc import Sequence

from crgame_ros.analysis.scores.collisions_by_kind import (
    AHEAD,
    angle_to,
    BEHIND,
    JudgedCollision,
)
from crgame_ros.analysis.scores.lanes_driven import LanesDriven
from crgame_ros.analysis.scores.scored_drive import ScoredDrive, Track
from crgame_ros.geometry.outline import outline, placed
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]

# How far ahead is looked, and how finely [s].
HORIZON_S, STRIDE_S = 3.0, 0.1
# Who is slower has no time to collision [m/s] (nuplan-devkit, time_to_collision_within_bound.py).
STANDS = 0.005


def times_to_contact(drive: ScoredDrive, lanes: LanesDriven,
                     collisions: Sequence[JudgedCollision]) -> FloatArray:
    """
    Return the time to collision of each step (K), inf where none is within the horizon [s].

    Who is ahead counts, and who is beside while the vehicle is between lanes or in an
    intersection; nobody counts from the step on at which it was touched. 0 at the step of a
    collision at fault.
    """
    times = np.full(len(drive.poses), np.inf)
    beside = lanes.in_intersection | ~lanes.in_one_lane
    touched = {each.other_id: each.step for each in collisions}
    moving = np.abs(drive.speeds) > STANDS
    for track in drive.tracks:
        angle = angle_to(drive.rear_axles, track.poses[:, :2])
        counts = (angle < AHEAD) | beside & (angle <= BEHIND)
        counts[touched.get(track.id, len(counts)):] = False
        reach = drive.shape.radius + track.shape.radius \
            + HORIZON_S * (np.abs(drive.speeds) + track.speeds)
        apart = np.hypot(*(track.poses[:, :2] - drive.poses[:, :2]).T)
        for step in np.flatnonzero(counts & moving & (apart <= reach)).tolist():
            times[step] = min(times[step], _time(drive, track, step))
    for each in collisions:
        if each.at_fault:
            times[each.step] = 0.0
    return times


def _time(drive: ScoredDrive, track: Track, step: int) -> float:
    """Find the first sample at which two footprints touch that keep speed and heading."""
    ahead_s = STRIDE_S * np.arange(1.0, round(HORIZON_S / STRIDE_S))
    own = _moved(drive.poses[step], float(drive.speeds[step]), ahead_s)
    theirs = _moved(track.poses[step], float(track.speeds[step]), ahead_s)
    near = np.flatnonzero(np.hypot(*(own - theirs)[:, :2].T)
                          <= drive.shape.radius + track.shape.radius)
    if not len(near):
        return np.inf
    touching = shapely.intersects(
        shapely.polygons(placed(outline(drive.shape), own[near])),
        shapely.polygons(placed(outline(track.shape), theirs[near])))
    hits = near[touching]
    return float(ahead_s[hits[0]]) if len(hits) else np.inf


def _moved(pose: FloatArray, speed: float, ahead_s: FloatArray) -> FloatArray:
    way = speed * ahead_s
    return np.stack((pose[0] + way * np.cos(pose[2]), pose[1] + way * np.sin(pose[2]),
                     np.full_like(way, pose[2])), axis=-1)
