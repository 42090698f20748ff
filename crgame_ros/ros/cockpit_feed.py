# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the cockpit shows of a live run: topics in, documents and frames for the page out."""

import json
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.frames import (
    encode_objects,
    encode_plan,
    encode_prediction,
    encode_state,
    OBJECT_COLUMNS,
    PLAN_COLUMNS,
    STATE_COLUMNS,
)
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.run_status import RunStatus
from crgame_ros.cockpit.scene import scene_document
from crgame_ros.errors import CrgameError
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.planner.joints import vehicles_from_joints
from crgame_ros.ros.endpoints import Endpoints, PolledSubscription
from crgame_ros.ros.messages import from_time
from crgame_ros.ros.scenario_documents import ScenarioDocuments, ScenarioSet
from crgame_ros.timing.cycle_rows import COMMAND_COLUMNS
from crgame_ros.vehicle.state import STATE_WIDTH, StateColumn

STATUS_PERIOD_S = 0.2
# Of the state frames that a client gets: who drives gets each.
WATCHER_PERIOD_S = 1.0 / 30.0
SKIPPING_PERIOD_S = 0.1
# sim_node tells its state every second; after a longer silence it is gone [s].
SILENCE_S = 3.0
QUEUE = 100


class CockpitFeed:
    """
    Reads the graph without an executor and passes on what the page shows.

    :param endpoints: of the node.
    :param hub: all pages.
    """

    def __init__(self, endpoints: Endpoints, hub: Hub) -> None:
        self._endpoints = endpoints
        self._hub = hub
        self.status = RunStatus()
        self._documents = ScenarioDocuments(endpoints)
        self._states = endpoints.polled('/vehicles/state')
        self._objects = endpoints.polled('/traffic/objects')
        self._cycles = endpoints.polled('/timing/cycle')
        self._signals = endpoints.polled('/scenario/signals')
        self._fired = endpoints.polled('/scenario/events')
        self._frame_skip = endpoints.polled('/timing/frame_skip')
        self._diagnostics = endpoints.polled('/diagnostics', depth=QUEUE)
        self._drivability: dict[str, PolledSubscription] = {}
        self._plans: dict[str, PolledSubscription] = {}
        self._requests: dict[str, PolledSubscription] = {}
        self.scenario: ScenarioSet | None = None
        self.frames_skipped = False
        self.n = 0
        self._run_heard_s = 0.0
        self._status_s = 0.0
        self._pace: tuple[float, int] = (0.0, 0)
        self._measured_factor: float | None = None

    @property
    def t(self) -> float:
        """Time of the run [s]."""
        return 0.0 if self.scenario is None else self.n * self.scenario.game.scheduler.dt_s

    def poll(self) -> list[str]:
        """
        Take what has come, and pass it on.

        :return: what went wrong, one line each
        """
        problems = []
        try:
            scenario = self._documents.poll()
            if scenario is not None:
                self._begin(scenario)
        except CrgameError as error:
            problems.append(str(error))
        order = self._frame_skip.latest()
        if order is not None:
            self.frames_skipped = bool(order.data)
        if self.scenario is not None:
            self._poll_motion()
            self._poll_plans()
            self._poll_texts()
        self._poll_diagnostics()
        now_s = time.monotonic()
        if now_s - self._status_s >= STATUS_PERIOD_S:
            self._status_s = now_s
            self._send_status(now_s)
        return problems

    def pace(self, client: Client) -> None:
        """Choose how many state frames a client gets."""
        client.state_period_s = SKIPPING_PERIOD_S if self.frames_skipped else (
            0.0 if client.drives else WATCHER_PERIOD_S)

    def _begin(self, scenario: ScenarioSet) -> None:
        """Show another scenario, game or epoch."""
        self.scenario = scenario
        game = scenario.game
        self._vehicle_ids = [item.id for item in scenario.driven]
        self._object_count = len(scenario.others)
        self._columns = {item.id: index for index, item in enumerate(
            (*scenario.driven, *scenario.others))}
        self._transforms = {entry['id']: RigidTransform(*entry['transform'])
                            for entry in game.avs}
        self._rows = np.full((len(self._vehicle_ids), STATE_COLUMNS), np.nan)
        self.n = 0
        self.status.begin(self._vehicle_ids)
        for vehicle in self._vehicle_ids:
            if vehicle not in self._drivability:
                self._drivability[vehicle] = self._endpoints.polled('/<v>/drivability', vehicle)
        for av in self._transforms:
            if av not in self._plans:
                self._plans[av] = self._endpoints.polled('/<av>/plan', av)
                self._requests[av] = self._endpoints.polled('/<av>/plan_request', av)
        self._hub.set_document('scene', scene_document(
            scenario.loaded, scenario.objects, game))
        self._hub.set_document('events', {'fired': []})

    def _poll_motion(self) -> None:
        cycle: Float64MultiArray | None = self._cycles.latest()
        if cycle is not None:
            self._take_commands(cycle)
        state: JointTrajectory | None = self._states.latest()
        if state is not None:
            self._send_state(state)
        objects: JointTrajectory | None = self._objects.latest()
        if objects is not None:
            self._send_objects(objects)

    def _take_commands(self, cycle: Float64MultiArray) -> None:
        """Keep what the vehicles obeyed in the last cycle."""
        width = len(COMMAND_COLUMNS) * len(self._vehicle_ids)
        if len(cycle.data) >= width and len(cycle.layout.dim) == 2:
            self._rows[:, STATE_WIDTH:] = np.frombuffer(cycle.data)[-width:].reshape(
                -1, len(COMMAND_COLUMNS))

    def _send_state(self, message: JointTrajectory) -> None:
        place = self._place(message)
        point = message.points[0]
        if place is None or len(point.positions) != 4 * len(self._vehicle_ids):
            # A state of the game before or after this one.
            return
        joints = [np.frombuffer(values).reshape(-1, 4) for values in (
            point.positions, point.velocities, point.accelerations)]
        self._rows[:, :STATE_WIDTH] = vehicles_from_joints(*joints)
        self.n = place[1]
        self._hub.send_frame('state', encode_state(*place, self._rows))

    def _send_objects(self, message: JointTrajectory) -> None:
        place = self._place(message)
        rows = np.empty((self._object_count, OBJECT_COLUMNS))
        if place is None or 2 * len(message.points[0].positions) != rows.size:
            return
        point = message.points[0]
        rows[:, :3] = np.frombuffer(point.positions).reshape(-1, 3)
        rows[:, 3:] = np.frombuffer(point.velocities).reshape(-1, 3)
        self._hub.send_frame('objects', encode_objects(*place, rows))

    def _place(self, message: JointTrajectory) -> tuple[int, int, int, float] | None:
        """Give epoch, n, k and t of a message; None if it belongs to another run."""
        assert self.scenario is not None
        game = self.scenario.game
        stamp_ns = from_time(message.header.stamp)
        n = game.scheduler.step_of_stamp(stamp_ns)
        if n < 0 or not message.points:
            return None
        return game.epoch, n, game.scheduler.k(n), n * game.scheduler.dt_s

    def _poll_plans(self) -> None:
        anybody = any(client.wants_predictions for client in self._hub.clients.values())
        for av, transform in self._transforms.items():
            index = self._columns[av]
            plan = self._plans[av].latest()
            if plan is not None and not self.frames_skipped:
                self._send_plan(plan, index, transform)
            if anybody and not self.frames_skipped:
                request = self._requests[av].latest()
                if request is not None:
                    self._send_prediction(request, index, transform)

    def _send_plan(self, message: JointTrajectory, index: int, transform: RigidTransform) -> None:
        place = self._place(message)
        if place is None or any(len(point.positions) < 3 or len(point.velocities) < 2
                                for point in message.points):
            return
        rows = np.empty((len(message.points), PLAN_COLUMNS))
        for row, point in zip(rows, message.points, strict=True):
            x, y, yaw = point.positions[:3]
            vx, vy = point.velocities[:2]
            time_from_start = point.time_from_start
            row[:] = (x, y, yaw, vx * np.cos(yaw) + vy * np.sin(yaw),
                      time_from_start.sec + 1e-9 * time_from_start.nanosec)
        rows[:, :3] = transform.to_simulation(rows[:, :3])
        self._hub.send_frame(f'plan:{index}', encode_plan(*place, index, rows))

    def _send_prediction(self, message: JointTrajectory, index: int,
                         transform: RigidTransform) -> None:
        place = self._place(message)
        if place is None:
            return
        joints = [name.rpartition('/') for name in message.joint_names]
        starts = [(column, self._columns[name]) for column, (name, _, joint) in enumerate(joints)
                  if joint == 'x' and name in self._columns and self._columns[name] != index]
        positions: NDArray[np.float64] = np.array(
            [np.frombuffer(point.positions) for point in message.points])
        futures = np.stack([positions[:, start:start + 3] for start, _ in starts]) if starts \
            else np.empty((0, len(positions), 3))
        for row, (_, column) in enumerate(starts):
            if column < len(self._vehicle_ids):
                futures[row] = transform.to_simulation(futures[row])
        present = np.isfinite(futures[:, 0, StateColumn.X])
        columns = [column for (_, column), here in zip(starts, present, strict=True) if here]
        self._hub.send_frame(
            f'prediction:{index}', encode_prediction(*place, index, columns, futures[present]),
            only_if=lambda client: client.wants_predictions)

    def _poll_texts(self) -> None:
        assert self.scenario is not None
        for slot, kind in ((self._signals, 'signals'), (self._fired, 'events')):
            message = slot.latest()
            content = None if message is None else _json_object(message.data)
            if content is not None and content.pop('epoch', self.scenario.game.epoch) \
                    == self.scenario.game.epoch:
                self._hub.set_document(kind, content)

    def _poll_diagnostics(self) -> None:
        before = self.status.run
        for slot in (self._diagnostics, *self._drivability.values()):
            while (message := slot.take()) is not None:
                for status in message.status:
                    values = {item.key: item.value for item in status.values}
                    self.status.take(status.name, int.from_bytes(status.level, 'little'),
                                     status.message, values, self.t)
                    if status.name == 'sim_node: run':
                        self._run_heard_s = time.monotonic()
        if self.status.run != before:
            # The page holds its picture still in a pause: it must not learn of it late.
            self._status_s = 0.0

    def _send_status(self, now_s: float) -> None:
        if self.scenario is None:
            return
        if now_s - self._run_heard_s > SILENCE_S:
            self.status.run = 'ended'
        since_s, since_n = self._pace
        if now_s - since_s >= 1.0:
            passed = (self.n - since_n) * self.scenario.game.scheduler.dt_s
            self._measured_factor = passed / (now_s - since_s) if passed >= 0.0 else None
            self._pace = (now_s, self.n)
        for client in self._hub.clients.values():
            self.pace(client)
        game = self.scenario.game
        self._hub.set_document('status', {
            **self.status.document(), 't': self.t, 'n': self.n,
            'k': game.scheduler.k(self.n), 'epoch': game.epoch,
            'measured_factor': self._measured_factor, 'frames_skipped': self.frames_skipped,
            'clients': len(self._hub.clients)})
        self._hub.set_document('alarms', self.status.alarms_document())


def _json_object(text: str) -> dict[str, Any] | None:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) else None
