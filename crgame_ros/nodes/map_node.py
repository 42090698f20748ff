# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""map_node: the permanent obstacles near the driven vehicles (FS II-A2)."""

from array import array
from functools import partial

from crgame_ros.errors import CrgameError
from crgame_ros.game.documents import GAME
from crgame_ros.messages.cdr import stamp_of
from crgame_ros.messages.joints import MAP
from crgame_ros.occupancy.occupancy import OccupancyGrid
from crgame_ros.occupancy.tiles import TiledOccupancy
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.node_main import run_node, StopFlag
from crgame_ros.ros.number_parameters import declare_number
from crgame_ros.ros.spinning import poll
from nav_msgs.msg import OccupancyGrid as OccupancyGridMessage
import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node

PERIOD_S = 0.1
# Joints of a vehicle in /vehicles/tick_state: x, y, yaw, steering.
JOINTS = 4
# Published where nothing is occupied: viewers need at least one cell.
NOTHING = OccupancyGrid((0.0, 0.0), 1.0, np.zeros((1, 1), dtype=bool))


class MapNode(Node):
    """The node that publishes the map tiles around the driven vehicles when these tiles change."""

    def __init__(self) -> None:
        super().__init__('map_node')
        self._reach = declare_number(
            self, 'reach', 60.0, 'how far around each vehicle the map is published [m]',
            (1.0, 1000.0))
        endpoints = Endpoints(self)
        self._diagnostics = endpoints.diagnostics
        self._games = endpoints.polled('/scenario/game')
        self._states = endpoints.polled('/vehicles/tick_state', depth=1)
        self._publisher = endpoints.publisher('/occupancy')
        self._map: TiledOccupancy | None = None
        self._published: OccupancyGrid | None = None
        self._left_out = 0

    def run(self, stop: StopFlag) -> None:
        """Publish until asked to stop."""
        poll(self, stop, PERIOD_S, self._work)

    def _work(self) -> None:
        try:
            message = self._games.latest()
            if message is not None:
                self._open(message.data)
            message = self._states.latest()
            if message is not None:
                self._diagnostics.now_ns = stamp_of(message)
            if message is not None and self._map is not None:
                points = np.array(message.points[0].positions).reshape(-1, JOINTS)[:, :2]
                self._publish(self._near(self._map, points) or NOTHING)
        except CrgameError as error:
            self._clear()
            self.get_logger().error(str(error))

    def _open(self, text: str) -> None:
        """Open the map of a new game; reopen it even if the file is the same."""
        path = GAME.read(text).occupancy
        if path is None:
            self._clear()
        else:
            self._map = TiledOccupancy(path)

    def _clear(self) -> None:
        """Clear the published map."""
        self._map = None
        if self._published is not None:
            self._publish(NOTHING)

    def _near(self, occupancy: TiledOccupancy, points: NDArray[np.float64]
              ) -> OccupancyGrid | None:
        """Return the neighbourhood of the vehicles, without the last ones if they are too far."""
        count = len(points)
        while count > 1 and not occupancy.fits(points[:count], self._reach):
            count -= 1
        if len(points) - count > self._left_out:
            self.get_logger().warning(
                f'the driven vehicles are too far apart for one map: it shows the first {count} '
                f'of {len(points)}')
        self._left_out = len(points) - count
        return occupancy.near(points[:count], self._reach)

    def _publish(self, grid: OccupancyGrid) -> None:
        if grid is self._published:
            return
        self._published = grid
        message = OccupancyGridMessage()
        message.header.frame_id = MAP
        message.header.stamp = message.info.map_load_time = self.get_clock().now().to_msg()
        message.info.resolution = grid.resolution
        message.info.height, message.info.width = grid.occupied.shape
        message.info.origin.position.x, message.info.origin.position.y = grid.origin
        message.info.origin.orientation.w = 1.0
        message.data = array('b', np.where(grid.occupied, 100, 0).astype(np.int8).tobytes())
        self._publisher.publish(message)


main = partial(run_node, MapNode)

if __name__ == '__main__':
    main()
