# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether there is room for a newcomer, and how fast it may be."""

from crgame_ros.traffic.agents import Agents, NOBODY
from crgame_ros.traffic.lane_graph import FloatArray
from crgame_ros.traffic.placement import Bodies
import numpy as np

# Between agents at the start, besides s0 [m] and at their speeds [s].
START_GAP = 3.0
START_TIME = 1.2
SIDE_GAP = 0.6
LANE = 3.5
# With which a newcomer could stop before what lies ahead [m/s^2].
EASY = 1.5
# With which those who were recorded get behind who is ahead [m/s^2], and the gap they leave [m].
FIRM, STOP_GAP = 2.0, 2.0
# Nor nearer than so long at their speeds [s].
CLOSE_TIME = 0.25


def safe_speed(pose: FloatArray, length: float, width: float, agents: Agents,
               others: Bodies) -> float:
    """Return the speed from which a newcomer gets behind everybody ahead with firm braking."""
    here = np.flatnonzero(agents.active)
    poses = np.concatenate((agents.centers()[here], others.poses))
    lengths = np.concatenate((agents.length[here], others.length))
    widths = np.concatenate((agents.width[here], others.width))
    velocities = np.concatenate((agents.velocities()[here], others.velocities))
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    east, north = poses[:, 0] - pose[0], poses[:, 1] - pose[1]
    ahead, aside = east * cos + north * sin, np.abs(north * cos - east * sin)
    turn = poses[:, 2] - pose[2]
    wide = 0.5 * (width + lengths * np.abs(np.sin(turn)) + widths * np.abs(np.cos(turn)))
    gap = ahead - 0.5 * (length + lengths) - STOP_GAP
    along = np.maximum(velocities[:, 0] * cos + velocities[:, 1] * sin, 0.0)
    before = (ahead > 0.0) & (aside < wide + SIDE_GAP)
    safe = np.sqrt(along[before]**2 + 2.0 * FIRM * np.maximum(gap[before], 0.0))
    return float(safe.min(initial=np.inf))


def is_free(pose: FloatArray, speed: float, length: float, width: float, agents: Agents,
            others: Bodies, close: bool = False) -> bool:
    """
    Return whether a place is free, with a gap to the front and the rear.

    :param close: whether touching nobody is enough.
    """
    here = np.flatnonzero(agents.active)
    poses = np.concatenate((agents.centers()[here], others.poses))
    if not len(poses):
        return True
    lengths = np.concatenate((agents.length[here], others.length))
    widths = np.concatenate((agents.width[here], others.width))
    speeds = np.concatenate((agents.speed[here], np.hypot(*others.velocities[:, :2].T)))
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    east, north = poses[:, 0] - pose[0], poses[:, 1] - pose[1]
    ahead = east * cos + north * sin
    along, aside = np.abs(ahead), np.abs(north * cos - east * sin)
    turn = poses[:, 2] - pose[2]
    long = 0.5 * (length + lengths * np.abs(np.cos(turn)) + widths * np.abs(np.sin(turn)))
    wide = 0.5 * (width + lengths * np.abs(np.sin(turn)) + widths * np.abs(np.cos(turn)))
    # Who is changing lanes takes both.
    wide += np.concatenate((np.where(agents.source[here] != NOBODY, LANE, 0.0),
                            np.zeros(len(others.length))))
    gap = 0.5 if close else START_GAP + START_TIME * np.maximum(speeds, speed)
    if not close:
        # Whoever is faster and behind has to slow down.
        faster = np.where(ahead > 0.0, speed**2 - speeds**2, speeds**2 - speed**2)
        gap = gap + np.maximum(faster, 0.0) / (2.0 * EASY)
    else:
        # Nor must anybody behind brake hard for whoever was recorded.
        closing = np.where(ahead < 0.0, np.maximum(speeds**2 - speed**2, 0.0), 0.0)
        gap = gap + closing / (2.0 * FIRM) + CLOSE_TIME * np.where(
            ahead < 0.0, speeds, np.minimum(speeds, speed))
    side = 0.2 if close else SIDE_GAP
    return bool(((along > long + gap) | (aside > wide + side)).all())
