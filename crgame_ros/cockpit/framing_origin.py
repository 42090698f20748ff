# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The origin of the one other page that may frame the cockpit."""

import ipaddress
import re

from crgame_ros.errors import InputError

_ORIGIN = re.compile(r'(https?)://([a-z0-9.-]{1,253}|\[[0-9a-f:.]{2,45}\])(?::([0-9]{1,5}))?')
_DEFAULT_PORTS = {'http': '80', 'https': '443'}


def read_origin(text: str) -> str:
    """
    Parse an origin, as browsers write it.

    It goes into a header unchanged, so only scheme, host and port may be in it.

    :param text: such as http://127.0.0.1:8070.
    :return: in lower case, without the default port of the scheme.
    :raises InputError: if it is anything else, such as an address with a path or a wildcard.
    """
    match = _ORIGIN.fullmatch(text.strip().lower().removesuffix('/'))
    port = match[3] if match is not None else None
    if match is None or not _is_host(match[2]) or not (
            port is None or 1 <= int(port) <= 65535):
        raise InputError('is no origin', text[:80],
                         'give scheme, host and port alone, such as http://127.0.0.1:8070')
    if port is None or port == _DEFAULT_PORTS[match[1]]:
        return f'{match[1]}://{match[2]}'
    return f'{match[1]}://{match[2]}:{int(port)}'


def _is_host(host: str) -> bool:
    if not host.startswith('['):
        return all(label and not label.startswith('-') and not label.endswith('-')
                   for label in host.split('.'))
    try:
        return ipaddress.IPv6Address(host[1:-1]) is not None
    except ValueError:
        return False
