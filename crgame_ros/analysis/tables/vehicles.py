# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of driven vehicles: driver, distance, scores, and worst moments."""

from collections.abc import Iterator
from dataclasses import replace

from crgame_ros.analysis.criticality.criticality import EXPOSURES, MEASURES
from crgame_ros.analysis.criticality.headways import LEAST_SPEED, SHORT_S
from crgame_ros.analysis.criticality.thresholds import USUAL
from crgame_ros.analysis.rules.vehicle_rules import RULE_MEASURES
from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.scores.vehicle import SCORE_MEASURES
from crgame_ros.analysis.tables.behaviour import VEHICLE_BEHAVIOUR
from crgame_ros.analysis.tables.column import (
    Column,
    declare,
    INTEGER,
    NUMBER,
    REAR_AXLE,
    Row,
    RUN,
    TablePart,
    TEXT,
)
from crgame_ros.analysis.tables.pairs import measure_column
from crgame_ros.game.documents import DrivenAv, DrivenHuman
from crgame_ros.measures import FOOTPRINTS, Measure
from crgame_ros.vehicle.state import StateColumn
import numpy as np

AT_STEPS = 'at the scenario steps'
NO_LEADER = 'it followed no leader'
NEVER_NEAR = 'it was never defined: no other was near'
# A shorter time to collision counts as this one in 1 / ttc, which is infinite in a contact [s].
LEAST_TTC_S = 0.1
HUMAN, UNRECORDED = 'a human drives it', 'not an AV, or not recorded'
# By column: the key of `timing.json`, and the meaning of the count.
COUNTS = {
    'requests': ('requests', 'plan requests'),
    'plans_accepted': ('accepted', 'plans that were accepted'),
    'plans_refused': ('refused', 'plans that were refused'),
    'plans_of_others': ('of_others', 'answers of other programs than its planner'),
    'skipped': ('skipped', 'requests left out while one was open'),
    'timed_out': ('timed_out', 'requests that were not answered in time'),
    'plans_realigned': ('realigned', 'plans that were aligned to where the AV was'),
    'steps_without_plan': ('steps_without_plan', 'simulation steps without a plan to follow')}
NOT_SCORED = 'the run was not scored'


def _rules(run: Run) -> Iterator[Row]:
    for each in run.usual_rules:
        yield {name: each.values[name] for name in RULE_MEASURES}


VEHICLE_RULES = TablePart(tuple(
    Column.of(name, measure) for name, measure in RULE_MEASURES.items()), _rules)


# By column, the score; ages and latencies of plans are in columns of their own.
_SCORES = {'score_nuplan': 'nuplan_score', **{
    f'score_{name.removesuffix("_m").lower()}': name for name in SCORE_MEASURES
    if name not in ('nuplan_score', 'latency_ms', 'age_ms')}}
_AGE = SCORE_MEASURES['age_ms']


def _score_column(name: str, measure: Measure) -> Column:
    return Column.of(name, measure, ', or '.join(filter(None, (measure.empty, NOT_SCORED))))


def _scores(run: Run) -> Iterator[Row]:
    scores = {each.vehicle_id: each for each in run.usual_scores.vehicles}
    for name in run.vehicles:
        each = scores.get(name)
        values = {} if each is None else each.values()
        age_ms = values.get('age_ms')
        yield {**{column: values.get(score) for column, score in _SCORES.items()},
               'score_age_p50_s': None if age_ms is None else 1e-3 * age_ms,
               'score_expert': None if each is None or each.nuplan is None
               else each.nuplan.expert,
               'score_failed_checks': None if each is None or each.commonroad is None
               else ', '.join(each.commonroad.checks.failed)}


VEHICLE_SCORES = TablePart((
    *(_score_column(name, SCORE_MEASURES[score]) for name, score in _SCORES.items()),
    _score_column('score_age_p50_s', replace(
        _AGE, unit='s', definition=f'median {_AGE.definition}')),
    Column('score_expert', TEXT, '', 'with whose progress it was compared: scores with different '
           'experts are not comparable', empty=f'{SCORE_MEASURES["progress"].empty}, or '
           f'{NOT_SCORED}'),
    Column('score_failed_checks', TEXT, '', 'names of the checks of valid_solution that it fails',
           variant='docs/scores.md', empty=f'all are passed, or {NOT_SCORED}')), _scores)


def _identity(run: Run) -> Iterator[Row]:
    for item, driven in zip(run.log.vehicles, run.game.vehicles, strict=True):
        yield {'run': run.id, 'id': item.id, 'role': item.role.value,
               'driver': driven.driver if isinstance(driven, DrivenHuman) else
               driven.planner if isinstance(driven, DrivenAv) else None,
               'vehicle_model': driven.vehicle.name,
               'length': item.shape.length, 'width': item.shape.width,
               'wheelbase': driven.vehicle.wheelbase, 'rear_to_center': item.rear_to_center,
               'planning_problem': driven.planning_problem if isinstance(driven, DrivenAv)
               else None}


def _drive(run: Run) -> Iterator[Row]:
    states = run.log.vehicle_states
    speeds, accelerations = (states[..., column] for column in (
        StateColumn.SPEED, StateColumn.ACCELERATION))
    columns = {'distance': run.record.ways(), 'mean_speed': speeds.mean(axis=0),
               'max_speed': speeds.max(axis=0), 'max_acceleration': accelerations.max(axis=0),
               'min_acceleration': accelerations.min(axis=0)}
    for values in zip(*columns.values(), strict=True):
        yield dict(zip(columns, values, strict=True))


def _criticality(run: Run) -> Iterator[Row]:
    for each in run.usual_criticality.report():
        least = each.worst.get('ttc')
        yield {
            **{f'worst_{name}{end}': value for name, worst in each.worst.items()
               for end, value in (('', worst.value), ('_of', worst.other),
                                  ('_time_s', worst.time_s))},
            'max_inverse_ttc': 0.0 if least is None else 1.0 / max(least.value, LEAST_TTC_S),
            **{name: each.exposures[name] for name in EXPOSURES},
            'crossings': len(each.crossings),
            'worst_pet_s': min((crossing.pet_s for crossing in each.crossings), default=None)}


def _following(run: Run) -> Iterator[Row]:
    for each in run.usual_criticality.report():
        headways = each.headways
        row = {'share_following': headways.share_following(),
               'share_approaching': headways.share_approaching()}
        for name, values in headways.distances().items():
            row |= {f'{name}_mean': values.mean, f'{name}_median': values.median}
        for name, values in headways.times().items():
            row |= {f'{name}_mean_s': values.mean, f'{name}_median_s': values.median}
            row |= {f'{name}_below_{limit}s': share
                    for limit, share in zip(SHORT_S, values.below, strict=True)}
        yield row


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


def _planning(run: Run) -> Iterator[Row]:
    for item in run.log.vehicles:
        answers, tally = run.answers.get(item.id), run.tallies.get(item.id)
        row: dict[str, object] = {} if answers is None else {
            'fallbacks': answers.fallback,
            **{name: getattr(answers, key) for name, (key, _) in COUNTS.items()}}
        if tally is not None:
            row['plans'] = tally.answers
            if tally.checked >= tally.answers:
                row['plans_passing'] = tally.passing
            if tally.latencies_s:
                row['latency_p50_s'] = float(np.percentile(tally.latencies_s, 50))
                row['latency_max_s'] = max(tally.latencies_s)
        yield row


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
        *(column for name in MEASURES for column in (
            measure_column(name, 'worst_', NEVER_NEAR),
            Column(f'worst_{name}_of', TEXT, '', f'id of the other one at the worst {name}',
                   empty=NEVER_NEAR),
            Column(f'worst_{name}_time_s', NUMBER, 's', f'time of the worst {name}, since the '
                   'start of the run', variant='the first such moment', empty=NEVER_NEAR))),
        Column('max_inverse_ttc', NUMBER, '1/s', 'greatest 1 / ttc; 0 if it never approached a '
               'leader, so that means over vehicles count it', FOOTPRINTS,
               f'a ttc below {LEAST_TTC_S:g} s, as in a contact, counts as {LEAST_TTC_S:g} s'),
        *(Column.of(name, each.told(USUAL)) for name, each in EXPOSURES.items()),
        Column('crossings', INTEGER, '1', 'rows of crossings with it'),
        Column('worst_pet_s', NUMBER, 's', 'least post-encroachment time', FOOTPRINTS,
               empty='it crossed no other path')), _criticality),
    TablePart(tuple(_following_columns()), _following),
    VEHICLE_RULES,
    TablePart((
        *(Column(name, INTEGER, '1', what, variant='as the engine told last', empty=UNRECORDED)
          for name, (_, what) in COUNTS.items()),
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
