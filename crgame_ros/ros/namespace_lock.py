# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Namespaces of a ROS domain: reads their names, and locks one for one simulation."""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
import fcntl
import os
from pathlib import Path
import re

from crgame_ros.errors import InputError, refusing

# Where every shell of a user looks, whatever its TMPDIR is, and where a full disk is no hindrance.
FOLDER = Path('/tmp')


def read_namespace(text: str) -> str:
    """
    Return a namespace from the command line, with its slash.

    :raises argparse.ArgumentTypeError: if it is none.
    """
    if text != '/' and not re.fullmatch(
            r'/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*', text):
        raise argparse.ArgumentTypeError(
            f'{text} is no namespace: letters, digits and _ between /')
    return '/' + text.removeprefix('/')


@contextmanager
def hold_namespace(domain: str, namespace: str) -> Iterator[None]:
    """
    Hold a namespace while a graph runs in it; the kernel releases it with the process.

    :param domain: ROS_DOMAIN_ID.
    :raises InputError: if another graph of this user holds it.
    """
    name = f'crgame-{os.getuid()}-{domain}{namespace.rstrip("/").replace("/", ".")}.lock'
    path = FOLDER / name
    with refusing('cannot be opened', path, 'remove it'):
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise InputError(
                f'another simulation runs in namespace {namespace} of ROS_DOMAIN_ID {domain}', '',
                'end it, or give this one a --namespace or another ROS_DOMAIN_ID') from error
        yield
    finally:
        os.close(descriptor)
