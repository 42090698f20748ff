# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Roads for tests: lanelets that bend evenly."""

from collections.abc import Mapping
from typing import NamedTuple

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from crgame_ros.roads.network import RoadNetwork
import numpy as np
from numpy.typing import NDArray

# Width of their lanes [m].
WIDTH = 3.5


class Piece(NamedTuple):
    """
    A lanelet.

    :param start: x [m], y [m], yaw [deg] where it begins.
    :param length: of its centre line [m]
    :param bend: to the left, along all of it [deg]
    :param after: ids of its successors.
    :param left: id of the lane of its direction on its left.
    :param right: id of the one on its right.
    :param opposite: id of the lane of the other direction on its left.
    """

    start: tuple[float, float, float]
    length: float
    bend: float = 0.0
    after: tuple[int, ...] = ()
    left: int | None = None
    right: int | None = None
    opposite: int | None = None

    def poses(self, aside: float = 0.0) -> NDArray[np.float64]:
        """Return (N, 3) x [m], y [m], yaw [rad] so far to its left [m], 1 m apart or less."""
        x, y, yaw = (*self.start[:2], np.radians(self.start[2]))
        s = np.linspace(0.0, self.length, max(2, int(np.ceil(self.length)) + 1))
        half = 0.5 * np.radians(self.bend) * s / self.length
        chord, turned = s * np.sinc(half / np.pi), yaw + 2.0 * half
        return np.column_stack((x + chord * np.cos(yaw + half) - aside * np.sin(turned),
                                y + chord * np.sin(yaw + half) + aside * np.cos(turned), turned))

    @property
    def end(self) -> tuple[float, float, float]:
        """Return x [m], y [m], yaw [deg] where it ends."""
        x, y, yaw = self.poses()[-1].tolist()
        return x, y, float(np.degrees(yaw))


def made(pieces: Mapping[int, Piece]) -> RoadNetwork:
    """Make the roads of lanelets, by their ids."""
    lanelets = []
    for number, piece in pieces.items():
        left, center, right = (piece.poses(d)[:, :2] for d in (0.5 * WIDTH, 0.0, -0.5 * WIDTH))
        lanelets.append(Lanelet(
            left, center, right, number, successor=list(piece.after),
            predecessor=[each for each, other in pieces.items() if number in other.after],
            adjacent_left=piece.left or piece.opposite, adjacent_right=piece.right,
            adjacent_left_same_direction=None if piece.left is piece.opposite
            else piece.left is not None,
            adjacent_right_same_direction=None if piece.right is None else True))
    return RoadNetwork(LaneletNetwork.create_from_lanelet_list(lanelets, cleanup_ids=False))
