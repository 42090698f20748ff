# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""drivability_node: collision and road compliance of every driven vehicle (CRG III-D)."""

from collections import deque
from collections.abc import Sequence
from pathlib import Path
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import numpy as np
from rclpy.node import Node
from rclpy.publisher import Publisher
from trajectory_msgs.msg import JointTrajectory

from crgame_ros.drivability.monitor import (
    changes,
    DrivabilityMonitor,
    road_transforms,
    VehicleDrivability,
)
from crgame_ros.errors import CrgameError
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.planner.joints import vehicles_from_joints
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.messages import from_time, to_time
from crgame_ros.ros.node_main import run_node, StopFlag
from crgame_ros.ros.scenario_documents import ScenarioDocuments, ScenarioSet
from crgame_ros.ros.spinning import poll
from crgame_ros.scenario.objects import ObjectStates
from crgame_ros.scenario.occupancy_tiles import TiledOccupancy
from crgame_ros.simulation.documents import GameDocument
from crgame_ros.vehicle.state import STATE_WIDTH

PERIOD_S = 0.005
HEARTBEAT_S = 1.0


class DrivabilityNode(Node):
    """Checks each published state; reports changes at once and a heartbeat every second."""

    def __init__(self) -> None:
        super().__init__('drivability_node')
        self._endpoints = Endpoints(self)
        self._documents = ScenarioDocuments(self._endpoints)
        self._states = self._endpoints.polled('/vehicles/state', depth=100)
        self._objects = self._endpoints.polled('/traffic/objects', depth=100)
        self._game: GameDocument | None = None
        self._monitor: DrivabilityMonitor | None = None
        self._reports: dict[str, Publisher] = {}
        self._waiting_objects: deque[tuple[int, ObjectStates]] = deque()
        self._tick_ns = 0
        self._reported: tuple[VehicleDrivability, ...] = ()
        self._heartbeat_s = 0.0

    def run(self, stop: StopFlag) -> None:
        """Check until asked to stop."""
        poll(self, stop, PERIOD_S, self._work)

    def _work(self) -> None:
        # States are taken before objects: those of a tick are published ahead of its state.
        states = []
        while (message := self._states.take()) is not None:
            states.append(message)
        while (message := self._objects.take()) is not None:
            poses = np.array(message.points[0].positions).reshape(-1, 3)
            velocities = np.array(message.points[0].velocities).reshape(-1, 3)
            self._waiting_objects.append(
                (from_time(message.header.stamp), ObjectStates(poses, velocities)))
        try:
            documents = self._documents.poll()
            if documents is not None:
                self._build(documents)
            for message in states if self._monitor is not None else ():
                self._check(message)
        except CrgameError as error:
            # Documents that cannot be used, or a map that breaks while it is read.
            self._monitor = None
            self.get_logger().error(f'{error}; nothing is checked until the next game')

    def _build(self, documents: ScenarioSet) -> None:
        game, driven = documents.game, documents.driven
        network = documents.loaded.scenario.lanelet_network
        place = game.content.get('occupancy')
        monitor = DrivabilityMonitor(
            driven, documents.others, network, game.drivability,
            None if place is None else TiledOccupancy(Path(place)),
            road_transforms(len(game.humans), [RigidTransform(*entry['transform'])
                                               for entry in game.avs]))
        states = [entry['state'] for entry in (*game.humans, *game.avs)]
        monitor.prepare(np.array(states).reshape(-1, STATE_WIDTH))
        for item in driven:
            if item.id not in self._reports:
                self._reports[item.id] = self._endpoints.publisher('/<v>/drivability', item.id)
        self._monitor, self._game, self._reported = monitor, game, ()

    def _check(self, message: JointTrajectory) -> None:
        assert self._monitor is not None and self._game is not None
        stamp_ns = from_time(message.header.stamp)
        scheduler = self._game.scheduler
        n = scheduler.step_of_stamp(stamp_ns)
        point = message.points[0]
        joints = [np.array(values).reshape(-1, 4)
                  for values in (point.positions, point.velocities, point.accelerations)]
        states = vehicles_from_joints(*joints)
        while self._waiting_objects and self._waiting_objects[0][0] <= stamp_ns:
            tick_ns, objects = self._waiting_objects.popleft()
            if tick_ns < scheduler.clock_offset_ns:
                continue
            self._tick_ns = tick_ns
            self._monitor.set_objects(scheduler.step_of_stamp(tick_ns), objects)
        if n < 0 or self._monitor.objects_n is None or len(states) != len(self._game.humans) \
                + len(self._game.avs):
            # A state of the game before or after this one.
            return
        since_s = (stamp_ns - self._tick_ns) * 1e-9
        verdicts = self._monitor.check(n, since_s, states)
        due = changes(self._reported, verdicts)
        self._reported = verdicts
        if time.monotonic() - self._heartbeat_s > HEARTBEAT_S:
            self._heartbeat_s = time.monotonic()
            due = verdicts
        self._report(due, stamp_ns)

    def _report(self, verdicts: Sequence[VehicleDrivability], stamp_ns: int) -> None:
        assert self._game is not None
        spec = self._game.drivability
        for verdict in verdicts:
            faults = [text for wrong, text in (
                (verdict.collision, 'collision with ' + ', '.join(verdict.hit)),
                (verdict.off_road, 'off the road')) if wrong]
            status = DiagnosticStatus(
                level=DiagnosticStatus.ERROR if faults else DiagnosticStatus.OK,
                name=f'{verdict.vehicle_id}/drivability', message='; '.join(faults) or 'valid')
            status.values = [KeyValue(key=key, value=value) for key, value in (
                ('collision', str(verdict.collision).lower() if spec.collision else 'off'),
                ('road_compliance', str(not verdict.off_road).lower() if spec.road else 'off'),
                ('hit', ','.join(verdict.hit)), ('n', str(verdict.n)),
                ('stop', str(verdict.stop_requested).lower()))]
            array = DiagnosticArray(status=[status])
            array.header.stamp = to_time(stamp_ns)
            self._reports[verdict.vehicle_id].publish(array)


def main(args: list[str] | None = None) -> None:
    """Run the node."""
    run_node(DrivabilityNode, args)


if __name__ == '__main__':
    main()
