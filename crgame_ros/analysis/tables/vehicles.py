# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of driven vehicles: driver, distance, scores, and worst moments."""

from collections.abc import Iterator, Mapping, Sequence
import math
from typing import NamedTuple

from crgame_ros.analysis.criticality.criticality import EXPOSURES, MEASURES
from crgame_ros.analysis.criticality.headways import LEAST_SPEED, SHORT_S
from crgame_ros.analysis.criticality.thresholds import USUAL
from crgame_ros.analysis.rules.vehicle_rules import RULE_MEASURES
from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.scores.vehicle import SCORE_MEASURES, VehicleScores
from crgame_ros.analysis.tables.behaviour import VEHICLE_BEHAVIOUR
from crgame_ros.analysis.tables.column import (
    Column,
    declare,
    FLAG,
    INTEGER,
    NUMBER,
    RUN,
    TablePart,
    TEXT,
)
from crgame_ros.analysis.tables.pairs import FOOTPRINTS, measure_column
from crgame_ros.game.documents import DrivenAv, DrivenHuman
from crgame_ros.vehicle.state import StateColumn
import numpy as np

REAR_AXLE = 'rear axle'
AT_STEPS = 'at the scenario steps'
NO_LEADER = 'it followed no leader'
NEVER_NEAR = 'it was never defined: no other was near'
# A shorter time to collision counts as this one in 1 / ttc, which is infinite in a contact [s].
LEAST_TTC_S = 0.1
HUMAN, UNRECORDED = 'a human drives it', 'not an AV, or not recorded'
# Keys of `timing.json`, with the meaning of each count.
COUNTS = {
    'requests': 'plan requests', 'accepted': 'plans that were accepted',
    'refused': 'plans that were refused',
    'of_others': 'answers of other programs than its planner',
    'skipped': 'requests left out while one was open',
    'timed_out': 'requests that were not answered in time',
    'realigned': 'plans that were aligned to where the AV was',
    'steps_without_plan': 'simulation steps without a plan to follow'}
NOT_SCORED = 'the run was not scored'


def _rules(run: Run) -> Mapping[str, Sequence[object]]:
    return {name: [each.values[name] for each in run.usual_rules] for name in RULE_MEASURES}


VEHICLE_RULES = TablePart(tuple(
    Column(name, INTEGER if measure.is_count else NUMBER, measure.unit, measure.definition,
           measure.reference, measure.variant, measure.empty)
    for name, measure in RULE_MEASURES.items()), _rules)


class _ScoreColumn(NamedTuple):
    """
    The column of a measure.

    :param name: name of the column.
    :param measure: name of the score.
    :param factor: factor from the measure's unit to SI.
    :param median: whether the measure is a spread, and the column has its median.
    """

    name: str
    measure: str
    factor: float = 1.0
    median: bool = False


# Latencies are in the plans' own columns.
_COLUMNS = (
    _ScoreColumn('score_nuplan', 'nuplan_score'),
    *(_ScoreColumn(f'score_{name.removesuffix("_m").lower()}', name) for name in SCORE_MEASURES
      if name not in ('nuplan_score', 'latency_ms', 'age_ms')),
    _ScoreColumn('score_age_p50_s', 'age_ms', 1e-3, True))


def _declared(column: _ScoreColumn) -> Column:
    measure = SCORE_MEASURES[column.measure]
    flag = not measure.unit
    return Column(
        column.name, FLAG if flag else NUMBER, 's' if column.median else measure.unit,
        f'median {measure.definition}' if column.median else measure.definition,
        variant=measure.variant,
        empty=f'{measure.undefined}, or {NOT_SCORED}' if measure.undefined else NOT_SCORED)


def _scores(run: Run) -> Mapping[str, Sequence[object]]:
    scores = {each.vehicle_id: each for each in run.usual_scores.vehicles}
    found = [scores.get(name) for name in run.vehicles]
    values = [{} if each is None else each.values() for each in found]
    return {
        **{column.name: [_value(row.get(column.measure), column) for row in values]
           for column in _COLUMNS},
        'score_expert': [None if each is None or each.nuplan is None else each.nuplan.expert
                         for each in found],
        'score_failed_checks': [_failed(each) for each in found]}


def _value(value: float | None, column: _ScoreColumn) -> float | None:
    return value if value is None or column.factor == 1.0 else column.factor * value


def _failed(scores: VehicleScores | None) -> str | None:
    if scores is None or scores.commonroad is None:
        return None
    return ', '.join(scores.commonroad.checks.failed)


VEHICLE_SCORES = TablePart((
    *map(_declared, _COLUMNS),
    Column('score_expert', TEXT, '', 'with whose progress it was compared: scores with different '
           'experts are not comparable', empty=f'{SCORE_MEASURES["progress"].undefined}, or '
           f'{NOT_SCORED}'),
    Column('score_failed_checks', TEXT, '', 'names of the checks of valid_solution that it fails',
           variant='docs/scores.md', empty=f'all are passed, or {NOT_SCORED}')), _scores)


def _identity(run: Run) -> Mapping[str, Sequence[object]]:
    vehicles, driven = run.log.vehicles, run.driven
    return {
        'run': [run.id] * len(vehicles), 'id': [item.id for item in vehicles],
        'role': [item.role.value for item in vehicles],
        'driver': [item.driver if isinstance(item, DrivenHuman) else
                   item.planner if isinstance(item, DrivenAv) else '' for item in driven],
        'vehicle_model': [item.vehicle.name for item in driven],
        'length': [item.shape.length for item in vehicles],
        'width': [item.shape.width for item in vehicles],
        'wheelbase': [item.vehicle.wheelbase for item in driven],
        'rear_to_center': [item.rear_to_center for item in vehicles],
        'planning_problem': [item.planning_problem if isinstance(item, DrivenAv) else None
                             for item in driven]}


def _drive(run: Run) -> Mapping[str, Sequence[object]]:
    states = run.log.vehicle_states
    speeds, accelerations = (states[..., column] for column in (
        StateColumn.SPEED, StateColumn.ACCELERATION))
    return {'distance': run.record.ways(), 'mean_speed': speeds.mean(axis=0),
            'max_speed': speeds.max(axis=0),
            'max_acceleration': accelerations.max(axis=0),
            'min_acceleration': accelerations.min(axis=0)}


def _criticality(run: Run) -> Mapping[str, Sequence[object]]:
    found = [run.vehicle_criticality.get(item.id) for item in run.log.vehicles]
    columns: dict[str, list[object]] = {}
    for name in MEASURES:
        worst = [None if each is None else each.worst.get(name) for each in found]
        columns[f'worst_{name}'] = [None if each is None else each.value for each in worst]
        columns[f'worst_{name}_of'] = [None if each is None else each.other for each in worst]
        columns[f'worst_{name}_time_s'] = [None if each is None else each.time_s for each in worst]
    columns['max_inverse_ttc'] = [
        None if each is None else 0.0 if (least := each.worst.get('ttc')) is None
        else 1.0 / max(least.value, LEAST_TTC_S) for each in found]
    for name in EXPOSURES:
        columns[name] = [None if each is None else each.exposures[name] for each in found]
    columns['crossings'] = [None if each is None else len(each.crossings) for each in found]
    columns['worst_pet_s'] = [None if each is None else min(
        (crossing.pet_s for crossing in each.crossings), default=None) for each in found]
    return columns


def _following(run: Run) -> Mapping[str, Sequence[object]]:
    found = [run.vehicle_criticality.get(item.id) for item in run.log.vehicles]
    columns: dict[str, list[object]] = {column.name: [] for column in FOLLOWING_COLUMNS}
    for each in found:
        row: dict[str, float | None] = dict.fromkeys(columns)
        if each is not None:
            headways = each.headways
            row['share_following'] = headways.share_following()
            row['share_approaching'] = headways.share_approaching()
            for name, values in headways.distances().items():
                row[f'{name}_mean'], row[f'{name}_median'] = values.mean, values.median
            for name, values in headways.times().items():
                row[f'{name}_mean_s'], row[f'{name}_median_s'] = values.mean, values.median
                for limit, share in zip(SHORT_S, values.below, strict=True):
                    row[f'{name}_below_{limit}s'] = share
        for name, value in row.items():
            columns[name].append(None if value is None or math.isnan(value) else value)
    return columns


def _following_columns() -> Iterator[Column]:
    """Yield the columns on gaps (bumper to bumper) and headways (front to front)."""
    yield Column('share_following', NUMBER, '1', 'share of its steps with a leader')
    yield Column('share_approaching', NUMBER, '1', 'share of its steps on which it was closing '
                 'in on its leader, with a finite ttc')
    for name, what in (('gap', 'gap to the leader'), ('headway', 'headway: from its front to the '
                                                      "leader's front")):
        for kind in ('mean', 'median'):
            yield Column(f'{name}_{kind}', NUMBER, 'm', f'{kind} {what}', FOOTPRINTS,
                         'over the steps with a leader', NO_LEADER)
    moving = f'over the steps with a leader at more than {LEAST_SPEED:g} m/s'
    for name, what in (('time_gap', 'gap'), ('time_headway', 'headway, front to front,')):
        for kind in ('mean', 'median'):
            yield Column(f'{name}_{kind}_s', NUMBER, 's', f'{kind} {what} divided by its speed',
                         FOOTPRINTS, moving, NO_LEADER)
        for limit in SHORT_S:
            yield Column(f'{name}_below_{limit}s', NUMBER, '1', f'share of the time with a {what}'
                         f' divided by its speed, below {limit} s', FOOTPRINTS, moving, NO_LEADER)


def _worst_columns() -> list[Column]:
    columns = []
    for name in MEASURES:
        value = measure_column(name, 'worst_', NEVER_NEAR)
        columns += [
            value,
            Column(f'{value.name}_of', TEXT, '', f'id of the other one at the worst {name}',
                   empty=NEVER_NEAR),
            Column(f'{value.name}_time_s', NUMBER, 's', f'time of the worst {name}, since the '
                   'start of the run', variant='the first such moment', empty=NEVER_NEAR)]
    return columns


def _count_name(key: str) -> str:
    """Return the column of a count."""
    return f'plans_{key}' if key in ('accepted', 'refused', 'of_others', 'realigned') else key


def _planning(run: Run) -> Mapping[str, Sequence[object]]:
    ids = [item.id for item in run.log.vehicles]
    answers = run.answers
    tallies = [run.tallies.get(name) for name in ids]
    latencies = [None if tally is None or not tally.latencies_s else tally.latencies_s
                 for tally in tallies]
    return {
        **{_count_name(key):
           [getattr(answers.get(name), key, None) for name in ids] for key in COUNTS},
        'fallbacks': [getattr(answers.get(name), 'fallback', None) for name in ids],
        'plans': [None if tally is None else tally.answers for tally in tallies],
        'plans_passing': [None if tally is None or tally.checked < tally.answers
                          else tally.passing for tally in tallies],
        'latency_p50_s': [None if each is None else float(np.percentile(each, 50))
                          for each in latencies],
        'latency_max_s': [None if each is None else max(each) for each in latencies]}


FOLLOWING_COLUMNS = tuple(_following_columns())
VEHICLE_PARTS = (
    TablePart((
        RUN, Column('id', TEXT, '', 'of the vehicle'),
        Column('role', TEXT, '', 'kind of its driver', values=('human', 'autonomous')),
        Column('driver', TEXT, '', "the game's driver of a human, or the AV's planner",
               empty='the game does not say'),
        Column('vehicle_model', TEXT, '', 'name of its vehicle type'),
        Column('length', NUMBER, 'm', 'extent along its heading'),
        Column('width', NUMBER, 'm', 'extent across its heading'),
        Column('wheelbase', NUMBER, 'm', 'between the axles'),
        Column('rear_to_center', NUMBER, 'm', 'from the rear axle forward to the center'),
        Column('planning_problem', INTEGER, '', "id of the AV's planning problem", empty=HUMAN),
    ), _identity),
    TablePart((
        Column('distance', NUMBER, 'm', 'length of its way', REAR_AXLE,
               'straight between scenario steps, forwards and backwards alike'),
        Column('mean_speed', NUMBER, 'm/s', 'mean of its signed speed', REAR_AXLE, AT_STEPS),
        Column('max_speed', NUMBER, 'm/s', 'greatest signed speed', REAR_AXLE, AT_STEPS),
        Column('max_acceleration', NUMBER, 'm/s^2', 'greatest acceleration along its heading',
               REAR_AXLE, AT_STEPS),
        Column('min_acceleration', NUMBER, 'm/s^2', 'least, which is the hardest braking while '
               'it drives forwards', REAR_AXLE, AT_STEPS)), _drive),
    TablePart((
        *_worst_columns(),
        Column('max_inverse_ttc', NUMBER, '1/s', 'greatest 1 / ttc; 0 if it never approached a '
               'leader, so that means over vehicles count it', FOOTPRINTS,
               f'a ttc below {LEAST_TTC_S:g} s, as in a contact, counts as {LEAST_TTC_S:g} s'),
        *(Column(name, NUMBER, each.unit, each.told(USUAL).definition, FOOTPRINTS, each.variant)
          for name, each in EXPOSURES.items()),
        Column('crossings', INTEGER, '1', 'rows of crossings with it'),
        Column('worst_pet_s', NUMBER, 's', 'least post-encroachment time', FOOTPRINTS,
               empty='it crossed no other path')), _criticality),
    TablePart(FOLLOWING_COLUMNS, _following),
    VEHICLE_RULES,
    TablePart((
        *(Column(_count_name(key), INTEGER, '1', what, variant='as the engine told last',
                 empty=UNRECORDED)
          for key, what in COUNTS.items()),
        Column('fallbacks', INTEGER, '1', 'plans that braked because the planner failed',
               empty=UNRECORDED),
        Column('plans', INTEGER, '1', 'rows of plans of it', empty=UNRECORDED),
        Column('plans_passing', INTEGER, '1', 'of these, how many pass the check',
               empty=f'{UNRECORDED}, or the requests of some were not'),
        Column('latency_p50_s', NUMBER, 's', 'median latency, of all answers with one',
               variant='interpolated linearly', empty=UNRECORDED),
        Column('latency_max_s', NUMBER, 's', 'greatest latency, that of the first plan included',
               empty=UNRECORDED)), _planning),
    VEHICLE_BEHAVIOUR, VEHICLE_SCORES)
VEHICLES = declare('vehicles', 'a driven vehicle of a run', ('run', 'id'), VEHICLE_PARTS)
