# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The state of a participant's present or next drive."""

from dataclasses import dataclass
from enum import StrEnum

from crgame_ros.study.quality import Excess


class DrivePhase(StrEnum):
    """The phase of a drive."""

    # No drive is due.
    NONE = 'none'
    # The graph is starting, or the game is loading.
    PREPARING = 'preparing'
    # The participant has to confirm that they are ready.
    READY = 'ready'
    COUNTDOWN = 'countdown'
    DRIVING = 'driving'
    # It is over, and its end is being recorded.
    ENDED = 'ended'
    # The experimenter has to fix a problem.
    FAILED = 'failed'


class DriveWork(StrEnum):
    """Present work on a drive, or why there is none."""

    NONE = ''
    LOADING = 'loading'
    # The data of the last drive do not hold.
    AGAIN = 'again'
    STOPPED = 'stopped'
    RESTARTING = 'restarting'
    NO_START = 'no_start'


@dataclass(frozen=True)
class DriveState:
    """
    A drive at one moment.

    :param phase: its phase.
    :param item: id of the session's item that is driven; empty without one.
    :param attempt: at it, from 1 on; 0 before the first cycle.
    :param link: address of the cockpit's page for the participant; empty if not available.
    :param watch: address of a page that shows the drive; empty if not available.
    :param time_s: the run's clock [s]; None before the first cycle.
    :param work: for the experimenter: the present work.
    :param text: for the experimenter: the failure, in the words of the program that failed.
    :param doubts: what of the drive's data is beyond a bound of the study so far.
    :param confederate: address of the cockpit's page for the experimenter who drives too; empty if
        they do not.
    :param awaits_others: whether the participant is ready, and others are not.
    """

    phase: DrivePhase = DrivePhase.NONE
    item: str = ''
    attempt: int = 0
    link: str = ''
    watch: str = ''
    time_s: float | None = None
    work: DriveWork = DriveWork.NONE
    text: str = ''
    doubts: tuple[Excess, ...] = ()
    confederate: str = ''
    awaits_others: bool = False
