# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of trials: one row for each trial that counts, with all its values."""

from collections.abc import Mapping, Sequence
from datetime import datetime, UTC
import math
from pathlib import Path
from typing import Any

from crgame_ros.analysis.tables.column import (
    Column,
    FLAG,
    INTEGER,
    NUMBER,
    TableDeclaration,
    TEXT,
)
from crgame_ros.analysis.tables.runs import RUNS
from crgame_ros.analysis.tables.vehicles import VEHICLES
from crgame_ros.errors import InputError
from crgame_ros.recording.run_folder import GAME_FILE
from crgame_ros.study.data.asked_questions import AskedQuestions
from crgame_ros.study.data.conducted_study import ConductedStudy, ParticipantRecord, TrialAttempt
from crgame_ros.study.data.run_tables import RunTables
from crgame_ros.study.data.study_row_table import flag_column, unlike, with_unit
from crgame_ros.study.file import StudyFile
from crgame_ros.study.quality import PAGE, TIMING
from crgame_ros.study.trial_plan import PlannedTrial

_SCORED = ('hit_rate', 'response_mean_s', 'response_median_s')
_ONE = 'there was no detection response task, or several: runs/detection_scores has each'
TASK_COLUMNS = (
    Column('detection_hit_rate', NUMBER, '1', 'hits over hits and misses', variant='ISO 17488',
           empty=_ONE),
    Column('detection_response_mean_s', NUMBER, 's', 'mean response time of the hits',
           empty=f'{_ONE}; or there was no hit'),
    Column('detection_response_median_s', NUMBER, 's', 'median of it',
           empty=f'{_ONE}; or there was no hit'),
    Column('take_over_requests', INTEGER, '1', 'requests to take over that tasks made'),
    Column('take_over_requests_taken', INTEGER, '1', 'of these, followed by a first input'),
    Column('take_over_first_input_mean_s', NUMBER, 's', 'mean time from such a request to the '
           'first input', empty='there was none'))


def task_values(scores: Sequence[Mapping[str, object]],
                requests: Sequence[Mapping[str, object]]) -> dict[str, object]:
    """
    Return the values of the columns.

    :param scores: rows of the table `detection_scores` of the trial's run.
    :param requests: likewise of `take_over_requests`.
    """
    found: dict[str, object] = {'take_over_requests': len(requests)}
    if len(scores) == 1:
        found |= {f'detection_{name}': scores[0][name] for name in _SCORED}
    inputs = [at_s for row in requests if isinstance(at_s := row['first_input_s'], int | float)]
    found['take_over_requests_taken'] = len(inputs)
    if inputs:
        found['take_over_first_input_mean_s'] = sum(inputs) / len(inputs)
    return found


WALL = 'wall clock, seconds since 1970-01-01 UTC'
UNMEASURED = 'the recording could not be measured'
PARTICIPANT = Column('participant', TEXT, '', 'anonymous id')
TRIAL = Column('trial', INTEGER, '1', 'number among all of the participant, from 1 on')
PLACE_IN_GROUP = Column('place_in_group', INTEGER, '1', 'of the participant in the orders of the '
                        'group, from 1 on')
STAIRCASE_COLUMNS = (
    Column('staircase', TEXT, '', 'name of its staircase', empty='its block has none'),
    Column('success', FLAG, '', 'whether it was a success for the staircase',
           empty='its block has no staircase, or it counts for nothing there'),
    Column('reversal', FLAG, '', 'whether the direction of the staircase changed after it',
           empty='its block has no staircase'))
_FIRST = (
    PARTICIPANT, TRIAL,
    Column('place', INTEGER, '1', 'of the participant among all, from 1 on: says the order'),
    Column('block', TEXT, '', 'name of its block'),
    Column('place_in_block', INTEGER, '1', 'number in its block, from 1 on'),
    Column('repetition', INTEGER, '1', 'of the condition in the block, from 1 on'),
    Column('condition', TEXT, '', 'levels of all factors, with / between them'))
_DRIVE = (
    Column('attempt', INTEGER, '1', 'which attempt counts, from 1 on', variant='the last that '
           'finished'),
    flag_column('to_repeat', 'whether it is to be driven again and has not been yet'),
    Column('game', TEXT, '', 'name of the game file, or of the scenario where there is none'),
    Column('vehicle', TEXT, '', 'id of the vehicle that the participant drove'),
    Column('av_planner', TEXT, '', 'planner of the AVs, with + between them if they differ',
           empty=UNMEASURED),
    Column('random_seed', INTEGER, '1', 'of everything random'),
    Column('outcome', TEXT, '', "how the drive ended; other: by another vehicle's violation",
           empty='not reported'),
    Column('own_contacts', INTEGER, '1', "how often the participant's vehicle touched something",
           empty='not reported'),
    Column('own_departures', INTEGER, '1', 'how often it left the road', empty='not reported'),
    Column('started', TEXT, '', 'when it was started, ISO 8601, UTC'),
    Column('started_s', NUMBER, 's', 'when it was started', variant=WALL),
    Column('ended_s', NUMBER, 's', 'when its end was noted', variant=WALL),
    Column('run_end_s', NUMBER, 's', "time of its end on the run's clock", empty='not reported'),
    Column('recording', TEXT, '', "folder of the run, from the study's on", empty='none is known'),
    Column('scenario', TEXT, '', 'the run as a CommonRoad scenario', empty='there is none'),
    Column('report', TEXT, '', 'report of the run', empty='there is none'),
    Column('game_file', TEXT, '', 'the game as it was driven', empty='there is none'),
    Column('run', TEXT, '', 'its name in the tables in runs/', empty=UNMEASURED),
    flag_column('made', 'whether crgame study make-data has made its measures: nobody drove'),
    Column('problem', TEXT, '', 'why it has no measures', empty='it has some'))
# Columns of the table of runs.
_RUN_COLUMNS = ('benchmark_id', 'scenario_sha256', 'game_sha256', 'duration_s',
                'contacts', 'violations', 'final_error_s', 'mean_step_error_s',
                'max_cumulative_error_s', 'timeout_ratio', 'real_time_ratio_final',
                'real_time_ratio_mean', 'real_time_ratio_min', 'time_efficiency',
                'precision_ratio', 'resets', 'gaps', 'catch_up_steps')
_WATCHED = tuple(
    Column(name, kind, unit, what, 'by the page and the log of tasks, during the drive',
           empty='not watched') for name, kind, unit, what in (
        ('stimuli', INTEGER, '1', 'lights and requests that came'),
        ('unseen_stimuli', INTEGER, '1', 'of these, those that the page has not shown'),
        ('away_s', NUMBER, 's', 'time for which the page was hidden or without the focus'),
        ('windowed_s', NUMBER, 's', 'time for which the page did not fill the screen'),
        ('device_changes', INTEGER, '1', 'changes of the input device'),
        ('link_delay_max_s', NUMBER, 's', 'longest from the page to the simulation and back, of '
         'one a second')))
_TIMING = (
    Column('input_delay_s', NUMBER, 's', "median from the participant's hand to the first later "
           'state at the page, which is drawn after that', empty='not measured'),
    Column('link_delay_s', NUMBER, 's', 'median from the page to the simulation and back',
           empty='not measured'),
    *(Column(name, kind, unit, what, variant='of the view that was shown longest',
             empty='not recorded') for name, kind, unit, what in (
        ('view', TEXT, '', 'what the page showed: driver, chase, bird or map'),
        ('view_across_deg', NUMBER, 'deg', 'angle across the picture'),
        ('screen_width_m', NUMBER, 'm', 'width of the screen, as was told'),
        ('eye_distance_m', NUMBER, 'm', 'of the eyes from the screen, as was told'),
        ('view_rate_hz', NUMBER, 'Hz', 'pictures a second, median'))),
    Column('plans_of_others', INTEGER, '1', 'answers of other programs to the requests for plans',
           variant='all AVs', empty='not recorded'),
    Column('view_changes', INTEGER, '1', 'how often the view was changed',
           empty='not recorded'),
    flag_column('timing_flag', 'whether its timing is beyond a bound'),
    Column('timing_reason', TEXT, '', 'what of its timing is beyond which bound',
           empty='nothing is'),
    *_WATCHED,
    flag_column('page_flag', "whether a value of the participant's page is beyond a bound"),
    Column('page_reason', TEXT, '', 'what of it is beyond which bound', empty='nothing is'))
_ANSWERED = Column('answered_attempt', INTEGER, '1', 'the attempt after which its questions were '
                   'answered', empty='there are no answers')
_LEFT_OUT = ('run', 'id', 'role', 'driver', 'vehicle_model', 'planning_problem', 'length', 'width',
             'wheelbase', 'rear_to_center')
_PLANNING = ('plan', 'fallbacks', 'latency', 'requests', 'skipped', 'timed_out',
             'steps_without_plan', 'score_accepted', 'score_age')


def measure_columns() -> dict[str, Column]:
    """Return the measures of the participant's vehicle, by their names in the table `vehicles`."""
    return {column.name: with_unit(column) for column in VEHICLES.columns
            if column.name not in _LEFT_OUT and not column.name.startswith(_PLANNING)
            and column.type in (NUMBER, INTEGER, FLAG)
            and not (column.name.startswith('worst_') and column.name.endswith('_time_s'))}


def declare_trials(study: StudyFile,
                   asked: AskedQuestions) -> tuple[dict[str, Column], TableDeclaration]:
    """
    Return the columns of a study's factors by their names, and the declaration of the table.

    :param asked: the study's questionnaires.
    :raises InputError: if a question has the name of another column.
    """
    runs = {column.name: column for column in RUNS.columns}
    fixed = [*_DRIVE, *(runs[name] for name in _RUN_COLUMNS), *_TIMING,
             *measure_columns().values(), *TASK_COLUMNS, _ANSWERED]
    stepped = STAIRCASE_COLUMNS if study.staircases else ()
    taken = {column.name for column in (*_FIRST, PLACE_IN_GROUP, *stepped, *fixed)}
    factors: dict[str, Column] = {}
    for factor in study.all_factors:
        name = unlike(factor.name, taken, '_level')
        taken.add(name)
        factors[factor.name] = Column(
            name, TEXT, '', f'level of the factor {factor.name}', empty='its block does not '
            'cross it', variant='between participants' if factor.name == study.between else '',
            values=factor.names)
    answers = [column for scale in asked.after_trials.values()
               for column in scale.columns(study.language)]
    return factors, TableDeclaration(
        'trials', 'a trial that counts', ('participant', 'trial'),
        (*_FIRST, *factors.values(), *((PLACE_IN_GROUP,) if study.groups is not None else ()),
         *stepped, *fixed, *_apart(answers, taken)))


class TrialsTable:
    """
    The declaration of the table, and its rows.

    :param asked: its questionnaires.
    :ivar factors: the columns of the factors, by their names.
    """

    def __init__(self, folder: ConductedStudy, asked: AskedQuestions) -> None:
        self._folder, self._asked = folder, asked
        self._measures = measure_columns()
        self.factors, self.declaration = declare_trials(folder.study, asked)

    def row(self, record: ParticipantRecord, attempt: TrialAttempt, run: RunTables | None,
            problem: str) -> dict[str, object]:
        """
        Return the row of a trial.

        :param run: its measures; None without any.
        :param problem: the reason for missing measures.
        """
        trial = attempt.trial
        row: dict[str, object] = {
            'participant': record.id, 'trial': trial.number, 'place': record.place + 1,
            'block': trial.block, 'place_in_block': trial.place, 'repetition': trial.repetition,
            'condition': trial.condition.name,
            **{self.factors[name].name: level for name, level in trial.condition.levels},
            **self._grouped(record), **_stepped(record, trial),
            **self._drive(record, attempt), 'problem': problem or None}
        if run is not None:
            row |= self._measured(attempt, run)
        watched = attempt.says('quality')
        if isinstance(watched, Mapping):
            row |= {column.name: watched[column.name] for column in _WATCHED
                    if column.name in watched}
        for kind, checks in (('timing', TIMING), ('page', PAGE)):
            faults = self._folder.study.quality.faults(row, checks)
            row |= {f'{kind}_flag': bool(faults), f'{kind}_reason': '; '.join(faults)}
        return row | self._answers(record, trial) | self._made(attempt)

    def _grouped(self, record: ParticipantRecord) -> dict[str, object]:
        groups, allocation = self._folder.study.groups, record.allocation
        if groups is None or allocation is None:
            return {}
        return {self.factors[groups.name].name: allocation.group,
                PLACE_IN_GROUP.name: allocation.place + 1}

    def _drive(self, record: ParticipantRecord, attempt: TrialAttempt) -> dict[str, object]:
        settings, folder = attempt.trial.condition.settings, attempt.folder
        place = settings.game or settings.scenario or ''
        row = {'attempt': attempt.attempt, 'to_repeat': attempt.item in record.to_repeat,
               'game': Path(place).name, 'random_seed': settings.seed,
               'vehicle': settings.seat, 'outcome': attempt.says('outcome'),
               'own_contacts': attempt.says('contacts'),
               'own_departures': attempt.says('departures'),
               'started': utc(attempt.started_at), 'started_s': attempt.started_at,
               'ended_s': attempt.ended_at,
               'run_end_s': attempt.says('end_time_s')}
        if folder is not None and folder.is_dir():
            row['recording'] = self._folder.relative(folder)
            for name, pattern in (('scenario', '*.xml'), ('report', 'report.html'),
                                  ('game_file', GAME_FILE)):
                found = sorted(folder.glob(pattern))
                row[name] = self._folder.relative(found[0]) if found else None
        return row

    def _made(self, attempt: TrialAttempt) -> dict[str, object]:
        """Return made values, which replace the scores of made answers as well."""
        made = attempt.says('made')
        if not isinstance(made, Mapping):
            return {'made': False}
        kinds = {column.name: column.type for column in self.declaration.columns}
        return {'made': True} | {
            name: round(value) if kinds[name] == INTEGER else value
            for name, value in made.items() if kinds.get(name) in (INTEGER, NUMBER)
            and isinstance(value, int | float) and math.isfinite(value)}

    def _measured(self, attempt: TrialAttempt, run: RunTables) -> dict[str, object]:
        summary = run.summary
        humans = list(summary['humans'])
        seat = attempt.trial.condition.settings.seat
        vehicle = seat or (humans[0] if humans else None)
        told = run.table('runs').to_pylist()[0]
        vehicles = run.table('vehicles').to_pylist()
        measures: dict[str, object] = next((row for row in vehicles if row['id'] == vehicle), {})
        of_others = [row['plans_of_others'] for row in vehicles
                     if row['plans_of_others'] is not None]
        return {'run': told['run'], 'vehicle': vehicle, 'random_seed': told['seed'],
                'av_planner': '+'.join(dict.fromkeys(summary['planners'].values())),
                **task_values(*([row for row in run.table(name).to_pylist()
                                 if row['vehicle'] == vehicle]
                                for name in ('detection_scores', 'take_over_requests'))),
                'plans_of_others': sum(of_others) if of_others else None,
                **_view(summary.get('views', {}).get(vehicle, ())),
                'input_delay_s': _seconds(summary['input_delay_ms'].get(vehicle)),
                'link_delay_s': _seconds(summary['round_trip_ms'].get(vehicle)),
                **{name: told[name] for name in _RUN_COLUMNS},
                **{column.name: measures.get(name) for name, column in self._measures.items()}}

    def _answers(self, record: ParticipantRecord, trial: PlannedTrial) -> dict[str, object]:
        found: dict[str, object] = {}
        for answered in record.answered:
            scale = self._asked.find(answered.item)
            if answered.item.trial == trial.number and scale is not None:
                found |= scale.values(answered.answers)
                found['answered_attempt'] = answered.attempt
        return found


def _stepped(record: ParticipantRecord, trial: PlannedTrial) -> dict[str, object]:
    """Return the columns of the staircase of a trial."""
    if trial.staircase is None:
        return {}
    track = record.tracks[trial.block, trial.staircase]
    index, step = next((index, step) for index, step in enumerate(track.trials)
                       if step.place == trial.place)
    return {'staircase': trial.staircase, 'success': step.success,
            'reversal': index in track.reversals}


def utc(at_s: float) -> str:
    """Return a time in ISO 8601, to the millisecond."""
    return datetime.fromtimestamp(at_s, UTC).isoformat(timespec='milliseconds').replace(
        '+00:00', 'Z')


def _view(periods: Sequence[Mapping[str, Any]]) -> dict[str, object]:
    """Return the columns of the view that was shown longest, from a seat's periods."""
    if not periods:
        return {}
    longest = max(periods, key=lambda period: period['to_s'] - period['from_s'])
    return {'view': longest.get('shown'), 'view_across_deg': longest.get('across_deg'),
            'screen_width_m': longest.get('screen_width_m'),
            'eye_distance_m': longest.get('eye_distance_m'),
            'view_rate_hz': longest.get('rate_hz'), 'view_changes': len(periods) - 1}


def _seconds(delay_ms: float | None) -> float | None:
    return None if delay_ms is None else 1e-3 * delay_ms


def _apart(columns: list[Column], taken: set[str]) -> list[Column]:
    """
    Return the columns of questions.

    :raises InputError: if one of them has the name of another column.
    """
    known = set(taken)
    for column in columns:
        if column.name in known:
            raise InputError(f'the column {column.name} is there already', 'questionnaire',
                             'rename the questionnaire or its question')
        known.add(column.name)
    return columns
