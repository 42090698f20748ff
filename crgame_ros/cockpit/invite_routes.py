# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`POST /api/invite`: a director makes another link that lets one browser in."""

import json

from aiohttp import web
from crgame_ros.cockpit.access import Access
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.request_rights import actor
from crgame_ros.cockpit.rights import ROLES
from crgame_ros.errors import CrgameError
from crgame_ros.game.driven_vehicle import VEHICLE_ID


def add_routes(app: web.Application, access: Access, hub: Hub) -> None:
    """
    Add the route.

    :param access: whose links they are; it may have none.
    :param hub: knows the page that asks.
    """
    async def invite(request: web.Request) -> web.Response:
        try:
            actor(request, hub, 'invite')
            return web.json_response({'link': _link(access, request, await request.read())})
        except CrgameError as error:
            return web.json_response({'error': str(error)}, status=400)

    app.router.add_post('/api/invite', invite)


def _link(access: Access, request: web.Request, body: bytes) -> str:
    if access.invitations is None:
        raise CrgameError('links are made where the cockpit was started with --open-cockpit')
    try:
        content = json.loads(body)
        role, seat = content['role'], content.get('seat', '')
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise CrgameError('name a role') from error
    if role not in ROLES or not isinstance(seat, str) \
            or (seat and not VEHICLE_ID.fullmatch(seat)):
        raise CrgameError('there is no such role or seat')
    port = request.get_extra_info('sockname')[1]
    return access.at_port(port).link(access.invitations.make(role, seat))
