# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of runs: the settings of each run, its timing, and its problems."""

from collections.abc import Iterator, Mapping
import hashlib
import json
from typing import Any

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

UNTIMED = 'its timing was not recorded, as that of an offline run'
UNTOLD = 'its cycles were not recorded'
# From `timing.json`: key, unit there, column, its unit and factor; docs/timing.md defines them.
_MS = ('s', 1e-3)
TIMING = {
    'final_error_ms': ('final_error_s', *_MS, 'final timing error E_f'),
    'mean_step_error_ms': ('mean_step_error_s', *_MS, 'mean of |e_n|, the error of a step'),
    'max_cumulative_error_ms': ('max_cumulative_error_s', *_MS, 'greatest cumulative error E_max'),
    'timeout_ratio': ('timeout_ratio', '1', 1.0, 'share of cycles busier than a step'),
    'time_efficiency': ('time_efficiency', '1', 1.0, 'time efficiency eta_t, as a fraction'),
    'precision_ratio': ('precision_ratio', '1', 1.0, 'precision ratio P_r'),
    'duration_s': ('timed_duration_s', 's', 1.0, 'measured duration, without pauses and scaled by '
                   'the real-time factor'),
    'rate_hz': ('rate_hz', 'Hz', 1.0, 'simulation steps per second'),
    'dropped_ms': ('dropped_s', *_MS, 'time by which drift resets moved the schedule'),
    'worst_lag_ms': ('worst_lag_s', *_MS, 'greatest lag behind the schedule in force'),
    'step_error_p99_ms': ('step_error_p99_s', *_MS, '99th percentile of |e_n|'),
    'busy_p50_ms': ('busy_p50_s', *_MS, 'median busy time of a cycle'),
    'busy_p99_ms': ('busy_p99_s', *_MS, '99th percentile of the busy time')}
RATIOS = {'final': 'over the whole run', 'mean': 'mean over all steps', 'min': 'least of a step'}
COUNTS = {'cycles': 'cycles that were recorded', 'gaps': 'cycles that were lost',
          'resets': 'drift resets', 'catch_up_steps': 'cycles more than a step late'}


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
    timing: Mapping[str, Any] | None = run.timing
    found: dict[str, object] = {} if timing is None else {
        **{name: timing[key] * factor for key, (name, _, factor, _) in TIMING.items()},
        **{f'real_time_ratio_{key}': timing['real_time_ratio'][key] for key in RATIOS},
        **{key: timing[key] for key in COUNTS}}
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
        *(Column(name, NUMBER, unit, what, variant='as docs/timing.md defines it', empty=UNTIMED)
          for name, unit, _, what in TIMING.values()),
        *(Column(f'real_time_ratio_{key}', NUMBER, '1', f'simulated over wall time, {what}',
                 empty=UNTIMED) for key, what in RATIOS.items()),
        *(Column(key, INTEGER, '1', what, empty=UNTIMED) for key, what in COUNTS.items()),
        Column('violations', INTEGER, '1', 'collisions and departures from the road that began',
               variant='of all driven vehicles, each as often as it began', empty=UNTOLD),
        Column('contacts', INTEGER, '1', 'first contacts of driven vehicles with something',
               empty=f'{UNTOLD}, or they cannot be named')), _timing))
RUNS = declare('runs', 'a run', ('run',), RUN_PARTS)
