# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Mistakes of a study are found before a session begins."""

import json
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from crgame_ros.cli import main
from crgame_ros.errors import InputError
from crgame_ros.game.task_spec import answer_key
from crgame_ros.paths import scenarios_directory
from crgame_ros.schema.reading import read
from crgame_ros.study.check import check_study, length_of
from crgame_ros.study.conduct.study_drive import StudyDrive, write_drive
from crgame_ros.study.file import load_study, StudyFile
from crgame_ros.study.session_script import drives_of, session_of
from crgame_ros.study.trial_game import trial_game
from crgame_ros.study.trial_plan import conditions_of, plan_trials
import pytest
import yaml

CUT_IN = str(scenarios_directory() / 'cut_in.yaml')
PLAIN: dict[str, Any] = {
    'name': 'demo', 'participants': 2, 'settings': {'game': CUT_IN, 'duration': 2},
    'factors': [{'name': 'planner', 'levels': [{'name': 'a', 'planner': 'idm'},
                                               {'name': 'b', 'planner': 'constant-velocity'}]}],
    'blocks': [{'name': 'main'}]}


def study_of(folder: Path, **changed: Any) -> StudyFile:
    """Make a study with changes to the plain one."""
    return read(StudyFile, PLAIN | changed, 'study', folder)


def told(study: StudyFile) -> str:
    """Return all findings."""
    return '\n'.join(f'{finding.kind}: {finding.text}' for finding in check_study(study))


def test_the_example_is_written_checked_and_planned(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / 'mine'
    assert main(['study', 'new', str(folder)]) == 0
    assert main(['study', 'check', str(folder / 'study.yaml'), '--participants', '1']) == 0
    out, err = capsys.readouterr()
    assert 'error' not in err and 'warning' not in err
    assert out.count('main') == 8 and 'min' in out
    assert main(['study', 'new', str(folder)]) == 2
    study = load_study(folder / 'study.yaml')
    length = length_of(study)
    # Eight drives and three practice drives of 20 s each; a break of 2 min and all other items.
    assert length.driving_s == 11 * 20.0 and length.else_s > 120.0


def test_groups_are_printed_and_conditions_on_answers_are_checked(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What nobody is asked can neither exclude anybody nor decide on a question."""
    fields = [{'name': 'age', 'number': {'low': 0, 'high': 99}}]
    scale = {'name': 'mine', 'questions': [
        {'name': 'often', 'likert': {'points': 5}, 'when': {'field': 'licence', 'equals': 1}},
        {'name': 'why', 'text': {}, 'when': {'question': 'often', 'equals': 6}}]}
    (tmp_path / 'mine.yaml').write_text(yaml.safe_dump(scale))
    grouped: dict[str, Any] = {
        'participants': 5, 'fields': fields, 'before': [{'questions': 'mine.yaml'}],
        'groups': {'name': 'display', 'levels': [{'name': 'bars'}, {'name': 'lights'}],
                   'strata': [{'field': 'age', 'cuts': [40]}]}}
    text = told(study_of(tmp_path, **grouped, exclude=[
        {'when': {'questionnaire': 'other', 'question': 'often', 'equals': 1}},
        {'when': {'questionnaire': 'mine', 'question': 'why', 'at_least': 1}},
        {'attention_failed': 1}]))
    for fault in ('error: mine: often: when: "licence" is asked nowhere',
                  'error: mine: why: when: 6 is no answer to "often"; give 1 to 5',
                  'error: exclude[0]: "often" is asked nowhere',
                  'error: exclude[1]: "why" has no numbers',
                  'error: exclude[2]: no question has an expected answer',
                  'warning: groups: 5 participants do not make 2 groups of equal size'):
        assert fault in text
    grouped['before'] = []
    file = tmp_path / 'study.yaml'
    file.write_text(yaml.safe_dump(PLAIN | grouped | {'participants': 4}))
    assert main(['study', 'check', str(file), '--participants', '2']) == 0
    out, err = capsys.readouterr()
    assert 'warning' not in err
    assert 'groups by display: randomly permuted blocks of 4, stratified by age' in out
    assert [line for line in out.splitlines() if line.endswith(':')] == [
        'bars, place 1:', 'bars, place 2:', 'lights, place 1:', 'lights, place 2:']


def test_settings_cascade(tmp_path: Path) -> None:
    study = study_of(
        tmp_path, settings={'game': CUT_IN, 'duration': 2, 'planner': 'idm', 'seed': 3,
                            'options': {'v0': 9.0}, 'view': 'chase'},
        factors=[{'name': 'planner', 'levels': [{'name': 'a', 'seed': 4},
                                                {'name': 'b', 'planner': 'reactive'}]}],
        blocks=[{'name': 'one', 'settings': {'duration': 1, 'map': True}}, {'name': 'two'}])
    a, b = (condition.settings for condition in conditions_of(study, study.blocks[0]))
    assert (a.planner, a.options, a.seed, a.duration, a.map, a.view) == (
        'idm', {'v0': 9.0}, 4, 1.0, True, 'chase')
    # Another planner does not accept the first one's options.
    assert (b.planner, b.options, b.seed) == ('reactive', None, 3)
    assert conditions_of(study, study.blocks[1])[0].settings.duration == 2.0
    game = trial_game(a, 'idle')
    assert game.avs is not None and {(spec.planner, spec.options['v0']) for spec in game.avs} == {
        ('idm', 9.0)}
    assert (game.duration, game.seed, game.humans[0].driver) == (1.0, 4, 'idle')


def test_labels_of_tasks_know_languages(tmp_path: Path) -> None:
    radio = {'name': 'radio', 'secondary_task': {'show': True}}
    study = study_of(
        tmp_path, blocks=[{'name': 'main', 'settings': {'labels': {'other': 'x'}}}],
        settings={'game': CUT_IN, 'duration': 2, 'tasks': [radio],
                  'labels': {'radio': {'en': 'Find a station', 'de': 'Sender suchen'}}})
    _, settings = next(drives_of(study))
    assert [settings.label_of('radio', language) for language in ('en', 'de', 'fr')] == [
        'Find a station', 'Sender suchen', 'Find a station']
    drive = StudyDrive(session_of(study, 0)[0], settings, ('hv0',), tmp_path)
    query = parse_qs(urlsplit(drive.link('http://127.0.0.1:1', 'hv0', 'de', 'k')).query)
    assert json.loads(query['labels'][0]) == {'radio': 'Sender suchen', 'other': 'x'}
    assert 'labels: other: no drive has this task' in told(study)
    with pytest.raises(InputError, match='labels: radio'):
        study_of(tmp_path, settings={'labels': {'radio': 7}})


def test_tasks_are_for_the_seat_of_the_participant(tmp_path: Path) -> None:
    """Who rides in an AV and has lights takes over by another key."""
    study = study_of(tmp_path, settings={'game': CUT_IN, 'duration': 2, 'seat': 'av0', 'tasks': [
        {'name': 'drt', 'detection_response': {}}, {'name': 'over', 'take_over': {}}]})
    tasks = trial_game(conditions_of(study, study.blocks[0])[0].settings, 'idle').tasks
    assert [(task.seat, answer_key(task, tasks)) for task in tasks] == [
        ('av0', 'Enter'), ('av0', 'KeyT')]
    assert answer_key(tasks[1], tasks[1:]) == 'Enter'


@pytest.mark.parametrize(('changed', 'message'), [
    ({'settings': {'duration': 2}}, 'names no game'),
    ({'settings': {'game': 'nowhere.yaml'}}, 'nowhere.yaml'),
    ({'settings': {'game': CUT_IN, 'seat': 'hv7'}}, 'has no human or AV "hv7"'),
    ({'settings': {'game': CUT_IN, 'duration': 2, 'seat': 'av0', 'tasks': [
        {'name': 'drt', 'seat': 'hv0', 'detection_response': {}}]}},
     'task drt is for hv0, and nobody who takes part sits there; name av0 as its "seat"'),
    ({'settings': {'game': CUT_IN, 'duration': 2, 'tasks': [
        {'name': 'drt', 'detection_response': {}}, {'name': 'over', 'take_over': {'key': 'Enter'}}
        ]}}, 'tasks drt and over: both are answered by Enter'),
    ({'settings': {'game': CUT_IN, 'duration': 2, 'planner': 'idm', 'options': {'x': 1}},
      'factors': [{'name': 'f', 'levels': [{'name': 'a'}, {'name': 'b'}]}]}, '"x" is unknown'),
    ({'settings': {'game': CUT_IN, 'duration': 2, 'confederate': 'hv0'}},
     'gives hv0 to a participant and the experimenter'),
    ({'before': [{'page': 'absent.md'}]}, 'there is no such page'),
    ({'after': [{'questions': 'tlx'}]}, 'there is no questionnaire "tlx"'),
    ({'blocks': [{'name': 'main', 'sequences': [['a', 'c']]}]}, 'names "c", which is no condit'),
    ({'settings': {'game': CUT_IN, 'duration': 2, 'perception': 'absent.yaml'}}, 'absent.yaml')])
def test_what_keeps_it_from_being_run_is_an_error(tmp_path: Path, changed: dict[str, Any],
                                                  message: str) -> None:
    found = told(study_of(tmp_path, **changed))
    assert message in found and 'error: ' in found


def test_an_unbalanced_design_is_a_warning(tmp_path: Path) -> None:
    assert told(study_of(tmp_path)) == ''
    assert 'take a multiple of 2 participants' in told(study_of(tmp_path, participants=3))
    found = told(study_of(tmp_path, blocks=[{'name': 'main', 'order': 'given'}]))
    assert 'warning: main' in found and 'error' not in found
    assert 'order: williams' in found


def test_texts_that_a_language_lacks_are_told(tmp_path: Path) -> None:
    (tmp_path / 'mine.yaml').write_text(yaml.safe_dump({
        'name': 'mine', 'questions': [{'name': 'a', 'ask': {'en': 'A?'}, 'text': {}}]}))
    study = study_of(tmp_path, after=[{'questions': 'mine.yaml'}], languages=['en', 'de'])
    assert 'warning: mine.yaml: has no texts in "de"' in told(study)


def test_a_scenario_alone_can_be_driven(tmp_path: Path) -> None:
    """A level may name a CommonRoad file, either alone or as the road of a game."""
    road = {'name': 'road', 'scenario': str(scenarios_directory() / 'ZAM_Merge-1_1_T-1.xml')}
    study = study_of(tmp_path, settings={'duration': 1}, factors=[{'name': 'scene', 'levels': [
        road, {'name': 'game', 'game': CUT_IN}]}], blocks=[{'name': 'main', 'practice': {}}])
    assert told(study) == ''
    first = trial_game(conditions_of(study, study.blocks[0])[0].settings, 'cockpit')
    assert first.scenario.name == 'ZAM_Merge-1_1_T-1.xml'
    assert [human.driver for human in first.humans] == ['cockpit']


def test_the_length_is_that_of_the_longest_group(tmp_path: Path) -> None:
    """Only the groups have a game, each of another duration."""
    study = study_of(tmp_path, settings={}, groups={'name': 'long', 'levels': [
        {'name': name, 'game': CUT_IN, 'duration': duration}
        for name, duration in (('no', 2), ('yes', 3))]})
    assert length_of(study).driving_s == 2 * 3.0


def test_what_would_stop_a_session_or_the_tables_is_told(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Also in a study that plans no comparison."""
    (tmp_path / 'mine.yaml').write_text(yaml.safe_dump({
        'name': 'own', 'questions': [{'name': 'contacts', 'text': {}}]}))
    (tmp_path / 'page.md').write_bytes(b'\xff')
    file = tmp_path / 'study.yaml'
    for changed, fault in (
            ({'blocks': [{'name': 'main', 'after_trial': [{'questions': 'mine.yaml'}]}]},
             'the column own_contacts is there already'),
            ({'before': [{'page': 'page.md'}]}, 'page.md: cannot be read')):
        file.write_text(yaml.safe_dump(PLAIN | changed))
        assert main(['study', 'check', str(file)]) == 2
        assert fault in capsys.readouterr().err


def test_a_drive_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / 'games').touch()
    with pytest.raises(InputError, match='games: cannot be made'):
        write_drive(session_of(study_of(tmp_path), 0)[0], tmp_path / 'games')


def test_a_sequence_is_taken_as_it_is(tmp_path: Path) -> None:
    study = study_of(tmp_path, blocks=[{'name': 'main', 'sequences': [list('aab'), list('bbb')]}])
    assert [[trial.condition.name for trial in plan_trials(study, place)]
            for place in range(3)] == [list('aab'), list('bbb'), list('aab')]


@pytest.mark.parametrize(('changed', 'message'), [
    ({'blocks': []}, 'give 1 to 50'), ({'blocks': [{'name': 'a', 'factors': ['x']}]}, '"x"'),
    ({'name': '../x'}, 'letters'), ({'before': [{'page': '/etc/x.md'}]}, 'beside this one'),
    ({'before': [{'page': 'a/../../x.md'}]}, 'beside this one'),
    ({'after': [{'questions': '../mine.yaml'}]}, 'beside this one'),
    ({'exclude': [{'attention_failed': 1, 'page': '../x.md'}]}, 'beside this one'),
    # Items of its trials would have the ids of steps.
    ({'blocks': [{'name': 'after'}]}, 'has the name of the steps around all blocks'),
    ({'blocks': [{'name': 'a', 'sequences': [[]]}]}, 'not equally long, or empty'),
    ({'blocks': [{'name': 'a', 'sequences': [['a', 'b'], ['a']]}]}, 'not equally long'),
    ({'factors': [{'name': 'f', 'levels': [{'name': 'a'}]}]}, 'give 2 to 50'),
    ({'blocks': [{'name': 'a', 'practice': {'at_least': 3, 'at_most': 2}}]}, 'at_most')])
def test_what_is_no_study_is_told(tmp_path: Path, changed: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        study_of(tmp_path, **changed)


def test_sequences_are_balanced_by_their_own_length(tmp_path: Path) -> None:
    """A sequence may name a condition several times: its pairs are those of the whole list."""
    def text(*sequences: list[str]) -> str:
        return told(study_of(tmp_path, blocks=[{'name': 'main', 'sequences': list(sequences)}]))

    assert 'follows every other' not in text(['a', 'b', 'b', 'a'], ['b', 'a', 'a', 'b']) \
        + text(['a', 'b', 'a'], ['b', 'a', 'b'])
    assert 'main: not every condition follows every other equally often' in text(
        ['a', 'b', 'b', 'a', 'a', 'b'], ['a', 'b', 'b', 'a', 'a', 'b'])
