# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A participant completes a study in a real browser despite killed processes."""

from collections import Counter
from collections.abc import Iterator
import csv
import math
from pathlib import Path
import shutil
import subprocess
import sys
from typing import Any

from crgame_ros.cli import main
from crgame_ros.paths import scenarios_directory
from crgame_ros.study.session_journal import read_journal
from personal_files import unlisted_files
import pytest
from study_people import study_session, StudySession
import yaml

pytestmark = pytest.mark.exhaustive

# Only in the first drive; the light comes twice.
TASKS = [
    {'name': 'light', 'detection_response': {'interval': [2.5, 2.6]}, 'when': {'time': 0}},
    {'name': 'radio', 'secondary_task': {'show': True}, 'label': 'Radio',
     'when': {'time': 1}, 'until': {'time': 3}}]
# In an AV that drives itself until the participant is asked; a light comes before.
HANDOVER = {'seat': 'av0', 'tasks': [
    TASKS[0], {'name': 'over', 'take_over': {'lead': 2.5}, 'when': {'time': 3.5}}]}
# Longer than a page may be gone [s].
DURATION_S = 6.0
PATIENCE_S = 240.0


@pytest.fixture(scope='module')
def conducted(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StudySession]:
    """Conduct four drives: a page, then the program is killed in the middle of one."""
    folder = tmp_path_factory.mktemp('study')
    game = str(scenarios_directory() / 'cut_in.yaml')
    (folder / 'study.yaml').write_text(yaml.safe_dump({
        'name': 'killed', 'settings': {'duration': DURATION_S, 'game': game, 'view': 'map'},
        'factors': [{'name': 'planner', 'levels': [
            {'name': 'idm', 'planner': 'idm', 'tasks': TASKS},
            {'name': 'steady', 'planner': 'constant-velocity'},
            {'name': 'over', **HANDOVER}, {'name': 'again', **HANDOVER}]}],
        'fields': [{'name': 'why', 'text': {}}],
        'blocks': [{'name': 'main', 'order': 'given',
                    'after_trial': [{'questions': 'van_der_laan'}]}]}))
    victims = ['page', 'study']
    with study_session(folder / 'study.yaml', folder / 'data', 'P01', 8340) as session:
        def each(shown: str) -> None:
            time_s = session.time_s() if shown == 'drive' and victims else None
            if time_s is not None and time_s > 0.5:
                session.mark(f'before the {victims[0]} is killed')
                session.kill(victims.pop(0))
        session.run(PATIENCE_S, each)
        yield session
    assert not victims


def test_every_file_is_among_those_with_personal_data(conducted: StudySession) -> None:
    """A withdrawal then leaves nothing of the only participant."""
    root = conducted.folder.parents[1]
    assert unlisted_files(root) == []
    copy = root.with_name('withdrawn')
    shutil.copytree(root, copy)
    assert main(['study', 'withdraw', str(copy), '--participant', 'P01', '--yes']) == 0
    assert not any((copy / 'participants').iterdir())
    assert not any('P01' in path.read_text('utf-8', 'replace')
                   for path in copy.rglob('*') if path.is_file())


def test_each_item_is_finished_once(conducted: StudySession) -> None:
    entries = conducted.entries
    finished = Counter(entry['item'] for entry in entries if entry['entry'] == 'finished')
    assert finished == dict.fromkeys(
        ('fields', *(f'main/{trial}{what}' for trial in range(1, 5) for what in ('', '/after/1'))),
        1)
    # A page that returns within two seconds continues its drive.
    assert sum(entry['entry'] == 'started' for entry in entries) in (5, 6)
    for entry in entries:
        if entry['entry'] == 'finished':
            assert entry['answers'].items() <= conducted.answers.items()
            assert entry.get('end_time_s', DURATION_S) == pytest.approx(DURATION_S)
    assert {entry['name'] for entry in entries if entry['entry'] == 'marker'} \
        <= {name for name, _ in conducted.marked}


def test_the_tables_hold_each_trial_once(conducted: StudySession) -> None:
    out = conducted.folder.parents[1]
    done = subprocess.run([sys.executable, '-m', 'crgame_ros.cli', 'study', 'data', str(out)],
                          capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stderr
    trials = table(out / 'data' / 'trials.csv')
    assert [(row['trial'], row['condition'], row['outcome']) for row in trials] == [
        ('1', 'idm', 'time'), ('2', 'steady', 'time'), ('3', 'over', 'time'),
        ('4', 'again', 'time')]
    assert [row['vehicle'] for row in trials] == ['hv0', 'hv0', 'av0', 'av0']
    for row in trials:
        assert 0.0 < float(row['link_delay_s']) < 1.0
        assert (out / row['report']).stat().st_size > 10_000
    for row in trials[:2]:
        assert 0.0 < float(row['input_delay_s']) < 2.0
    answers = {row['text'] for row in table(out / 'data' / 'answers.csv')
               if row['question'] == 'why'}
    assert answers == {conducted.answers['why']}
    assert '<b>' in conducted.answers['why']


def test_the_tables_tell_of_tasks_in_drives_that_count(conducted: StudySession) -> None:
    folder = conducted.folder.parents[1] / 'data'
    told = [row for row in table(folder / 'events.csv') if row['name'] in ('light', 'radio')
            and row['trial'] == '1']
    # It was begun several times, as the page and the program were killed during it.
    assert len({(row['trial'], row['attempt']) for row in told}) == 1
    assert [(row['kind'], row['time_s'], row['duration_s']) for row in told
            if row['name'] == 'radio'] == [('secondary_task_span', '1.0', '2.0')]
    lights = [row for row in told if row['kind'] == 'detection_response_stimulus']
    assert len(lights) == 2 and 2.5 <= float(lights[0]['time_s']) <= 2.61
    outcomes = [row['text'] for row in lights]
    assert {*outcomes} <= {'hit', 'premature', 'missed', 'open'}
    hits = [float(row['response_time_s']) for row in lights if row['text'] == 'hit']
    trials = table(folder / 'trials.csv')
    assert [float(row['detection_hit_rate']) for row in trials] == pytest.approx(
        [len(hits) / rated if (rated := len(hits) + outcomes.count('missed')) else math.nan,
         math.nan, *[float(row['detection_hit_rate']) for row in trials[2:]]], nan_ok=True)
    assert float(trials[0]['detection_response_mean_s']) == pytest.approx(
        sum(hits) / len(hits) if hits else math.nan, nan_ok=True)


def test_a_passenger_takes_the_av_over_on_request(conducted: StudySession) -> None:
    trials = table(conducted.folder.parents[1] / 'data' / 'trials.csv')[2:]
    for row in trials:
        # A drive begins with the planner in control, also after one that ended without it.
        assert (row['take_over_requests'], row['take_over_requests_taken']) == ('1', '1')
        assert 0.0 < float(row['take_over_first_input_mean_s']) < 4.0


def test_a_passenger_sees_the_lights_of_the_av(conducted: StudySession) -> None:
    """Before the request, and answering them takes nothing over."""
    folder = conducted.folder.parents[1] / 'data'
    for trial in ('3', '4'):
        light = next(row for row in table(folder / 'events.csv') if row['trial'] == trial
                     and row['kind'] == 'detection_response_stimulus')
        assert float(light['time_s']) < 3.0 and light['text'] in ('hit', 'premature', 'missed')


def test_a_drive_says_whether_its_data_hold(conducted: StudySession) -> None:
    """Every light was shown, and the page kept the focus, also while an AV drove itself."""
    folder = conducted.folder.parents[1] / 'data'
    for row, least in zip(table(folder / 'trials.csv'), (2, 0, 2, 2), strict=True):
        assert int(row['stimuli']) >= least
        assert (row['unseen_stimuli'], row['away_s'], row['device_changes']) == ('0', '0.0', '0')
        assert float(row['view_rate_hz']) > 0.0
        assert row['page_flag'] == ('TRUE' if row['page_reason'] else 'FALSE')


def test_a_finished_participant_is_not_asked_again(conducted: StudySession) -> None:
    before = len(read_journal(conducted.folder))
    done = subprocess.run(conducted.command, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0
    assert 'nothing is left' in done.stdout
    assert len(read_journal(conducted.folder)) == before


def table(path: Path) -> list[dict[str, Any]]:
    """Read a table."""
    with path.open(encoding='utf-8', newline='') as file:
        return list(csv.DictReader(file))
