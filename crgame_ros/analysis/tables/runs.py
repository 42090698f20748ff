# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of runs: the settings of each run, its timing, and its problems."""

from collections.abc import Iterator
from dataclasses import replace
import hashlib
import json

from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.column import (
    Column,
    declare,
    INTEGER,
    NUMBER,
    Row,
    RUN,
    TablePart,
    TEXT,
)
from crgame_ros.game.objects import Role
from crgame_ros.measures import Measure
from crgame_ros.timing.measures import in_seconds, TIMING_MEASURES, timing_values

UNTIMED = 'its timing was not recorded, as that of an offline run'
UNTOLD = 'its cycles were not recorded'


def _column(key: str, measure: Measure) -> tuple[Column, float]:
    """Return the column of a number of `timing.json`, and the factor to its unit."""
    name, factor = in_seconds(key)
    # The run's duration has another column.
    return Column.of('timed_duration_s' if key == 'duration_s' else name, replace(
        measure, unit='s' if measure.unit == 'ms' else measure.unit), UNTIMED), factor


_COLUMNS = {key: _column(key, measure) for key, measure in TIMING_MEASURES.items()}


def _identity(run: Run) -> Iterator[Row]:
    log = run.log
    game, scheduler = log.game, log.game.scheduler
    planners = {av.id: av.planner for av in game.avs}
    refusal = run.usual_scores.refusal
    remarks = (f'no scores: {refusal}',) if refusal else ()
    file = hashlib.sha256(game.file.encode('utf-8', 'replace')).hexdigest() if game.file else None
    yield {
        'run': run.id, 'benchmark_id': game.benchmark_id, 'title': game.title,
        'epoch': game.epoch, 'scenario_sha256': game.scenario_sha256, 'game_sha256': file,
        'seed': game.seed if abs(game.seed) < 2**63 else None,
        'time_step_s': scheduler.time_step_s, 'dt_s': scheduler.dt_s,
        'k0': scheduler.k0, 'first_k': int(log.ks[0]), 'last_k': int(log.ks[-1]),
        'duration_s': int(log.ks[-1] - log.ks[0]) * scheduler.time_step_s,
        'real_time_factor': game.real_time_factor, 'humans': len(game.humans),
        'avs': len(game.avs), 'objects': len(log.objects),
        'agents': sum(item.role is Role.TRAFFIC for item in log.objects),
        'planners': json.dumps(planners), 'events': len(run.record.fired),
        'notices': '\n'.join((*run.missing, *remarks))}


def _timing(run: Run) -> Iterator[Row]:
    found: dict[str, object] = {} if run.timing is None else {
        _COLUMNS[key][0].name: _COLUMNS[key][1] * value
        for key, value in timing_values(run.timing).items()}
    if run.outcome is not None:
        found['violations'] = run.outcome['drivability']['violations']
        found['contacts'] = None if run.contacts is None else len(run.contacts)
    yield found


RUN_PARTS = (
    TablePart((
        RUN, Column('benchmark_id', TEXT, '', 'of its scenario', empty='it has none'),
        Column('title', TEXT, '', 'of its game, for people', empty='it has none'),
        Column('epoch', INTEGER, '1', 'counts resets from 0'),
        Column('scenario_sha256', TEXT, '', "of the scenario file's text"),
        Column('game_sha256', TEXT, '', "of the game file's text", empty='it has no game file'),
        Column('seed', INTEGER, '1', 'of everything random', empty='it is beyond 64 bits'),
        Column('time_step_s', NUMBER, 's', 'scenario time step'),
        Column('dt_s', NUMBER, 's', 'simulation step'),
        Column('k0', INTEGER, '1', 'scenario time step at which the run begins'),
        Column('first_k', INTEGER, '1', 'first scenario time step in these tables'),
        Column('last_k', INTEGER, '1', 'last scenario time step in these tables'),
        Column('duration_s', NUMBER, 's', 'simulated time between those two'),
        Column('real_time_factor', NUMBER, '1', 'simulated over wall time, as the game asked'),
        Column('humans', INTEGER, '1', 'driven vehicles of humans'),
        Column('avs', INTEGER, '1', 'autonomous vehicles (AVs)'),
        Column('objects', INTEGER, '1', 'everything else that may appear'),
        Column('agents', INTEGER, '1', 'of these, agents of traffic'),
        Column('planners', TEXT, '', 'planner of each AV, as a JSON object'),
        Column('events', INTEGER, '1', 'rows of events'),
        Column('notices', TEXT, '', 'data of the run that are missing here, one line each',
               empty='all data are here'),
    ), _identity),
    TablePart((
        *(column for column, _ in _COLUMNS.values()),
        Column('violations', INTEGER, '1', 'collisions and departures from the road that began',
               variant='of all driven vehicles, each as often as it began', empty=UNTOLD),
        Column('contacts', INTEGER, '1', 'first contacts of driven vehicles with something',
               empty=f'{UNTOLD}, or they cannot be named')), _timing))
RUNS = declare('runs', 'a run', ('run',), RUN_PARTS)
