# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
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
