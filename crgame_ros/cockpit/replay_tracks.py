# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tracks of a recorded run over time: documents, alarms and marks for the time line."""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import asdict, dataclass, replace

from crgame_ros.cockpit.run_status import RunStatus
from crgame_ros.errors import InputError
from crgame_ros.game.documents import EVENTS, GameDocument, SIGNALS
from crgame_ros.game.events import FiredEvent
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.game.seat_documents import SEATS
from crgame_ros.messages.cdr import stamp_of
from crgame_ros.messages.status_values import read_status, Status
from crgame_ros.recording.reader import DecodedMessage
import numpy as np
from numpy.typing import NDArray

# A mark this soon after the one before of its kind and subject is counted with it [s].
MERGED_WITHIN_S = 1.0


@dataclass(frozen=True)
class Mark:
    """
    An event on the time line.

    :param n: simulation step of the first of its kind.
    :param last_n: step of the last that is counted with it.
    :param kind: collision, off_road, stale_plan, refused_plan, fallback, lost_device, reset,
        trigger, stop, late, recording or gap.
    :param subject: vehicle or event of the game, empty if it concerns the run.
    :param count: how many are counted together.
    """

    n: int
    last_n: int
    kind: str
    subject: str
    text: str
    count: int = 1


class MarkList:
    """A collector of marks; those of one kind and subject must be added in the order of n."""

    def __init__(self, scheduler: ScenarioScheduler) -> None:
        self._within = round(MERGED_WITHIN_S / scheduler.dt_s)
        self._marks: list[Mark] = []
        self._newest: dict[tuple[str, str], int] = {}

    def add(self, n: int, kind: str, subject: str, text: str) -> None:
        """Add a mark, or count it with the one before of its kind and subject."""
        place = self._newest.get((kind, subject))
        if place is not None and 0 <= n - self._marks[place].last_n <= self._within:
            known = self._marks[place]
            self._marks[place] = replace(known, last_n=n, count=known.count + 1)
            return
        self._newest[kind, subject] = len(self._marks)
        self._marks.append(Mark(n, n, kind, subject, text))

    def marks(self) -> tuple[Mark, ...]:
        """Return all marks in the order of n."""
        return tuple(sorted(self._marks, key=lambda mark: mark.n))


_DIAGNOSTICS = '/diagnostics'
_LATCHED = {SIGNALS.topic: 'signals', EVENTS.topic: 'events', SEATS.topic: 'seats'}
_FRAME_SKIP = '/timing/frame_skip'
# Parts of the status document that are read from the recording; the page fills in the rest.
_STATUS_PARTS = ('timing', 'planners', 'drivability', 'seats_lost')

# (n, content): the content holds from step n until the next entry.
Track = list[tuple[int, object]]


@dataclass(frozen=True)
class RunTracks:
    """
    A run's documents over time; every entry of a track is a complete document.

    :param documents: by kind as on the page (signals, events, seats, alarms) and by part
        of `status` (timing, planners, drivability, seats_lost, frames_skipped).
    """

    documents: dict[str, Track]
    marks: tuple[Mark, ...]


class TrackCollector:
    """A collector of a run's tracks, which takes its messages in the order of log time."""

    def __init__(self, game: GameDocument) -> None:
        self._game = game
        self._scheduler = game.scheduler
        vehicles = [item.id for item in game.vehicles]
        self._planners = {av.id: av.planner for av in game.avs}
        self._verdict_topics = {f'/{vehicle}/drivability' for vehicle in vehicles}
        self.topics = (_DIAGNOSTICS, _FRAME_SKIP, *_LATCHED, *self._verdict_topics)
        self._status = RunStatus()
        self._status.begin(vehicles)
        self._tracks: dict[str, Track] = {}
        self._marks = MarkList(game.scheduler)
        self._known_alarms: frozenset[str] = frozenset()
        self._resets: int | None = None
        self._fired: set[tuple[str, int]] = set()

    def add(self, recorded: DecodedMessage, newest: int | None) -> None:
        """Add one message of `topics`; `newest` is the step of the newest state, if any."""
        topic, _, _, message = recorded
        if topic in _LATCHED:
            self._add_latched(_LATCHED[topic], message.data, newest)
        elif topic == _FRAME_SKIP:
            self._put('frames_skipped', newest or 0, bool(message.data))
        elif newest is not None:
            n = newest
            if topic in self._verdict_topics:
                stamp_ns = stamp_of(message)
                if stamp_ns < self._scheduler.clock_offset_ns:
                    return
                n = min(self._scheduler.step_of_stamp(stamp_ns), newest)
            for status in message.status:
                self._add_status(status, n)

    def add_resets(self, steps: NDArray[np.float64], resets: NDArray[np.float64]) -> None:
        """Add a mark at each step at which the count of drift resets rose."""
        for n, count in zip(steps.tolist(), resets.tolist(), strict=True):
            if self._resets is not None and count > self._resets:
                self._marks.add(int(n), 'reset', '', 'too late: the clock was set back to now')
            self._resets = int(count)

    def finish(self, steps: NDArray[np.int64]) -> RunTracks:
        """Return the tracks of a run whose states are of these steps."""
        first = int(steps[0])
        strides = np.diff(steps)
        usual = int(np.median(strides)) if len(strides) else 1
        for index in np.flatnonzero(strides > usual).tolist():
            missing = round(strides[index] / usual) - 1
            self._marks.add(int(steps[index]), 'gap', '', f'{missing} states were not recorded')
        for track in self._tracks.values():
            track.sort(key=lambda entry: entry[0])
            # A document latched before the first recorded state is valid from that state on.
            while len(track) > 1 and track[1][0] <= first:
                track.pop(0)
        return RunTracks(self._tracks, self._marks.marks())

    def _put(self, kind: str, n: int, content: object) -> None:
        track = self._tracks.setdefault(kind, [])
        if track and track[-1][1] == content:
            return
        if track and track[-1][0] == n:
            track.pop()
        track.append((n, deepcopy(content)))

    def _add_status(self, status: object, n: int) -> None:
        taken = read_status(status)
        self._status.add(taken, n * self._scheduler.dt_s)
        for av, entry in self._status.planners.items():
            entry['planner'] = entry['planner'] or self._planners.get(av, '')
        content = self._status.document()
        for part in _STATUS_PARTS:
            if content[part]:
                self._put(part, n, content[part])
        alarms = self._status.alarms
        for alarm in alarms:
            if alarm.id not in self._known_alarms:
                self._marks.add(n, alarm.kind, alarm.subject, alarm.text)
        self._known_alarms = frozenset(alarm.id for alarm in alarms)
        if alarms or 'alarms' in self._tracks:
            self._put('alarms', n, self._status.alarms_document())
        self._mark_status(taken, n)

    def _mark_status(self, status: Status, n: int) -> None:
        """Add a mark for a status that is reported once and is not an alarm."""
        name, level, text, values = status
        node, _, subject = name.partition(': ')
        vehicle = subject.partition(' ')[0]
        if name == 'sim_node: stop':
            self._marks.add(n, 'stop', '', text)
        elif node == 'sim_node' and subject.endswith(' plan refused'):
            at = values.get('n', '')
            self._marks.add(int(at) if at.isdecimal() else n, 'refused_plan', vehicle, text)
        elif node == 'planner_node' and level and vehicle in self._planners:
            self._marks.add(n, 'fallback', vehicle, text)

    def _add_latched(self, kind: str, text: str, newest: int | None) -> None:
        try:
            if kind == 'signals':
                signals = SIGNALS.read(text)
                n = (signals.k - self._scheduler.k0) * self._scheduler.steps_per_tick
                self._put(kind, max(n, 0), asdict(signals))
            elif kind == 'seats':
                self._put(kind, newest or 0, {'seats': _seats(text)})
            else:
                events = EVENTS.read(text)
                if events.epoch == self._game.epoch:
                    self._add_fired(events.fired, newest or 0)
        except InputError:
            # Any node may publish on a topic; other content is skipped.
            return

    def _add_fired(self, fired: Sequence[FiredEvent], newest: int) -> None:
        for event in fired:
            key = (event.name, event.n)
            if key not in self._fired:
                self._fired.add(key)
                self._marks.add(event.n, 'trigger', event.name, f'by {event.by}')
        self._status.add_events(fired, self._scheduler.dt_s)
        self._put('events', max((event.n for event in fired), default=newest),
                  {'fired': [asdict(event) for event in fired]})


def _seats(text: str) -> dict[str, dict[str, str | None]]:
    """Read the drivers of the seats, by name if the driver was at a page; no page holds one."""
    return {name: {'source': entry.source, 'driver': entry.driver, 'holder': None,
                   'holder_name': entry.person.name if entry.here and entry.person else None}
            for name, entry in SEATS.read(text).items()}
