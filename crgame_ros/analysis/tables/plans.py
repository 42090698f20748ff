# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of plans: planners' answers, their times, and their agreement with the motion."""

from collections.abc import Iterator
import math

from crgame_ros.analysis.runs.run import PlanTally, Run
from crgame_ros.analysis.tables.column import (
    Column,
    FLAG,
    INTEGER,
    NUMBER,
    REAR_AXLE,
    Row,
    RUN,
    step_columns,
    TableDeclaration,
    TEXT,
)
from crgame_ros.game.documents import DrivenAv
from crgame_ros.planner.plan_check import check_plan
from crgame_ros.recording.recorded_plans import RecordedPlan
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

NO_PLAN = 'the answer was not a plan'
STATE_COLUMNS = (
    ('x', 'm', 'first coordinate', StateColumn.X), ('y', 'm', 'second coordinate', StateColumn.Y),
    ('yaw', 'rad', 'heading', StateColumn.YAW), ('speed', 'm/s', 'speed', StateColumn.SPEED),
    ('acceleration', 'm/s^2', 'acceleration', StateColumn.ACCELERATION),
    ('steering_angle', 'rad', 'steering angle', StateColumn.STEERING_ANGLE))
DRIVEN = "distance from the AV's own state at that time, in the frame map"
ENDS = (('first', 0), ('last', -1))
DEVIATIONS = (('deviation_1s', 'at 1 s after the request', 1.0),
              ('deviation_end', 'at its last state', math.inf))

PLANS = TableDeclaration(
    'plans', "a planner's answer", ('run', 'av', 'number'), (
        RUN,
        Column('av', TEXT, '', 'id of the AV'),
        Column('number', INTEGER, '1', 'counts its answers from 0, in the order of recording'),
        *(Column(**vars(column) | {'empty': 'the stamp is that of no scenario step'})
          for column in step_columns('the request that it answers')),
        Column('latency_s', NUMBER, 's', 'from request to answer', variant='wall time, between '
               'the log times of both messages in the recording; of a request that was sent '
               'twice, from the second time',
               empty='the request was not recorded, or has been answered before'),
        Column('points', INTEGER, '1', 'states in it', empty=NO_PLAN),
        Column('horizon_s', NUMBER, 's', 'from its first state to its last', empty=NO_PLAN),
        Column('passes_check', FLAG, '', "whether it passes the engine's check of stamp, start "
               'and limits', variant='made again from the recording; not known are a refusal for '
               'leaving the road and one for coming after a newer plan',
               empty='the request was not recorded'),
        Column('refusal', TEXT, '', 'why it does not', empty='it does, or it is not known'),
        *(Column(f'{end}_{name}', NUMBER, unit, f'{what} of its {end} state', REAR_AXLE,
                 'as planned, in the frame map', NO_PLAN)
          for end, _ in ENDS for name, unit, what, _ in STATE_COLUMNS),
        *(Column(name, NUMBER, 'm', f'{DRIVEN}, {when}', REAR_AXLE,
                 'against the plan as it was sent, whichever plan was followed then',
                 'no plan, none so long, or the run was over then')
          for name, when, _ in DEVIATIONS)))


def plan_rows(run: Run) -> Iterator[Row]:
    """
    Yield the rows of a run, and count the plans of each AV.

    :raises InputError: if the recording is damaged.
    """
    avs = {av.id: av for av in run.game.avs}
    plans = run.plans()
    run.tallies = {} if plans is None else {av: PlanTally() for av in avs}
    for plan in plans or ():
        yield {'run': run.id, **_row(run, plan, avs[plan.av], run.tallies[plan.av])}


def _row(run: Run, found: RecordedPlan, av: DrivenAv, tally: PlanTally) -> dict[str, object]:
    scheduler = run.game.scheduler
    row: dict[str, object] = {
        'av': found.av, 'number': tally.answers, 'k': found.k, 'latency_s': found.latency_s,
        'time_s': None if found.k is None else float(run.seconds_at(np.array(found.k)))}
    refusal: str | None = found.fault
    if found.plan is not None:
        row |= _planned(run, found, av)
        refusal = None if found.told is None else check_plan(
            found.plan, found.told, found.stamp_ns, av.vehicle, scheduler.time_step_s)
    known = found.plan is None or found.told is not None
    tally.answers += 1
    tally.checked += known
    tally.passing += known and refusal is None
    if not math.isnan(found.latency_s):
        tally.latencies_s.append(found.latency_s)
    return row | {'passes_check': refusal is None if known else None, 'refusal': refusal}


def _planned(run: Run, found: RecordedPlan, av: DrivenAv) -> dict[str, object]:
    """Return the columns that concern a plan's states."""
    assert found.plan is not None
    log, states = run.log, found.plan.states.copy()
    states[:, :3] = av.transform.to_simulation(states[:, :3])
    step_s = log.game.scheduler.time_step_s
    row: dict[str, object] = {'points': len(states), 'horizon_s': (len(states) - 1) * step_s}
    for end, place in ENDS:
        for name, _, _, column in STATE_COLUMNS:
            row[f'{end}_{name}'] = float(states[place, column])
    driven = log.vehicle_states[:, [item.id for item in log.vehicles].index(av.id)]
    for name, _, after_s in DEVIATIONS:
        steps = len(states) - 1 if math.isinf(after_s) else round(after_s / step_s)
        at = -1 if found.k is None else found.k + steps - int(log.ks[0])
        if steps < len(states) and 0 <= at < len(driven):
            row[name] = math.dist(states[steps, :2], driven[at, :2])
    return row
