# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reruns a study's recorded drivers against other planners, and compares the results."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
import json
from pathlib import Path

from crgame_ros.analysis.tables.column import Column, INTEGER, NUMBER, TableDeclaration, TEXT
from crgame_ros.analysis.tables.data_package import data_package, WrittenTable
from crgame_ros.analysis.tables.vehicles import VEHICLES
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.evaluation.cell_scene import before_take_over
from crgame_ros.recording.export import prepare_folder
from crgame_ros.recording.run_cycles import replay_inputs
from crgame_ros.recording.run_folder import PACKAGE_FILE, recording_in
from crgame_ros.simulation.av_assignment import OWN
from crgame_ros.study.data.study_data import CountedTrial, one_per_run, StudyData
from crgame_ros.study.data.study_row_table import csv_of_table, table_of_rows, with_unit
from crgame_ros.study.data.trials_table import PARTICIPANT, TRIAL
from crgame_ros.whole_file import write_bytes, write_text
import pyarrow.parquet as pq

# Columns of the vehicles' tables that are compared directly.
COMPARED = ('distance', 'mean_speed', 'max_speed', 'min_acceleration', 'worst_gap', 'worst_ttc',
            'worst_thw', 'max_inverse_ttc', 'time_gap_median_s', 'worst_drac',
            'worst_min_distance', 'worst_pet_s', 'tet_s', 'tit', 'score_nuplan',
            'score_no_collision_at_fault', 'score_progress', 'score_comfort')
RECORDED, RERUN = 'recorded', 'rerun'
COMPARISON = 'comparison'
# Folder of the evaluation of trials in which the participant rode, beside the others.
RIDDEN = 'ridden'
FILE = f'{COMPARISON}.csv'


def comparison_declaration() -> TableDeclaration:
    """Return the declaration of the comparison table."""
    known = {column.name: column for column in VEHICLES.columns}
    pairs = [with_unit(_declared(known[name], when), f'{when}_') for name in COMPARED
             for when in (RECORDED, RERUN)]
    return TableDeclaration(
        COMPARISON, 'a vehicle of a trial, driven again against a planner',
        ('participant', 'trial', 'vehicle', 'planner'), (
            PARTICIPANT, TRIAL, Column('condition', TEXT, '', 'of the trial'),
            Column('vehicle', TEXT, '', 'id of the vehicle'),
            Column('role', TEXT, '', 'kind of its driver', values=('human', 'autonomous')),
            Column('recorded_planner', TEXT, '', 'planner of the AVs when it was driven'),
            Column('planner', TEXT, '', 'label of the planner of the AVs now'),
            Column('random_seed', INTEGER, '1', 'of everything random'),
            Column('cell', TEXT, '', 'key in the evaluation',
                   empty='it was not computed'),
            Column('status', TEXT, '', 'how the run ended now, as in the evaluation'),
            Column('reason', TEXT, '', 'why it failed', empty='it did not'),
            Column('until_s', NUMBER, 's', 'when the participant took over the AV: the run is '
                   'driven again up to then', variant="on the run's clock",
                   empty='the participant drove, or took over no AV'),
            *pairs, Column('recorded_duration_s', NUMBER, 's', 'of the recorded run'),
            Column('rerun_duration_s', NUMBER, 's', 'simulated now', empty='it failed')))


def _declared(column: Column, when: str) -> Column:
    empty = '; '.join(filter(None, (column.empty, 'until_s has a value')))
    return column if when == RERUN else replace(column, empty=empty)


def rerun_study(data: StudyData, planners: Sequence[str], out: Path, workers: int | None,
                say: Callable[[str], object]) -> list[str]:
    """
    Replay the drivers of all trials that count against each planner.

    Trials in which the participant rode in an AV are driven up to the take-over, and against the
    recorded planner too (`own`): the recorded measures are of the whole drive.

    :param planners: of all AVs.
    :param out: folder of the evaluation, with a folder for each seed if trials differ in it.
    :param workers: number of processes; None for one per processor.
    :param say: prints one line.
    :return: the results, one line each.
    :raises InputError: if there is nothing to repeat, or a planner or folder cannot be used.
    """
    from crgame_ros.evaluation.dask_cluster import require_dask
    require_dask()
    trials = [trial for trial in one_per_run(data.trials) if _can_be_repeated(trial, say)]
    if not trials:
        raise InputError('no trial of a person and an AV can be repeated', str(data.folder.path),
                         'run some first')
    groups: dict[tuple[int, bool], list[CountedTrial]] = {}
    for trial in trials:
        groups.setdefault((int(trial.row['random_seed']), _is_ridden(trial)), []).append(trial)
    seeds, kinds = ({key[part] for key in groups} for part in (0, 1))
    rows: list[dict[str, object]] = []
    for (seed, ridden), of_group in sorted(groups.items(), key=lambda item: item[0]):
        folder = out if len(seeds) == 1 else out / f'seed-{seed}'
        if ridden and len(kinds) > 1:
            folder /= RIDDEN
        labels = _evaluated(of_group, planners, seed, folder, workers, ridden)
        rows += _compared(of_group, labels, folder)
    rows.sort(key=lambda row: (row['participant'], row['trial'], row['planner'], row['vehicle']))
    _write(rows, out, data.folder.study.name)
    return [_summarize(rows, planner)
            for planner in dict.fromkeys(str(row['planner']) for row in rows)]


def _can_be_repeated(trial: CountedTrial, say: Callable[[str], object]) -> bool:
    """Return whether all inputs of a trial's driver are known; print the reason if not."""
    reason = trial.row['problem']
    if trial.row['made']:
        reason = 'it is made'
    elif trial.run is not None and not _is_ridden(trial) \
            and trial.row['vehicle'] not in trial.run.summary['humans']:
        reason = 'no vehicle was driven in it'
    elif trial.run is not None and not trial.run.summary['planners']:
        reason = 'no AV takes part'
    elif trial.attempt.folder is not None and not reason:
        try:
            inputs = replay_inputs(recording_in(trial.attempt.folder))
            if _is_ridden(trial) and trial.run is not None:
                before_take_over(inputs, list(trial.run.summary['humans']), trial.attempt.folder)
        except CrgameError as error:
            reason = str(error)
    if reason:
        say(f'note: {trial.record.id}, trial {trial.attempt.trial.number} is left out: {reason}')
    return not reason


def _is_ridden(trial: CountedTrial) -> bool:
    """Return whether the participant's seat was an AV."""
    return trial.run is not None and trial.row['vehicle'] in trial.run.summary['planners']


def _taken_over_s(trial: CountedTrial) -> float | None:
    """Return when an AV first obeyed a person; None if none did."""
    if trial.run is None or not _is_ridden(trial):
        return None
    return min(trial.run.table('take_overs').column('seat_s').to_pylist(), default=None)


def _evaluated(trials: Sequence[CountedTrial], planners: Sequence[str], seed: int, folder: Path,
               workers: int | None, ridden: bool) -> list[str]:
    """Run or resume the evaluation; return its names of the recorded runs."""
    from crgame_ros.evaluation.dask_cluster import default_workers
    from crgame_ros.evaluation.evaluation import Computing, evaluate
    from crgame_ros.evaluation.file_names import GRID_FILE
    from crgame_ros.evaluation.plan import parse_plan
    from crgame_ros.evaluation.progress import EvaluationProgress
    humans = [str(trial.attempt.folder.resolve()) for trial in trials
              if trial.attempt.folder is not None]
    given: dict[str, object] = {'humans': humans, 'planners': list(planners), 'seeds': [seed]}
    if ridden:
        given |= {'take_overs': 'end', 'planners': list(dict.fromkeys((OWN, *planners)))}
    plan = parse_plan(given, '--planner', Path.cwd())
    evaluate(plan, folder, Computing(workers=default_workers() if workers is None else workers),
             EvaluationProgress())
    grid = json.loads((folder / GRID_FILE).read_text('utf-8'))['grid']
    return [scene['human'] for scene in grid['scenes']]


def _compared(trials: Sequence[CountedTrial], labels: Sequence[str],
              folder: Path) -> Iterator[dict[str, object]]:
    """Yield rows that compare the recorded and the new results."""
    cells = _parts(folder, 'cells')
    vehicles: dict[object, list[dict[str, object]]] = {}
    for row in _parts(folder, 'vehicles'):
        vehicles.setdefault(row['cell'], []).append(row)
    by_label: dict[object, CountedTrial] = dict(zip(labels, trials, strict=True))
    for cell in cells:
        trial = by_label.get(cell['human'])
        if trial is None or trial.run is None:
            continue
        now = {row['vehicle']: row for row in vehicles.get(cell['cell'], ())}
        for recorded in trial.run.table('vehicles').to_pylist():
            yield _row(trial, cell, recorded, now.get(recorded['id'], {}))


def _row(trial: CountedTrial, cell: Mapping[str, object], recorded: Mapping[str, object],
         now: Mapping[str, object]) -> dict[str, object]:
    known = {column.name: column for column in VEHICLES.columns}
    until_s = _taken_over_s(trial)
    comparable = recorded if until_s is None else {}
    values = {with_unit(known[name], f'{when}_').name: row.get(name) for name in COMPARED
              for when, row in ((RECORDED, comparable), (RERUN, now))}
    return {'participant': trial.record.id, 'trial': trial.attempt.trial.number,
            'condition': trial.attempt.trial.condition.name, 'vehicle': recorded['id'],
            'role': recorded['role'], 'recorded_planner': trial.row['av_planner'],
            'planner': cell['planner'], 'random_seed': cell['seed'], 'cell': cell['cell'],
            'status': cell['status'], 'reason': cell['reason'], 'until_s': until_s, **values,
            'recorded_duration_s': trial.row['duration_s'],
            'rerun_duration_s': cell['simulated_s']}


def _parts(folder: Path, name: str) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    for part in sorted((folder / name).glob('part-*.parquet')):
        rows += pq.read_table(part).to_pylist()
    return rows


def _write(rows: Sequence[Mapping[str, object]], out: Path, study: str) -> None:
    """Write the table and its dictionary, in their own folder beside the evaluation's."""
    folder = out / COMPARISON
    prepare_folder(folder)
    declaration = comparison_declaration()
    table = table_of_rows(declaration, rows)
    path = folder / FILE
    write_bytes(csv_of_table(table), path)
    package = data_package([WrittenTable(declaration, path, path.name, len(table))], 'csv',
                           f'{study}-{RERUN}', None)
    write_text(json.dumps(package, indent=1, ensure_ascii=False) + '\n', folder / PACKAGE_FILE)


def _summarize(rows: Sequence[Mapping[str, object]], planner: str) -> str:
    mine = [row for row in rows if row['planner'] == planner]
    runs = {(row['participant'], row['trial']): row['status'] for row in mine}
    ok = sum(status == 'ok' for status in runs.values())
    return f'{planner}: {ok} of {len(runs)} trials driven again'
