# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Watches a drive: its state, link, pictures, focus, device, unseen stimuli, timing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
import statistics

from crgame_ros.game.task_documents import TaskEntry
from crgame_ros.messages.status_values import Status, status_amount, status_truth
from crgame_ros.study.quality import Excess
from crgame_ros.timing.measures import in_seconds

# Statuses come every second, and at each change; one that fails to come tells nothing [s].
_LONGEST_S = 1.5
# Keys of statuses with values of table I.
_TIMES = ('max_cumulative_error_ms', 'timeout_ratio', 'real_time_ratio_final', 'resets')


class DriveWatch:
    """
    Collects the values of `quality.PAGE`, and of table I, while a drive goes on.

    :param seat: of the participant.
    """

    def __init__(self, seat: str) -> None:
        self._seat = seat
        self._name = f'cockpit_node: {seat} view'
        self._link_name = f'cockpit_node: {seat} driver'
        self._links_s: list[float] = []
        self._rates_hz: list[float] = []
        self._before: tuple[float, bool, bool] | None = None
        self._away_s = self._windowed_s = 0.0
        self._devices: list[str] = []
        self._open: dict[tuple[str, int], bool] = {}
        self._timing: dict[str, float] = {}
        self.stimuli = self.unseen = 0

    def add(self, status: Status, time_s: float) -> None:
        """
        Process a status of the cockpit; ignore all others.

        :param time_s: of the run's clock [s]
        """
        values = status.values
        if status.name == self._link_name and time_s > 0.0:
            delay_ms = status_amount(values, 'round_trip_ms')
            if delay_ms is not None:
                self._links_s.append(1e-3 * delay_ms)
        if status.name != self._name or not values.get('shown') or time_s <= 0.0:
            return
        # Another program may send such a status: what is no number is left out.
        rate_hz = status_amount(values, 'rate_hz')
        if rate_hz is not None:
            self._rates_hz.append(rate_hz)
        if self._before is not None:
            before_s, away, windowed = self._before
            passed_s = min(max(0.0, time_s - before_s), _LONGEST_S)
            self._away_s += passed_s * away
            self._windowed_s += passed_s * windowed
        self._before = (time_s, values.get('away', '') != '',
                        not status_truth(values, 'full_screen'))
        device = values.get('device', '')
        if device and device not in self._devices[-1:]:
            self._devices.append(device)

    def add_tasks(self, entries: Sequence[TaskEntry]) -> None:
        """Process entries of the log of tasks; ignore those for other seats."""
        for entry in entries:
            if entry.seat != self._seat:
                continue
            key = entry.task, entry.number
            if entry.what in ('stimulus', 'request'):
                self.stimuli += 1
                self._open[key] = False
            elif entry.what == 'shown' and key in self._open:
                self._open[key] = True
            elif entry.what in ('missed', 'over') and entry.by != 'end':
                self.unseen += not self._open.pop(key, True)

    def add_timing(self, table: Mapping[str, object] | None) -> None:
        """Take table I as far as it is known: values by name, with `_ms` for milliseconds."""
        for key in _TIMES:
            value = None if table is None else table.get(key)
            if isinstance(value, float):
                name, factor = in_seconds(key)
                self._timing[name] = factor * value

    def values(self) -> dict[str, float]:
        """Return the values so far; those that the page has not told are missing."""
        found: dict[str, float] = {'stimuli': self.stimuli, 'unseen_stimuli': self.unseen,
                                   **self._timing}
        if self._links_s:
            found |= {'link_delay_s': round(statistics.median(self._links_s), 4),
                      'link_delay_max_s': round(max(self._links_s), 4)}
        if self._rates_hz:
            found['view_rate_hz'] = round(statistics.median(self._rates_hz), 1)
        if self._before is not None:
            found |= {'away_s': round(self._away_s, 2), 'windowed_s': round(self._windowed_s, 2),
                      'device_changes': max(0, len(self._devices) - 1)}
        return found


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


# During these phases of a drive no other item can come first.
UNDER_WAY = (DrivePhase.COUNTDOWN, DrivePhase.DRIVING, DrivePhase.ENDED)


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
