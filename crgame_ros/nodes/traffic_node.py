# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""traffic_node: reactive traffic in its own process (FS III)."""

from functools import partial
import gc
import time

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.documents import EVENTS, FiredEvents
from crgame_ros.game.events import TrafficOrder
from crgame_ros.game.objects import ObjectStates, Role
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.messages.joints import object_joint_names
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.signs import TrafficLights
from crgame_ros.ros.endpoints import Endpoints, NodeReport
from crgame_ros.ros.messages import StateMessage
from crgame_ros.ros.node_main import run_node, StopFlag
from crgame_ros.ros.spinning import poll
from crgame_ros.ros.trusted_code import TrustedCode
from crgame_ros.ros.world_follower import WorldFollower, WorldStep
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.simulation.traffic_setup import make_traffic, WorldReader
from crgame_ros.simulation.world import TrafficOrders
from crgame_ros.traffic.compiling.kernel_cache import compile_now
from crgame_ros.traffic.fleet.world_view import WorldView
from crgame_ros.traffic.traffic import Traffic
from crgame_ros.traffic.warm_up import drive_everything
import numpy as np
from rclpy.node import Node

PERIOD_S = 0.005
# Garbage is collected after an answer, never during one.
COLLECT_EVERY = 10
# Ticks.
MAX_BEHIND = 5


class TrafficNode(Node):
    """The node that moves a run's agents one tick ahead of the published world."""

    def __init__(self) -> None:
        super().__init__('traffic_node')
        self._code = TrustedCode(self)
        endpoints = Endpoints(self)
        self._refusals = endpoints.refusals
        self._world = WorldFollower(endpoints, '/vehicles/tick_state', self._begin)
        self._events = endpoints.polled('/scenario/events')
        self._agents = endpoints.publisher('/traffic/agents')
        self._report = NodeReport(endpoints, 'traffic_node: agents')
        self._spec: TrafficSpec | None = None
        self._traffic: Traffic | None = None
        self._k = 0
        self._ticks = 0
        self._events_so_far = FiredEvents(-1, ())
        self._obeyed: set[str] = set()

    def run(self, stop: StopFlag) -> None:
        """Follow the world until asked to stop."""
        poll(self, stop, PERIOD_S, self._work)

    def _work(self) -> None:
        try:
            self._world.look()
            message = self._events.latest()
            if message is not None:
                self._receive_events(message.data)
            ticks = list(self._world.steps()) if self._knows_the_events else []
            # After a short delay the agents catch up; after a long one they continue from the
            # newest tick.
            for step in ticks if len(ticks) <= MAX_BEHIND else ticks[-1:]:
                if self._spec is not None:
                    self._advance(step)
        except CrgameError as error:
            self._spec = None
            self.get_logger().error(str(error))

    @property
    def _knows_the_events(self) -> bool:
        """Return whether this run's events have been received, which agents need to continue."""
        game = self._world.scenario.game if self._world.scenario is not None else None
        return game is None or not game.events or self._events_so_far.epoch == game.epoch

    def _receive_events(self, text: str) -> None:
        try:
            self._events_so_far = EVENTS.read(text)
        except InputError as error:
            self._refusals.note('/scenario/events', str(error))

    def _begin(self) -> None:
        """Prepare for a run; its agents are built when its world arrives."""
        scenario = self._world.scenario
        assert scenario is not None
        self._traffic, self._spec = None, None
        self._spec = scenario.game.traffic
        if self._spec is None:
            return
        self._code.check(self._spec.model, 'car-following model')
        compile_now()
        drive_everything()
        self._orders = TrafficOrders(scenario.loaded, scenario.game.events)
        self._obeyed = set()
        self._network = RoadNetwork(scenario.loaded.scenario.lanelet_network)
        self._obstacles = ScenarioObstacles(scenario.loaded)
        self._reader = WorldReader(scenario.objects, TrafficLights(scenario.loaded.scenario))
        objects = scenario.others
        agents = [item for item in objects if item.role is Role.TRAFFIC]
        self._columns = [objects.index(item) for item in agents]
        self._adopted = [self._obstacles.ids.index(item.id) for item in agents
                         if item.id in self._obstacles.ids]
        self._message = StateMessage(
            [name for item in agents for name in object_joint_names(item.id)])
        self._message.accelerations[:] = np.nan
        self.get_logger().info(f'{len(agents)} agents at most')

    def _advance(self, step: WorldStep) -> None:
        """Move the agents from the world of a tick to the next one."""
        assert self._world.scenario is not None
        scheduler = self._world.scenario.game.scheduler
        k = scheduler.k(step.n)
        if self._traffic is not None and k == self._k - 1:
            # Published again because the answer may have been lost.
            self._agents.publish(self._message.message)
            return
        begin_s = time.perf_counter()
        view = self._reader.view(k, step.joints[0], step.joints[1], step.objects)
        traffic = self._traffic
        if traffic is None or k != self._k:
            traffic = self._made(view, k, step)
        self._obey(traffic, k)
        taken_off = traffic.taken_off
        traffic.advance(view)
        if traffic.taken_off > taken_off:
            self.get_logger().warning(
                f'k = {k}: removed an agent from the road: agents waited for each other')
        self._traffic, self._k = traffic, k + 1
        states, message = traffic.states, self._message
        message.positions[:] = states.poses.ravel()
        message.velocities[:] = states.velocities.ravel()
        stamp_ns = scheduler.stamp_ns(step.n + scheduler.steps_per_tick)
        self._agents.publish(message.stamp(stamp_ns))
        if self._report.worked(time.perf_counter() - begin_s):
            count = int(np.isfinite(states.poses[:, 0]).sum())
            self._report.publish(f'{count} agents', {
                'agents': count, 'k': k, 'taken_off': traffic.taken_off}, stamp_ns)
        self._ticks += 1
        if self._ticks % COLLECT_EVERY == 0:
            gc.collect()

    def _obey(self, traffic: Traffic, k: int) -> None:
        """Apply the events up to a tick to the agents."""
        assert self._world.scenario is not None
        events = self._events_so_far
        game = self._world.scenario.game
        actions = {event.name: event.action for event in game.events}
        for event in events.fired if events.epoch == game.epoch else ():
            action = actions.get(event.name)
            if event.k <= k and event.name not in self._obeyed \
                    and isinstance(action, TrafficOrder):
                self._obeyed.add(event.name)
                self._orders.obey(action, traffic)

    def _made(self, view: WorldView, k: int, step: WorldStep) -> Traffic:
        """Build the agents of a new run, or continue with those published before."""
        scenario = self._world.scenario
        assert scenario is not None and self._spec is not None
        game, traffic = scenario.game, self._traffic
        is_new = traffic is None
        if traffic is None:
            traffic = make_traffic(
                self._spec, scenario.loaded, self._network, self._reader.others,
                self._obstacles, self._adopted, view, game.scheduler,
                game.seed)
            if tuple(item.id for item in traffic.descriptions) != tuple(
                    item.id for item in scenario.objects if item.role is Role.TRAFFIC):
                raise InputError('lists other agents than traffic_node creates',
                                 '/scenario/objects', 'run all nodes from one version')
            gc.collect()
            gc.freeze()
            gc.disable()
        if k != game.scheduler.k0:
            self.get_logger().warning(f'going on at k = {k}')
            traffic.resume(k, ObjectStates(step.objects.poses[self._columns],
                                           step.objects.velocities[self._columns]), is_new)
        return traffic


main = partial(run_node, TrafficNode)

if __name__ == '__main__':
    main()
