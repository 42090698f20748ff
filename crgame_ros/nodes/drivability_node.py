# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""drivability_node: collision and road compliance of every driven vehicle (CRG III-D)."""

from functools import partial
import time

from crgame_ros.drivability.monitor import drivability_status, DrivabilityMonitor
from crgame_ros.game.game import DrivabilitySpec
from crgame_ros.ros.node_main import run_node
from crgame_ros.ros.world_follower import ObserverNode
from crgame_ros.simulation.observer import drivability_monitor, ObservedRun
from rclpy.publisher import Publisher

HEARTBEAT_S = 1.0


class DrivabilityNode(ObserverNode[DrivabilityMonitor]):
    """
    The node that checks each published state; it reports changes at once and all every second.

    A new subscriber also gets a report at once, because after a restart none has received any.
    """

    def __init__(self) -> None:
        super().__init__('drivability_node')
        self._reports: dict[str, Publisher] = {}
        self._spec = DrivabilitySpec()
        self._heartbeat_s = 0.0
        self._listeners = 0

    def make(self, run: ObservedRun) -> DrivabilityMonitor:
        """Build the monitor of a run and the topics of its vehicles."""
        monitor = drivability_monitor(run)
        for item in run.vehicles:
            if item.id not in self._reports:
                self._reports[item.id] = self.endpoints.publisher('/<v>/drivability', item.id)
        self._spec = run.drivability
        return monitor

    def publish(self, observer: DrivabilityMonitor, stamp_ns: int) -> None:
        """Publish the changes; publish everything every second."""
        due = observer.changed
        listeners = sum(each.get_subscription_count() for each in self._reports.values())
        if listeners > self._listeners or time.monotonic() - self._heartbeat_s > HEARTBEAT_S:
            self._heartbeat_s = time.monotonic()
            due = observer.verdicts
        self._listeners = listeners
        for verdict in due:
            self._reports[verdict.vehicle_id].publish(self.endpoints.diagnostics.array_of(
                drivability_status(verdict, self._spec), stamp_ns))


main = partial(run_node, DrivabilityNode)

if __name__ == '__main__':
    main()
