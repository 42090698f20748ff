# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Modes of exposing the cockpit: to this machine, to others with a token, by links over TLS."""

from collections.abc import Sequence
from dataclasses import dataclass
import hashlib
import ipaddress
from pathlib import Path
import shutil
import socket
import ssl
import subprocess

from crgame_ros.cockpit.access import Access, is_loopback, reachable_addresses
from crgame_ros.cockpit.rights import Invitations, new_token
from crgame_ros.errors import CrgameError, InputError

_DAYS = 30
_OPENSSL_S = 30.0
_GIVE = 'install openssl, or give a certificate with --certificate and --key'


def make_certificate(folder: Path, addresses: Sequence[str]) -> tuple[Path, Path]:
    """
    Create a self-signed certificate for this machine, unless the folder has one.

    :param folder: only its owner can read it.
    :param addresses: names and IP addresses under which the machine is reached.
    :return: the files of the certificate and of its key.
    :raises CrgameError: if there is no openssl, or it fails.
    """
    certificate, key = folder / 'certificate.pem', folder / 'key.pem'
    if certificate.exists() and key.exists():
        return certificate, key
    program = shutil.which('openssl')
    if program is None:
        raise CrgameError(f'no certificate can be made: {_GIVE}')
    names = ','.join(f'{"IP" if _is_ip(item) else "DNS"}:{item}' for item in addresses)
    command = [program, 'req', '-x509', '-newkey', 'ec', '-pkeyopt', 'ec_paramgen_curve:P-256',
               '-nodes', '-sha256', '-days', str(_DAYS), '-subj', '/CN=crgame cockpit',
               '-addext', f'subjectAltName={names}', '-keyout', str(key),
               '-out', str(certificate)]
    try:
        subprocess.run(command, check=True, capture_output=True, timeout=_OPENSSL_S)
        key.chmod(0o600)
    except (OSError, subprocess.SubprocessError) as error:
        said = getattr(error, 'stderr', b'') or b''
        line = (said.decode('utf-8', 'replace').strip().splitlines() or [str(error)])[-1]
        raise CrgameError(f'openssl makes no certificate ({line}): {_GIVE}') from error
    return certificate, key


def tls_context(certificate: Path, key: Path) -> ssl.SSLContext:
    """
    Return the TLS context of a server: version 1.2 or newer.

    :raises InputError: if the files are not a certificate and its key.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    for path in (certificate, key):
        if not path.is_file():
            raise InputError('there is no such file', str(path), 'name a PEM file')
    try:
        # A key with a passphrase would ask for it at the terminal.
        context.load_cert_chain(certificate, key, password=lambda: b'')
    except (OSError, ssl.SSLError) as error:
        reason = getattr(error, 'reason', None) or getattr(error, 'strerror', None) or error
        raise InputError(f'is no certificate with the key {key} ({reason})', str(certificate),
                         'give PEM files that belong together, the key without a passphrase'
                         ) from error
    return context


def fingerprint(certificate: Path) -> str:
    """
    Return the SHA-256 fingerprint as browsers show it.

    :raises InputError: if it is no PEM file.
    """
    text = certificate.read_text('ascii', 'replace')
    begin = text.find('-----BEGIN CERTIFICATE-----')
    end = text.find('-----END CERTIFICATE-----', begin)
    if begin < 0 or end < 0:
        raise InputError('is no certificate', str(certificate), 'give a PEM file')
    der = ssl.PEM_cert_to_DER_cert(text[begin:end] + '-----END CERTIFICATE-----\n')
    return hashlib.sha256(der).digest().hex(':').upper()


def _is_ip(text: str) -> bool:
    try:
        ipaddress.ip_address(text)
    except ValueError:
        return False
    return True


@dataclass(frozen=True)
class Exposure:
    """
    The access options of the command line.

    :param port: the first to try.
    :param token: whether clients of this machine need a token too.
    :param links: whether only links admit people, one browser each, over TLS.
    :param certificate: PEM file; None creates one if there are links, else means plain HTTP.
    :param private: folder that only its owner can read, used if there are links.
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
        Return the access control of the server.

        :raises CrgameError: if a certificate cannot be created or used.
        """
        pair = self.pair()
        tls = None if pair is None else tls_context(*pair)
        if self.links and self.private is not None:
            return Access(self.host, self.port, tls=tls,
                          invitations=Invitations(self.private / 'links.json'))
        asks = self.token or not is_loopback(self.host)
        return Access(self.host, self.port, new_token() if asks else None, tls)

    def lines(self, access: Access, seats: Sequence[str]) -> list[str]:
        """
        Return lines with the addresses of the page, and create the first links.

        :param access: access control with the port at which the server listens.
        :param seats: vehicles; each gets a link for its driver.
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
        return [*lines, *self.certificate_lines()]

    def certificate_lines(self) -> list[str]:
        """Return a line with the certificate's fingerprint; none without TLS."""
        pair = self.pair()
        if pair is None:
            return []
        made = '' if self.certificate is not None \
            else ', made for this run: browsers warn of it, compare before going on'
        return [f'its certificate (SHA-256{made}): {fingerprint(pair[0])}']

    def pair(self) -> tuple[Path, Path] | None:
        """
        Return the files of the certificate and of its key; None for plain HTTP.

        :raises CrgameError: if none is given and none can be created.
        """
        if self.certificate is not None and self.key is not None:
            return self.certificate, self.key
        if not self.links or self.private is None:
            return None
        names = [*reachable_addresses(self.host), 'localhost', '127.0.0.1', socket.gethostname()]
        return make_certificate(self.private, list(dict.fromkeys(names)))


def check_certificate(certificate: Path | None, key: Path | None) -> ssl.SSLContext | None:
    """
    Check that a certificate can be used, before anything is started.

    :raises InputError: if it cannot, or one of both is missing.
    """
    if (certificate is None) != (key is None):
        raise InputError('a certificate and its key belong together', '--certificate',
                         'give --certificate and --key')
    return None if certificate is None or key is None else tls_context(certificate, key)
