# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tables of driving behaviour: for each vehicle, event, lane change and take-over."""

from collections.abc import Iterator, Mapping

from crgame_ros.analysis.behaviour.measures import MEASURES
from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.column import (
    Column,
    INTEGER,
    NUMBER,
    Row,
    RUN,
    TableDeclaration,
    TablePart,
    TEXT,
)
from crgame_ros.analysis.tables.writer import TableRows

_PER_VEHICLE = tuple(name for name, measure in MEASURES.items() if measure.per == 'vehicle')
_REACTIONS = ('reaction_throttle', 'reaction_brake', 'reaction_steering')
_SINCE_START = "since the run's start"


def _column(name: str, empty: str, prefix: str = '') -> Column:
    return Column.of(prefix + name, MEASURES[name], empty)


def _vehicles(run: Run) -> Iterator[Row]:
    for each in run.usual_behaviour:
        yield {'driven_s': each.driven_s,
               **{f'drive_{name}': each.values.get(name) for name in _PER_VEHICLE}}


VEHICLE_BEHAVIOUR = TablePart((
    Column('driven_s', NUMBER, 's', 'time in which commands drove it',
           variant='0 of an AV that followed its plans throughout'),
    *(_column(name, 'there was nothing to measure, or it was not driven by hand', 'drive_')
      for name in _PER_VEHICLE)), _vehicles)

_OF = (RUN, Column('vehicle', TEXT, '', 'id of the vehicle'))
REACTIONS = TableDeclaration(
    'reactions', 'what a driver did after an event', ('run', 'vehicle', 'event'),
    (*_OF, Column('event', TEXT, '', 'name of the event'),
     Column('time_s', NUMBER, 's', f'when it took effect, {_SINCE_START}'),
     *(_column(name, 'there was no such response in time') for name in _REACTIONS)))
LANE_CHANGES = TableDeclaration(
    'lane_changes', 'a change to a neighbouring lane', ('run', 'vehicle', 'number'),
    (*_OF, Column('number', INTEGER, '1', 'counts the changes of the vehicle from 0'),
     Column('time_s', NUMBER, 's', f'first wheel across, {_SINCE_START}',
            empty='it was across at the start'),
     Column('side', TEXT, '', 'to which it went', values=('left', 'right')),
     *(column for who in ('leader', 'follower') for column in (
         Column(who, TEXT, '', f'id of the {who} in the lane entered', empty='there was none'),
         _column(f'gap_to_{who}', 'there was none'),
         _column(f'gap_accepted_{who}', 'there was none')))))
TAKE_OVERS = TableDeclaration(
    'take_overs', 'a period in which a person drives an AV', ('run', 'vehicle', 'seat_s'),
    (*_OF, Column('seat_s', NUMBER, 's', f'first command that the AV obeyed, {_SINCE_START}'),
     Column('end_s', NUMBER, 's', f'last such command, {_SINCE_START}'),
     Column('request', TEXT, '', '`order` of the seat, or the name of the event or task asking',
            empty='none is known'),
     Column('request_s', NUMBER, 's', f'when it was asked for, {_SINCE_START}',
            empty='no request is known'),
     Column('hands_on_s', NUMBER, 's', f'first input, {_SINCE_START}', empty='there was none'),
     Column('stable_s', NUMBER, 's', f'beginning of the first stable second, {_SINCE_START}',
            empty='there was none'),
     _column('take_over_hands_on', 'no request or no input is known'),
     _column('take_over_stable', 'no request or no stable second is known')))
BEHAVIOUR_TABLES = REACTIONS, LANE_CHANGES, TAKE_OVERS


def write_behaviour(run: Run, writers: Mapping[str, TableRows]) -> None:
    """Add the rows of a run to the tables of reactions, lane changes and take-overs."""
    for driver in run.usual_behaviour:
        of = {'run': run.id, 'vehicle': driver.vehicle_id}
        writers[REACTIONS.name].add_rows(of | each.values() for each in driver.reactions)
        writers[LANE_CHANGES.name].add_rows(
            of | {'number': number} | each.values()
            for number, each in enumerate(driver.lane_changes))
        writers[TAKE_OVERS.name].add_rows(of | each.values() for each in driver.take_overs)
