# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""planner_node: one AV's planner in its own process (CRG III-B, the worker of algorithm 2)."""

from functools import partial
import gc
import math
import time

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.documents import EVENTS, FiredEvents, GameDocument
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.messages.joints import from_joint_trajectory, MAP, plan_to_joints
from crgame_ros.messages.plan import Plan
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.planner.manager import FailureLines, planner_status, PlannerManager, swapped_in
from crgame_ros.planner.request_reader import RequestReader
from crgame_ros.ros.diagnostics import complain
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.messages import SeriesMessage, to_time
from crgame_ros.ros.node_main import run_node, StopFlag
from crgame_ros.ros.number_parameters import fixed
from crgame_ros.ros.run_time import RunTime, TimeCourse, USUAL_NS
from crgame_ros.ros.scenario_documents import DocumentCollector, ScenarioSet
from crgame_ros.ros.spinning import spin
from crgame_ros.ros.trusted_code import TrustedCode
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.node import Node
from std_msgs.msg import Bool, String
from trajectory_msgs.msg import JointTrajectory

# Garbage is collected after an answer, never during planning.
COLLECT_EVERY = 10


class PlannerNode(Node):
    """The node that answers one AV's plan requests; a new game or scenario resets it."""

    def __init__(self) -> None:
        super().__init__('planner_node')
        self._vehicle_id = fixed(self, 'vehicle', 'av0', 'id of the AV to drive')
        self._choice = fixed(self, 'planner', '',
                             'planner instead of the one that the game names')
        self._code = TrustedCode(self, self._choice)
        endpoints = Endpoints(self)
        self._plans = endpoints.publisher('/<av>/plan', self._vehicle_id)
        self._paths = endpoints.publisher('/<av>/plan_path', self._vehicle_id)
        self._diagnostics, self._refusals = endpoints.diagnostics, endpoints.refusals
        self._documents = DocumentCollector()
        self._game: GameDocument | None = None
        self._transform = RigidTransform(0.0, 0.0, 0.0)
        self._manager: PlannerManager | None = None
        self._events = FiredEvents(-1, ())
        self._reader: RequestReader | None = None
        self._frames_skipped = False
        self._message: SeriesMessage | None = None
        self._waiting: JointTrajectory | None = None
        self._scenario: ScenarioSet | None = None
        self._time = RunTime()
        self._subscriptions_kept = [
            *(endpoints.subscription(f'/scenario/{kind}', partial(self._on_document, kind))
              for kind in ('xml', 'objects', 'game')),
            endpoints.subscription('/timing/frame_skip', self._on_frame_skip),
            # Before the requests, because an event may change the planner that answers them.
            endpoints.subscription('/scenario/events', self._on_events),
            endpoints.subscription('/<av>/plan_request', self._on_request, self._vehicle_id)]

    def run(self, stop: StopFlag) -> None:
        """Serve requests until asked to stop."""
        spin(self, stop)

    def _on_events(self, message: String) -> None:
        try:
            self._events = EVENTS.read(message.data)
        except InputError as error:
            self._refusals.note('/scenario/events', str(error))
            return
        self._apply_events()

    def _apply_events(self) -> None:
        """Apply the events of the present run to the planner."""
        if self._manager is None or self._game is None or self._events.epoch != self._game.epoch:
            return
        for text in self._manager.apply([event.name for event in self._events.fired]):
            self.get_logger().info(f'{self._vehicle_id}: {text} by an event')

    def _on_frame_skip(self, message: Bool) -> None:
        self._frames_skipped = message.data

    def _on_document(self, kind: str, message: String) -> None:
        try:
            self._documents.add(kind, message.data)
        except InputError as error:
            # The previous game goes on.
            self._refusals.note(f'/scenario/{kind}', str(error))
            return
        try:
            scenario = self._documents.complete()
            if scenario is not None:
                self._prepare(scenario)
        except CrgameError as error:
            self._manager = None
            self.get_logger().error(f'{self._vehicle_id}: {error}')
            return
        waiting, self._waiting = self._waiting, None
        if waiting is not None:
            self._on_request(waiting)

    def _prepare(self, scenario: ScenarioSet) -> None:
        """Set up the planner for a matching set of documents."""
        game, loaded = scenario.game, scenario.loaded
        self._scenario = scenario
        self._time = RunTime(max(USUAL_NS, 3 * game.scheduler.time_step_ns))
        av = game.av(self._vehicle_id)
        if av is None:
            self._manager = None
            self.get_logger().warning(f'{self._vehicle_id} takes no part in this game: waiting')
            return
        objects = {item.id: item for item in scenario.objects}
        problem = next((problem for problem in loaded.planning_problems
                        if problem.planning_problem_id == av.planning_problem), None)
        if problem is None:
            raise InputError(f'planning problem {av.planning_problem} is not in it',
                             '/scenario/xml')
        name = self._choice or av.planner
        options = {} if self._choice and self._choice != av.planner else dict(av.options)
        context = PlannerContext(
            self._vehicle_id, loaded.scenario, problem, av.vehicle, objects,
            game.scheduler.time_step_s, game.scheduler.k0, game.seed, game.drivability.road)
        for planner in (name, *swapped_in(self._vehicle_id, game.events)):
            self._code.check(planner, 'planner')
        manager = PlannerManager(context, name, options, game.events, time.perf_counter)
        self._reader = RequestReader(self._vehicle_id, objects, game.scheduler)
        self._manager, self._game = manager, game
        self._transform = av.transform
        gc.collect()
        gc.freeze()
        gc.disable()
        if manager.failure is None:
            self.get_logger().info(f'{self._vehicle_id}: planner {name} is ready')
        self._failures = FailureLines(self._vehicle_id, self.get_logger().error,
                                      game.scheduler.time_step_s)
        self._failures.note(manager)
        self._apply_events()

    def _on_request(self, message: JointTrajectory) -> None:
        if self._manager is None or self._reader is None or self._game is None:
            self._waiting = message
            return
        try:
            request = self._reader.read(
                from_joint_trajectory(message, f'/{self._vehicle_id}/plan_request'))
        except InputError as error:
            # A request of the game before or after this one; its documents have not arrived yet.
            complain(self, 'request', str(error))
            self._waiting = message
            return
        course = self._time.follow(request.stamp_ns)
        if course is TimeCourse.BEHIND:
            return
        if course is TimeCourse.BACK and self._scenario is not None:
            # A recording is played again: the planner starts afresh.
            self._prepare(self._scenario)
        self._diagnostics.now_ns = request.stamp_ns
        plan = self._manager.plan(request)
        self._failures.note(self._manager)
        series = plan_to_joints(plan, self._vehicle_id, self._game.scheduler.time_step_ns)
        self._message = SeriesMessage.for_series(series, self._message)
        self._plans.publish(self._message.fill(series))
        if not self._frames_skipped and self._paths.get_subscription_count():
            self._paths.publish(_path(plan, self._transform))
        status = planner_status(self._vehicle_id, request.k, plan, self._manager)
        if status is not None:
            self._diagnostics.publish_status(status)
        if self._manager.statistics.plans % COLLECT_EVERY == 0:
            gc.collect()


def _path(plan: Plan, transform: RigidTransform) -> Path:
    """Return a plan for viewers: rear-axle poses in map, whatever frame its AV plans in."""
    message = Path()
    message.header.frame_id = MAP
    message.header.stamp = to_time(plan.stamp_ns)
    for x, y, yaw in transform.to_simulation(plan.states[:, :3]).tolist():
        pose = PoseStamped(header=message.header)
        pose.pose.position.x, pose.pose.position.y = x, y
        pose.pose.orientation.z = math.sin(0.5 * yaw)
        pose.pose.orientation.w = math.cos(0.5 * yaw)
        message.poses.append(pose)
    return message


main = partial(run_node, PlannerNode)

if __name__ == '__main__':
    main()
