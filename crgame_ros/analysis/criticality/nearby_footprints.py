# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All footprints at a tick: which are near a vehicle, at what distance and time to collision."""

from collections.abc import Sequence
from typing import NamedTuple

from crgame_ros.analysis.criticality.footprint_approach import (
    approach,
    distance,
    time_to_contact,
)
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.geometry.outline import outline, placed
from crgame_ros.geometry.rigid_transform import RigidTransform
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]
Numbers = NDArray[np.int64]

NEAR = 100.0
CIRCLE_CORNERS = 32
# Pairs with no more corners than this in total are measured one by one.
FEW_CORNERS = 16


class Scene(NamedTuple):
    """
    The scene at a tick: N vehicles and objects, driven vehicles first.

    :param poses: (N, 3) poses of the centres.
    :param rates: (N, 3) derivatives of the poses.
    :param accelerations: (N, 2)
    :param outlines: (N, C, 2) corners of the footprints; a shorter one repeats its last corner.
    """

    poses: FloatArray
    rates: FloatArray
    accelerations: FloatArray
    outlines: FloatArray


class NearbyFootprints:
    """
    The convex hulls of all footprints in a run.

    :param everybody: (N) driven vehicles, then all others.
    :ivar radii: (N) radii of circles around the centres that contain the footprints [m]
    """

    def __init__(self, everybody: Sequence[ObjectDescription]) -> None:
        outlines = [_convex(outline(item.shape, CIRCLE_CORNERS)) for item in everybody]
        self.radii = np.array([np.hypot(*corners.T).max() for corners in outlines])
        # All in one padded array, and groups by number of corners, to compute no more than needed.
        self._most = max(map(len, outlines), default=1)
        self._outlines = np.array([
            np.concatenate((corners, np.repeat(corners[-1:], self._most - len(corners), axis=0)))
            for corners in outlines]).reshape(-1, self._most, 2)
        self._corners = np.array([len(corners) for corners in outlines], dtype=np.int64)

    def scene(self, poses: FloatArray, rates: FloatArray, accelerations: FloatArray) -> Scene:
        """Return the scene; parameters as for `Scene`."""
        return Scene(poses, rates, accelerations, placed(self._outlines, poses))

    def on_road(self, scene: Scene, transform: RigidTransform) -> Scene:
        """Return a scene in the coordinates of a vehicle's road."""
        if transform.is_identity:
            return scene
        moves = transform.turn_to_scenario(scene.rates[:, :2])
        return self.scene(transform.to_scenario(scene.poses),
                          np.column_stack((moves, scene.rates[:, 2])),
                          transform.turn_to_scenario(scene.accelerations))

    def near(self, subject: int, scene: Scene) -> Numbers:
        """Return the numbers of those near a vehicle."""
        x, y = (scene.poses[:, :2] - scene.poses[subject, :2]).T
        away = np.hypot(x, y)
        away[subject] = np.nan
        return np.flatnonzero(away - self.radii - self.radii[subject] < NEAR)

    def approach(self, subjects: Sequence[int], near: Sequence[Numbers],
                 scenes: Sequence[Scene]) -> list[FloatArray]:
        """
        Return ttc_2d [s] and min_distance [m] of vehicles to those near them, (P, 2) each.

        :param subjects: numbers of the vehicles, one at least.
        :param near: numbers of those near each vehicle.
        :param scenes: the scene in the coordinates of each vehicle's road.
        """
        counts = [len(others) for others in near]
        if sum(counts) * self._most <= FEW_CORNERS:
            return [self._approach_few(subject, others.tolist(), scene)
                    for subject, others, scene in zip(subjects, near, scenes, strict=True)]
        rows, others = np.repeat(np.arange(len(subjects)), counts), np.concatenate(near)
        own = np.repeat(subjects, counts)
        outlines = np.stack([scene.outlines for scene in scenes])
        moves = np.stack([scene.rates[:, :2] for scene in scenes])
        corners = np.maximum(self._corners[own], self._corners[others])
        result = np.empty((len(others), 2))
        for count in set(corners.tolist()):
            pairs = np.flatnonzero(corners == count)
            row, first, second = rows[pairs], own[pairs], others[pairs]
            footprints = outlines[row, first, :count], outlines[row, second, :count]
            contact = time_to_contact(*footprints, moves[row, first], moves[row, second])
            result[pairs, 0] = contact
            result[pairs, 1] = distance(*footprints, contact == 0.0)
        return np.split(result, np.cumsum(counts)[:-1])

    def _approach_few(self, subject: int, others: list[int], scene: Scene) -> FloatArray:
        own = scene.outlines[subject, :self._corners[subject]].tolist()
        return np.array([approach(
            own, scene.outlines[other, :self._corners[other]].tolist(),
            (scene.rates[other, :2] - scene.rates[subject, :2]).tolist()) for other in others]
        ).reshape(-1, 2)


def _convex(corners: FloatArray) -> FloatArray:
    """Return the corners of a footprint's convex hull."""
    hull = shapely.convex_hull(shapely.multipoints(corners))
    return np.asarray(shapely.get_coordinates(hull)[:-1])
