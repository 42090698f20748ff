# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page at which a platform's participants arrive, and are led to their sessions."""

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from html import escape
import logging

from aiohttp import hdrs, web
from crgame_ros.cockpit.access import Access
from crgame_ros.cockpit.request_guard import (
    ACCESS,
    Doorkeeper,
    file_answer,
    guard,
    header_writer,
    KEEPER,
)
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.study.desk.pages import words_of
from crgame_ros.study.desk.server import read_desk_files
from crgame_ros.study.elsewhere import Elsewhere, PlatformIds
from crgame_ros.study.file import StudyFile

# After which the page of a full study asks again [s].
AGAIN_S = 30
_log = logging.getLogger(__name__)
_STYLES = ('/static/cockpit/cockpit.css', '/static/desk/desk.css')


@dataclass(frozen=True)
class Reception:
    """
    What becomes of a participant who arrives.

    :param link: to the session; empty without one.
    :param why: without a link: full, failed, or how the session ended: done, declined, excluded,
        ended.
    """

    link: str = ''
    why: str = ''


def create_reception_app(study: StudyFile, access: Access, ids: PlatformIds,
                         receive: Callable[[str], Awaitable[Reception]]) -> web.Application:
    """
    Build the server's application.

    :param study: with `elsewhere`.
    :param access: access control, with the token of the platform's address.
    :param ids: makes the participants' ids.
    :param receive: begins or finds the session of a participant's id.
    :raises CrgameError: if the pages are not installed.
    """
    keeper, files = Doorkeeper(), read_desk_files()
    elsewhere = study.elsewhere
    assert elsewhere is not None
    app = web.Application(middlewares=[guard(access, keeper)])
    app[KEEPER], app[ACCESS] = keeper, access
    app.on_response_prepare.append(header_writer(lambda path: path.startswith('/static/')))

    async def arrive(request: web.Request) -> web.Response:
        words = words_of(study, _language(request, study))
        try:
            given, = request.query.getall(elsewhere.id_from, [''])
            participant = ids.own_id(given)
        except (InputError, ValueError):
            return _page(study, words, Reception(why='bad'), elsewhere)
        try:
            reception = await receive(participant)
        except CrgameError as error:
            _log.error('%s: %s', participant, error)
            reception = Reception(why='failed')
        if reception.link:
            return web.Response(status=303, headers={hdrs.LOCATION: reception.link})
        return _page(study, words, reception, elsewhere)

    async def static(request: web.Request) -> web.Response:
        return file_answer(request, files.get(request.path) if request.path in _STYLES else None)

    app.router.add_get('/', arrive)
    app.router.add_get('/static/{name:.*}', static)
    return app


def _language(request: web.Request, study: StudyFile) -> str:
    """Return the first of the browser's languages that the study has, else the study's."""
    wanted = (part.partition(';')[0].strip().partition('-')[0].lower()
              for part in request.headers.get(hdrs.ACCEPT_LANGUAGE, '')[:200].split(','))
    return next((each for each in wanted if each in study.all_languages), study.language)


def _page(study: StudyFile, words: Mapping[str, str], reception: Reception,
          elsewhere: Elsewhere) -> web.Response:
    """Return a page of one sentence, and of the code if the session is over."""
    why = reception.why
    code, address = elsewhere.code_for(why), elsewhere.address_for(why)
    title = 'wait' if why == 'full' else 'not_here' if why in ('bad', 'failed') else 'thanks'
    text = words[f'arrive_{why}' if f'arrive_{why}' in words
                 else f'over_{why}_code' if code else f'over_{why}']
    lines = [f'<h2>{escape(words[title])}</h2>', f'<p class="lead">{escape(text)}</p>']
    if code:
        lines.append(f'<p class="code">{escape(words["code"].replace("{code}", code))}</p>')
    if address:
        lines.append(f'<p><a href="{escape(address)}">{escape(words["to_platform"])}</a></p>')
    again = f'<meta http-equiv="refresh" content="{AGAIN_S}">' if why == 'full' else ''
    styles = ''.join(f'<link rel="stylesheet" href="{path}">' for path in _STYLES)
    return web.Response(
        status=400 if why == 'bad' else 503 if why in ('full', 'failed') else 200,
        content_type='text/html', charset='utf-8', text=(
            f'<!DOCTYPE html><html><head><meta charset="utf-8">{again}'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f'<title>{escape(study.name)}</title>{styles}</head><body class="desk" '
            'data-show="over"><main id="sheet"><div class="message" role="status">'
            f'{"".join(lines)}</div></main></body></html>\n'))
