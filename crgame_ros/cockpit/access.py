# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Access to the server: token, Host and Origin header, and the addresses that lead to it."""

from dataclasses import dataclass, replace
import errno
import fcntl
import hmac
import ipaddress
from pathlib import Path
import socket
import ssl
import struct
from urllib.parse import urlsplit

from crgame_ros.cockpit.rights import ALL_RIGHTS, Invitations, new_token, Rights, UNKNOWN
from crgame_ros.errors import InputError

WITH_TOKEN = 'Open the address with the token that the cockpit printed when it started.'
_LOOPBACK_NAMES = ('localhost', '127.0.0.1', '[::1]')
# The request to Linux for the IPv4 address of an interface.
_SIOCGIFADDR = 0x8915
_IF_INET6 = Path('/proc/net/if_inet6')
_GLOBAL = '00'


@dataclass(frozen=True)
class Access:
    """
    The address at which the server listens, and what it demands of a client.

    :param host: address or name to listen on.
    :param port: the port; `listen` may move to a later one.
    :param token: secret that every client must present; None admits every client of this machine.
    :param tls: None is plain HTTP.
    :param invitations: links, the only way to be admitted; None if the token is used.
    :raises InputError: if other machines can connect and the token is missing or too short.
    """

    host: str
    port: int
    token: str | None = None
    tls: ssl.SSLContext | None = None
    invitations: Invitations | None = None

    def __post_init__(self) -> None:
        """Raise InputError if other machines could connect without a token."""
        if self.token is None and self.invitations is None and not is_loopback(self.host):
            raise InputError('is open to other machines without a token', f'address {self.host}',
                             'make it with Access.guarded')
        if self.token is not None and len(self.token) < 16:
            raise InputError('has fewer than 16 characters', 'token', 'make it at random')

    @classmethod
    def guarded(cls, host: str, port: int) -> 'Access':
        """Return access without a token on loopback, else with a new random token."""
        return cls(host, port, None if is_loopback(host) else new_token())

    @property
    def refusal(self) -> str:
        """Return the instruction for a browser without a cookie."""
        return WITH_TOKEN if self.invitations is None else UNKNOWN

    def at_port(self, port: int) -> 'Access':
        """Return a copy with another port."""
        return replace(self, port=port)

    @property
    def asks(self) -> bool:
        """Return whether a client must present a token or a link."""
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
        """Return the address with a token that admits one browser."""
        return f'{self._address(reachable_addresses(self.host)[0])}?token={token}'

    def _address(self, host: str) -> str:
        name = f'[{host}]' if ':' in host else host
        return f'{"http" if self.tls is None else "https"}://{name}:{self.port}/'

    def allows_host(self, host: str, port: int) -> bool:
        """
        Return whether a Host header names this server.

        After DNS rebinding, a page of another site sends the name of that site.

        :param host: the header.
        :param port: the port at which the request arrived.
        """
        if self.asks:
            # A client with the token was given the address, which may be any name of this machine.
            return bool(host)
        name, _, given = host.lower().rpartition(':') if _has_port(host) else (
            host.lower(), '', '80')
        listened = f'[{self.host}]' if ':' in self.host else self.host.lower()
        return given == str(port) and name in (*_LOOPBACK_NAMES, listened)

    def rights(self, cookie: str | None) -> Rights | None:
        """Return the rights of the browser with a cookie; None if it is not admitted."""
        if self.invitations is not None:
            return self.invitations.rights(cookie)
        return ALL_RIGHTS if self.token is None or _same(cookie, cookie_for(self.token)) else None

    def exchange(self, token: str, cookie: str | None) -> str:
        """
        Exchange the token of an address for a cookie.

        :param cookie: the cookie that the browser presents.
        :raises InputError: with a readable sentence, if the browser is not admitted.
        """
        if self.invitations is not None:
            return self.invitations.exchange(token, cookie)
        if self.token is None or not _same(token, self.token):
            raise InputError(WITH_TOKEN)
        return cookie_for(self.token)


def cookie_name(port: int, tls: bool, page: str = '') -> str:
    """
    Return the name of a server's cookie.

    Browsers send a cookie of 127.0.0.1 to every port of it, so each server has a name of its own.
    Over TLS no other site, and no page without TLS, can set it (RFC 6265bis, `__Host-`).

    :param page: which one, where a server has several.
    """
    return f'{"__Host-" if tls else ""}crgame-{f"{page}-" if page else ""}{port}'


def cookie_for(token: str) -> str:
    """
    Return the value that a browser has instead of a token.

    Other servers of this machine see it, and cannot learn the token from it.
    """
    return hmac.new(token.encode(), b'cookie', 'sha256').hexdigest()


def _same(given: str | None, right: str) -> bool:
    """Compare secrets in constant time."""
    return hmac.compare_digest((given or '').encode('utf-8', 'surrogatepass'), right.encode())


def is_own_origin(origin: str | None, host: str) -> bool:
    """
    Return whether a request comes from a page of this server or from a program.

    :param origin: the Origin header; None if there is none, as from a program.
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
    Check that this machine can listen at an address, before anything is started.

    :param port: may be taken; the server then uses the next free one.
    :raises InputError: if the address is not this machine's or the port is privileged.
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


def _has_port(host: str) -> bool:
    return ':' in host.rpartition(']')[2]


def reachable_addresses(host: str) -> tuple[str, ...]:
    """
    Return the addresses at which other machines reach a server that listens on one.

    :param host: an address, or `0.0.0.0` or `::` for all of this machine.
    :return: for all, those of the interfaces; loopback only if there is no other.
    """
    if host == '0.0.0.0':
        return _version_4() or ('127.0.0.1',)
    if host == '::':
        return (*_version_4(), *_version_6()) or ('::1',)
    return (host,)


def _version_4() -> tuple[str, ...]:
    found: dict[str, None] = {}
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        for _, name in socket.if_nameindex():
            request = struct.pack('256s', name.encode()[:15])
            try:
                answer = fcntl.ioctl(probe.fileno(), _SIOCGIFADDR, request)
            except OSError:
                # The interface has no such address.
                continue
            found[socket.inet_ntoa(answer[20:24])] = None
    return tuple(item for item in found if not ipaddress.ip_address(item).is_loopback)


def _version_6() -> tuple[str, ...]:
    try:
        rows = [line.split() for line in _IF_INET6.read_text().splitlines()]
    except OSError:
        return ()
    return tuple(str(ipaddress.IPv6Address(int(row[0], 16))) for row in rows
                 if len(row) == 6 and row[3] == _GLOBAL)
