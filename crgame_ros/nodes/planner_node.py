# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""planner_node: one AV's planner in its own process (CRG III-B, the worker of algorithm 2)."""

from collections.abc import Mapping
import gc
import math
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from std_msgs.msg import Bool, String
from trajectory_msgs.msg import JointTrajectory

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.planner.adapter import PlannerAdapter
from crgame_ros.planner.interface import Plan, PlannerContext
from crgame_ros.planner.joints import plan_to_joints
from crgame_ros.planner.registry import create_planner
from crgame_ros.planner.request_reader import RequestReader
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.messages import from_joint_trajectory, MAP, SeriesMessage, to_time
from crgame_ros.ros.node_main import run_node, StopFlag
from crgame_ros.ros.spinning import spin
from crgame_ros.scenario.loading import parse_scenario, scenario_digest
from crgame_ros.scenario.objects import ObjectDescription
from crgame_ros.simulation.documents import (
    GameDocument,
    parse_game_document,
    parse_objects_document,
)
from crgame_ros.vehicle.parameters import VehicleParameters

# Garbage is collected after an answer, never in the middle of planning one.
COLLECT_EVERY = 10


class PlannerNode(Node):
    """Answers the plan requests of one AV; prepares anew when the scenario or game changes."""

    def __init__(self) -> None:
        super().__init__('planner_node')
        self._vehicle_id: str = self.declare_parameter(
            'vehicle', 'av0', ParameterDescriptor(
                description='id of the AV to drive', read_only=True)).value
        self._choice: str = self.declare_parameter(
            'planner', '', ParameterDescriptor(
                description='planner instead of the one that the game names',
                read_only=True)).value
        endpoints = Endpoints(self)
        self._plans = endpoints.publisher('/<av>/plan', self._vehicle_id)
        self._paths = endpoints.publisher('/<av>/plan_path', self._vehicle_id)
        self._diagnostics = endpoints.publisher('/diagnostics')
        self._documents: dict[str, str] = {}
        self._game: GameDocument | None = None
        self._ready_for: tuple[str, ...] = ()
        self._adapter: PlannerAdapter | None = None
        self._reader: RequestReader | None = None
        self._frames_skipped = False
        self._message: SeriesMessage | None = None
        self._waiting: JointTrajectory | None = None
        self._subscriptions_kept = [
            endpoints.subscription('/scenario/xml', self._on_xml),
            endpoints.subscription('/scenario/objects', self._on_objects),
            endpoints.subscription('/scenario/game', self._on_game),
            endpoints.subscription('/timing/frame_skip', self._on_frame_skip),
            endpoints.subscription('/<av>/plan_request', self._on_request, self._vehicle_id)]

    def run(self, stop: StopFlag) -> None:
        """Serve requests until asked to stop."""
        spin(self, stop)

    def _on_xml(self, message: String) -> None:
        self._take_document('xml', message.data)

    def _on_objects(self, message: String) -> None:
        self._take_document('objects', message.data)

    def _on_game(self, message: String) -> None:
        self._take_document('game', message.data)

    def _on_frame_skip(self, message: Bool) -> None:
        self._frames_skipped = message.data

    def _take_document(self, kind: str, text: str) -> None:
        self._documents[kind] = text
        if len(self._documents) < 3:
            return
        try:
            self._prepare()
        except CrgameError as error:
            self._adapter = None
            self.get_logger().error(f'{self._vehicle_id}: {error}')
            return
        waiting, self._waiting = self._waiting, None
        if waiting is not None:
            self._on_request(waiting)

    def _prepare(self) -> None:
        """Set the planner up once text, game and objects belong together."""
        game = parse_game_document(self._documents['game'])
        xml_text = self._documents['xml']
        key = (self._documents['game'], self._documents['objects'], game.scenario_sha256)
        if scenario_digest(xml_text) != game.scenario_sha256 or key == self._ready_for:
            return
        entry = game.vehicle(self._vehicle_id)
        if entry is None:
            self._adapter = None
            self.get_logger().warning(f'{self._vehicle_id} takes no part in this game: waiting')
            return
        loaded = parse_scenario(xml_text, '/scenario/xml')
        objects: Mapping[str, ObjectDescription] = {
            item.id: item for item in parse_objects_document(self._documents['objects'])}
        problem = next((problem for problem in loaded.planning_problems
                        if problem.planning_problem_id == entry['planning_problem']), None)
        if problem is None:
            raise InputError(f'planning problem {entry["planning_problem"]} is not in it',
                             '/scenario/xml')
        name = self._choice or entry['planner']
        options = {} if self._choice and self._choice != entry['planner'] else entry['options']
        adapter = PlannerAdapter(create_planner(name, options), time.perf_counter)
        failure = adapter.setup(PlannerContext(
            self._vehicle_id, loaded.scenario, problem, VehicleParameters(**entry['vehicle']),
            objects, game.scheduler.time_step_s, game.scheduler.k0, int(game.content['seed'])))
        self._reader = RequestReader(self._vehicle_id, objects, game.scheduler)
        self._adapter, self._game, self._ready_for = adapter, game, key
        gc.collect()
        gc.freeze()
        gc.disable()
        if failure is None:
            self.get_logger().info(f'{self._vehicle_id}: planner {name} is ready')
        else:
            self.get_logger().error(f'{self._vehicle_id}: planner {name}: {failure}')

    def _on_request(self, message: JointTrajectory) -> None:
        if self._adapter is None or self._reader is None or self._game is None:
            self._waiting = message
            return
        try:
            request = self._reader.read(
                from_joint_trajectory(message, f'/{self._vehicle_id}/plan_request'))
        except InputError as error:
            # A request of the game before or after this one: its documents are on their way.
            self.get_logger().warning(str(error), throttle_duration_sec=1.0)
            self._waiting = message
            return
        plan = self._adapter.plan(request)
        series = plan_to_joints(plan, self._vehicle_id, self._game.scheduler.time_step_ns)
        if self._message is None or not self._message.fits(series):
            self._message = SeriesMessage(series.names, series.times_ns)
        self._plans.publish(self._message.fill(series))
        if not self._frames_skipped and self._paths.get_subscription_count():
            self._paths.publish(_path(plan))
        self._report(request.k, plan)
        if self._adapter.statistics.plans % COLLECT_EVERY == 0:
            gc.collect()

    def _report(self, k: int, plan: Plan) -> None:
        """Tell of a fallback at once, and of the counts every ten requests."""
        assert self._adapter is not None
        statistics = self._adapter.statistics
        if not plan.fallback and statistics.plans % 10:
            return
        status = DiagnosticStatus(
            level=DiagnosticStatus.WARN if plan.fallback else DiagnosticStatus.OK,
            name=f'planner_node: {self._vehicle_id}',
            message=f'braking: {self._adapter.last_reason}' if plan.fallback else 'planning')
        times = statistics.durations_s
        status.values = [KeyValue(key=key, value=str(value)) for key, value in (
            ('k', k), ('plans', statistics.plans), ('fallbacks', statistics.fallbacks),
            ('plan_time_ms', f'{times[-1] * 1e3:.3f}'))]
        message = DiagnosticArray(status=[status])
        message.header.stamp = to_time(plan.stamp_ns)
        self._diagnostics.publish(message)


def _path(plan: Plan) -> Path:
    """Give a plan for people: rear-axle poses in map."""
    message = Path()
    message.header.frame_id = MAP
    message.header.stamp = to_time(plan.stamp_ns)
    for x, y, yaw in plan.states[:, :3].tolist():
        pose = PoseStamped(header=message.header)
        pose.pose.position.x, pose.pose.position.y = x, y
        pose.pose.orientation.z = math.sin(0.5 * yaw)
        pose.pose.orientation.w = math.cos(0.5 * yaw)
        message.poses.append(pose)
    return message


def main(args: list[str] | None = None) -> None:
    """Run the node."""
    run_node(PlannerNode, args)


if __name__ == '__main__':
    main()
