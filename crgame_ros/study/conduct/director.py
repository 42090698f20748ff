# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The study's node in the graph, which chooses games and starts, stops and follows runs."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from crgame_ros.cockpit.run_status import RunStatus
from crgame_ros.errors import InputError
from crgame_ros.game.documents import EVENTS, GAME, GameDocument
from crgame_ros.game.task_documents import TASK_LOG
from crgame_ros.messages.status_values import read_status
from crgame_ros.nodes.cockpit.orders import CockpitOrders
from crgame_ros.ros.endpoints import Endpoints, PolledSubscription
from crgame_ros.ros.messages import from_time
from crgame_ros.study.drive_watch import DriveWatch
from diagnostic_msgs.msg import DiagnosticStatus
import rclpy
from rclpy.context import Context

NS_PER_S = 1_000_000_000
_QUEUE = 100


class Director:
    """
    The controller of one graph. It is polled, and waits only in its coroutines.

    :param domain_id: of the graph.
    :ivar status: of the run.
    :ivar drive_watches: get statuses and tasks of the present drive.
    """

    def __init__(self, domain_id: int) -> None:
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain_id)
        self._node = rclpy.create_node('study_node', context=self._context)
        endpoints = Endpoints(self._node)
        self._endpoints = endpoints
        self._orders = CockpitOrders(self._node, endpoints)
        self._clock = endpoints.polled('/clock')
        self._games = endpoints.polled('/scenario/game')
        self._events = endpoints.polled('/scenario/events')
        self._diagnostics = endpoints.polled('/diagnostics', depth=_QUEUE)
        self._tasks = endpoints.polled(TASK_LOG.topic, depth=_QUEUE)
        self._verdicts: dict[str, PolledSubscription] = {}
        self._stamp_ns = 0
        self.status = RunStatus()
        self.game: GameDocument | None = None
        self.drive_watches: tuple[DriveWatch, ...] = ()

    @property
    def epoch(self) -> int:
        """Return the number of the present game in this graph, from 0 on; -1 before the first."""
        return -1 if self.game is None else self.game.epoch

    @property
    def time_s(self) -> float:
        """Return the run's clock [s]."""
        offset_ns = 0 if self.game is None else self.game.scheduler.clock_offset_ns
        return max(0, self._stamp_ns - offset_ns) / NS_PER_S

    def poll(self) -> None:
        """Process the messages that have arrived."""
        self._read_game()
        self._read_clock()
        self._read_events()
        for slot in (self._diagnostics, *self._verdicts.values()):
            for _ in range(_QUEUE):
                message = slot.pop()
                if message is None:
                    break
                stamp_ns = from_time(message.header.stamp)
                if self.game is not None and stamp_ns >= self.game.scheduler.clock_offset_ns:
                    for status in map(read_status, message.status):
                        self.status.add(status, self.time_s)
                        for watch in self.drive_watches:
                            watch.add(status, self.time_s)
        self._read_tasks()

    async def load(self, game: Path) -> None:
        """
        Choose another game.

        :raises CrgameError: if the simulation refuses it.
        """
        await self._orders.set_parameter('game', str(game))
        await self._orders.control('reset')

    async def start(self) -> None:
        """Start the run once its driver is present."""
        await self._orders.control('start')

    async def stop(self) -> None:
        """Stop the run."""
        await self._orders.control('stop')

    def record(self, subject: str, text: str, **values: object) -> None:
        """Publish a text for the recording."""
        self._endpoints.diagnostics.publish(
            f'study_node: {subject}', DiagnosticStatus.OK, text, values, self._stamp_ns)

    def watch(self, seats: Sequence[str]) -> None:
        """Subscribe to the verdicts on some vehicles alone."""
        for seat in self._verdicts.keys() - set(seats):
            self._endpoints.release(self._verdicts.pop(seat))
        for seat in seats:
            if seat not in self._verdicts:
                self._verdicts[seat] = self._endpoints.polled('/<v>/drivability', seat)

    def close(self) -> None:
        """Leave the graph."""
        self._orders.close()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def _read_game(self) -> None:
        try:
            message = self._games.latest()
            game = None if message is None else GAME.read(message.data)
        except InputError:
            # It comes from another program: those of sim_node are readable.
            return
        if game is not None and (self.game is None or game.epoch != self.game.epoch):
            self.game = game
            self._stamp_ns = game.scheduler.clock_offset_ns
            self.status.begin([vehicle.id for vehicle in game.vehicles])

    def _read_events(self) -> None:
        message = self._events.latest()
        if message is None or self.game is None:
            return
        # Another program may publish a malformed document there.
        with suppress(InputError):
            events = EVENTS.read(message.data)
            if events.epoch == self.game.epoch:
                self.status.add_events(events.fired, self.game.scheduler.dt_s)

    def _read_tasks(self) -> None:
        for _ in range(_QUEUE):
            message = self._tasks.pop()
            if message is None:
                return
            # Another program may publish a malformed document there.
            with suppress(InputError):
                log = TASK_LOG.read(message.data)
                for watch in self.drive_watches if log.epoch == self.epoch else ():
                    watch.add_tasks(log.entries)

    def _read_clock(self) -> None:
        message = self._clock.latest()
        if message is not None:
            stamp_ns = from_time(message.clock)
            if self.game is None or stamp_ns >= self.game.scheduler.clock_offset_ns:
                self._stamp_ns = stamp_ns
