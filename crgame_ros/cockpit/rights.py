# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rights of a person at a page: direct, drive or watch; and links that grant them."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
import hashlib
import json
import os
from pathlib import Path
import secrets

from crgame_ros.errors import CrgameError, InputError

# The roles that a page, a link or the address may request.
ROLES = ('direct', 'drive', 'watch', 'all')
_DIRECTS = ('control', 'rate', 'planner', 'trigger')
_DRIVES = ('input', 'claim', 'release', 'ask', 'hand_over', 'answer', 'ready', 'device',
           'task', 'picture')
_DEEDS = {'start': 'start the run', 'pause': 'pause the run', 'step': 'step through the run',
          'reset': 'reset the run', 'stop': 'stop the run', 'rate': 'change the speed of time',
          'planner': 'stop a planner or let it go on', 'trigger': 'trigger events',
          'load': 'choose what is run', 'invite': 'make links', 'delete': 'delete runs'}
TOKEN_BYTES = 24
MAX_LINKS = 200
USED = 'This link has been used: it lets one browser in. Ask whoever gave it to you for another.'
UNKNOWN = 'Open a link that was printed at the start, or that somebody gave you.'


@dataclass(frozen=True)
class Rights:
    """
    The rights of one person.

    :param directs: controls the experiment: run control, scenarios, planners, events, links.
    :param drives: may take a seat.
    :param seat: the only seat that may be taken without being offered; empty for any.
    """

    directs: bool = True
    drives: bool = True
    seat: str = ''

    @classmethod
    def for_role(cls, role: str, seat: str = '') -> 'Rights':
        """Return the rights of a role: direct, drive, watch or all."""
        return cls(role in ('direct', 'all'), role in ('drive', 'all'), seat)

    @property
    def role(self) -> str:
        """Return the role in words."""
        words = [word for has, word in ((self.directs, 'director'), (self.drives, 'driver'))
                 if has]
        return ' and '.join(words) or 'spectator'

    def narrowed(self, role: str) -> 'Rights':
        """Return the rights of a role, limited to these rights."""
        wanted = Rights.for_role(role)
        return replace(self, directs=self.directs and wanted.directs,
                       drives=self.drives and wanted.drives)

    def refusal(self, kind: str, action: str = '') -> str:
        """
        Return why an action is refused; empty if it is allowed.

        :param kind: kind of a message, or load, invite, runs or delete.
        :param action: action of the run control.
        """
        deed = _DEEDS.get(action or kind, '')
        if kind == 'control' and action == 'start' and (self.directs or self.drives):
            # A driver starts to report ready; the handler of the order refuses any other start.
            return ''
        if kind == 'runs' and not (self.directs or self.drives):
            return f'only a driver or a director can look at past runs; you are a {self.role}'
        if kind in (*_DIRECTS, 'load', 'invite', 'delete') and not self.directs:
            return f'only a director can {deed}; you are a {self.role}'
        if kind in _DRIVES and not self.drives:
            return f'only a driver can take a seat; you are a {self.role}'
        return ''


ALL_RIGHTS = Rights()


@dataclass(frozen=True)
class _Link:
    """A link: the digests of its token and of the cookie that replaced the token."""

    token: str
    role: str
    seat: str
    cookie: str = ''


class Invitations:
    """
    The links of one cockpit. Only digests are kept, in memory and in the file.

    :param path: file that a restarted cockpit reads; created readable for its owner only.
    :raises InputError: if the file is not a list of links.
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
        Create a link.

        :param role: direct, drive, watch or all.
        :param seat: the only seat that its driver may take; empty for any.
        :return: its token.
        :raises CrgameError: if there are too many, or they cannot be saved.
        """
        if len(self._links) >= MAX_LINKS:
            raise CrgameError(f'{MAX_LINKS} links have been made: start the cockpit again')
        token = new_token()
        self._save([*self._links, _Link(_digest(token), role, seat)])
        return token

    def exchange(self, token: str, cookie: str | None) -> str:
        """
        Exchange a token for a cookie.

        :param cookie: the browser's cookie, if any: a browser may open its own link again.
        :raises InputError: with a readable sentence, if there is no such link or it was used.
        :raises CrgameError: if that cannot be saved; the link then stays unused.
        """
        link = _find(self._links, 'token', token)
        if link is None:
            raise InputError(UNKNOWN)
        if link.cookie:
            if cookie is None or not secrets.compare_digest(link.cookie, _digest(cookie)):
                raise InputError(USED)
            return cookie
        cookie = new_token()
        used = replace(link, cookie=_digest(cookie))
        self._save([used if each is link else each for each in self._links])
        return cookie

    def rights(self, cookie: str | None) -> Rights | None:
        """Return the rights of the browser with a cookie; None if it used no link."""
        link = _find(self._links, 'cookie', cookie) if cookie else None
        return None if link is None else Rights.for_role(link.role, link.seat)

    def _save(self, links: list[_Link]) -> None:
        """Write the links to the file, then use them."""
        part = self._path.with_suffix('.new')
        try:
            part.unlink(missing_ok=True)
            file = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(file, 'w', encoding='utf-8') as stream:
                json.dump([asdict(link) for link in links], stream)
            part.replace(self._path)
        except OSError as error:
            raise CrgameError(f'{self._path}: cannot be written ({error.strerror})') from error
        self._links = links


def new_token() -> str:
    """Return a new random token."""
    return secrets.token_urlsafe(TOKEN_BYTES)


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode('utf-8', 'surrogatepass')).hexdigest()


def _find(links: Sequence[_Link], field: str, secret: str) -> _Link | None:
    # Digests are compared, so the time that it takes reveals nothing of the secret.
    digest = _digest(secret)
    return next((link for link in links if getattr(link, field) == digest), None)
