# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Links that let one browser in each, and what those who came by them may do."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
import hashlib
import json
import os
from pathlib import Path
import secrets

from crgame_ros.cockpit.rights import Rights
from crgame_ros.errors import CrgameError, InputError

TOKEN_BYTES = 24
MAX_LINKS = 200
USED = 'This link has been used: it lets one browser in. Ask a director for another one.'
UNKNOWN = 'Open a link that the cockpit printed when it started, or that a director gave you.'


@dataclass
class _Link:
    """A link: the digest of its token, and of the cookie that it was exchanged for."""

    token: str
    role: str
    seat: str
    cookie: str = ''


class Invitations:
    """
    The links of one cockpit. Only digests are kept, also in the file.

    :param path: file that a cockpit which is started again reads; made here, for its owner alone.
    :raises InputError: if there is a file that is no list of links.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._links: list[_Link] = []
        self.is_new = not path.exists()
        if not self.is_new:
            try:
                self._links = [_Link(**entry) for entry in json.loads(path.read_text('utf-8'))]
            except (OSError, ValueError, TypeError) as error:
                raise InputError('is no list of links', str(path), 'remove it') from error

    def make(self, role: str, seat: str = '') -> str:
        """
        Make a link.

        :param role: direct, drive, watch or all.
        :param seat: the only one that its driver may take; empty for any.
        :return: its token.
        :raises CrgameError: if there are too many, or they cannot be kept.
        """
        if len(self._links) >= MAX_LINKS:
            raise CrgameError(f'{MAX_LINKS} links have been made: start the cockpit again')
        token = secrets.token_urlsafe(TOKEN_BYTES)
        self._links.append(_Link(_digest(token), role, seat))
        self._write()
        return token

    def exchange(self, token: str, cookie: str | None) -> str:
        """
        Exchange a token for a cookie.

        :param cookie: that the browser has already: its own link may be opened again.
        :return: the cookie.
        :raises InputError: with a sentence for people, if there is no such link or it was used.
        """
        link = _find(self._links, 'token', token)
        if link is None:
            raise InputError(UNKNOWN)
        if link.cookie:
            if cookie is None or not secrets.compare_digest(link.cookie, _digest(cookie)):
                raise InputError(USED)
            return cookie
        cookie = secrets.token_urlsafe(TOKEN_BYTES)
        link.cookie = _digest(cookie)
        self._write()
        return cookie

    def rights(self, cookie: str | None) -> Rights | None:
        """Return what the browser with a cookie may do; None if it came by no link."""
        link = _find(self._links, 'cookie', cookie) if cookie else None
        return None if link is None else Rights.for_role(link.role, link.seat)

    def _write(self) -> None:
        part = self._path.with_suffix('.new')
        try:
            part.unlink(missing_ok=True)
            file = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(file, 'w', encoding='utf-8') as stream:
                json.dump([asdict(link) for link in self._links], stream)
            part.replace(self._path)
        except OSError as error:
            raise CrgameError(f'{self._path}: cannot be written ({error.strerror})') from error


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode('utf-8', 'surrogatepass')).hexdigest()


def _find(links: Sequence[_Link], field: str, secret: str) -> _Link | None:
    # The digests are compared: how long that takes tells nothing of the secret.
    digest = _digest(secret)
    return next((link for link in links if getattr(link, field) == digest), None)
