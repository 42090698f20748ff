# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The graph in which participants drive: its process, links to its cockpit, its node."""

from collections.abc import Sequence
from contextlib import suppress
import os
from pathlib import Path
import signal
import subprocess
import sys

from aiohttp import ClientError, ClientSession, ClientTimeout, CookieJar, Fingerprint
from crgame_ros.cockpit.exposure import fingerprint
from crgame_ros.cockpit.run_status import RunStatus
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.documents import EVENTS, GAME, GameDocument
from crgame_ros.game.task_documents import TASK_LOG
from crgame_ros.messages.cdr import stamp_of
from crgame_ros.messages.status_values import read_status
from crgame_ros.nodes.cockpit.orders import CockpitOrders
from crgame_ros.processes import PARENT_VARIABLE
from crgame_ros.ros.endpoints import Endpoints, PolledSubscription
from crgame_ros.ros.environment import free_domain_id
from crgame_ros.ros.messages import from_time, NS_PER_S
from crgame_ros.study.drive_watch import DriveWatch
from diagnostic_msgs.msg import DiagnosticStatus
import rclpy
from rclpy.context import Context

_AT, _DIRECT = 'the cockpit is at ', '  to direct '
# Time limit for finishing recordings [s].
_END_S = 90.0
_PATIENCE_S = 20.0
_QUEUE = 100


class StudyGraph:
    """
    A launcher with its nodes.

    :param game: its first game file; later ones may come from the same folder.
    :param folder: of its runs; created if missing.
    :param port: of its cockpit; the next free one if it is in use.
    :param more: further arguments of the launcher.
    :ivar domain_id: its `ROS_DOMAIN_ID`.
    :ivar cockpit: address of its cockpit; empty before it is known.
    :ivar director: link to direct it, if it is opened to other machines; else empty.
    """

    def __init__(self, game: Path, folder: Path, port: int, more: Sequence[str] = ()) -> None:
        self.folder = folder
        self.domain_id = free_domain_id()
        self._log = folder.with_suffix('.log')
        self._read = 0
        self._rest = b''
        self.cockpit = self.director = ''
        folder.parent.mkdir(parents=True, exist_ok=True)
        # It has links.
        self._log.touch(mode=0o600)
        with self._log.open('wb') as log:
            self._process = subprocess.Popen(
                [sys.executable, '-m', 'crgame_ros.launcher.main', str(game), '--out',
                 str(folder), '--port', str(port), '--no-report', '--start-paused', *more],
                stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                env={**os.environ, 'ROS_DOMAIN_ID': str(self.domain_id),
                     PARENT_VARIABLE: str(os.getpid())},
                # Ctrl-C goes to the study only, which ends its drive, then the graph.
                start_new_session=True)

    @property
    def pid(self) -> int:
        """Return the process id of the launcher."""
        return self._process.pid

    @property
    def has_ended(self) -> bool:
        """Return whether the launcher has ended, for any reason."""
        return self._process.poll() is not None

    @property
    def was_killed(self) -> bool:
        """Return whether a signal ended the launcher."""
        return (self._process.poll() or 0) < 0

    def poll(self) -> None:
        """Read the launcher's new output, which contains the cockpit's address."""
        with self._log.open('rb') as log:
            log.seek(self._read)
            content = self._rest + log.read()
            self._read = log.tell()
        *lines, self._rest = content.split(b'\n')
        for line in lines:
            text = line.decode('utf-8', 'replace')
            if _AT in text:
                self.cockpit = text.partition(_AT)[2].strip()
            elif _DIRECT in text:
                self.director = text.partition(_DIRECT)[2].strip()

    def last_words(self) -> str:
        """Return its last line about an error, or else its last line."""
        lines = [line for line in self._log.read_text('utf-8', 'replace').splitlines()
                 if line.strip()]
        errors = [line for line in lines if 'error' in line.lower() or ' died ' in line]
        return (errors or lines or ['it said nothing'])[-1].strip()[:300]

    def end(self) -> None:
        """Shut it down, and wait until its recordings are finished."""
        # To a process that has ended, no signal is sent.
        self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


async def make_links(director: str, certificate: Path, drivers: int) -> tuple[str, ...]:
    """
    Return a link to watch, and some to drive any seat, each for one browser.

    A game chosen later may have other seats than the one with which the cockpit began, so the
    links that it prints do not do.

    :param director: the link to direct, which is used up.
    :param certificate: of the cockpit.
    :param drivers: number of links to drive.
    :raises CrgameError: if the cockpit makes none.
    """
    trusted = Fingerprint(bytes.fromhex(fingerprint(certificate).replace(':', '')))
    page = director.partition('?')[0]
    links = []
    try:
        async with ClientSession(cookie_jar=CookieJar(unsafe=True), raise_for_status=True,
                                 timeout=ClientTimeout(total=_PATIENCE_S)) as http:
            async with http.get(director, ssl=trusted) as answer:
                await answer.read()
            for role in ('watch', *('drive',) * drivers):
                async with http.post(f'{page}api/invite', ssl=trusted, json={'role': role},
                                     headers={'X-Crgame': '1'}) as answer:
                    links.append(str((await answer.json())['link']))
    except (ClientError, TimeoutError, ValueError, KeyError) as error:
        raise CrgameError(f'the cockpit makes no links ({error})') from error
    return tuple(links)


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
            for message in slot.waiting(_QUEUE):
                stamp_ns = stamp_of(message)
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
        for message in self._tasks.waiting(_QUEUE):
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
