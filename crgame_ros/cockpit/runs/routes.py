# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The HTTP interface of past runs: list, pictures, scores, files, comparison, deletion, replay."""

import asyncio
from collections import OrderedDict
from collections.abc import AsyncIterator, Iterator, Mapping
from dataclasses import dataclass
import hashlib
import json
from pathlib import Path
from urllib.parse import quote
import zipfile

from aiohttp import ClientError, ClientSession, hdrs, web, WSMsgType
from crgame_ros.cockpit.access import cookie_for, cookie_name
from crgame_ros.cockpit.job_process import end_module, JobProcess, start_module
from crgame_ros.cockpit.library_routes import asked_id, asker_gone, guarded, MAX_TEXT
from crgame_ros.cockpit.rights import new_token
from crgame_ros.cockpit.runs.archive import PastRun, PICTURE, RunArchive
from crgame_ros.cockpit.server import HUB
from crgame_ros.errors import CrgameError, InputError

PROCESS = 'crgame_ros.cockpit.runs.replay_process'
MOST_REPLAYS = 3
BEGIN_S = 60.0
# The headers of an answer that the page needs; the server sets the others.
_PASSED = (hdrs.CONTENT_TYPE, hdrs.CONTENT_ENCODING)
_CHUNK_BYTES = 256 * 1024
READER = 'crgame_ros.cockpit.runs.jobs'
READ_S = 120.0
MOST_COMPARED = 6
SCORES_KEPT = 100
# A report has scripts and styles of its own: it may run them, isolated from the cockpit.
_REPORT = ("sandbox allow-scripts allow-downloads; default-src 'none'; "
           "script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:")
_PICTURE = "default-src 'none'; style-src 'unsafe-inline'; sandbox"


@dataclass(frozen=True)
class _Replay:
    process: asyncio.subprocess.Process
    port: int
    token: str

    @property
    def address(self) -> str:
        return f'http://127.0.0.1:{self.port}'

    @property
    def headers(self) -> dict[str, str]:
        return {hdrs.COOKIE: f'{cookie_name(self.port, tls=False)}={cookie_for(self.token)}'}


class RunReplays:
    """The processes of replays; the least recently used ends first."""

    def __init__(self) -> None:
        self._replays: OrderedDict[str, _Replay] = OrderedDict()
        self._starting = asyncio.Lock()
        self._http: ClientSession | None = None

    async def close(self) -> None:
        """End them all."""
        for key in list(self._replays):
            await self.end(key)
        if self._http is not None:
            await self._http.close()

    async def end(self, key: str) -> None:
        """End the replay of a run, if there is one."""
        replay = self._replays.get(key)
        if replay is not None:
            await end_module(replay.process)
            # Kept until then: whoever ends the server waits for it, too.
            if self._replays.get(key) is replay:
                del self._replays[key]

    async def forward(self, run: PastRun, rest: str, request: web.Request) -> web.StreamResponse:
        """
        Return the answer of the process that shows the run.

        :param rest: path below its address.
        :raises CrgameError: if the run cannot be shown.
        """
        replay = await self._replay(run)
        if self._http is None:
            self._http = ClientSession(auto_decompress=False)
        try:
            if rest == 'ws':
                return await _forward_socket(self._http, replay, request)
            async with self._http.get(f'{replay.address}/{rest}', params=request.query,
                                      headers=replay.headers) as answer:
                kept = {name: answer.headers[name] for name in _PASSED if name in answer.headers}
                return web.Response(status=answer.status, body=await answer.read(), headers=kept)
        except ClientError as error:
            await self.end(run.id)
            raise CrgameError('the replay has ended; load the page again') from error

    async def _replay(self, run: PastRun) -> _Replay:
        async with self._starting:
            found = self._replays.get(run.id)
            if found is None or found.process.returncode is not None:
                await self.end(run.id)
                while len(self._replays) >= MOST_REPLAYS:
                    await self.end(next(iter(self._replays)))
                found = self._replays[run.id] = await _start(run)
            self._replays.move_to_end(run.id)
            return found


async def _start(run: PastRun) -> _Replay:
    process = await start_module(PROCESS, str(run.bag), own_session=True)
    token = new_token()
    assert process.stdin is not None and process.stdout is not None
    try:
        process.stdin.write(f'{token}\n'.encode())
        async with asyncio.timeout(BEGIN_S):
            told = json.loads(await process.stdout.readline() or b'{}')
    except (TimeoutError, ConnectionError, ValueError) as error:
        await end_module(process)
        raise InputError('cannot be shown', run.name, 'the log of the server says why') from error
    if 'port' not in told:
        await end_module(process)
        raise InputError(str(told.get('error', 'cannot be shown')), run.name)
    return _Replay(process, int(told['port']), token)


async def _forward_socket(http: ClientSession, replay: _Replay,
                          request: web.Request) -> web.WebSocketResponse:
    page = web.WebSocketResponse(max_msg_size=64 * 1024)
    await page.prepare(request)
    async with http.ws_connect(f'{replay.address}/ws', headers=replay.headers,
                               max_msg_size=0) as shown:
        async def back() -> None:
            async for message in shown:
                if message.type is WSMsgType.TEXT:
                    await page.send_str(message.data)
                elif message.type is WSMsgType.BINARY:
                    await page.send_bytes(message.data)
            await page.close()

        answering = asyncio.create_task(back())
        try:
            async for message in page:
                if message.type is WSMsgType.TEXT:
                    await shown.send_str(message.data)
        finally:
            await shown.close()
            answering.cancel()
            await asyncio.gather(answering, return_exceptions=True)
    return page


class _Pending:
    """A buffer of written data that is not yet sent; it does not support seek."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []

    def write(self, data: bytes, /) -> int:
        self._parts.append(bytes(data))
        return len(data)

    def flush(self) -> None:
        """Do nothing: written data is available at once."""

    def close(self) -> None:
        """Do nothing: the sender knows the end."""

    def read(self) -> bytes:
        data = b''.join(self._parts)
        self._parts.clear()
        return data


def zip_chunks(name: str, files: Mapping[str, Path]) -> Iterator[bytes]:
    """
    Pack files into a ZIP archive.

    :param name: name of the folder in the archive.
    :param files: files by their names in that folder.
    :return: the archive in pieces; a file that has been deleted meanwhile is left out.
    """
    pending = _Pending()
    # Recordings are compressed already.
    with zipfile.ZipFile(pending, 'w', zipfile.ZIP_STORED) as archive:
        for inside, path in files.items():
            try:
                source = path.open('rb')
            except OSError:
                continue
            entry = zipfile.ZipInfo.from_file(path, f'{name}/{inside}', strict_timestamps=False)
            with source, archive.open(entry, 'w', force_zip64=True) as target:
                while data := source.read(_CHUNK_BYTES):
                    target.write(data)
                    yield pending.read()
    yield pending.read()


def add_run_routes(app: web.Application, archive: RunArchive, work: Path) -> None:
    """Add the routes below /api/runs and /replay/; comparisons are written to a folder."""
    routes, hub = RunRoutes(archive, work), app[HUB]
    for method, path, handler in (
            ('GET', '', routes.runs), ('GET', '/picture', routes.picture),
            ('GET', '/score', routes.score), ('GET', '/file', routes.file),
            ('GET', '/zip', routes.zip), ('GET', '/comparison', routes.comparison)):
        app.router.add_route(method, f'/api/runs{path}', guarded(handler, hub, 'runs'))
    app.router.add_post('/api/runs/delete', guarded(routes.delete, hub, 'delete'))
    app.router.add_get('/replay/{run}/{rest:.*}', guarded(routes.replay, hub, 'runs'))

    async def lifetime(_: web.Application) -> AsyncIterator[None]:
        warming = asyncio.create_task(routes.warm_up())
        yield
        warming.cancel()
        await asyncio.gather(warming, return_exceptions=True)
        await routes.close()

    app.cleanup_ctx.append(lifetime)


class RunRoutes:
    """The handlers of requests about runs; comparisons are written to a folder."""

    def __init__(self, archive: RunArchive, work: Path) -> None:
        self._archive = archive
        self._work = work.resolve()
        # Two processes: a score is needed at once, while pictures of a long list are drawn.
        self._scorer = JobProcess(READER, 'run', READ_S)
        self._painter = JobProcess(READER, 'run', READ_S)
        self._replays = RunReplays()
        self._scores: dict[str, bytes] = {}

    async def warm_up(self) -> None:
        """Start the scoring process early: clients wait for the score at the end of a run."""
        await self._scorer.start()

    async def close(self) -> None:
        """Stop the running processes."""
        await self._scorer.close()
        await self._painter.close()
        await self._replays.close()

    async def runs(self, _: web.Request) -> web.Response:
        """Return the list of the runs."""
        return web.json_response(await asyncio.to_thread(self._archive.listing))

    async def picture(self, request: web.Request) -> web.StreamResponse:
        """Return a picture of a run, which is drawn once."""
        run = await self._closed(_asked(request))
        path = run.folder / PICTURE
        if not path.is_file():
            await self._painter.run('picture', path=str(run.bag), out=str(path),
                                    unwanted=asker_gone(request))
        return web.FileResponse(path, headers={
            'Content-Security-Policy': _PICTURE, hdrs.CONTENT_TYPE: 'image/svg+xml'})

    async def score(self, request: web.Request) -> web.Response:
        """Return the scores of the driven vehicles in a run."""
        run = await self._closed(_asked(request))
        if run.id not in self._scores:
            answer = await self._scorer.run('score', path=str(run.bag),
                                            unwanted=asker_gone(request))
            if len(self._scores) >= SCORES_KEPT:
                self._scores.pop(next(iter(self._scores)))
            self._scores[run.id] = answer
        return web.Response(body=self._scores[run.id], content_type='application/json')

    async def file(self, request: web.Request) -> web.StreamResponse:
        """Send one file of a run; the report is shown, other files are downloaded."""
        run = await asyncio.to_thread(self._archive.run, _asked(request))
        name = request.query.get('file', '')[:MAX_TEXT]
        path = run.files().get(name)
        if path is None:
            raise InputError('there is no such file', 'file', 'load the page again')
        if path.suffix == '.html':
            return web.FileResponse(path, headers={'Content-Security-Policy': _REPORT})
        saved = f'{run.name}_{name}'.replace('/', '_')
        return web.FileResponse(path, headers={
            hdrs.CONTENT_TYPE: 'application/octet-stream',
            hdrs.CONTENT_DISPOSITION: _attachment(saved)})

    async def zip(self, request: web.Request) -> web.StreamResponse:  # noqa: A003
        """Send all files of a run as one archive."""
        run = await self._closed(_asked(request))
        name = run.name.replace('/', '_')
        response = web.StreamResponse(headers={
            hdrs.CONTENT_TYPE: 'application/zip',
            hdrs.CONTENT_DISPOSITION: _attachment(f'{name}.zip')})
        await response.prepare(request)
        chunks = zip_chunks(name, run.files())
        # Not in the event loop, which may carry a driver's inputs.
        while (chunk := await asyncio.to_thread(next, chunks, None)) is not None:
            if chunk:
                await response.write(chunk)
        await response.write_eof()
        return response

    async def comparison(self, request: web.Request) -> web.StreamResponse:
        """Write and return one report of several runs."""
        keys = request.query.get('ids', '')[:MAX_TEXT].split(',')
        if not 2 <= len(keys) <= MOST_COMPARED or len(set(keys)) != len(keys):
            raise InputError(f'choose 2 to {MOST_COMPARED} runs', 'comparison')
        runs = [await self._closed(key) for key in keys]
        name = hashlib.sha256(','.join(keys).encode()).hexdigest()[:16]
        path = self._work / 'comparisons' / f'{name}.html'
        if not path.is_file():
            path.parent.mkdir(parents=True, exist_ok=True)
            await self._painter.run(
                'compare', path=str(runs[0].bag), others=[str(run.bag) for run in runs[1:]],
                names=[run.name for run in runs], out=str(path), unwanted=asker_gone(request))
        return web.FileResponse(path, headers={'Content-Security-Policy': _REPORT})

    async def delete(self, request: web.Request) -> web.Response:
        """Delete a run."""
        key = asked_id(await request.read())
        await self._replays.end(key)
        text = await asyncio.to_thread(self._archive.delete, key)
        self._scores.pop(key, None)
        return web.json_response({'ok': True, 'text': text})

    async def replay(self, request: web.Request) -> web.StreamResponse:
        """Forward a request to the process that shows a run."""
        run = await self._closed(request.match_info['run'])
        return await self._replays.forward(run, request.match_info['rest'], request)

    async def _closed(self, key: str) -> PastRun:
        run = await asyncio.to_thread(self._archive.run, key)
        if not run.is_closed:
            raise InputError('is being recorded', run.name, 'wait until its run is over')
        return run


def _asked(request: web.Request) -> str:
    return request.query.get('id', '')[:MAX_TEXT]


def _attachment(name: str) -> str:
    return f"attachment; filename*=UTF-8''{quote(name, safe='')}"
