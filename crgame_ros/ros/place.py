# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""A namespace of a ROS domain, held by one simulation."""

from collections.abc import Iterator
from contextlib import contextmanager
import fcntl
import os
from pathlib import Path
import tempfile

from crgame_ros.errors import InputError


@contextmanager
def held(domain: str, namespace: str) -> Iterator[None]:
    """
    Hold a place while a graph runs there; the kernel lets go of it with the process.

    :param domain: ROS_DOMAIN_ID.
    :raises InputError: if another graph of this user holds it.
    """
    name = f'crgame-{os.getuid()}-{domain}{namespace.rstrip("/").replace("/", ".")}.lock'
    path = Path(tempfile.gettempdir()) / name
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    except OSError as error:
        raise InputError(f'cannot be opened ({error.strerror})', str(path),
                         'remove it') from error
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
