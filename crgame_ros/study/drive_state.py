# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is known of the drive that a participant is in, or about to begin."""

from dataclasses import dataclass
from enum import StrEnum


class DrivePhase(StrEnum):
    """How far a drive has come."""

    # Nothing is to be driven now.
    NONE = 'none'
    # The graph is started, or the game is loaded.
    PREPARING = 'preparing'
    # The participant has to say that they are ready.
    READY = 'ready'
    COUNTDOWN = 'countdown'
    DRIVING = 'driving'
    # It is over, and its end is being recorded.
    ENDED = 'ended'
    # The experimenter has to mend something.
    FAILED = 'failed'


@dataclass(frozen=True)
class DriveState:
    """
    A drive at one moment.

    :param phase: how far it has come.
    :param item: id of the session's item that is driven; empty where there is none.
    :param attempt: at it, from 1 on; 0 before the first cycle.
    :param link: address of the cockpit's page for the participant; empty while there is none.
    :param time_s: the run's clock [s]; None before the first cycle.
    :param text: for the experimenter: what is going on, or what failed.
    """

    phase: DrivePhase = DrivePhase.NONE
    item: str = ''
    attempt: int = 0
    link: str = ''
    time_s: float | None = None
    text: str = ''
