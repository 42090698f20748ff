# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rows of a cell in the tables, and the tables' declarations."""

from collections.abc import Collection, Sequence
from typing import Any, TypedDict

from crgame_ros.analysis.blame.blame import blame_of, KINDS
from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.column import (
    Column,
    FLAG,
    INTEGER,
    NUMBER,
    part_rows,
    TableDeclaration,
    TEXT,
)
from crgame_ros.analysis.tables.vehicles import VEHICLE_PARTS
from crgame_ros.simulation.contacts import Contact
from crgame_ros.simulation.offline import OfflineResult

STATUSES = ('ok', 'error', 'refused', 'timeout', 'memory', 'died')
_KEY = Column('cell', TEXT, '', 'key of the cell: a hash of everything that it depends on')
_FACTORS = (
    Column('scenario', TEXT, '', "benchmark id, with the file's name where two files have that "
           'id'),
    Column('game', TEXT, '', "name of the game's file", empty='it is a scenario without a game'),
    Column('human', TEXT, '', 'name of the recorded run whose humans drive',
           empty='no recorded human drives'),
    Column('participant', TEXT, '', "the study's participant who drove that run",
           empty='the run is not of a study'),
    Column('variant', TEXT, '', 'values of what varies in the game, as a JSON object',
           empty='the game is run as it is'),
    Column('planner', TEXT, '', 'label of the planner or driver of the AVs'),
    Column('perception', TEXT, '', 'label of how AVs perceive'),
    Column('traffic', TEXT, '', 'label of the traffic'),
    Column('seed', INTEGER, '1', 'of everything random'))
# Names of the columns that identify cells; cells that share all but the planner are a pair.
FACTORS = tuple(column.name for column in _FACTORS)
TEXT_FACTORS = tuple(column.name for column in _FACTORS if column.type is TEXT)
FAILED = 'the cell failed'
CELLS = TableDeclaration('cells', 'a cell', ('cell',), (
    _KEY, *_FACTORS,
    Column('status', TEXT, '', 'how it ended', values=STATUSES),
    Column('reason', TEXT, '', 'why it failed, in a line', empty='it did not'),
    Column('traceback', TEXT, '', 'where it failed', empty='it did not fail, or it is not known'),
    Column('simulated_s', NUMBER, 's', 'how long the run was', empty=FAILED),
    Column('state_hash', TEXT, '', 'SHA-256 over all states of the driven vehicles',
           empty=FAILED),
    Column('contacts', INTEGER, '1', 'first contacts of driven vehicles with something',
           empty=FAILED),
    Column('stopped', FLAG, '', "whether a human's violation ended it", empty=FAILED)))
_OUTCOME = (
    Column('collided', FLAG, '', 'whether it touched anything'),
    Column('blame', TEXT, '', 'whether it could have avoided its first contact',
           variant='docs/search.md, "Who is to blame"',
           empty='it had no contact, or a human drives it',
           values=tuple(kind for kind in KINDS if kind)),
    Column('left_road', FLAG, '', 'whether a part of its footprint was off the road'),
    Column('accepted_ratio', NUMBER, '1', "share of its planner's answers that were accepted and "
           'no fallback', empty='a human drives it'))
_PARTS = tuple(column for part in VEHICLE_PARTS for column in part.columns
               if column.name not in ('run', 'id'))
VEHICLES_OF_CELLS = TableDeclaration('vehicles', 'a driven vehicle of a cell', (
    'cell', 'vehicle'), (_KEY, *_FACTORS, Column('vehicle', TEXT, '', 'id of the vehicle'),
                         *_OUTCOME, *_PARTS))
WORK = TableDeclaration('work', 'the computing of a cell', ('cell',), (
    _KEY, Column('worker', TEXT, '', 'address of the worker that computed it'),
    Column('wall_s', NUMBER, 's', 'time that it took'),
    Column('computing_s', NUMBER, 's', 'processor time that it took', empty=FAILED),
    Column('peak_bytes', INTEGER, '1', 'largest resident memory of the process so far',
           empty=FAILED),
    Column('plan_p50_s', NUMBER, 's', 'median time that planners took to plan', empty=FAILED),
    Column('plan_max_s', NUMBER, 's', 'greatest such time', empty=FAILED)))
TABLES_OF_CELLS = (CELLS, VEHICLES_OF_CELLS, WORK)


class CellRows(TypedDict, total=False):
    """The rows of a cell in the tables of an evaluation; a cell that failed may lack some."""

    cell: dict[str, object]
    vehicles: list[dict[str, object]]
    work: dict[str, Any]


def outcome_of(result: OfflineResult, contacts: Sequence[Contact]) -> dict[str, object]:
    """
    Return the values of a run in the cell's row.

    :param contacts: of the run.
    """
    steps = len(result.vehicle_states) - 1
    return {'status': 'ok', 'simulated_s': steps * result.setup.scheduler.dt_s,
            'state_hash': result.state_hash, 'contacts': len(contacts),
            'stopped': result.stop is not None}


def vehicle_rows(run: Run, result: OfflineResult, contacts: Sequence[Contact],
                 wanted: Collection[str] | None = None) -> list[dict[str, object]]:
    """
    Return the rows of a run's driven vehicles.

    :param contacts: of the run.
    :param wanted: columns; what is measured for others alone may be left out. None for all.
    """
    rows = []
    identity, *parts = VEHICLE_PARTS
    for row in part_rows([identity, *(
            part for part in parts if wanted is None
            or not {column.name for column in part.columns}.isdisjoint(wanted))], run):
        del row['run']
        vehicle = str(row.pop('id'))
        verdicts = [item for item in result.violations if item.vehicle_id == vehicle]
        record = result.planners.get(vehicle)
        collided = any(item.collision for item in verdicts)
        rows.append({
            'vehicle': vehicle,
            'collided': collided,
            'blame': blame_of(result, contacts, vehicle, latest=False).kind or None
            if collided and record is not None else None,
            'left_road': any(item.off_road for item in verdicts),
            'accepted_ratio': None if record is None else record.accepted_ratio,
            **{name: _plain(value) for name, value in row.items()}})
    return rows


def _plain(value: object) -> object:
    """Return a value as a JSON-compatible one; None, which is missing, for NaN."""
    plain: object = value.item() if hasattr(value, 'item') else value
    return None if plain != plain else plain
