# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Errors of recordings and of runs too short to use."""

from pathlib import Path

from crgame_ros.errors import CrgameError, InputError


class RecordingError(CrgameError):
    """
    A refusal of the operating system to store a recording.

    :param path: the file that could not be written.
    :param reason: the operating system's message.
    :param remedy: the action for the user.
    """

    def __init__(self, path: Path, reason: str, remedy: str) -> None:
        self.path = path
        self.reason = reason
        super().__init__(f'{path}: {reason}; {remedy}')


class RunTooShortError(InputError):
    """A run that ended before its second scenario step, too short for any output."""
