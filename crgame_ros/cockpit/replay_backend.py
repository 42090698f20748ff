# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recording behind the page: its description, and its frames in chunks."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
import json
from pathlib import Path
from threading import Event
from typing import Literal, TYPE_CHECKING, TypeVar

from aiohttp import web
from crgame_ros.analysis.criticality.criticality import Criticality
from crgame_ros.analysis.criticality.recorded import measure_log
from crgame_ros.analysis.criticality.rows import criticality_rows, CRITICALITY_TOPIC
from crgame_ros.cockpit.message_frames import MessageFrames
from crgame_ros.cockpit.page_messages import Command
from crgame_ros.cockpit.replay_chunks import ChunkBuilder
from crgame_ros.cockpit.replay_index import index_run, pack, RunIndex
from crgame_ros.cockpit.replay_tracks import Mark
from crgame_ros.cockpit.scene import scene_document
from crgame_ros.cockpit.shown_paths import without_paths
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.recording.epochs import Epoch, epoch_numbers, read_epoch
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_folder import recording_in
from crgame_ros.recording.run_trajectories import read_trajectories
from crgame_ros.scenario.loading import parse_scenario

if TYPE_CHECKING:
    from crgame_ros.cockpit.client import Client
    from crgame_ros.cockpit.hub import Hub

T = TypeVar('T')
Progress = Callable[[float], None]


def recorded_criticality(reader: BagReader, run: Epoch) -> bytes | None:
    """Return the recorded frames, each after its length in bytes; None if there are none."""
    if CRITICALITY_TOPIC not in reader.topics:
        return None
    frames, found = MessageFrames(run.game, run.descriptions), []
    for message in reader.readable([CRITICALITY_TOPIC]):
        try:
            frame = frames.criticality(message.message)
        except (InputError, IndexError, OverflowError):
            # Any node may have published on the topic.
            continue
        if frame is not None:
            found.append(frame.data)
    return pack(found) if found else None


def measured_criticality(run: Epoch, path: Path, go_on: Progress) -> bytes:
    """
    Measure a run and return its frames, each after its length in bytes.

    A run of minutes takes seconds.

    :param go_on: called over and over with the share that is done; what it raises ends the work.
    :raises InputError: if the run cannot be measured.
    """
    frames = MessageFrames(run.game, run.descriptions)
    found: list[bytes] = []

    def add_step(criticality: Criticality) -> None:
        rows = criticality_rows(criticality, run.game.epoch, criticality.n)
        if (frame := frames.criticality_of(rows)) is not None:
            found.append(frame.data)

    measure_log(read_trajectories(path, run.game.epoch, go_on), progress=go_on, on_tick=add_step)
    return pack(found)


# Each holds 5 s: enough for two people who view different parts.
CHUNKS_KEPT = 8
RUNS_KEPT = 2
# Between two lines about the progress of reading [s].
PATIENCE_S = 2.0
_MOST_DIGITS = 9


class Replay:
    """
    One run of a recording; not to be used by two threads at once.

    :param progress: called with the share of the recording that has been read, 0 to 1.
    :ivar chunk: `ChunkBuilder.build`, from memory for the chunks that were requested last.
    :raises InputError: if the recording lacks the description of the run or its states.
    """

    def __init__(self, reader: BagReader, epoch: int, progress: Progress | None) -> None:
        self._reader = reader
        self.index: RunIndex = index_run(reader, read_epoch(reader, epoch), progress)
        self.builder = ChunkBuilder(reader, self.index)
        self.chunk = lru_cache(CHUNKS_KEPT)(self.builder.build)
        run = self.index.run
        loaded = parse_scenario(run.xml_text, f'{reader.path}, /scenario/xml')
        self.scene = scene_document(loaded, run.descriptions, run.game)

    def criticality(self) -> tuple[Epoch, bytes | None]:
        """Return the run and its recorded CRITICALITY frames; None if none were recorded."""
        return self.index.run, recorded_criticality(self._reader, self.index.run)

    def info(self) -> dict[str, object]:
        """Return the description of the run: its times, its marks and its documents over time."""
        scheduler = self.index.run.game.scheduler
        first, last = self.index.first_n, self.index.last_n
        dt_s = scheduler.dt_s
        return {
            'epoch': self.index.run.game.epoch,
            'start_s': first * dt_s, 'end_s': last * dt_s, 'duration_s': (last - first) * dt_s,
            'first_n': first, 'last_n': last, 'k0': scheduler.k0, 'dt_s': dt_s,
            'steps_per_tick': scheduler.steps_per_tick,
            'chunk_s': self.builder.chunk_s, 'chunks': self.builder.count,
            'real_time_factor': self.index.run.game.real_time_factor,
            'events': [_event(mark, dt_s, self.index) for mark in self.index.tracks.marks],
            'documents': {kind: [[n * dt_s, content] for n, content in track]
                          for kind, track in self.index.tracks.documents.items()},
            'notices': list(self._reader.notices), 'scene': self.scene}


def _event(mark: Mark, dt_s: float, index: RunIndex) -> dict[str, object]:
    # The state of a violation can be missing at the end; it is then shown at the nearest step.
    n = min(max(mark.n, index.first_n), index.last_n)
    return {'t': n * dt_s, 'until_t': min(max(mark.last_n, n), index.last_n) * dt_s, 'n': n,
            'k': index.run.game.scheduler.k(n), 'kind': mark.kind, 'subject': mark.subject,
            'text': mark.text, 'count': mark.count}


class ReplayBackend:
    """
    A backend that shows a recording. One thread beside the server's reads it.

    :param path: a recording (as for `BagReader`), or the folder of a run that holds it in `bag`.
    :param epoch: the run that is shown first, None for the last of the recording.
    :param progress: called with the share of the recording that has been read, 0 to 1.
    :raises InputError: if it is not a recording, or lacks the run's description or states.
    """

    mode: Literal['live', 'replay'] = 'replay'

    def __init__(self, path: Path, epoch: int | None = None,
                 progress: Progress | None = None) -> None:
        self.path = recording_in(path)
        # SQLite and the chunks in memory are used in one thread only.
        self._thread = ThreadPoolExecutor(1, 'replay')
        self._closed = Event()
        self._measuring = asyncio.Lock()
        self._measured: dict[int, bytes] = {}
        try:
            self._reader, self.epochs = self._thread.submit(self._open).result()
            self.epoch = self.epochs[-1] if epoch is None else epoch
            self._run = lru_cache(RUNS_KEPT)(lambda epoch: Replay(self._reader, epoch, progress))
            self._thread.submit(self._run, self.epoch).result()
        except BaseException:
            self._thread.shutdown()
            raise

    @property
    def notices(self) -> tuple[str, ...]:
        """Return the faults of a recording that can nevertheless be shown."""
        return self._reader.notices

    def close(self) -> None:
        """Close the recording after the current read; a measurement ends at once."""
        self._closed.set()
        self._thread.submit(self._reader.close)
        self._thread.shutdown()

    def go_on(self, _: float) -> None:
        """
        Let a measurement go on.

        :raises CrgameError: once the recording is closed.
        """
        if self._closed.is_set():
            raise CrgameError('the replay has ended')

    def _open(self) -> tuple[BagReader, tuple[int, ...]]:
        reader = BagReader(self.path, parts=True)
        return reader, epoch_numbers(reader)

    def info(self, epoch: int | None = None) -> dict[str, object]:
        """
        Return the description of a run; wait until it has been read.

        :param epoch: epoch of the run, None for the one that is shown first.
        :raises InputError: if it is not in the recording or cannot be read.
        """
        return self._thread.submit(self._info, self._chosen(epoch)).result()

    def chunk(self, number: int, epoch: int | None = None) -> bytes:
        """
        Return frames, each after its length in bytes; wait until they have been read.

        :param number: number of the chunk, from 0.
        :raises InputError: if there is no such chunk or epoch, or the recording is damaged there.
        """
        return self._thread.submit(self._chunk, self._chosen(epoch), number).result()

    def outline(self, epoch: int | None = None) -> bytes:
        """Return thinned-out STATE frames of the whole run, each after its length in bytes."""
        return self._thread.submit(self._outline, self._chosen(epoch)).result()

    def _chosen(self, epoch: int | None) -> int:
        return self.epoch if epoch is None else epoch

    def _info(self, epoch: int) -> dict[str, object]:
        return {**self._run(epoch).info(), 'epochs': list(self.epochs),
                'recording': self.path.name}

    def _chunk(self, epoch: int, number: int) -> bytes:
        return self._run(epoch).chunk(number)

    def _outline(self, epoch: int) -> bytes:
        return self._run(epoch).index.outline.encoded()

    def _criticality(self, epoch: int) -> tuple[Epoch, bytes | None]:
        return self._run(epoch).criticality()

    def routes(self) -> list[web.RouteDef]:
        """Return the routes of the server besides the page."""
        return [web.get('/api/replay/info', self._answer_info),
                web.get('/api/replay/chunk', self._answer_chunk),
                web.get('/api/replay/outline', self._answer_outline),
                web.get('/api/replay/criticality', self._answer_criticality)]

    async def _answer_info(self, request: web.Request) -> web.Response:
        content = await self._read(self._info, self._asked_epoch(request))
        # A compressed string: an hour's documents are some megabytes of repetitions.
        text = without_paths(json.dumps(content, separators=(',', ':')))
        response = web.Response(text=text, content_type='application/json')
        response.enable_compression()
        return response

    async def _answer_chunk(self, request: web.Request) -> web.Response:
        epoch = self._asked_epoch(request)
        number = _whole_number(request.query.get('i'))
        if number is None:
            raise _missing('there is no such chunk')
        return web.Response(body=await self._read(self._chunk, epoch, number),
                            content_type='application/octet-stream')

    async def _answer_outline(self, request: web.Request) -> web.Response:
        data = await self._read(self._outline, self._asked_epoch(request))
        return web.Response(body=data, content_type='application/octet-stream')

    async def _answer_criticality(self, request: web.Request) -> web.Response:
        epoch = self._asked_epoch(request)
        async with self._measuring:
            if epoch not in self._measured:
                run, data = await self._read(self._criticality, epoch)
                if data is None:
                    # Not in the reading thread, or nothing would be shown meanwhile.
                    data = await self._read(measured_criticality, run, self.path, self.go_on,
                                            thread=None)
                self._measured[epoch] = data
        return web.Response(body=self._measured[epoch], content_type='application/octet-stream')

    async def _read(self, what: Callable[..., T], *arguments: object,
                    thread: ThreadPoolExecutor | None | Literal['own'] = 'own') -> T:
        try:
            return await asyncio.get_running_loop().run_in_executor(
                self._thread if thread == 'own' else thread, what, *arguments)
        except CrgameError as error:
            raise _missing(str(error)) from error

    def _asked_epoch(self, request: web.Request) -> int:
        if 'epoch' not in request.query:
            return self.epoch
        epoch = _whole_number(request.query['epoch'])
        if epoch is None or epoch not in self.epochs:
            raise _missing('there is no such epoch')
        return epoch

    async def start(self, hub: 'Hub') -> None:
        """Set the scene; the page requests everything else when it needs it."""
        loop = asyncio.get_running_loop()
        replay = await loop.run_in_executor(self._thread, self._run, self.epoch)
        hub.set_document('scene', replay.scene)

    async def stop(self) -> None:
        """Close the recording."""
        self.close()

    async def command(self, client: 'Client', message: Command) -> str:
        """Raise CrgameError: a recording cannot be controlled."""
        raise CrgameError('This is a recording: nothing in it can be changed.')

    def joined(self, client: 'Client') -> None:
        """Do nothing: each page has its own playback time."""

    def left(self, client: 'Client') -> None:
        """Do nothing."""

    async def load_game(self, path: Path, client: 'Client | None' = None, *,
                        takes_seat: bool = False) -> str:
        """Raise CrgameError: no simulation runs."""
        raise CrgameError('This is a recording: start ./run.sh without --replay to play a game.')


def _whole_number(text: str | None) -> int | None:
    if text is None or not (text.isascii() and text.isdigit() and len(text) <= _MOST_DIGITS):
        return None
    return int(text)


def _missing(text: str) -> web.HTTPNotFound:
    return web.HTTPNotFound(text=json.dumps({'error': without_paths(text)}),
                            content_type='application/json')


def open_replay(path: Path, say: Callable[[str], None],
                clock_s: Callable[[], float]) -> ReplayBackend:
    """
    Open a recording, and print the progress if it takes long.

    :param say: prints a line.
    :param clock_s: steady clock [s].
    :raises InputError: like `ReplayBackend`.
    """
    told_s = clock_s()

    def show_progress(share: float) -> None:
        nonlocal told_s
        if clock_s() - told_s > PATIENCE_S:
            told_s = clock_s()
            say(f'reading {path}: {share:.0%}')

    return ReplayBackend(path, progress=show_progress)
