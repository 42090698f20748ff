# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who is ahead of a vehicle on its own path, and how far: bumper to bumper."""

from typing import NamedTuple

from crgame_ros.analysis.criticality.own_path import SeenPath
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# The corridor is as wide as the vehicle, and so much more on either side [m].
MARGIN = 0.25
# What the distance to the nearest sample may differ by from that to the path, and s too [m].
SLACK = 2.0


class Ahead(NamedTuple):
    """
    The nearest one ahead in the corridor.

    :param number: its number among the others.
    :param gap: from the subject's front to its rear, along the path [m]; negative where they
        overlap along it
    :param own_heading: of the path where the subject's centre is [rad]
    :param heading: of the path where the leader's centre is [rad]
    """

    number: int
    gap: float
    own_heading: float
    heading: float


def find_leader(seen: SeenPath, others: FloatArray, radii: FloatArray,
                touching: NDArray[np.bool_]) -> Ahead | None:
    """
    Find the nearest one ahead whose footprint overlaps the corridor of a vehicle.

    :param seen: path of the vehicle, from its centre, its corners and the centres of the others;
        the corridor keeps the offset that the vehicle has now.
    :param others: (N, D, 2) corners of the others [m]
    :param radii: (N) of circles around their centres that hold their footprints [m]
    :param touching: (N) whether they touch it; of those beside it these alone lead
    """
    path, mine = seen.path, len(seen.positions) - len(others)
    s, d = (each.tolist() for each in path.refined(seen.positions[:mine], seen.guess[:mine]))
    low, high, front = min(d[1:]) - MARGIN, max(d[1:]) + MARGIN, max(s[1:])
    centers, away, guess = seen.positions[mine:], seen.away[mine:], seen.guess[mine:]
    reach = max(abs(low), abs(high)) + radii + SLACK
    candidates = np.flatnonzero((away < reach) & (guess > s[0] - radii - SLACK))
    if not len(candidates):
        return None
    places = np.concatenate((centers[candidates, None], others[candidates]), axis=1)
    positions = places.reshape(-1, 2)
    along, aside = (each.reshape(places.shape[:2])
                    for each in path.refined(positions, path.near(positions)[1]))
    rears, right, left = (along[:, 1:].min(axis=1), aside[:, 1:].min(axis=1),
                          aside[:, 1:].max(axis=1))
    # Who is passed closely is not in the way.
    ahead = (along[:, 0] > s[0]) & (right <= high) & (left >= low) & (
        (rears >= front) | touching[candidates])
    if not ahead.any():
        return None
    rear = np.where(ahead, rears, np.inf)
    nearest = int(np.argmin(rear))
    own_heading, heading = (path.line.place(at)[3]
                            for at in (s[0], float(along[nearest, 0])))
    return Ahead(int(candidates[nearest]), float(rear[nearest] - front), own_heading, heading)
