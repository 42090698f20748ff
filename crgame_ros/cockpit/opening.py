# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the cockpit is opened: to this machine, to others with a token, or by links over TLS."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
import socket
import ssl

from crgame_ros.cockpit.access import Access, is_loopback, new_token
from crgame_ros.cockpit.certificate import fingerprint, make_certificate, tls_context
from crgame_ros.cockpit.invitations import Invitations
from crgame_ros.cockpit.machine_addresses import reachable_addresses


@dataclass(frozen=True)
class Opening:
    """
    What the command line says of who may come.

    :param host: address to listen on.
    :param port: the first to try.
    :param token: whether a token is asked for on this machine too.
    :param links: whether people are let in by links alone, one browser each, over TLS.
    :param certificate: PEM file; None makes one where there are links, and is plain HTTP else.
    :param key: of the certificate.
    :param private: folder that only its owner can read, where there are links.
    """

    host: str
    port: int
    token: bool = False
    links: bool = False
    certificate: Path | None = None
    key: Path | None = None
    private: Path | None = None

    def access(self) -> Access:
        """
        Make what the server asks of those who come.

        :raises CrgameError: if a certificate cannot be made or used.
        """
        pair = self._certificate()
        tls = None if pair is None else tls_context(*pair)
        if self.links and self.private is not None:
            return Access(self.host, self.port, tls=tls,
                          invitations=Invitations(self.private / 'links.json'))
        asks = self.token or not is_loopback(self.host)
        return Access(self.host, self.port, new_token() if asks else None, tls)

    def lines(self, access: Access, seats: Sequence[str]) -> list[str]:
        """
        Return where the page is, and make the first links.

        :param access: with the port at which the server listens.
        :param seats: for each a link is made for its driver.
        """
        first, *others = access.urls
        lines = [f'the cockpit is at {first}']
        if others:
            lines.append(f'also at {" and ".join(others)}')
        links = access.invitations
        if links is not None and links.is_new:
            lines.append('each link lets one browser in; a director can make more in the page:')
            for words, role, seat in (('to direct', 'direct', ''),
                                      *((f'to drive {seat}', 'drive', seat) for seat in seats),
                                      ('to watch', 'watch', '')):
                lines.append(f'  {words:<14} {access.link(links.make(role, seat))}')
        elif links is not None:
            lines.append('the links are those that were printed before')
        pair = self._certificate()
        if pair is not None:
            made = '' if self.certificate is not None \
                else ', made for this run: browsers warn of it, compare before going on'
            lines.append(f'its certificate (SHA-256{made}): {fingerprint(pair[0])}')
        return lines

    def _certificate(self) -> tuple[Path, Path] | None:
        if self.certificate is not None and self.key is not None:
            return self.certificate, self.key
        if not self.links or self.private is None:
            return None
        names = [*reachable_addresses(self.host), 'localhost', '127.0.0.1', socket.gethostname()]
        return make_certificate(self.private, list(dict.fromkeys(names)))


def check_certificate(certificate: Path | None, key: Path | None) -> ssl.SSLContext | None:
    """
    Find out whether a certificate can be used, before anything is started.

    :raises InputError: if it cannot.
    """
    return None if certificate is None or key is None else tls_context(certificate, key)
