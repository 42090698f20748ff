# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The HTTP interface of the library: list, preview, upload, delete, load."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
import json
import logging
from typing import Any

from aiohttp import web
from crgame_ros.cockpit.backend import Backend
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.library import Choice, Library
from crgame_ros.cockpit.request_guard import actor
from crgame_ros.cockpit.shown_paths import without_paths
from crgame_ros.errors import CrgameError, InputError

MAX_VEHICLES = 1000
MAX_TEXT = 1000
MAX_OPTIONS = 100
UPLOAD_S = 60.0

_log = logging.getLogger(__name__)
Answer = Callable[[web.Request], Awaitable[web.StreamResponse]]


def add_routes(app: web.Application, library: Library | None, backend: Backend,
               hub: Hub) -> None:
    """
    Add the routes /api/scenarios, preview, planner, upload, upload/delete and load.

    :param library: None answers that there is nothing to choose.
    """
    if library is None:
        for method, path in (('GET', 'scenarios'), ('GET', 'preview'), ('GET', 'planner'),
                             ('POST', 'upload'), ('POST', 'upload/delete'), ('POST', 'load')):
            app.router.add_route(method, f'/api/{path}', _nothing)
        return
    routes = _Routes(library, backend, hub)
    app.router.add_get('/api/scenarios', guarded(routes.scenarios, hub, 'load'))
    app.router.add_get('/api/preview', guarded(routes.preview, hub, 'load'))
    app.router.add_get('/api/planner', guarded(routes.planner, hub, 'load'))
    app.router.add_post('/api/upload', guarded(routes.upload, hub, 'load'))
    app.router.add_post('/api/upload/delete', guarded(routes.delete, hub, 'load'))
    app.router.add_post('/api/load', refusable(routes.load))

    async def closing(_: web.Application) -> AsyncIterator[None]:
        yield
        await library.close()

    app.cleanup_ctx.append(closing)


class _Routes:

    def __init__(self, library: Library, backend: Backend, hub: Hub) -> None:
        self._hub = hub
        self._library = library
        self._backend = backend
        # At most two bodies in memory: this one and the one that is being checked.
        self._receiving = asyncio.Semaphore(2)

    async def scenarios(self, _: web.Request) -> web.Response:
        return web.json_response(await self._library.listing())

    async def preview(self, request: web.Request) -> web.Response:
        return _shown(await self._library.preview(request.query.get('id', '')[:MAX_TEXT],
                                                  asker_gone(request)))

    async def planner(self, request: web.Request) -> web.Response:
        return _shown(await self._library.planner_options(
            request.query.get('name', '')[:MAX_TEXT]))

    async def upload(self, request: web.Request) -> web.Response:
        async with self._receiving:
            data = await _body(request, self._library.max_upload_bytes)
            title = request.query.get('name', '')[:MAX_TEXT]
            return web.json_response({'id': await self._library.upload(data, title)})

    async def delete(self, request: web.Request) -> web.Response:
        text = await self._library.delete_upload(asked_id(await request.read()))
        return web.json_response({'ok': True, 'text': text})

    async def load(self, request: web.Request) -> web.Response:
        client = actor(request, self._hub, 'load')
        choice = _choice(await request.read())
        path = await self._library.write_game(choice)
        text = await self._backend.load_game(
            path, client, takes_seat=self._library.is_upload(choice.id))
        self._library.note_loaded(choice.id)
        return web.json_response({'ok': True, 'text': without_paths(text)})


def refusable(handler: Answer) -> Answer:
    """Wrap a handler so that a failure answers with one line of JSON."""
    async def answer(request: web.Request) -> web.StreamResponse:
        try:
            return await handler(request)
        except CrgameError as error:
            return web.json_response({'error': without_paths(str(error))}, status=400)
        except web.HTTPRequestEntityTooLarge:
            return web.json_response({'error': 'that is too much'}, status=413)
        except TimeoutError:
            return web.json_response({'error': 'the upload takes too long'}, status=408)
        except (ConnectionError, web.HTTPException):
            raise
        except Exception:
            _log.exception('%s', request.path)
            return web.json_response(
                {'error': 'it failed; the log of the server says why'}, status=500)
    return answer


def guarded(handler: Answer, hub: Hub, kind: str) -> Answer:
    """Wrap a handler like `refusable`; it answers only who may do what `kind` names in `actor`."""
    async def answer(request: web.Request) -> web.StreamResponse:
        actor(request, hub, kind)
        return await handler(request)
    return refusable(answer)


def asker_gone(request: web.Request) -> Callable[[], bool]:
    """Return a function that returns True once the client has gone."""
    def gone() -> bool:
        return request.transport is None or request.transport.is_closing()
    return gone


def asked_id(body: bytes) -> str:
    """
    Return the `id` that a request names.

    :raises InputError: if it names none.
    """
    return _text(_object(body).get('id'))


def _shown(content: bytes) -> web.Response:
    return web.Response(text=without_paths(content.decode()), content_type='application/json')


async def _nothing(_: web.Request) -> web.Response:
    return web.json_response({'error': 'there is nothing to choose here'}, status=404)


async def _body(request: web.Request, limit: int) -> bytes:
    if (request.content_length or 0) > limit:
        raise web.HTTPRequestEntityTooLarge(limit, request.content_length or 0)
    data = bytearray()
    async with asyncio.timeout(UPLOAD_S):
        async for chunk in request.content.iter_any():
            data += chunk
            if len(data) > limit:
                raise web.HTTPRequestEntityTooLarge(limit, len(data))
    return bytes(data)


def _object(body: bytes) -> dict[str, Any]:
    try:
        content = json.loads(body)
    except (ValueError, RecursionError) as error:
        raise InputError('is no JSON', 'choice', 'load the page again') from error
    if not isinstance(content, dict):
        raise InputError('is no JSON object', 'choice', 'load the page again')
    return content


def _choice(body: bytes) -> Choice:
    content = _object(body)
    return Choice(_text(content.get('id')), _by_vehicle(content.get('humans', []), 'driver'),
                  _by_vehicle(content.get('avs', []), 'planner'),
                  {entry['id']: _options(entry['options']) for entry in content.get('avs', [])
                   if 'options' in entry})


def _by_vehicle(entries: object, what: str) -> dict[str, str]:
    if not isinstance(entries, list) or len(entries) > MAX_VEHICLES:
        raise InputError('is no list of vehicles', 'choice', 'load the page again')
    if not all(isinstance(entry, dict) for entry in entries):
        raise InputError('holds something other than vehicles', 'choice', 'load the page again')
    return {_text(entry.get('id')): _text(entry.get(what)) for entry in entries}


def _options(value: object) -> dict[str, str]:
    if not isinstance(value, dict) or len(value) > MAX_OPTIONS:
        raise InputError('holds something other than options', 'choice', 'load the page again')
    return {_text(key): _text(given) for key, given in value.items()}


def _text(value: object) -> str:
    if not isinstance(value, str) or len(value) > MAX_TEXT:
        raise InputError('misses a text', 'choice', 'load the page again')
    return value
