# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A picture of a vehicle's surroundings from above, as a part of its policy's observation."""

import math

from commonroad.scenario.lanelet import LaneletNetwork
from crgame_ros.geometry.outline import placed
from crgame_ros.geometry.polyline import ReferencePath
from crgame_ros.policy.seat_view import Surrounded
from crgame_ros.roads.surface import lanelet_ring
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
import shapely

Array = NDArray[np.float64]
# The rear axle is in the middle of a row, this share of the height below the top.
AXLE = 0.75
INSIDE, BORDER = 255, 127


class BirdView:
    """
    A painter of pictures that turn with the vehicle: ahead is up, left is left.

    The channels are `IMAGE_CHANNELS`: lanelets are 255 and their borders 127, the route is a line
    of 255 with the width of a pixel, objects are 255; the vehicle itself is in none of them.

    :param size: height and width [px]
    :param pixel: side of a pixel [m]
    """

    def __init__(self, size: int, pixel: float, network: LaneletNetwork) -> None:
        self._size, self._pixel = size, pixel
        self._lanelets = list(map(lanelet_ring, network.lanelets))
        self._tree = shapely.STRtree([
            shapely.box(*points.min(axis=0), *points.max(axis=0)) for points in self._lanelets])
        # From the rear axle to the farthest corner [m].
        self._reach = pixel * size * math.hypot(AXLE, 0.5)
        self._ahead = np.arange(0.0, pixel * size * AXLE + pixel, max(pixel, 1.0))

    def paint(self, around: Surrounded, path: ReferencePath, s: float) -> NDArray[np.uint8]:
        """
        Return a picture (3, H, W).

        :param path: the route.
        :param s: arc length on it [m]
        """
        state, poses, things = around.state, around.poses, around.things
        middle = np.array(state[:2])
        cos, sin = math.cos(state.yaw) / self._pixel, math.sin(state.yaw) / self._pixel
        # Rows count backwards, columns to the right; integers are the middles of pixels.
        turn = np.array(((sin, -cos), (-cos, -sin)))
        shift = np.array((0.5, AXLE)) * self._size - 0.5

        def pixels(points: Array) -> list[float]:
            return ((points - middle) @ turn.T + shift).ravel().tolist()

        road, route, objects = (Image.new('L', (self._size, self._size)) for _ in range(3))
        draw = ImageDraw.Draw(road)
        window = shapely.box(*(middle - self._reach), *(middle + self._reach))
        for index in sorted(self._tree.query(window).tolist()):
            draw.polygon(pixels(self._lanelets[index]), fill=INSIDE, outline=BORDER)
        ImageDraw.Draw(route).line(pixels(path.pose_at(s + self._ahead)[:, :2]), fill=INSIDE)
        draw = ImageDraw.Draw(objects)
        if len(poses):
            apart = np.hypot(*(poses[:, :2] - middle).T)
            # In this form, NaN counts as far away.
            for index in np.flatnonzero(apart < self._reach + things.radii).tolist():
                draw.polygon(pixels(placed(things.outlines[index], poses[index])), fill=INSIDE)
        return np.stack([np.asarray(channel) for channel in (road, route, objects)])
