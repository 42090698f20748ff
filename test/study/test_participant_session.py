# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An ended session resumes at its place: no item is lost or repeated."""

from collections.abc import Iterator
import json
from pathlib import Path
import random
import resource
import subprocess
import sys
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.schema.reading import read
from crgame_ros.study.data.conducted_study import read_participant
from crgame_ros.study.data.session_tables import event_rows
from crgame_ros.study.file import Page, StudyFile
from crgame_ros.study.folder import StudyFolder
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.session_journal import JOURNAL, read_journal, SessionJournal
from crgame_ros.study.session_script import PracticeDrives
from crgame_ros.study.trial_plan import PlannedTrial
import pandas
import pytest
import yaml

STUDY = {
    'name': 'demo', 'seed': 3,
    'fields': [{'name': 'age', 'number': {'low': 18, 'high': 99, 'whole': True}}],
    'factors': [
        {'name': 'planner', 'levels': [{'name': 'a', 'planner': 'idm'},
                                       {'name': 'b', 'planner': 'reactive'}]},
        {'name': 'scene', 'levels': [{'name': 'x', 'game': 'x.yaml'},
                                     {'name': 'y', 'game': 'y.yaml'}]}],
    'before': [{'page': {'file': 'consent.md', 'consent': True}}],
    'blocks': [{'name': 'main', 'after_trial': [{'questions': 'van_der_laan'}],
                'practice': {'at_least': 2, 'at_most': 3}, 'break_every': 2}],
    'after': [{'questions': 'ssq'}]}
KILLED = """
import os, sys
sys.path.insert(0, sys.argv[2])
from test_participant_session import open_session, do_next
session = open_session(sys.argv[1])
for _ in range(int(sys.argv[3])):
    do_next(session)
# The power goes while a line is being written.
os.write(session.journal._file.fileno(), b'{"entry": "finis')
os.kill(os.getpid(), 9)
"""


@pytest.fixture
def session(tmp_path: Path) -> Iterator[ParticipantSession]:
    """Return a new session."""
    with open_session(tmp_path) as opened:
        yield opened


def open_session(folder: Path | str, place: int = 0, **changed: Any) -> ParticipantSession:
    """Open the session of a participant."""
    study = read(StudyFile, STUDY | changed, 'study')
    return ParticipantSession(study, Path(folder), 'P01', place)


def do_next(session: ParticipantSession) -> str:
    """Complete the next item as a participant; return its id."""
    item = session.next_item
    assert item is not None
    if isinstance(item.what, PracticeDrives):
        session.practised(False)
    elif isinstance(item.what, Page):
        session.finish(agreed=True)
    elif isinstance(item.what, PlannedTrial):
        session.start(run=f'trial-{item.what.number}')
        session.finish(outcome='ended')
    else:
        session.finish({question.name: 30 if question.name == 'age' else 3
                        for question in session.questions(item)})
    return item.id


def test_a_session_is_gone_through_in_order(session: ParticipantSession) -> None:
    done = []
    while session.next_item is not None:
        done.append(do_next(session))
    assert done == [
        'fields', 'before/1', 'main/practice', 'main/practice', 'main/practice',
        'main/1', 'main/1/after/1', 'main/2', 'main/2/after/1', 'main/2/break',
        'main/3', 'main/3/after/1', 'main/4', 'main/4/after/1', 'after/1']
    with pytest.raises(InputError, match='is over'):
        session.start()


@pytest.mark.slow
def test_after_any_kill_it_goes_on_at_the_right_item(tmp_path: Path) -> None:
    rng = random.Random(11)
    with open_session(tmp_path / 'whole') as whole:
        wanted = []
        while whole.next_item is not None:
            wanted.append(do_next(whole))
    killed = tmp_path / 'killed'
    left = len(wanted)
    while left:
        steps = min(left, rng.randint(1, 5))
        done = subprocess.run([sys.executable, '-c', KILLED, killed, Path(__file__).parent,
                               str(steps)], capture_output=True, text=True)
        assert done.returncode == -9, done.stderr
        left -= steps
    with open_session(killed) as last:
        assert last.next_item is None
        told = [{name: value for name, value in entry.items() if name != 'at'}
                for entry in last.journal.entries]
    assert told == [{name: value for name, value in entry.items() if name != 'at'}
                    for entry in read_journal(tmp_path / 'whole')]


def test_a_trial_that_did_not_finish_comes_again(tmp_path: Path) -> None:
    with open_session(tmp_path) as session:
        while not isinstance(session.next_item.what, PlannedTrial):
            do_next(session)
        assert session.start('first') == 1
    with open_session(tmp_path) as session:
        assert session.next_item.id == 'main/1' and session.start('second') == 2
        session.abort('the driver was ill')
        assert session.start('third') == 3
        session.finish(outcome='ended')
        assert session.next_item.id == 'main/1/after/1'


def test_the_experimenter_skips_repeats_and_ends(session: ParticipantSession) -> None:
    with pytest.raises(InputError, match='needs a reason'):
        session.skip(' ')
    session.skip('known from last year')
    assert session.next_item.id == 'before/1'
    with pytest.raises(InputError, match='needs consent'):
        session.finish()
    do_next(session)
    session.repeat('before/1', 'the wrong language')
    assert session.next_item.id == 'before/1'
    with pytest.raises(InputError, match='is not done'):
        session.repeat('main/1', 'why not')
    session.note('coffee\n<b>', trial=1)
    session.end('asked to stop')
    assert session.next_item is None


def test_practice_ends_when_it_is_good(session: ParticipantSession) -> None:
    do_next(session), do_next(session)
    assert not session.practised(True)
    assert session.practised(True) and session.next_item.id == 'main/1'


def test_practice_that_is_repeated_is_counted_anew(session: ParticipantSession) -> None:
    do_next(session), do_next(session)
    for _ in range(3):
        session.practised(False)
    assert session.journal.entries[-1]['criterion_met'] is False
    session.repeat('main/practice', 'was not ready')
    assert not session.practised(False) and not session.practised(False)
    assert session.practised(True)
    assert session.journal.entries[-1]['criterion_met'] is True
    assert session.journal.entries[-1]['drives'] == 3


def test_with_a_trial_come_its_questions_again(session: ParticipantSession) -> None:
    while do_next(session) != 'main/2/after/1':
        pass
    session.repeat('main/1', 'the telephone rang')
    assert [do_next(session) for _ in range(3)] == ['main/1', 'main/1/after/1', 'main/2/break']
    # A question that was not asked yet is asked once.
    do_next(session)
    session.repeat('main/3', 'again')
    assert [do_next(session) for _ in range(3)] == ['main/3', 'main/3/after/1', 'main/4']


def test_answers_that_cannot_be_taken_change_nothing(session: ParticipantSession) -> None:
    before = len(session.journal.entries)
    with pytest.raises(InputError, match='give a whole number from 18 to 99'):
        session.finish({'age': 7})
    assert len(session.journal.entries) == before and session.next_item.id == 'fields'


def test_a_participant_is_in_one_process_and_one_plan(tmp_path: Path) -> None:
    with open_session(tmp_path), pytest.raises(InputError, match='takes part already'):
        open_session(tmp_path)
    for changed in ({'place': 1}, {'after': []}):
        place = changed.pop('place', 0)
        with pytest.raises(InputError, match='began with another plan'):
            open_session(tmp_path, place, **changed)
    open_session(tmp_path).journal.close()


def test_what_was_said_comes_back_as_it_was(tmp_path: Path) -> None:
    text = '<script>"it\'s"</script>,\n\r\t\u2028😀' + 'ä' * 10_000
    with SessionJournal(tmp_path) as journal:
        journal.add({'entry': 'note', 'at': 1.0, 'text': text})
    assert read_journal(tmp_path)[0]['text'] == text
    with (tmp_path / JOURNAL).open('ab') as file:
        later = json.dumps({'entry': 'note', 'at': 2.0, 'text': 'x'})
        file.write(b'not json\n' + later.encode() + b'\n[')
    assert [entry['text'] for entry in read_journal(tmp_path)] == [text, 'x']
    with SessionJournal(tmp_path) as journal:
        assert [entry['text'] for entry in journal.entries] == [text, 'x']
        journal.add({'entry': 'note', 'at': 3.0, 'text': 'y'})
    assert [entry['text'] for entry in read_journal(tmp_path)] == [text, 'x', 'y']


def test_a_note_after_a_killed_program_is_of_no_drive(tmp_path: Path) -> None:
    for text in ('during', 'after'):
        with open_session(tmp_path / 'P01') as session:
            session.note_software({})
            while not isinstance(session.next_item.what, PlannedTrial):
                do_next(session)
            if text == 'during':
                session.start('runs/1')
            session.note(text)
    record = read_participant(read(StudyFile, STUDY, 'study'), tmp_path / 'P01')
    assert record is not None
    assert [(row['text'], row.get('trial')) for row in event_rows(record, {})
            if row['kind'] == 'note'] == [('during', 1), ('after', None)]


def test_nothing_of_a_refused_entry_stays(tmp_path: Path) -> None:
    """It would be written later, or be glued to the next one."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    with SessionJournal(tmp_path) as journal:
        journal.add({'entry': 'note', 'at': 1.0, 'text': 'a'})
        resource.setrlimit(resource.RLIMIT_FSIZE, (journal.path.stat().st_size + 20, limits[1]))
        try:
            with pytest.raises(InputError, match='cannot be written'):
                journal.add({'entry': 'note', 'at': 2.0, 'text': 'b' * 100})
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        journal.add({'entry': 'note', 'at': 3.0, 'text': 'c'})
        assert [entry['text'] for entry in journal.entries] == ['a', 'c']
    assert [entry['text'] for entry in read_journal(tmp_path)] == ['a', 'c']
    assert len((tmp_path / JOURNAL).read_bytes().splitlines()) == 2


@pytest.mark.parametrize('name', ['007', '1e5', '1E5', '0x1f', '2026-01-02', 'NA', 'nan', 'null',
                                  'TRUE', 'T', 'no', 'inf', 'MAR1', 'Dec-5', 'sept2026'])
def test_ids_that_readers_change_are_refused_for_new_participants(tmp_path: Path,
                                                                  name: str) -> None:
    with pytest.raises(InputError, match=f'put a letter before it, such as P{name}'):
        StudyFolder(tmp_path).begin(name)
    with ParticipantSession(read(StudyFile, STUDY, 'study'), tmp_path / 'participants' / name,
                            name, 0):
        # One who has begun goes on.
        StudyFolder(tmp_path).begin(name)


def test_other_ids_are_the_same_in_every_reader(tmp_path: Path) -> None:
    names = ['P07', 'p-1', 'Marie', 'E5', 'March', 'NA1', 'VP_003', 'ab12']
    for name in names:
        StudyFolder(tmp_path).begin(name)
    (tmp_path / 'ids.csv').write_text('\n'.join(['id', *names]))
    assert pandas.read_csv(tmp_path / 'ids.csv')['id'].tolist() == names
    assert yaml.safe_load('[' + ', '.join(names) + ']') == names
