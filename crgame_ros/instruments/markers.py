# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Markers out of a run's messages, for the recordings of other instruments.

A marker is words with slashes between them, from the general to the particular, by which MNE and
other tools choose epochs: `stimulus/drt/hv0/3` is one of `stimulus` and of `stimulus/drt`.
"""

from typing import NamedTuple

from crgame_ros.driver.seat_state import RETURNING
from crgame_ros.game.documents import FiredEvents, RunState
from crgame_ros.game.seat_documents import DrivingSpell, DrivingSpells
from crgame_ros.game.task_documents import TaskEntry, TaskLog
from crgame_ros.messages.status_values import Status

_KINDS = {'begin': 'task/begin', 'end': 'task/end', 'stimulus': 'stimulus',
          'request': 'take_over/request', 'shown': 'shown', 'answer': 'answer',
          'unrequested': 'answer/unrequested', 'missed': 'missed', 'over': 'take_over/over'}


class Marker(NamedTuple):
    """
    What has happened.

    :param n: simulation step at which it happened; None: at the newest.
    :param after_s: wall time from that step to when it happened [s]
    :param steady_s: when it happened, on the machine's steady clock, where a page has told it [s];
        it goes before `after_s`.
    """

    text: str
    n: int | None = None
    after_s: float = 0.0
    steady_s: float | None = None


class RunMarkers:
    """The markers of one run; each thing is told once, though documents repeat it."""

    def __init__(self, epoch: int) -> None:
        self._epoch = epoch
        self._state = ''
        self._events = 0
        self._drivers: dict[str, DrivingSpell] = {}
        self._hits: dict[str, frozenset[str]] = {}
        # Onsets of stimuli and requests, by task and number.
        self._onsets: dict[tuple[str, int], int] = {}

    def begun(self, n: int) -> list[Marker]:
        """Return the marker of the first cycle."""
        if self._state:
            return []
        self._state = 'running'
        return [Marker(_words('trial/begin', self._epoch), n)]

    def of_state(self, state: RunState) -> list[Marker]:
        """Return the markers of a pause, of its end, or of the run's end."""
        before = self._state
        if state.epoch != self._epoch or not before or state.state == before:
            return []
        self._state = state.state
        word = {'paused': 'pause', 'ended': 'end',
                'running': 'resume' if before == 'paused' else ''}.get(state.state)
        return [Marker(_words(f'trial/{word}', self._epoch))] if word else []

    def of_events(self, document: FiredEvents) -> list[Marker]:
        """Return the markers of events that are new."""
        if document.epoch != self._epoch:
            return []
        fired = document.fired[self._events:]
        self._events += len(fired)
        return [Marker(_words('event', event.name, event.by), event.n) for event in fired]

    def of_tasks(self, log: TaskLog) -> list[Marker]:
        """Return the markers of what tasks tell."""
        return [self._of_task(entry) for entry in log.entries] if log.epoch == self._epoch else []

    def _of_task(self, entry: TaskEntry) -> Marker:
        """Return a marker; what a page has timed itself is where the page puts it."""
        numbered = (entry.number,) if entry.number else ()
        text = _words(_KINDS[entry.what], entry.task, entry.seat, *numbered,
                      *((entry.by,) if entry.by else ()))
        key = entry.task, entry.number
        if entry.what in ('stimulus', 'request'):
            self._onsets[key] = entry.n
        onset_n, times = self._onsets.get(key), entry.times
        answer_ms = 0.0 if entry.what == 'shown' or times.response_ms is None \
            else times.response_ms + (times.paused_ms or 0.0)
        if times.steady_s is not None and (entry.what == 'shown' or times.response_ms is not None):
            return Marker(text, entry.n, 0.0, times.steady_s + 1e-3 * answer_ms)
        if onset_n is None or entry.what not in ('shown', 'answer') or times.delay_ms is None:
            return Marker(text, entry.n)
        if entry.what == 'answer' and times.response_ms is None:
            return Marker(text, entry.n)
        return Marker(text, onset_n, 1e-3 * (times.delay_ms + answer_ms))

    def of_drivers(self, document: DrivingSpells) -> list[Marker]:
        """Return the markers of seats whose source has changed since the run's start."""
        found: list[Marker] = []
        if document.epoch != self._epoch:
            return found
        for spell in document.drivers:
            before = self._drivers.get(spell.seat)
            if before is not None and spell.from_n <= before.from_n:
                continue
            self._drivers[spell.seat] = spell
            if before is not None and spell.source != before.source:
                word = 'back' if spell.source in RETURNING else 'driven'
                found.append(Marker(_words('take_over', word, spell.seat, spell.source),
                                    spell.from_n))
        return found

    def of_study(self, status: Status) -> list[Marker]:
        """Return the markers of a study: the trial that is driven, the experimenter's markers."""
        node, _, subject = status.name.partition(': ')
        if node != 'study_node':
            return []
        values = status.values
        if subject == 'trial':
            return [Marker(_words('trial', values.get('item', ''), values.get('condition', ''),
                                  values.get('attempt', '')))]
        return [Marker(_words('marker', status.text))] if subject == 'marker' else []

    def of_drivability(self, status: Status) -> list[Marker]:
        """Return the markers of contacts that have begun."""
        vehicle = status.name.partition('/')[0]
        hit = frozenset(filter(None, status.values.get('hit', '').split(',')))
        fresh = hit - self._hits.get(vehicle, frozenset())
        self._hits[vehicle] = hit
        n = status.values.get('n', '')
        return [Marker(_words('contact', vehicle, other), int(n) if n.isdecimal() else None)
                for other in sorted(fresh)]


def _words(*words: object) -> str:
    """Join words; a slash in a name would make two of it."""
    first, *others = words
    return '/'.join((str(first), *(str(word).replace('/', '_') for word in others)))
