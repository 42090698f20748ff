# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the experimenter's page shows now, as it is sent there."""

from collections import Counter
from collections.abc import Mapping
from typing import Any

from crgame_ros.study.desk.desk import Desk
from crgame_ros.study.desk.participant_document import how_over
from crgame_ros.study.participant_session import SessionEvent
from crgame_ros.study.session_script import Fields, PracticeDrives, SessionItem
from crgame_ros.study.study_file import Break, DeviceCheck, Page
from crgame_ros.study.trial_plan import PlannedTrial

MOST_ENTRIES = 300
LONGEST = 300


def experimenter_document(desk: Desk, page: Mapping[str, Any]) -> dict[str, Any]:
    """
    Describe the page.

    :param page: what is known of the participant's: connected, delays, seat.
    """
    session, state = desk.session, desk.drives.state
    item = session.next_item
    return {
        'study': session.study.title.in_language('en') or session.study.name,
        'name': session.study.name, 'participant': session.participant, 'place': session.place,
        'language': session.language, 'page': dict(page), 'markers': list(session.study.markers),
        'item': '' if item is None else item.id, 'held': session.held_at is not None,
        'waits': desk.waits, 'ending': desk.ending,
        'over': how_over(desk) if item is None else '', 'can_abort': desk.can_abort,
        'drive': {'phase': state.phase.value, 'item': state.item, 'attempt': state.attempt,
                  'time_s': state.time_s, 'text': state.text},
        'items': _items(desk), 'log': _log(desk)}


def _items(desk: Desk) -> list[dict[str, Any]]:
    session = desk.session
    attempts: Counter[str] = Counter()
    states: dict[str, str] = {}
    outcomes: dict[str, str] = {}
    for entry in session.journal.entries:
        name = entry.get('item', '')
        match entry['entry']:
            case SessionEvent.STARTED:
                attempts[name] += 1
            case SessionEvent.FINISHED | SessionEvent.SKIPPED:
                states[name] = entry['entry']
                outcomes[name] = str(entry.get('outcome', entry.get('reason', '')))[:LONGEST]
            case SessionEvent.REPEATED:
                states.pop(name, None)
                outcomes.pop(name, None)
    now = session.next_item
    return [{'id': item.id, 'kind': kind_of(item), 'attempts': attempts[item.id],
             'condition': item.what.condition.name if isinstance(item.what, PlannedTrial) else '',
             'trial': item.what.number if isinstance(item.what, PlannedTrial) else item.trial,
             'outcome': outcomes.get(item.id, ''),
             'state': 'now' if now is not None and item.id == now.id
             else states.get(item.id, 'to come')} for item in session.items]


def kind_of(item: SessionItem) -> str:
    """Return in a few words what an item is."""
    what = item.what
    if isinstance(what, PlannedTrial):
        return f'drive {what.number}'
    if isinstance(what, PracticeDrives):
        return 'practice'
    if isinstance(what, Fields):
        return 'about the participant'
    if isinstance(what, Page):
        return f'consent {what.file}' if what.consent else f'page {what.file}'
    if isinstance(what, Break):
        return f'break {what.minutes:g} min'
    if isinstance(what, DeviceCheck):
        return 'device check'
    return f'questions {what.name}'


def _log(desk: Desk) -> list[dict[str, Any]]:
    """Return the last entries of the journal, without answers: the file has them."""
    return [{name: value[:LONGEST] if isinstance(value, str) else value
             for name, value in entry.items()
             if name not in ('answers', 'items', 'after_s') and not isinstance(value, dict)}
            for entry in desk.session.journal.entries[-MOST_ENTRIES:]]
