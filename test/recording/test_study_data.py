# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Data of a study: its tables hold all actions and answers, however the program ends."""

from collections.abc import Callable
import csv
import gzip
import hashlib
import json
import math
from pathlib import Path
import random
import shutil
import subprocess
import sys
import time

from crgame_ros import __version__
from crgame_ros.analysis.tables.run_tables import TABLES
from crgame_ros.cli import main
from crgame_ros.evaluation.summary.summarise import summarise
from crgame_ros.recording.run_folder import FINISHED_MARK
from crgame_ros.recording.run_trajectories import read_trajectories
from crgame_ros.study.data.bids_folder import escaped
from crgame_ros.study.session_journal import JOURNAL, SessionJournal
from crgame_ros.vehicle.state import StateColumn
import numpy as np
import pandas
import polars
import pytest
from study_maker import DURATION_S, lines_of, NASTY, Studied

pytestmark = pytest.mark.xdist_group('study-data')
ROWS = [(name, number) for name in ('P01', 'P02', 'P03') for number in (1, 2)]
RSCRIPT = """
table <- read.csv(commandArgs(TRUE)[1], na.strings = c("", "NaN"), encoding = "UTF-8")
text <- table$remarks_remark[!is.na(table$remarks_remark)][1]
writeBin(c(charToRaw(enc2utf8(text)), charToRaw("|"), charToRaw(sprintf("%d %d %.17g",
  nrow(table), ncol(table), mean(table$mean_speed_m_per_s)))), commandArgs(TRUE)[2])
"""


def table(folder: Path, name: str) -> polars.DataFrame:
    """Read a table as other programs do."""
    return polars.read_parquet(folder / 'data' / f'{name}.parquet')


def digests(folder: Path) -> dict[str, str]:
    """Hash all files."""
    return {path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(folder.rglob('*')) if path.is_file()}


@pytest.mark.slow
def test_a_trial_that_counts_is_one_row(studied: Studied) -> None:
    trials = table(studied.folder, 'trials')
    assert trials.select('participant', 'trial').rows() == ROWS
    assert trials['attempt'].to_list() == [1, 1, 1, 1, 3, 1]
    assert trials['problem'].null_count() == len(ROWS)
    assert trials['planner'].to_list() == trials['condition'].to_list()
    planner = {'idm': 'idm', 'cv': 'constant-velocity'}
    assert trials['av_planner'].to_list() == [planner[name] for name in trials['condition']]
    assert trials['random_seed'].unique().to_list() == [3]
    # There was no driver at a page.
    assert trials['link_delay_s'].null_count() == len(ROWS)
    for row in trials.iter_rows(named=True):
        assert row['run'] in (studied.folder / row['report']).read_text('utf-8')
    assert trials['recording'][4] == 'participants/P03/runs/1/run_3'
    # Williams: both orders of two conditions.
    assert {tuple(trials.filter(participant=name)['condition']) for name in ('P01', 'P02')} == {
        ('idm', 'cv'), ('cv', 'idm')}


def test_measures_are_those_of_the_recording(studied: Studied) -> None:
    for row in table(studied.folder, 'trials').iter_rows(named=True):
        log = read_trajectories(studied.folder / row['recording'] / 'bag')
        states = log.vehicle_states[:, 0]
        assert row['mean_speed_m_per_s'] == pytest.approx(
            float(states[:, StateColumn.SPEED].mean()), rel=1e-12)
        steps = np.diff(states[:, [StateColumn.X, StateColumn.Y]], axis=0)
        assert row['distance_m'] == pytest.approx(np.linalg.norm(steps, axis=1).sum(), rel=1e-12)
        assert row['duration_s'] == pytest.approx(DURATION_S)


def test_scores_are_those_computed_by_hand(studied: Studied) -> None:
    for row in table(studied.folder, 'trials').iter_rows(named=True):
        given = studied.answers[row['participant'], row['trial']]
        # Van der Laan: items 3, 6 and 8 have their good end at the right.
        points = {name: value - 3 if name in ('good', 'likeable', 'desirable') else 3 - value
                  for name, value in given.items()}
        assert row['acceptance_usefulness'] == pytest.approx(sum(
            points[name] for name in ('useful', 'good', 'effective', 'assisting', 'alerting')) / 5)
        assert row['acceptance_satisfaction'] == pytest.approx(sum(
            points[name] for name in ('pleasant', 'nice', 'likeable', 'desirable')) / 4)
    people = table(studied.folder, 'participants')
    for row in people.iter_rows(named=True):
        # Kennedy: 9.54 times the sum of the seven symptoms, 0 to 3.
        nausea = [row[f'before_ssq_{name}'] - 1 for name in (
            'general_discomfort', 'salivation', 'sweating', 'nausea', 'concentrating',
            'stomach_awareness', 'burping')]
        assert row['before_ssq_nausea_score'] == pytest.approx(9.54 * sum(nausea))
    assert people['complete'].to_list() == [True, True, True, False]
    assert people['after_ssq_total_score'][3] is None
    assert people['end_reason'].to_list() == [None, None, None, 'felt ill']


def test_what_was_not_counted_is_among_the_events(studied: Studied) -> None:
    events = table(studied.folder, 'events').filter(participant='P03', trial=1)
    kinds = events.filter(polars.col('kind').str.starts_with('trial_')).select(
        'kind', 'attempt', 'text').rows()
    assert kinds == [
        ('trial_started', 1, None), ('trial_aborted', 1, 'sneezing'), ('trial_started', 2, None),
        ('trial_finished', 2, None), ('trial_repeated', None, 'a phone rang'),
        ('trial_started', 3, None), ('trial_finished', 3, None)]
    note = events.filter(kind='note').row(0, named=True)
    assert (note['text'], note['time_s'], note['attempt']) == ('sneezed', 0.5, 1)
    everybody = table(studied.folder, 'events')
    assert everybody.filter(participant='P04', kind='trial_started').height == 1
    for name in everybody['participant'].unique():
        mine = everybody.filter(participant=name)
        assert mine['wall_s'].is_sorted() and mine['number'].to_list() == list(
            range(1, mine.height + 1))
        # The table has every entry of the journal once.
        journal = lines_of(studied.folder / 'participants' / name / JOURNAL)
        told = mine.filter(polars.col('kind') != 'game_event')
        assert told['wall_s'].to_list() == [entry['at'] for entry in journal]


def test_texts_come_back_as_they_were(studied: Studied) -> None:
    data = studied.folder / 'data'
    with (data / 'answers.csv').open(encoding='utf-8', newline='') as stream:
        rows = [row for row in csv.DictReader(stream) if row['question'] == 'remark']
    assert [row['text'] for row in rows[:2]] == [NASTY, NASTY] and rows[2]['text'] == ''
    with (data / 'trials.csv').open(encoding='utf-8', newline='') as stream:
        assert next(csv.DictReader(stream))['remarks_remark'] == NASTY
    assert table(studied.folder, 'answers').filter(
        participant='P01', question='remark')['text'].to_list() == [NASTY, NASTY]
    assert polars.read_csv(data / 'trials.csv')['remarks_remark'][0] == NASTY
    seen = table(studied.folder, 'answers').filter(question='seen')['text'][0]
    assert json.loads(seen) == ['car', 'sign']


def test_pandas_reads_the_same(studied: Studied) -> None:
    """The path alone is enough."""
    data = studied.folder / 'data'
    trials = table(studied.folder, 'trials')
    for frame in (pandas.read_csv(data / 'trials.csv'),
                  pandas.read_parquet(data / 'trials.parquet')):
        assert frame.columns.tolist() == trials.columns and len(frame) == trials.height
        assert frame['remarks_remark'][0] == NASTY
        assert frame['mean_speed_m_per_s'].tolist() == pytest.approx(
            trials['mean_speed_m_per_s'].to_list(), rel=1e-15)
        assert frame['problem'].isna().all()
    runs = pandas.read_parquet(data / 'runs' / 'vehicles.parquet')
    assert set(runs['participant']) == {'P01', 'P02', 'P03'}


def test_r_reads_the_same(studied: Studied, tmp_path: Path) -> None:
    rscript = shutil.which('Rscript')
    if rscript is None:
        pytest.skip('Rscript is not installed')
    (tmp_path / 'read.R').write_text(RSCRIPT)
    done = subprocess.run([rscript, '--vanilla', tmp_path / 'read.R',
                           studied.folder / 'data' / 'trials.csv', tmp_path / 'out'],
                          capture_output=True,
                          env={'LC_ALL': 'C.UTF-8', 'PATH': '/usr/bin:/bin'})
    assert done.returncode == 0, done.stderr.decode()
    text, _, numbers = (tmp_path / 'out').read_bytes().decode().rpartition('|')
    trials = table(studied.folder, 'trials')
    # R reads every end of a line as one.
    assert text == NASTY.replace('\r\n', '\n')
    rows, columns, mean = numbers.split()
    assert (int(rows), int(columns)) == trials.shape
    assert float(mean) == pytest.approx(trials['mean_speed_m_per_s'].mean(), rel=1e-12)


def unescaped(cell: str) -> str:
    """Undo the escapes that the sidecar declares."""
    marks = {'\\': '\\', 't': '\t', 'n': '\n', 'r': '\r', '/': '/'}
    parts = iter(cell)
    return ''.join(marks[next(parts)] if each == '\\' else each for each in parts)


def test_bids_files_hold_what_happened(studied: Studied) -> None:
    bids = studied.folder / 'data' / 'bids'
    assert {'Name', 'BIDSVersion'} <= json.loads(
        (bids / 'dataset_description.json').read_text()).keys()
    events = bids / 'sub-P03' / 'beh' / 'sub-P03_task-demo_events.tsv'
    lines = events.read_text('utf-8').split('\n')
    assert lines.pop() == '' and {line.count('\t') for line in lines} == {
        len(lines[0].split('\t')) - 1}
    rows = list(csv.DictReader(lines, dialect='excel-tab'))
    assert json.loads(events.with_suffix('.json').read_text('utf-8')).keys() == {
        'TaskName', 'TaskDescription', 'StimulusPresentation', *rows[0]}
    trials = [(row['trial'], row['attempt'], row['name'], row['duration'])
              for row in rows if row['trial_type'] == 'trial']
    assert trials == [('1', '1', 'aborted', '2.5'), ('1', '2', 'time', '1.25'),
                      ('1', '3', 'time', '1.25'), ('2', '1', 'time', '1.25')]
    assert [float(row['onset']) for row in rows] == sorted(float(row['onset']) for row in rows)
    people = list(csv.DictReader((bids / 'participants.tsv').read_text('utf-8').splitlines(),
                                 dialect='excel-tab'))
    assert [row['participant_id'] for row in people] == ['sub-P01', 'sub-P02', 'sub-P03',
                                                         'sub-P04']
    assert people[3]['after_ssq_total_score'] == 'n/a'
    for text in (NASTY, 'n/a', '\\n', '\t\r\n"'):
        assert '\t' not in escaped(text) and '\n' not in escaped(text)
        assert unescaped(escaped(text)) == text and escaped(text) != 'n/a'


def test_instruments_are_in_bids_as_it_has_them(studied: Studied) -> None:
    """A steady stream is a physiological recording with a gap, texts are events; one zero."""
    folder = studied.folder / 'data' / 'bids' / 'sub-P01' / 'beh'
    name = 'sub-P01_task-demo_run-2_recording-Heart_physio'
    told = json.loads((folder / f'{name}.json').read_text('utf-8'))
    assert told['Columns'] == ['lead,1', 'lead 2'] and told['lead,1'] == {
        'Description': 'channel lead,1 of Heart', 'Units': 'mV'}
    assert told['SamplingFrequency'] == 50.0
    with gzip.open(folder / f'{name}.tsv.gz', 'rt') as stream:
        rows = [line.rstrip('\n').split('\t') for line in stream]
    # From 0.2 s before the run on, 50 a second, n/a where none is near.
    assert len(rows) == 70 and rows[40] == ['n/a', 'n/a']
    values = np.array([math.nan if row[0] == 'n/a' else float(row[0]) for row in rows])
    assert np.nanmax(np.abs(values - (np.arange(70) / 50.0 - 0.2))) < 0.021
    events = list(csv.DictReader((folder / 'sub-P01_task-demo_events.tsv').read_text(
        'utf-8').split('\n')[:-1], dialect='excel-tab'))
    notes = [row for row in events if row['trial_type'] == 'instrument' and row['trial'] == '2']
    assert [(row['name'], row['value']) for row in notes] == [
        ('Notes', 'now'), ('Notes', 'n/a'), ('Notes', escaped('=then\t"'))]
    begun_s = float(notes[0]['onset']) - float(notes[0]['run_time'])
    assert told['StartTime'] == pytest.approx(begun_s - 0.2, abs=1e-4)
    assert [float(row['onset']) for row in events] == sorted(float(row['onset']) for row in events)
    runs = polars.read_parquet(studied.folder / 'data' / 'runs' / 'instrument_channels.parquet')
    assert sorted(runs.select('participant', 'trial').unique().rows()) == ROWS


def test_every_file_is_valid(studied: Studied, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['validate', str(studied.folder)]) == 0
    told = capsys.readouterr().out
    for what in ('study.yaml: study', 'remarks.yaml: questionnaire', 'P04/journal.jsonl: journal',
                 'run_4/bag: recording', 'data: 8 tables', f'data/runs: {len(TABLES)} tables'):
        assert what in told


def test_a_spoilt_journal_is_not_valid(copied: Path, capsys: pytest.CaptureFixture[str]) -> None:
    journal = copied / 'participants' / 'P04' / JOURNAL
    with journal.open('a') as stream:
        stream.write('{"entry": "note", "at": "noon"}\n{"entry": "no')
    assert main(['validate', str(journal)]) == 2
    told = capsys.readouterr().err
    assert 'line 7 cannot be read as an entry' in told and 'was cut off' in told


def test_long_tables_say_whose_they_are(studied: Studied) -> None:
    states = polars.read_parquet(studied.folder / 'data' / 'runs' / 'states.parquet')
    assert sorted(states.select('participant', 'trial').unique().rows()) == ROWS
    trials = table(studied.folder, 'trials')
    for row in states.select('participant', 'trial', 'condition', 'run').unique().iter_rows(
            named=True):
        trial = trials.filter(participant=row['participant'], trial=row['trial'])
        assert (trial['condition'][0], trial['run'][0]) == (row['condition'], row['run'])


def test_the_dictionary_names_every_column(studied: Studied) -> None:
    data = studied.folder / 'data'
    resources = {resource['path']: resource for resource in json.loads(
        (data / 'datapackage.json').read_text('utf-8'))['resources']}
    for name in ('trials', 'participants', 'answers', 'events'):
        with (data / f'{name}.csv').open(encoding='utf-8', newline='') as stream:
            head = next(csv.reader(stream))
        fields = resources[f'{name}.csv']['schema']['fields']
        assert [field['name'] for field in fields] == head
        assert all(field['description'] for field in fields)
    fields = {field['name']: field for field in resources['trials.csv']['schema']['fields']}
    assert fields['worst_ttc_s']['unit'] == 's'
    assert fields['drive_jerk_sd_m_per_s3']['unit'] == 'm/s^3'
    source = json.loads((data / 'provenance.json').read_text('utf-8'))
    assert source['files']['study/study.yaml'] == hashlib.sha256(
        (studied.folder / 'study' / 'study.yaml').read_bytes()).hexdigest()
    assert 'Kennedy' in json.dumps(source['questionnaires'])
    (used,) = source['sessions_run_by']['P01']
    assert used == {'crgame_ros': '9.8', 'commit': 'abc'}
    assert source['data_written_by']['crgame_ros'] == __version__


def test_twice_gives_the_same_and_measures_nothing_again(copied: Path) -> None:
    """What does not count any more is not in BIDS either; what somebody put there stays."""
    bids = copied / 'data' / 'bids'
    for own in (bids / 'CHANGES', bids / 'sub-P01' / 'eeg' / 'sub-P01_task-demo_eeg.edf'):
        own.parent.mkdir(exist_ok=True)
        own.touch()
    before = digests(copied)
    for name in ('P01', 'P09'):
        old = bids / f'sub-{name}/beh/sub-{name}_task-demo_run-9_recording-x_physio.json'
        old.parent.mkdir(parents=True, exist_ok=True)
        old.touch()
    kept = {path: path.stat().st_mtime_ns for path in (copied / 'data' / '.runs').rglob('*')}
    assert len({path.parent for path in kept if path.is_file()}) == len(ROWS)
    assert main(['study', 'data', str(copied), '--bids']) == 0
    assert digests(copied) == before and not (bids / 'sub-P09').exists()
    assert {path: path.stat().st_mtime_ns
            for path in (copied / 'data' / '.runs').rglob('*')} == kept


@pytest.mark.exhaustive
def test_killed_it_leaves_whole_files(copied: Path) -> None:
    before = digests(copied / 'data')
    shutil.rmtree(copied / 'data' / 'runs')
    rng = random.Random(5)
    command = [sys.executable, '-m', 'crgame_ros.cli', 'study', 'data', str(copied), '--bids']
    for _ in range(4):
        # The measured data is there: the process dies while files are written.
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        package = copied / 'data' / 'datapackage.json'
        package.touch()
        began = package.stat().st_mtime_ns
        while process.poll() is None and package.stat().st_mtime_ns == began:
            time.sleep(0.002)
        time.sleep(rng.uniform(0.0, 0.05))
        process.kill()
        process.wait()
        for path in (copied / 'data').rglob('[!.]*.parquet'):
            polars.read_parquet(path)
        for path in (copied / 'data').rglob('[!.]*.json'):
            json.loads(path.read_text('utf-8'))
        for name in ('trials', 'answers'):
            file = copied / 'data' / f'{name}.csv'
            assert hashlib.sha256(file.read_bytes()).hexdigest() == before[f'{name}.csv']
    assert main(['study', 'data', str(copied), '--bids']) == 0
    assert digests(copied / 'data') == before


def test_what_a_killed_recorder_has_left_is_finished(copied: Path) -> None:
    run = copied / 'participants' / 'P02' / 'runs' / '1'
    (run / FINISHED_MARK).unlink()
    (run / 'bag' / 'metadata.yaml').unlink()
    recording = next((run / 'bag').glob('*.mcap'))
    with recording.open('r+b') as stream:
        stream.truncate(recording.stat().st_size * 6 // 10)
    # Not while the session goes on: its recorder may be at work.
    with SessionJournal(copied / 'participants' / 'P02'):
        assert main(['study', 'data', str(copied)]) == 0
    row = table(copied, 'trials').filter(participant='P02', trial=1).row(0, named=True)
    assert row['problem'] == 'the recording is not finished yet'
    assert row['mean_speed_m_per_s'] is None and row['acceptance_usefulness'] is not None
    assert main(['study', 'data', str(copied)]) == 0
    row = table(copied, 'trials').filter(participant='P02', trial=1).row(0, named=True)
    assert row['problem'] is None and 0.5 < row['duration_s'] < DURATION_S
    assert (run / FINISHED_MARK).exists() and list(run.glob('*.xml'))
    assert row['scenario'].endswith('.xml') and (copied / row['scenario']).is_file()


@pytest.mark.matrix('run.json-empty', 'vehicles.parquet-zeros', 'files.sha256-gone')
@pytest.mark.parametrize('spoil', [
    lambda path: path.write_bytes(b''), lambda path: path.unlink(),
    lambda path: path.write_bytes(path.read_bytes()[:-30] + bytes(30))],
    ids=['empty', 'gone', 'zeros'])
@pytest.mark.parametrize('name', ['run.json', 'vehicles.parquet', 'files.sha256'])
def test_a_damaged_cache_is_made_anew(copied: Path, name: str,
                                      spoil: Callable[[Path], object]) -> None:
    before = digests(copied / 'data')
    spoil(sorted((copied / 'data' / '.runs').glob(f'*/{name}'))[0])
    assert main(['study', 'data', str(copied)]) == 0
    assert digests(copied / 'data') == before


@pytest.mark.parametrize('line', [
    '{"entry": "finished", "at": 1e9}', '{"entry": "skipped", "at": 1e9, "item": 7}',
    '{"entry": "repeated", "at": 1e400, "item": "x"}', '[]', '{"entry": "started", "at": 1}',
    '{"entry": "finished", "at": 1, "item": "x", "attempt": "1"}', '{"entry": "held", "at": 1}',
    '{"entry": "finished", "at": 1, "item": "main/1", "outcome": true}',
    '{"entry": "finished", "at": 1, "item": "main/1", "contacts": 1e999}',
    '{"entry": "language", "at": 1, "language": ["de"]}'])
def test_a_line_that_is_no_entry_is_passed_over(copied: Path, line: str) -> None:
    journal = copied / 'participants' / 'P01' / JOURNAL
    before = (copied / 'data' / 'trials.csv').read_bytes()
    with journal.open('a') as stream:
        stream.write(line + '\n')
    assert main(['study', 'data', str(copied)]) == 0
    assert (copied / 'data' / 'trials.csv').read_bytes() == before


def test_a_journal_that_is_a_folder_is_said_in_one_line(
        copied: Path, capsys: pytest.CaptureFixture[str]) -> None:
    journal = copied / 'participants' / 'P01' / JOURNAL
    journal.unlink()
    journal.mkdir()
    assert main(['study', 'data', str(copied)]) == 2
    assert f'{journal}: cannot be read' in capsys.readouterr().err


def test_what_cannot_be_measured_is_told(copied: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.rmtree(copied / 'participants' / 'P01' / 'runs' / '1' / 'bag')
    assert main(['study', 'data', str(copied)]) == 0
    assert 'P01, trial 1: the recording is missing' in capsys.readouterr().err
    trials = table(copied, 'trials')
    assert trials.height == len(ROWS) and math.isnan(
        trials['mean_speed_m_per_s'].fill_null(math.nan)[0])


def test_one_that_is_left_out_after_a_repeat_does_not_count(copied: Path) -> None:
    with SessionJournal(copied / 'participants' / 'P03') as journal:
        at = journal.entries[-1]['at']
        journal.add({'entry': 'repeated', 'item': 'main/2', 'reason': 'again', 'at': at + 1})
    assert main(['study', 'data', str(copied)]) == 0
    again = table(copied, 'trials').filter(participant='P03')
    assert again['to_repeat'].to_list() == [False, True]
    with SessionJournal(copied / 'participants' / 'P03') as journal:
        journal.add({'entry': 'skipped', 'item': 'main/2', 'reason': 'no time', 'at': at + 2})
    assert main(['study', 'data', str(copied)]) == 0
    assert table(copied, 'trials').filter(participant='P03')['trial'].to_list() == [1]


@pytest.mark.exhaustive
def test_people_drive_again_as_they_did(copied: Path) -> None:
    shutil.rmtree(copied / 'participants' / 'P02')
    # Both sessions' runs are called alike.
    shutil.rmtree(copied / 'participants' / 'P04')
    assert main(['study', 'rerun', str(copied), '--planner', 'reactive', '--workers', '1']) == 0
    found = polars.read_csv(copied / 'data' / 'rerun' / 'comparison' / 'comparison.csv',
                            null_values=['', 'NaN'])
    assert found.filter(vehicle='hv0').select('participant', 'trial').rows() == [
        ('P01', 1), ('P01', 2), ('P03', 1), ('P03', 2)]
    assert found['status'].unique().to_list() == ['ok']
    trials = table(copied, 'trials')
    for row in found.filter(vehicle='hv0').iter_rows(named=True):
        mine = trials.filter(participant=row['participant'], trial=row['trial'])
        for name in ('distance_m', 'max_speed_m_per_s', 'min_acceleration_m_per_s2'):
            assert row[f'recorded_{name}'] == mine[name][0]
            assert row[f'rerun_{name}'] == pytest.approx(mine[name][0], rel=1e-9)
    assert found.filter(role='autonomous')['rerun_distance_m'].n_unique() > 1
    rerun = copied / 'data' / 'rerun'
    assert main(['validate', str(rerun / 'comparison')]) == 0
    cells = polars.read_parquet(rerun / 'cells' / '*.parquet')
    assert cells.group_by('participant').len().sort('participant').rows() == [
        ('P01', 2), ('P03', 2)]
    # Of one scenario, it is the participants that vary by chance.
    assert [group.clustered for group in summarise(rerun).groups] == ['participants']


def test_no_study_is_said_in_one_line(tmp_path: Path,
                                      capsys: pytest.CaptureFixture[str]) -> None:
    for command in ('data', 'report'):
        assert main(['study', command, str(tmp_path / 'none')]) == 2
        assert capsys.readouterr().err.count('\n') == 1
