# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live run for the cockpit: topics turned into documents and frames for the page."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
import time

from crgame_ros.analysis.criticality.rows import CRITICALITY_TOPIC
from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.message_frames import MessageFrames
from crgame_ros.cockpit.run_status import RunStatus
from crgame_ros.cockpit.runs.archive import files_document
from crgame_ros.cockpit.scene import scene_document
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.documents import EVENTS, GameDocument, SIGNALS
from crgame_ros.game.task_documents import TASK_STATE
from crgame_ros.messages.cdr import stamp_of
from crgame_ros.messages.status_values import read_status
from crgame_ros.ros.endpoints import Endpoints, PolledSubscription
from crgame_ros.ros.run_time import RunTime, TimeCourse
from crgame_ros.ros.scenario_documents import ScenarioDocuments, ScenarioSet
from crgame_ros.timing.cycle_rows import CycleTable
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

# Between two estimated poses; the page extrapolates from them [s].
LOOK_PERIOD_S = 1.0 / 30.0
# The sensors of an AV share a topic, and the newest scan of each is needed.
SCAN_DEPTH = 64


class AvFeed:
    """The plans, requests and perception of AVs, passed on to the pages that show them."""

    def __init__(self, endpoints: Endpoints, hub: Hub) -> None:
        self._endpoints = endpoints
        self._hub = hub
        self._slots: dict[tuple[str, str], PolledSubscription] = {}
        self._map = endpoints.polled('/occupancy')
        # The newest map, for the next epoch if it keeps the map, and the map's file.
        self._map_message: object | None = None
        self._map_path: object = None
        self._frames: MessageFrames | None = None
        self._avs: tuple[str, ...] = ()
        self._looked_s = 0.0

    def begin(self, game: GameDocument, frames: MessageFrames) -> None:
        """Show another scenario, game or epoch."""
        first = self._frames is None
        self._frames = frames
        self._avs = tuple(av.id for av in game.avs)
        wanted = [(name, av) for name in ('/<av>/plan', '/<av>/plan_request')
                  for av in self._avs]
        wanted += [(name, av) for name in ('/<av>/localization', '/<av>/scan')
                   for av in frames.mounts.avs]
        for key in self._slots.keys() - set(wanted):
            self._endpoints.release(self._slots.pop(key))
        for key in wanted:
            if key not in self._slots:
                depth = SCAN_DEPTH if key[0] == '/<av>/scan' else 1
                self._slots[key] = self._endpoints.polled(*key, depth=depth)
        path, before = game.occupancy, self._map_path
        self._map_path = path
        if not first and path != before:
            self._map_message = None

    def show_map(self) -> None:
        """Send the map again, because a new scene invalidates all frames."""
        if self._map_message is not None and self._map_path is not None:
            self._send_map(self._map_message)

    def poll_plans(self, frames_skipped: bool) -> None:
        """
        Pass on plans, and those requests that a page shows.

        :raises CrgameError: or another of `UNREADABLE`, if a message cannot be read.
        """
        frames, clients = self._frames, self._hub.clients.values()
        if frames is None or frames_skipped:
            return
        predictions = any(client.wants_predictions for client in clients)
        perceiving = {client.perceives_as for client in clients}
        for av in self._avs:
            plan = self._slots['/<av>/plan', av].latest()
            if plan is not None and (place := frames.place_of(plan)) is not None:
                self._hub.send_frame(*frames.plan(place, av, plan))
            if predictions or av in perceiving:
                request = self._slots['/<av>/plan_request', av].latest()
                if request is not None:
                    self._send_request(frames, request, av, predictions)

    def poll_perception(self, frames_skipped: bool) -> None:
        """
        Pass on the map, and those estimates and scans that a page shows.

        :raises CrgameError: or another of `UNREADABLE`, if a message cannot be read.
        """
        message = self._map.latest()
        if message is not None:
            self._map_message = message
            self._send_map(message)
        now_s = time.monotonic()
        frames = self._frames
        if frames_skipped or frames is None or now_s - self._looked_s < LOOK_PERIOD_S:
            return
        self._looked_s = now_s
        clients = self._hub.clients.values()
        perceiving = {client.perceives_as for client in clients}
        scanning = {client.perceives_as for client in clients if client.wants_scans}
        for av in frames.mounts.avs:
            if av in perceiving:
                self._send_estimate(frames, av)
            if av in scanning:
                self._send_scans(frames, av)

    def _send_estimate(self, frames: MessageFrames, av: str) -> None:
        message = self._slots['/<av>/localization', av].latest()
        place = None if message is None else frames.place_of(message)
        if place is not None:
            self._hub.send_frame(*frames.estimate(place, av, message), only_if=_perceives_as(av))

    def _send_scans(self, frames: MessageFrames, av: str) -> None:
        slot = self._slots['/<av>/scan', av]
        newest = {message.header.frame_id: message for message in slot.waiting()}
        for message in newest.values():
            place = frames.place_of(message)
            scan = None if place is None else frames.scan(place, av, message)
            if scan is not None:
                self._hub.send_frame(*scan, only_if=_perceives_as(av, scans=True))

    def _send_map(self, message: object) -> None:
        if self._frames is not None:
            self._hub.send_frame(*self._frames.occupancy(self._frames.place(0), message))

    def _send_request(self, frames: MessageFrames, message: JointTrajectory, av: str,
                      predictions: bool) -> None:
        place = frames.place_of(message)
        if place is None:
            return
        seen = frames.seen(place, av, message)
        if seen is not None:
            self._hub.send_frame(*seen, only_if=_perceives_as(av))
        if predictions:
            self._hub.send_frame(*frames.prediction(place, av, message),
                                 only_if=lambda client: client.wants_predictions)


def _perceives_as(av: str, scans: bool = False) -> Callable[[Client], bool]:
    return lambda client: client.perceives_as == av and (client.wants_scans or not scans)


STATUS_PERIOD_S = 0.2
# Period of state frames for a client that watches; a client that drives gets every frame [s].
WATCHER_PERIOD_S = 1.0 / 30.0
SKIPPING_PERIOD_S = 0.1
# sim_node publishes its state every second; after this much silence it counts as gone [s].
SILENCE_S = 3.0
QUEUE = 100
# Topics whose delay people do not notice are polled at this longer period [s].
SLOW_PERIOD_S = 0.02
# The errors of a message from anyone, including those of huge numbers.
UNREADABLE = (AttributeError, CrgameError, IndexError, KeyError, OverflowError, TypeError,
              ValueError)


class CockpitFeed:
    """
    The live run as the page shows it, read from the graph without an executor.

    :param runs: folder of the session's files; None where none are kept.
    """

    def __init__(self, endpoints: Endpoints, hub: Hub, runs: Path | None = None) -> None:
        self._endpoints = endpoints
        self._hub = hub
        self._runs = runs
        self.status = RunStatus()
        self._documents = ScenarioDocuments(endpoints)
        self._avs = AvFeed(endpoints, hub)
        # For these topics the newest message is enough.
        self._states = endpoints.polled('/vehicles/state', depth=1)
        self._objects = endpoints.polled('/traffic/objects', depth=1)
        self._cycles = endpoints.polled('/timing/cycle', depth=1)
        self._criticality = endpoints.polled(CRITICALITY_TOPIC, depth=QUEUE)
        self._signals = endpoints.polled('/scenario/signals')
        self._fired = endpoints.polled('/scenario/events')
        self._tasks = endpoints.polled(TASK_STATE.topic)
        self._frame_skip = endpoints.polled('/timing/frame_skip')
        self._diagnostics = endpoints.polled('/diagnostics', depth=QUEUE)
        self._verdicts: dict[str, PolledSubscription] = {}
        self.scenario: ScenarioSet | None = None
        self.frames_skipped = False
        self._vehicle_ids: list[str] = []
        self._frames: MessageFrames | None = None
        self._commands: NDArray[np.float64] | None = None
        self.n = 0
        self._time = RunTime()
        # Number of times that time has run back; each time pages discard what they have shown.
        self._again = 0
        self._run_heard_s = 0.0
        self._slow_s = 0.0
        self._status_s = 0.0
        self._told = ('', 0)
        self._pace: tuple[float, int] = (0.0, 0)
        self._measured_factor: float | None = None
        # Of the last run whose files pages know to be complete.
        self._filed_epoch: int | None = None

    @property
    def t(self) -> float:
        """Time of the run [s]."""
        return 0.0 if self.scenario is None else self.n * self.scenario.game.scheduler.dt_s

    def poll(self) -> list[str]:
        """
        Read the messages that have come, and pass them on.

        :return: problems, one line each
        """
        problems: list[str] = []
        now_s = time.monotonic()
        if now_s - self._slow_s >= SLOW_PERIOD_S:
            self._slow_s = now_s
            for work in (self._poll_documents, self._poll_plans, self._poll_perception,
                         self._poll_texts, self._poll_criticality, self._poll_diagnostics):
                _read(work, problems)
        for work in (self._poll_commands, self.poll_states, self._poll_tasks, self._poll_objects):
            _read(work, problems)
        # The page freezes its picture in a pause and plays a sound at a collision, so it must
        # learn of both at once.
        urgent = (self.status.run, self.status.verdicts)
        if now_s - self._status_s >= STATUS_PERIOD_S or urgent != self._told:
            self._status_s = now_s
            self._told = urgent
            self._send_status(now_s)
        return problems

    def pace(self, client: Client) -> None:
        """Set the period of a client's state frames."""
        client.state_period_s = SKIPPING_PERIOD_S if self.frames_skipped else (
            0.0 if client.drives else WATCHER_PERIOD_S)

    def _poll_documents(self) -> None:
        scenario = self._documents.poll()
        if scenario is not None:
            self._begin(scenario)
        order = self._frame_skip.latest()
        if order is not None:
            self.frames_skipped = bool(order.data)

    def _begin(self, scenario: ScenarioSet) -> None:
        """Show another scenario, game or epoch."""
        game = scenario.game
        scene = scene_document(scenario.loaded, scenario.objects, game)
        self._frames = MessageFrames(game, scenario.objects)
        self._avs.begin(game, self._frames)
        self.scenario = scenario
        self._vehicle_ids = [item.id for item in scenario.driven]
        self._commands = None
        self.n = 0
        self._time = RunTime()
        self._run_heard_s = time.monotonic()
        self.status.begin(self._vehicle_ids)
        for vehicle in self._verdicts.keys() - set(self._vehicle_ids):
            self._endpoints.release(self._verdicts.pop(vehicle))
        for vehicle in self._vehicle_ids:
            if vehicle not in self._verdicts:
                self._verdicts[vehicle] = self._endpoints.polled('/<v>/drivability', vehicle)
        self._hub.set_document('scene', {**scene, 'again': self._again})
        self._hub.set_document('events', {'fired': []})
        self._hub.set_document('tasks', {'running': [], 'open': []})
        self._avs.show_map()

    def _poll_plans(self) -> None:
        self._avs.poll_plans(self.frames_skipped)

    def _poll_perception(self) -> None:
        self._avs.poll_perception(self.frames_skipped)

    def _poll_commands(self) -> None:
        """Keep the commands that the vehicles executed in the last cycle."""
        cycle: Float64MultiArray | None = self._cycles.latest()
        if cycle is None or self.scenario is None:
            return
        table = CycleTable.from_message(cycle.layout.dim[1].label, cycle.data)
        # A table of the game before or after this one is ignored.
        if table.is_of(self.scenario.game.epoch):
            self._commands = table.commands_of(self._vehicle_ids)[-1]

    def poll_states(self) -> None:
        """Pass on the newest states, if there are any."""
        message: JointTrajectory | None = self._states.latest()
        frames = self._frames
        if message is None or frames is None or (place := frames.place_of(message)) is None:
            return
        course = self._time.follow(stamp_of(message))
        if course is TimeCourse.BACK and self.scenario is not None:
            # A recording is played again.
            self._again += 1
            self._begin(self.scenario)
        elif course is TimeCourse.BEHIND:
            return
        # States of the game before or after this one are skipped.
        with suppress(InputError):
            states = frames.states(message)
            self.n = place.n
            self._endpoints.diagnostics.now_ns = stamp_of(message)
            self._hub.send_frame(*frames.state(place, states, self._commands))

    def _poll_objects(self) -> None:
        message: JointTrajectory | None = self._objects.latest()
        frames = self._frames
        if message is None or frames is None or (place := frames.place_of(message)) is None:
            return
        with suppress(InputError):
            self._hub.send_frame(*frames.objects(place, message))

    def _poll_tasks(self) -> None:
        message = None if self.scenario is None else self._tasks.latest()
        if message is None or self.scenario is None:
            return
        state = TASK_STATE.read(message.data)
        if state.epoch == self.scenario.game.epoch:
            self._hub.set_document('tasks', {
                'running': state.running, 'open': [asdict(prompt) for prompt in state.open]})

    def _poll_criticality(self) -> None:
        for message in self._criticality.waiting():
            if self._frames is not None \
                    and (frame := self._frames.criticality(message)) is not None:
                self._hub.send_frame(*frame)

    def _poll_texts(self) -> None:
        if self.scenario is None:
            return
        signals, fired = self._signals.latest(), self._fired.latest()
        if fired is not None:
            events = EVENTS.read(fired.data)
            if events.epoch == self.scenario.game.epoch:
                self._hub.set_document(
                    'events', {'fired': [asdict(event) for event in events.fired]})
                self.status.add_events(events.fired, self.scenario.game.scheduler.dt_s)
        if signals is not None:
            self._hub.set_document('signals', asdict(SIGNALS.read(signals.data)))

    def _poll_diagnostics(self) -> None:
        for slot in (self._diagnostics, *self._verdicts.values()):
            # The rest of a flood waits for the next call.
            for message in slot.waiting(QUEUE):
                stamp_ns = stamp_of(message)
                for status in message.status:
                    self._add_status(status, stamp_ns)

    def _add_status(self, status: DiagnosticStatus, stamp_ns: int) -> None:
        # Other nodes report before they have received any time.
        timeless = stamp_ns == 0 and not (
            status.name.startswith('sim_node: ') or status.name.endswith('/drivability'))
        if self.scenario is not None and not timeless \
                and stamp_ns < self.scenario.game.scheduler.clock_offset_ns:
            # From the previous run.
            return
        self.status.add(read_status(status), self.t)
        if status.name == 'sim_node: run':
            self._run_heard_s = time.monotonic()

    def _send_status(self, now_s: float) -> None:
        if self.scenario is None:
            return
        if now_s - self._run_heard_s > SILENCE_S:
            self.status.lose()
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
        if self.status.run == 'ended' and self._runs is not None \
                and self._filed_epoch != game.epoch:
            files = files_document(self._runs, game.epoch)
            self._hub.set_document('files', files)
            if files['complete']:
                self._filed_epoch = game.epoch
        self._hub.set_document('alarms', self.status.alarms_document())


def _read(work: Callable[[], None], problems: list[str]) -> None:
    """Read one kind of message; one that cannot be read does not block the others."""
    try:
        work()
    except UNREADABLE as error:
        problems.append(f'{work.__name__.strip("_").removeprefix("poll_")}: {error}')
