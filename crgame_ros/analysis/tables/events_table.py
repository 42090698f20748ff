# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of events: what took effect when, and who or what made it."""

from collections.abc import Mapping, Sequence
from typing import Any

from crgame_ros.analysis.tables.column import Column, RUN, step_columns, TEXT
from crgame_ros.analysis.tables.table_part import declare, TablePart
from crgame_ros.analysis.tables.tabulated_run import TabulatedRun
from crgame_ros.game.events import ACTIONS

UNKNOWN = 'the game does not know the event: a vehicle touched somebody, or was put back'


def _fired(run: TabulatedRun) -> Mapping[str, Sequence[Any]]:
    game = run.record.log.game
    specs = {spec.name: spec for spec in game.events}
    fired = run.record.fired
    known = [specs.get(event.name) for event in fired]
    return {
        'run': [run.id] * len(fired), 'k': [event.k for event in fired],
        'time_s': [event.n * game.scheduler.dt_s for event in fired],
        'name': [event.name for event in fired],
        'kind': [None if spec is None else spec.kind for spec in known],
        'label': [None if spec is None else spec.label for spec in known],
        'by': [event.by for event in fired],
        'object': [None if spec is None else spec.object_id for spec in known]}


EVENT_PARTS = (
    TablePart((
        RUN, *step_columns('its effect'),
        Column('name', TEXT, '', 'of the event in the game'),
        Column('kind', TEXT, '', 'what it does', empty=UNKNOWN, values=tuple(ACTIONS)),
        Column('label', TEXT, '', 'text for people', empty=UNKNOWN),
        Column('by', TEXT, '', 'whether somebody triggered it, its condition came true, a driver '
               'had the vehicle put back, or a contact stopped it',
               values=('trigger', 'condition', 'driver', 'contact')),
        Column('object', TEXT, '', 'id of the obstacle that it changes or puts',
               empty='it changes no obstacle')), _fired),)
EVENTS = declare('events', 'an event that took effect', ('run', 'name', 'time_s'), EVENT_PARTS)
