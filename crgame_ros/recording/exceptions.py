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
"""What can go wrong while a recording is written."""

from pathlib import Path

from crgame_ros.errors import CrgameError, InputError


class RecordingError(CrgameError):
    """
    The operating system refused to store a recording.

    :param path: the file that could not be written.
    :param reason: what the operating system said.
    :param remedy: what the user can do about it.
    """

    def __init__(self, path: Path, reason: str, remedy: str) -> None:
        self.path = path
        self.reason = reason
        super().__init__(f'{path}: {reason}; {remedy}')


class RunTooShortError(InputError):
    """A run that ended before its second scenario step: there is nothing to make of it."""
