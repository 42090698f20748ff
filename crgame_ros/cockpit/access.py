# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who may talk to the server: the token, the Host header and the Origin header."""

from dataclasses import dataclass, replace
import errno
import hmac
import ipaddress
import secrets
import socket
import ssl
from urllib.parse import urlsplit

from crgame_ros.cockpit.invitations import Invitations, UNKNOWN
from crgame_ros.cockpit.machine_addresses import reachable_addresses
from crgame_ros.cockpit.rights import ALL_RIGHTS, Rights
from crgame_ros.errors import InputError

TOKEN_BYTES = 24
WITH_TOKEN = 'Open the address with the token that the cockpit printed when it started.'
_LOOPBACK_NAMES = ('localhost', '127.0.0.1', '[::1]')


@dataclass(frozen=True)
class Access:
    """
    Where the server listens and what it asks of those who come.

    :param host: address or name to listen on.
    :param port: the port; `listen` may move to a later one.
    :param token: secret that everybody has to show; None lets everybody on this machine in.
    :param tls: None is plain HTTP.
    :param invitations: links by which alone people are let in; None for the token.
    :raises InputError: if there is no token where other machines can connect, or it is short.
    """

    host: str
    port: int
    token: str | None = None
    tls: ssl.SSLContext | None = None
    invitations: Invitations | None = None

    def __post_init__(self) -> None:
        """Refuse to be open to other machines without a token."""
        if self.token is None and self.invitations is None and not is_loopback(self.host):
            raise InputError('is open to other machines without a token', f'address {self.host}',
                             'make it with Access.guarded')
        if self.token is not None and len(self.token) < 16:
            raise InputError('has fewer than 16 characters', 'token', 'make it at random')

    @classmethod
    def guarded(cls, host: str, port: int) -> 'Access':
        """Ask nothing of this machine, and a new random token where others can connect."""
        return cls(host, port, None if is_loopback(host) else new_token())

    @property
    def refusal(self) -> str:
        """Return to somebody without a cookie what to do."""
        return WITH_TOKEN if self.invitations is None else UNKNOWN

    def at_port(self, port: int) -> 'Access':
        """Return the same at another port."""
        return replace(self, port=port)

    @property
    def asks(self) -> bool:
        """Whether anything is asked of those who come."""
        return self.token is not None or self.invitations is not None

    @property
    def urls(self) -> list[str]:
        """Return the addresses to open in a browser, with the token."""
        query = f'?token={self.token}' if self.token is not None else ''
        return [self._address(host) + query for host in reachable_addresses(self.host)]

    @property
    def url(self) -> str:
        """Return the first of these addresses."""
        return self.urls[0]

    def link(self, token: str) -> str:
        """Return the address with a token that lets one browser in."""
        return f'{self._address(reachable_addresses(self.host)[0])}?token={token}'

    def _address(self, host: str) -> str:
        name = f'[{host}]' if ':' in host else host
        return f'{"http" if self.tls is None else "https"}://{name}:{self.port}/'

    def allows_host(self, host: str, port: int) -> bool:
        """
        Return whether a Host header names this server.

        A page of another site whose name was made to point here (DNS rebinding) sends that name.

        :param host: the header.
        :param port: at which the request arrived.
        """
        if self.asks:
            # Whoever knows the token was told the address: it may be any name of this machine.
            return bool(host)
        name, _, given = host.lower().rpartition(':') if _has_port(host) else (
            host.lower(), '', '80')
        listened = f'[{self.host}]' if ':' in self.host else self.host.lower()
        return given == str(port) and name in (*_LOOPBACK_NAMES, listened)

    def rights(self, cookie: str | None) -> Rights | None:
        """
        Return what a browser may do.

        :param cookie: that it shows.
        :return: None if it is not let in.
        """
        if self.invitations is not None:
            return self.invitations.rights(cookie)
        return ALL_RIGHTS if self.knows(cookie) else None

    def exchange(self, token: str, cookie: str | None) -> str:
        """
        Exchange the token of an address for a cookie.

        :param cookie: that the browser shows.
        :raises InputError: with a sentence for people, if it is not let in.
        """
        if self.invitations is not None:
            return self.invitations.exchange(token, cookie)
        if self.token is None or not self.knows(token):
            raise InputError(WITH_TOKEN)
        return self.token

    def knows(self, token: str | None) -> bool:
        """Return whether a token is the right one, in a time that does not depend on it."""
        if self.token is None:
            return True
        given = (token or '').encode('utf-8', 'surrogatepass')
        return hmac.compare_digest(given, self.token.encode())


def is_own_origin(origin: str | None, host: str) -> bool:
    """
    Return whether a request comes from a page of this server, or from no page at all.

    :param origin: the Origin header; None if there is none: a program, no browser.
    :param host: the Host header.
    """
    if origin is None:
        return True
    try:
        parts = urlsplit(origin)
    except ValueError:
        return False
    return (parts.scheme in ('http', 'https') and parts.netloc.lower() == host.lower()
            and origin == f'{parts.scheme}://{parts.netloc}')


def is_loopback(host: str) -> bool:
    """Return whether only this machine can connect to an address."""
    if host == 'localhost':
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def check_address(host: str, port: int) -> None:
    """
    Find out whether this machine can listen there, before anything is started.

    :param port: it may be taken: the next free one will do.
    :raises InputError: if the address is not this machine's or the port is not for everybody.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise InputError(f'cannot listen ({error.strerror})', f'{host}:{port}',
                             'choose another address or port') from error
    except ValueError as error:
        raise InputError('is no address', host[:80], 'give one of this machine') from error


def new_token() -> str:
    """Make a random token."""
    return secrets.token_urlsafe(TOKEN_BYTES)


def _has_port(host: str) -> bool:
    return ':' in host.rpartition(']')[2]
