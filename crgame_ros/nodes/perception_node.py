# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""perception_node: one AV's perception of the true world (FS II-B)."""

from array import array
from functools import partial
import gc
import math
import time

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.messages.joints import from_joint_trajectory, JointSeries, MAP
from crgame_ros.occupancy.tiles import TiledOccupancy
from crgame_ros.perception.perception import Perception
from crgame_ros.ros.diagnostics import complain
from crgame_ros.ros.endpoints import Endpoints, NodeReport
from crgame_ros.ros.messages import EXACT_VARIANCE, SeriesMessage, set_time
from crgame_ros.ros.node_main import run_node, StopFlag
from crgame_ros.ros.number_parameters import fixed
from crgame_ros.ros.scenario_documents import ScenarioSet
from crgame_ros.ros.spinning import poll
from crgame_ros.ros.trusted_code import TrustedCode
from crgame_ros.ros.world_follower import WorldFollower, WorldStep
from crgame_ros.vehicle.state import VehicleState
from nav_msgs.msg import Odometry
import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import LaserScan

PERIOD_S = 0.002
COLLECT_EVERY = 100
Array = NDArray[np.float64]
# Indices of x, y and yaw in the 6 x 6 covariance of a pose.
POSE_PLACES = (0, 1, 5)


class PerceptionNode(Node):
    """The node that turns the true requests of one AV into the perceived ones for its planner."""

    def __init__(self) -> None:
        super().__init__('perception_node')
        self._vehicle_id = fixed(self, 'vehicle', 'av0', 'id of the AV that perceives')
        self._code = TrustedCode(self)
        endpoints = Endpoints(self)
        self._world = WorldFollower(endpoints, '/vehicles/state', self._forget)
        self._true = endpoints.polled('/<av>/true_request', self._vehicle_id)
        self._perceived = endpoints.publisher('/<av>/plan_request', self._vehicle_id)
        self._localization = LocalizationMessage(endpoints, self._vehicle_id)
        self._scans = ScanMessages(endpoints, self._vehicle_id)
        self._report = NodeReport(endpoints, f'perception_node: {self._vehicle_id}')
        self._perception: Perception | None = None
        self._asked: JointSeries | None = None
        self._message: SeriesMessage | None = None
        self._n = -1
        self._steps = 0

    def run(self, stop: StopFlag) -> None:
        """Follow the world until asked to stop."""
        poll(self, stop, PERIOD_S, self._work)

    def _work(self) -> None:
        try:
            self._world.look()
            message = self._true.latest()
            if message is not None:
                self._asked = from_joint_trajectory(message, f'/{self._vehicle_id}/true_request')
            for step in self._world.steps():
                self._observe(step)
            self._answer()
        except CrgameError as error:
            complain(self, 'perception', f'{self._vehicle_id}: {error}', failed=True)

    def _forget(self) -> None:
        """Discard the state for a new run, or for a restart of the same one."""
        self._perception, self._asked = None, None
        self._n = -1

    def _observe(self, step: WorldStep) -> None:
        """Observe the true world at one step."""
        scenario = self._world.scenario
        if scenario is None or step.n <= self._n:
            return
        place = next((row for row, item in enumerate(scenario.driven)
                      if item.id == self._vehicle_id), None)
        states = step.states
        if self._perception is None:
            if place is None:
                return
            self._perception = self._made(
                scenario, VehicleState(*states[place].tolist()), step.n)
            if self._perception is None:
                return
        begin_s = time.perf_counter()
        scheduler = scenario.game.scheduler
        self._perception.observe(step.n, states, step.objects.poses, step.objects.velocities,
                                 scheduler.since_tick_s(step.n))
        self._n = step.n
        stamp_ns = scheduler.stamp_ns(step.n)
        if self._report.worked(time.perf_counter() - begin_s):
            self._publish_diagnostics(self._perception, stamp_ns)
        self._localization.publish(stamp_ns, self._perception)
        self._scans.publish(scheduler, self._perception)
        self._steps += 1
        if self._steps % COLLECT_EVERY == 0:
            gc.collect()
        self._answer()

    def _publish_diagnostics(self, perception: Perception, stamp_ns: int) -> None:
        """Publish what the AV knows."""
        seen = int(perception.seen.sum())
        sigma = math.sqrt(max(perception.covariance[0, 0] + perception.covariance[1, 1], 0.0))
        self._report.publish(f'{seen} known', {
            'known': seen, 'position_sigma': f'{sigma:.3f}', 'n': self._n}, stamp_ns)

    def _made(self, scenario: ScenarioSet, initial: VehicleState, n: int) -> Perception | None:
        """Build the AV's perception from its state at step n; None if the game gives it none."""
        game = scenario.game
        av = game.av(self._vehicle_id)
        if av is None or av.perception is None:
            return None
        spec = av.perception
        for sensor in spec.sensors:
            self._code.check(sensor.model, f'sensor {sensor.name} of {self._vehicle_id}:')
        perception = Perception(
            self._vehicle_id, spec, scenario.objects, av.vehicle, av.transform, initial, game.seed,
            game.scheduler.dt_s,
            None if game.occupancy is None else TiledOccupancy(game.occupancy), n)
        gc.collect()
        gc.freeze()
        gc.disable()
        sensors = ', '.join(sensor.name for sensor in spec.sensors) or 'no sensors'
        self.get_logger().info(f'{self._vehicle_id}: perceiving with {sensors}')
        return perception

    def _answer(self) -> None:
        """Publish the perceived request once the step of the true one has been observed."""
        if self._asked is None or self._perception is None or self._world.scenario is None:
            return
        scheduler = self._world.scenario.game.scheduler
        n = scheduler.tick_of_stamp(self._asked.stamp_ns)
        if n is None or n > self._n:
            return
        asked, self._asked = self._asked, None
        if n < self._n - scheduler.steps_per_tick:
            return
        try:
            request = self._perception.perceive(asked)
        except (KeyError, ValueError) as error:
            raise InputError(f'is of another run ({error})',
                             f'/{self._vehicle_id}/true_request') from error
        self._message = SeriesMessage.for_series(request, self._message)
        self._perceived.publish(self._message.fill(request))


class LocalizationMessage:
    """The estimated pose and speed with their covariance."""

    def __init__(self, endpoints: Endpoints, av_id: str) -> None:
        self._publisher = endpoints.publisher('/<av>/localization', av_id)
        self._message = Odometry(child_frame_id=f'{av_id}/base_link')
        self._message.header.frame_id = MAP

    def publish(self, stamp_ns: int, perception: Perception) -> None:
        """Publish the present estimate."""
        message, estimate = self._message, perception.estimate
        set_time(message.header.stamp, stamp_ns)
        pose, twist = message.pose, message.twist
        pose.pose.position.x, pose.pose.position.y = estimate.x, estimate.y
        pose.pose.orientation.z = math.sin(0.5 * estimate.yaw)
        pose.pose.orientation.w = math.cos(0.5 * estimate.yaw)
        twist.twist.linear.x, twist.twist.angular.z = estimate.speed, estimate.yaw_rate
        # Quantities that the filter does not estimate come from the world or the vehicle's own
        # sensors.
        known, covariance = np.diag([EXACT_VARIANCE] * 6), perception.covariance
        place = np.ix_(POSE_PLACES, POSE_PLACES)
        pose.covariance = _at_least(known, place, covariance[:3, :3])
        twist.covariance = _at_least(known, np.ix_((0,), (0,)), covariance[3:, 3:])
        self._publisher.publish(message)


def _at_least(known: Array, place: tuple[NDArray[np.intp], ...], part: Array) -> Array:
    """Return a covariance (36) with the filter's part, bounded below by the exact variance."""
    covariance = known.copy()
    covariance[place] = part
    np.fill_diagonal(covariance, np.maximum(covariance.diagonal(), known.diagonal()))
    return covariance.ravel()


class ScanMessages:
    """The scans of the sensors: the hits of their rays."""

    def __init__(self, endpoints: Endpoints, av_id: str) -> None:
        self._publisher = endpoints.publisher('/<av>/scan', av_id)
        self._av_id = av_id
        self._sent: dict[str, int] = {}

    def publish(self, scheduler: ScenarioScheduler, perception: Perception) -> None:
        """Publish every new scan."""
        for spec, n, scan in perception.scans:
            if self._sent.get(spec.name) == n:
                continue
            self._sent[spec.name] = n
            first, last = float(scan.angles[0]), float(scan.angles[-1])
            message = LaserScan(
                angle_min=first, angle_max=last,
                angle_increment=(last - first) / max(1, len(scan.angles) - 1),
                scan_time=1.0 / spec.rate, range_max=spec.horizon,
                ranges=array('f', scan.ranges.astype(np.float32).tobytes()))
            message.header.frame_id = f'{self._av_id}/{spec.name}'
            set_time(message.header.stamp, scheduler.stamp_ns(n))
            self._publisher.publish(message)


main = partial(run_node, PerceptionNode)

if __name__ == '__main__':
    main()
