# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws a game from above, fast enough for every step."""

from commonroad.scenario.lanelet import LaneletNetwork
from crgame_ros.geometry.outline import outline, placed_at
from crgame_ros.geometry.reference_point import ahead
from crgame_ros.gym.driving_game import DrivingGame
from crgame_ros.roads.surface import lanelet_areas, lanelet_ring
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
import shapely

Points = NDArray[np.float64]
FRAMES_PER_S = 10
# Size of the picture, and of a metre in it [px].
WIDTH, HEIGHT = 720, 432
SCALE = 6.0
# Colours as in the figures: warm for humans, cold for AVs.
GROUND, ROAD, LINE = (208, 214, 205), (235, 235, 235), (160, 160, 160)
AGENT, HUMAN, AV, OBJECT = (0, 158, 115), (213, 94, 0), (0, 114, 178), (140, 140, 140)
ROUTE = (140, 205, 180)
# Length of the route shown, and spacing of its points [m].
_AHEAD, _STEP = 80.0, 2.0


class ScenePainter:
    """A painter of games on one road, north up, centred on the first agent's vehicle."""

    def __init__(self, network: LaneletNetwork) -> None:
        self._lanelets = list(map(lanelet_ring, network.lanelets))
        self._tree = shapely.STRtree(lanelet_areas(network.lanelets))

    def paint(self, game: DrivingGame) -> NDArray[np.uint8]:
        """Return a picture (HEIGHT, WIDTH, 3) of the current state."""
        states = game.simulation.states
        seat = game.seats[0]
        middle = np.array(states[seat.row][:2])
        image = Image.new('RGB', (WIDTH, HEIGHT), GROUND)
        draw = ImageDraw.Draw(image)
        half = np.array((WIDTH, HEIGHT)) / (2.0 * SCALE)
        window = shapely.box(*(middle - half), *(middle + half))
        for index in sorted(self._tree.query(window).tolist()):
            draw.polygon(_pixels(self._lanelets[index], middle), fill=ROAD, outline=LINE)
        self._paint_route(draw, game, middle)
        poses, things = game.objects.poses, game.setup.obstacles.descriptions
        near = np.abs(poses[:, :2] - middle).max(axis=1) < half.max() + 20.0
        for index in np.flatnonzero(near).tolist():
            draw.polygon(_pixels(placed_at(outline(things[index].shape),
                                           *poses[index].tolist()), middle), fill=OBJECT)
        agents = {item.row for item in game.seats}
        for row, (state, setup) in enumerate(zip(states, game.setup.vehicles, strict=True)):
            vehicle = setup.vehicle
            x, y = ahead(state.x, state.y, state.yaw, vehicle.rear_to_center)
            colour = AGENT if row in agents else HUMAN if row < len(game.setup.humans) else AV
            draw.polygon(_pixels(placed_at(outline(vehicle.shape), x, y, state.yaw), middle),
                         fill=colour, outline=(34, 34, 34))
        return np.asarray(image)

    def _paint_route(self, draw: ImageDraw.ImageDraw, game: DrivingGame, middle: Points) -> None:
        seat = game.seats[0]
        ways = np.arange(0.0, _AHEAD, _STEP) + seat.place.s
        points = seat.view.in_simulation(seat.guide.driving.path.pose_at(ways)[:, :3])
        draw.line(_pixels(points[:, :2], middle), fill=ROUTE, width=2)


def _pixels(points: Points, middle: Points) -> list[tuple[float, float]]:
    """Return pixel coordinates of points; rows count downwards."""
    shown = (points - middle) * (SCALE, -SCALE) + (0.5 * WIDTH, 0.5 * HEIGHT)
    return [(x, y) for x, y in shown.tolist()]
