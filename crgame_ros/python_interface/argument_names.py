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
"""Refusals of what a command line would have said, in the words of Python's arguments."""

from collections.abc import Iterator
import contextlib

from crgame_ros.errors import InputError

_NAMES = {'--planner': 'planner', '--driver': 'driver', '--problem': 'problems',
          '--rate': 'rate_hz', '--duration': 'duration_s'}


@contextlib.contextmanager
def argument_names() -> Iterator[None]:
    """Name the argument, not the option."""
    try:
        yield
    except InputError as error:
        if error.where not in _NAMES:
            raise
        raise InputError(error.what, _NAMES[error.where], error.remedy) from error
