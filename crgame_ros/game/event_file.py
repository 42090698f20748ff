# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads and writes the events of a game file and of `/scenario/game`."""

from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.game.events import EventList, EventSpec
from crgame_ros.schema.reading import read
from crgame_ros.schema.writing import write

_COMMON = ('name', 'label', 'kind', 'when')


def document_entry(event: EventSpec) -> dict[str, Any]:
    """Return an event's entry of `/scenario/game`: name, label, kind, when and its parameters."""
    entry = write(event)
    parameters = entry.pop(event.kind)
    return {'name': None, 'label': None, 'kind': event.kind, 'when': None} | entry | parameters


def parse_document_entries(entries: Any, where: str) -> tuple[EventSpec, ...]:
    """
    Read the entries that `document_entry` writes.

    :raises InputError: if they are malformed.
    """
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise InputError('"events" is no list of events', where)
    events: tuple[EventSpec, ...] = read(EventList, [
        {key: entry[key] for key in _COMMON if key in entry and key != 'kind'}
        | {str(entry.get('kind')): {key: value for key, value in entry.items()
                                    if key not in _COMMON}}
        for entry in entries], where)
    return events
