# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The certificate by which the cockpit is recognised: made by openssl, or given."""

from collections.abc import Sequence
import hashlib
import ipaddress
from pathlib import Path
import shutil
import ssl
import subprocess

from crgame_ros.errors import CrgameError, InputError

_DAYS = 30
_OPENSSL_S = 30.0
_GIVE = 'install openssl, or give a certificate with --certificate and --key'


def make_certificate(folder: Path, addresses: Sequence[str]) -> tuple[Path, Path]:
    """
    Make a self-signed certificate for this machine, unless the folder has one.

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
    Make what a server speaks TLS with: version 1.2 or newer.

    :raises InputError: if the files are no certificate and its key.
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
