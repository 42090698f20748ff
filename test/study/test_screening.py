# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""People who do not fit, or do not attend, are excluded kindly, kept apart and replaced."""

from collections.abc import Mapping
import json
from pathlib import Path
import sys
from typing import Any

from crgame_ros.cli import main
from crgame_ros.errors import InputError
from crgame_ros.recording.run_folder import STUDY_FILE
from crgame_ros.study.data.conducted_study import ConductedStudy
from crgame_ros.study.data.study_data import read_study_data, StudyData
from crgame_ros.study.data.study_report import participant_flow, study_html
from crgame_ros.study.desk.desk import Desk
from crgame_ros.study.desk.participant_document import experimenter_document, participant_document
from crgame_ros.study.file import load_study, Page, StudyFile
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.session_journal import JOURNAL, read_journal
from crgame_ros.study.trial_plan import PlannedTrial
import pytest
import yaml

sys.path.insert(0, str(Path(__file__).parent))

from desk_support import DrivesWithoutGraph  # noqa: E402, I100

SCALE: dict[str, Any] = {
    'name': 'health', 'shuffle': True, 'questions': [
        {'name': 'epilepsy', 'choice': {'choices': {'yes': 'Yes', 'no': 'No'}}},
        {'name': 'seizures', 'number': {'low': 0}, 'when': {
            'question': 'epilepsy', 'equals': 'yes'}},
        {'name': 'glasses', 'choice': {'choices': {'yes': 'Yes', 'no': 'No'}}},
        {'name': 'driving', 'likert': {}, 'when': {'field': 'licence', 'equals': 'yes'}},
        {'name': 'choose_four', 'likert': {}, 'expect': 4}]}
STUDY: dict[str, Any] = {
    'name': 'screened', 'seed': 2, 'language': 'en', 'languages': ['en', 'de'],
    'participants': 4, 'settings': {'game': 'x.yaml'}, 'fields': [
        {'name': 'age', 'number': {'low': 0, 'high': 99, 'whole': True}},
        {'name': 'licence', 'choice': {'choices': {'yes': 'Yes', 'no': 'No'}}}],
    'groups': {'name': 'display', 'levels': [{'name': 'bars'}, {'name': 'lights'}]},
    'exclude': [
        {'when': {'field': 'age', 'below': 18}, 'page': 'too_young.md', 'reason': 'under age'},
        {'when': {'questionnaire': 'health', 'question': 'epilepsy', 'equals': 'yes'}},
        {'attention_failed': 2}],
    'before': [{'page': {'file': 'consent.md', 'consent': True}}, {'questions': 'health.yaml'}],
    'blocks': [{'name': 'main', 'repetitions': 2, 'after_trial': [{'questions': 'health.yaml'}]}]}
PERSON = {'age': 40, 'licence': 'yes'}
HEALTHY = {'epilepsy': 'no', 'glasses': 'no', 'driving': 3, 'choose_four': 4}


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Return the folder of a study that people take part in."""
    folder = (tmp_path / STUDY_FILE).parent
    folder.mkdir()
    for name, text in (
            (STUDY_FILE.name, yaml.safe_dump(STUDY)), ('health.yaml', yaml.safe_dump(SCALE)),
            ('consent.md', 'Do you agree?\n'), ('too_young.md', '# Thank you\n'),
            ('too_young.de.md', '# Danke\n'), ('consent.de.md', 'Stimmen Sie zu?\n')):
        (folder / name).write_text(text, 'utf-8')
    return tmp_path


def study_in(root: Path) -> StudyFile:
    """Return the study of a folder."""
    return load_study(root / STUDY_FILE)


def opened(root: Path, name: str) -> ParticipantSession:
    """Open the session of a participant."""
    return ParticipantSession(study_in(root), root / 'participants' / name, name)


def answer(session: ParticipantSession, *given: Mapping[str, Any], agreed: bool = True) -> None:
    """Go through a session, with answers for as long as there are some."""
    left = list(given)
    while (item := session.next_item) is not None:
        if isinstance(item.what, Page):
            if not agreed:
                session.end('consent was not given')
                return
            session.finish(agreed=True)
        elif isinstance(item.what, PlannedTrial):
            session.start()
            session.finish(outcome='time')
        elif left:
            session.finish(left.pop(0))
        else:
            return


def data_of(root: Path) -> StudyData:
    """Read the data of the study."""
    return read_study_data(ConductedStudy(root), lambda _: None)


def rows(data: StudyData, table: str) -> list[dict[str, Any]]:
    """Return the rows of a table."""
    found: list[dict[str, Any]] = data.tables[table].to_pylist()
    return found


def test_a_field_excludes_before_a_group_is_drawn(root: Path) -> None:
    with opened(root, 'P1') as session:
        answer(session, PERSON | {'age': 17})
        assert session.next_item is None and session.allocation is None
        desk = Desk(session, DrivesWithoutGraph(session))
        shown = participant_document(desk)
        assert (shown['show'], shown['how']) == ('over', 'excluded')
        assert 'Thank you' in json.dumps(shown['tree'])
        session.choose_language('de')
        assert 'Danke' in json.dumps(participant_document(desk)['tree'])
        assert experimenter_document(desk, {})['over'] == 'excluded'
        with pytest.raises(InputError, match='is over'):
            session.finish()
    entry = read_journal(root / 'participants' / 'P1')[-2]
    assert (entry['entry'], entry['item'], entry['reason']) == ('excluded', 'fields', 'under age')
    with opened(root, 'P1') as session:
        assert session.next_item is None
    with opened(root, 'P2') as session:
        assert session.place == 0


def test_a_kill_before_the_exclusion_is_noted_changes_nothing(root: Path) -> None:
    with opened(root, 'P1') as session:
        answer(session, PERSON | {'age': 17})
    journal = root / 'participants' / 'P1' / JOURNAL
    lines = journal.read_text().splitlines(keepends=True)
    journal.write_text(''.join(lines[:-1]) + lines[-1][:20])
    with opened(root, 'P1') as session:
        assert session.next_item is None
        assert session.journal.entries[-1]['reason'] == 'under age'


def test_a_question_excludes_and_a_condition_holds_by_its_answer(root: Path) -> None:
    with opened(root, 'P1') as session:
        answer(session, PERSON)
        with pytest.raises(InputError, match='seizures'):
            session.finish(HEALTHY | {'epilepsy': 'yes'})
        session.finish(HEALTHY | {'epilepsy': 'yes', 'seizures': 2})
        assert session.next_item is None
        assert session.journal.entries[-1]['reason'] == 'health.epilepsy is yes'


def test_failed_attention_checks_exclude_and_take_the_trials_along(root: Path) -> None:
    with opened(root, 'P1') as session:
        answer(session, PERSON, HEALTHY | {'choose_four': 5}, HEALTHY)
        assert session.next_item is not None
        assert session.allocation is not None
        allocation = session.allocation
        answer(session, HEALTHY | {'choose_four': None} | {'choose_four': 1})
        assert session.next_item is None
    with opened(root, 'P2') as session:
        # The group and its place are free again.
        answer(session, PERSON, HEALTHY, HEALTHY, HEALTHY | {'choose_four': 2})
        assert session.allocation == allocation
    data = data_of(root)
    assert {row['participant'] for row in rows(data, 'trials')} == {'P2'}
    assert {row['display'] for row in rows(data, 'trials')} == {allocation.group}
    people = {row['participant']: row for row in rows(data, 'participants')}
    assert people['P1'] | {
        'excluded': True, 'excluded_reason': '2 attention checks failed', 'attention_failed': 2,
        'excluded_at': 'main/2/after/1', 'trials': 0, 'complete': False} == people['P1']
    assert people['P2'] | {'excluded': False, 'excluded_reason': None, 'attention_failed': 1,
                           'place_in_group': 1, 'complete': True} == people['P2']


def test_questions_that_were_not_asked_are_told_apart(root: Path) -> None:
    with opened(root, 'P1') as session:
        # An answer that was given before its question was hidden is not kept.
        answer(session, PERSON | {'licence': 'no'}, HEALTHY | {'seizures': 3})
        given = next(entry for entry in session.journal.entries if 'asked' in entry)
        assert given['answers'] == {'epilepsy': 'no', 'seizures': None, 'glasses': 'no',
                                    'driving': None, 'choose_four': 4}
    found = {row['question']: row for row in rows(data_of(root), 'answers')
             if row['questionnaire'] == 'health'}
    positions = {name: row['position'] for name, row in found.items()}
    assert positions['seizures'] is None and positions['driving'] is None
    assert sorted(place for place in positions.values() if place) == [1, 2, 3]
    # As in the journal, which has the order that was shown.
    assert [name for name, place in sorted(positions.items(), key=lambda each: each[1] or 9)
            if place] == given['asked']


def test_questions_are_shuffled_for_each_person_and_time(root: Path) -> None:
    orders = []
    for name in ('P1', 'P2', 'P3', 'P4', 'P5', 'P6'):
        with opened(root, name) as session:
            answer(session, PERSON)
            item = session.next_item
            assert item is not None
            names = [question.name for question in session.questions(item)]
            assert names == [question.name for question in session.questions(item)]
            # A question stays behind the one that it depends on.
            assert names.index('seizures') == names.index('epilepsy') + 1
            assert sorted(names) == sorted(each['name'] for each in SCALE['questions'])
            session.finish(HEALTHY)
            session.repeat(item.id, 'a slip')
            orders += [tuple(names), tuple(each.name for each in session.questions(item))]
    assert len(set(orders)) > 6


def test_the_report_has_the_flow_of_participants(root: Path) -> None:
    with opened(root, 'P1') as session:
        answer(session, PERSON | {'age': 17})
    with opened(root, 'P2') as session:
        answer(session, PERSON, agreed=False)
    for name in ('P3', 'P4'):
        with opened(root, name) as session:
            answer(session, PERSON, HEALTHY, HEALTHY, HEALTHY)
    with opened(root, 'P5') as session:
        answer(session, PERSON, HEALTHY)
        session.end('felt sick')
    with opened(root, 'P6') as session:
        answer(session, PERSON, HEALTHY)
        gone = session.allocation
    assert gone is not None
    assert main(['study', 'withdraw', str(root), '--participant', 'P6', '--yes']) == 0
    data = data_of(root)
    flow = dict(participant_flow(data))
    told = {words: sum(counts.values()) for words, counts in flow.items()}
    assert told == {'began': 6, 'excluded': 1, 'excluded: under age': 1,
                    'did not give consent': 1, 'session ended early': 1,
                    'withdrew, data deleted': 1, 'under way': 0, 'completed': 2}
    assert flow['excluded'] == {'': 1} and flow['completed'].keys() <= {'bars', 'lights'}
    assert flow['withdrew, data deleted'] == {gone.group: 1}
    html = study_html(data)
    assert 'Flow of participants' in html and 'randomly permuted blocks of 4' in html


@pytest.mark.parametrize(('rule', 'told'), [
    ({}, 'has not one of "when" and "attention_failed"'),
    ({'when': {'field': 'age'}}, 'tests nothing'),
    ({'when': {'field': 'height', 'below': 2}}, 'names the field "height"'),
    ({'when': {'question': 'epilepsy', 'equals': 'yes'}}, 'has a question of no questionnaire'),
    ({'when': {'field': 'age', 'question': 'x', 'below': 2}}, 'has not one of "question" and'),
    ({'attention_failed': 0}, 'attention_failed')])
def test_rules_without_sense_are_refused(root: Path, rule: dict[str, Any], told: str) -> None:
    (root / STUDY_FILE).write_text(yaml.safe_dump(STUDY | {'exclude': [rule]}))
    with pytest.raises(InputError, match=told):
        study_in(root)
