# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Staircases settle where Levitt says, and follow from the journal alone."""

from collections.abc import Callable
import json
import math
from pathlib import Path
import random
import statistics
import sys
from typing import Any

from crgame_ros.cli import main
from crgame_ros.errors import InputError
from crgame_ros.schema.reading import read
from crgame_ros.study.analysis.mixed_model import model_formulas
from crgame_ros.study.analysis.planned_tests import used_rows
from crgame_ros.study.analysis.power import measure_models, planned_people, SimulatedTrials
from crgame_ros.study.check import check_study
from crgame_ros.study.data.conducted_study import ConductedStudy, read_participant
from crgame_ros.study.desk.desk import Desk
from crgame_ros.study.desk.participant_document import experimenter_document, participant_document
from crgame_ros.study.file import load_study, StudyFile
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.session_journal import JOURNAL
from crgame_ros.study.session_script import members_of, PracticeDrives, session_of
from crgame_ros.study.staircase import Staircase, StaircaseTrial, Track
from crgame_ros.study.trial_plan import PlannedTrial
from crgame_ros.study.trial_settings import Factor
import numpy as np
import polars
import pytest
import yaml

sys.path.insert(0, str(Path(__file__).parent))

from desk_support import DrivesWithoutGraph  # noqa: E402, I100

DRIVEN: dict[str, Any] = {'factor': 'gap', 'success': {'drive': 'contacts', 'equals': 0}}
# The psychometric function of the made observer, in levels: 1 / (1 + exp(SLOPE (level - MIDDLE))).
SLOPE, MIDDLE, LEVELS = 0.5, 12, 25


def track(levels: int, **keys: Any) -> Track:
    """Return a staircase that has not begun; its levels are numbered from 1 on."""
    factor = read(Factor, {'name': 'gap', 'levels': [
        {'name': f'{number + 1}'} for number in range(levels)]}, 'factor')
    return Track(read(Staircase, DRIVEN | keys, 'staircase'), factor)


def drive(going: Track, success: Callable[[int], bool | None]) -> list[int]:
    """Drive a staircase to its end; return the levels of its trials, from 0 on."""
    levels = []
    while going.end is None:
        levels.append(going.level)
        going.add(StaircaseTrial(len(levels), going.level, success(going.level), True))
    return levels


def chance(level: int) -> float:
    """Return the observer's probability of a success."""
    return 1.0 / (1.0 + math.exp(SLOPE * (level - MIDDLE)))


def settled(down: int, up: int) -> float:
    """Return the mean level of reversals of an endless track, from its Markov chain."""
    states = {state: number for number, state in enumerate(
        (level, streak, harder) for level in range(LEVELS) for streak in range(1 - up, down)
        for harder in (-1, 1))}
    moves, turns = np.zeros((len(states), len(states))), np.zeros(len(states))
    for (level, streak, before), here in states.items():
        for p, now in ((chance(level), max(streak, 0) + 1),
                       (1.0 - chance(level), min(streak, 0) - 1)):
            harder = (now == down) - (now == -up)
            if not harder:
                moves[here, states[level, now, before]] += p
            elif 0 <= level + harder < LEVELS:
                moves[here, states[level + harder, 0, harder]] += p
                turns[here] += p * (harder != before)
            else:
                moves[here, states[level, 0, before]] += p
    equations = np.vstack([moves.T - np.eye(len(states)), np.ones(len(states))])
    shares = np.linalg.lstsq(equations, np.eye(len(states) + 1)[-1], rcond=None)[0] * turns
    return float(shares @ [level for level, _, _ in states] / shares.sum())


@pytest.mark.parametrize(('rule', 'target'), [
    ('1-down 1-up', 0.5), ('2-down 1-up', 0.5 ** (1 / 2)), ('3-down 1-up', 0.5 ** (1 / 3)),
    ('1-down 2-up', 1.0 - 0.5 ** (1 / 2))])
def test_rules_settle_where_levitt_says(rule: str, target: float) -> None:
    """The chance of N successes in a row is a half there (Levitt 1971, table I)."""
    level = MIDDLE + math.log(1.0 / target - 1.0) / SLOPE
    # An endless track settles a little off this level, as its steps are not infinitely small.
    exact = settled(int(rule[0]), int(rule[-4]))
    assert exact == pytest.approx(level, abs=0.1)
    thresholds = []
    for seed in range(60):
        rng = random.Random(f'{rule} {seed}')
        going = track(LEVELS, rule=rule, start=f'{round(level) + 1}',
                      stop={'reversals': 60, 'at_most': 500})
        drive(going, lambda at, rng=rng: rng.random() < chance(at))
        found = going.threshold
        assert going.ended == 'reversals' and found is not None and found.reversals == 60
        thresholds.append(found.mean - 1.0)
    error = statistics.stdev(thresholds) / math.sqrt(len(thresholds))
    # A track of 60 reversals begins at the level itself: a chance of 0.2 % for each rule.
    assert statistics.fmean(thresholds) == pytest.approx(exact, abs=3.1 * error)
    assert error < 0.1


def test_a_track_is_that_of_the_rule_on_paper() -> None:
    """Two successes go down, a failure goes up; first steps are larger, the ends hold."""
    outcomes = iter([True, True, True, True, False, True, True, False, None, True, True, True,
                     True, False, True, True])
    going = track(6, first_steps=[2], stop={'reversals': 6, 'at_most': 40})
    assert drive(going, lambda _: next(outcomes)) == [
        0, 0, 2, 2, 4, 3, 3, 4, 3, 3, 3, 4, 4, 5, 4, 4]
    # Directions: + + - + - + + - +; the first reversal is that of the first step.
    assert [going.trials[index].place for index in going.reversals] == [5, 7, 8, 11, 14, 16]
    found = going.threshold
    # Of the five others the last four: levels 4, 3, 5 and 4 from 0 on.
    assert found is not None and found.reversals == 4
    assert found.mean == statistics.fmean([5, 4, 6, 5])
    assert found.sd == pytest.approx(math.sqrt(2.0 / 3.0))
    assert going.ended == 'reversals' and len(going.judged) == 15 and going.beyond == 0
    ends = track(2, rule='1-down 1-up', stop={'at_most': 5})
    assert drive(ends, lambda _: True) == [0, 1, 1, 1, 1]
    assert ends.beyond == 4 and ends.threshold is None and ends.ended == 'at_most'


STUDY: dict[str, Any] = {
    'name': 'gaps', 'seed': 4,
    'factors': [
        {'name': 'gap', 'levels': [{'name': f'g{number}', 'game': f'{number}.yaml'}
                                   for number in range(6, 0, -1)]},
        {'name': 'light', 'levels': [{'name': 'day'}, {'name': 'night', 'seed': 'each'}]}],
    'blocks': [
        {'name': 'steps', 'practice': {'at_least': 1}, 'break_every': 6,
         'after_trial': [{'questions': 'van_der_laan'}],
         'staircase': {'factor': 'gap', 'values': [6, 5, 4, 3, 2, 1],
                       'success': {'question': 'useful', 'at_least': 4},
                       'stop': {'reversals': 4, 'at_most': 20}}},
        {'name': 'last', 'factors': ['light'], 'order': 'given'}]}


def study_with(**staircase: Any) -> dict[str, Any]:
    """Return the study with other keys of its staircase."""
    first, last = STUDY['blocks']
    return STUDY | {'blocks': [first | {'staircase': first['staircase'] | staircase}, last]}


def session_in(folder: Path, study: dict[str, Any] = STUDY, place: int = 0) -> ParticipantSession:
    """Open the session of a participant."""
    return ParticipantSession(read(StudyFile, study, 'study'), folder, 'P01', place)


def answer_next(session: ParticipantSession, rng: random.Random,
                good: bool | None = None) -> PlannedTrial | None:
    """Do the next item; return its trial. Answers are those of an observer, unless given."""
    item = session.next_item
    assert item is not None
    trial = item.what if isinstance(item.what, PlannedTrial) else None
    if isinstance(item.what, PracticeDrives):
        session.practised(True)
    elif trial is not None:
        session.start(f'runs/{item.id}')
        session.finish(outcome='time', contacts=0)
    elif item.trial is not None:
        before = next(each.what for each in session.items
                      if isinstance(each.what, PlannedTrial) and each.what.number == item.trial)
        level = 'gap' in dict(before.condition.levels) and int(before.condition.name[1])
        seen = rng.random() < 1.0 / (1.0 + math.exp(3.5 - level)) if good is None else good
        session.finish({question.name: 5 if seen else 2 for question in session.questions(item)})
    else:
        session.finish()
    return trial


def present(session: ParticipantSession) -> tuple[str, str]:
    """Return the present item and its condition."""
    item = session.next_item
    if item is None:
        return '', ''
    return item.id, item.what.condition.name if isinstance(item.what, PlannedTrial) else ''


def test_after_any_entry_the_same_trial_comes_next(tmp_path: Path) -> None:
    rng = random.Random(5)
    wanted: list[tuple[str, str]] = []
    with session_in(tmp_path / 'whole') as session:
        wanted.append(present(session))
        add = session.journal.add

        def noted(entry: dict[str, object]) -> None:
            add(entry)
            wanted.append(present(session))

        session.journal.add = noted
        while session.next_item is not None:
            answer_next(session, rng)
            if present(session)[0] == 'steps/8':
                # A drive that begins and does not count changes nothing.
                session.start('runs/lost')
                session.abort('a phone rang')
            if present(session)[0] == 'steps/11' and session.attempts('steps/4') == 1:
                session.repeat('steps/4', 'a phone rang')
            if present(session)[0] == 'steps/13':
                session.skip('no time')
        planned = json.loads((tmp_path / 'whole' / JOURNAL).read_text().splitlines()[0])['items']
        ids = [item.id for item in session.items]
    # The longest session is what the journal notes, however many trials were needed.
    assert planned == [item.id for item in session_of(session.study, 0)]
    assert len(set(planned)) == len(planned) > len(ids)
    lines = (tmp_path / 'whole' / JOURNAL).read_bytes().splitlines(keepends=True)
    assert len(lines) == len(wanted)
    for count, what in enumerate(wanted, 1):
        folder = tmp_path / f'{count}'
        folder.mkdir()
        # The power goes while the next line is being written.
        (folder / JOURNAL).write_bytes(b''.join(lines[:count]) + b''.join(lines[count:])[:7])
        with session_in(folder) as again:
            assert present(again) == what
            assert len(again.journal.entries) == count
    assert {'steps/4', 'steps/12/break'} < {item for item, _ in wanted} and not wanted[-1][0]


def test_staircases_alternate_at_random_until_each_has_ended(tmp_path: Path) -> None:
    orders = []
    for place in (0, 0, 1):
        rng, conditions = random.Random(1), []
        with session_in(tmp_path / f'{len(orders)}', place=place) as session:
            while session.next_item is not None:
                trial = answer_next(session, rng)
                conditions += [] if trial is None else [trial]
            numbers = [trial.number for trial in conditions]
        orders.append([trial.condition.name for trial in conditions])
        stepped = [trial for trial in conditions if trial.block == 'steps']
        assert {trial.staircase for trial in stepped} == {'day', 'night'}
        assert all(trial.condition.name.endswith(str(trial.staircase)) for trial in stepped)
        # What comes after the staircases has the same numbers however long they were.
        assert numbers[-2:] == [41, 42] and len(stepped) < 40
        # Drives with a seed of their own have different ones.
        seeds = [trial.condition.settings.seed for trial in stepped if trial.staircase == 'night']
        assert len(set(seeds)) == len(seeds)
        names = [trial.staircase for trial in stepped[:8]]
        assert 1 < sum(a != b for a, b in zip(names, names[1:], strict=False)) < 8
    assert orders[0] == orders[1] != orders[2]


def test_a_repeat_replaces_an_answer_and_a_skip_counts_for_nothing(tmp_path: Path) -> None:
    single = STUDY | {'factors': STUDY['factors'][:1], 'blocks': STUDY['blocks'][:1]}
    rng = random.Random(0)

    def drive_one(session: ParticipantSession, good: bool) -> str:
        while not isinstance(session.next_item.what, PlannedTrial):
            answer_next(session, rng)
        name = present(session)[1]
        answer_next(session, rng)
        answer_next(session, rng, good)
        return name

    with session_in(tmp_path, single) as session:
        assert [drive_one(session, True) for _ in range(3)] == ['g6', 'g6', 'g5']
        session.skip('the device was loose')
        # Left out: the success before it still counts.
        assert drive_one(session, True) == 'g5'
        assert present(session)[1] == 'g4'
        session.repeat('steps/5', 'pressed the wrong button')
        assert present(session) == ('steps/5', 'g5')
        assert drive_one(session, False) == 'g5'
        assert drive_one(session, True) == 'g6'
        # The first trial is repeated with another answer: later ones keep their levels.
        session.repeat('steps/1', 'did not look')
        assert drive_one(session, False) == 'g6'
        levels = [item.what.condition.name for item in session.items
                  if isinstance(item.what, PlannedTrial)]
        assert levels[:3] == ['g6', 'g6', 'g5'] and levels[4:6] == ['g5', 'g6']
        # Without an answer after it, a trial counts for nothing.
        assert present(session) == ('steps/6/break', '')
        answer_next(session, rng)
        assert present(session) == ('steps/7', 'g6')
        answer_next(session, rng)
        session.skip('no time')
        assert present(session) == ('steps/8', 'g6')


@pytest.mark.parametrize(('changed', 'words'), [
    ({'factor': 'gaps'}, r'staircase: factor: names "gaps", which is no factor of the block.*gap'),
    ({'start': 'g9'}, 'staircase: start: names "g9", which is no level of gap'),
    ({'rule': '2-up 1-down'}, 'N-down M-up'),
    ({'values': [1, 2]}, 'has 2 numbers for 6 levels'),
    ({'values': [1, 2, 3, 4, 5, 5]}, 'neither rise nor fall'),
    ({'first_steps': [4, 2, 2], 'stop': {'reversals': 4}}, 'fewer than two reversals'),
    ({'success': {'equals': 1}}, 'has not one of "question" and "drive"'),
    ({'success': {'question': 'useful', 'drive': 'outcome', 'equals': 1}}, 'has not one of'),
    ({'success': {'drive': 'outcome', 'equals': 'crash'}}, 'time, collision, off_road'),
    ({'success': {'drive': 'contacts', 'equals': 'none'}}, 'give numbers'),
    ({'success': {'question': 'useful'}}, 'tests nothing')])
def test_refusals_name_the_key(changed: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as refused:
        read(StudyFile, study_with(**changed), 'study')
    assert len(str(refused.value).splitlines()) == 1
    refused.match(words)


def test_a_staircase_stands_alone_in_its_block() -> None:
    for keys in ({'repetitions': 2}, {'order': 'random'}, {'sequences': [['g1']]}):
        with pytest.raises(InputError, match='leave out repetitions, order and sequences'):
            read(StudyFile, STUDY | {'blocks': [STUDY['blocks'][0] | keys]}, 'study')
    with pytest.raises(InputError, match='only blocks with a staircase have'):
        read(StudyFile, STUDY | {'analysis': {'comparisons': [
            {'measure': 'mean_speed_m_per_s', 'factor': 'gap'}]}}, 'study')


def test_who_drives_together_has_no_staircase() -> None:
    study = read(StudyFile, STUDY | {'settings': {'seats': ['hv0', 'hv1']}}, 'study')
    with pytest.raises(InputError, match='blocks: steps: is ruled by successes.*or "seats"'):
        members_of(study)


def test_a_question_has_to_follow_every_trial(tmp_path: Path) -> None:
    missing = study_with(success={'question': 'seen', 'equals': 'yes'})
    with pytest.raises(InputError, match='does not follow every trial.*useful'):
        session_in(tmp_path, missing)
    assert not (tmp_path / JOURNAL).exists()
    twice = STUDY | {'blocks': [STUDY['blocks'][0] | {
        'after_trial': [{'questions': 'van_der_laan'}] * 2}]}
    with pytest.raises(InputError, match='give "questionnaire" too'):
        session_in(tmp_path, twice)
    found = [each.text for each in check_study(read(StudyFile, study_with(
        success={'question': 'useful', 'equals': 9}), 'study')) if 'success' in each.text]
    assert len(found) == 1 and 'success: 9 is no answer to "useful"' in found[0]


def test_the_journal_of_another_scale_is_refused(tmp_path: Path) -> None:
    rng = random.Random(3)
    with session_in(tmp_path) as session:
        while present(session)[0] != 'steps/3':
            answer_next(session, rng)
    other = json.loads(json.dumps(STUDY))
    other['factors'][0]['levels'][0]['name'] = 'g7'
    with pytest.raises(InputError, match='tells of the condition "g6/(day|night)", which is not'):
        session_in(tmp_path, other)


def test_groups_have_staircases_of_their_own_settings(tmp_path: Path) -> None:
    study = STUDY | {'groups': {'name': 'hood', 'levels': [
        {'name': 'low', 'view': 'driver'}, {'name': 'high', 'view': 'chase'}]}}
    rng = random.Random(2)
    with session_in(tmp_path / 'P01', study) as session:
        while session.next_item is not None:
            trial = answer_next(session, rng)
            group = session.allocation
            assert trial is None or group is not None and trial.condition.settings.view == (
                'driver' if group.group == 'low' else 'chase')
        wanted = [item.id for item in session.items]
    record = read_participant(session.study, tmp_path / 'P01')
    assert record is not None and record.complete and list(record.items) == wanted
    assert {name for _, name in record.tracks} == {'day', 'night'}
    for track in record.tracks.values():
        assert (track.ended, len(track.reversals), len(track.trials)) in (
            ('reversals', 4, len(track.judged)), ('at_most', len(track.reversals), 20))


def test_pages_tell_no_level_before_it_is_known(tmp_path: Path) -> None:
    rng = random.Random(2)
    with session_in(tmp_path) as session:
        drives = DrivesWithoutGraph(session)
        desk = Desk(session, drives)
        while present(session)[0] != 'last/1':
            item = session.next_item
            rows = {row['id']: row for row in experimenter_document(desk, {})['items']}
            for name, row in rows.items():
                if name.count('/') == 1 and row['kind'] == 'drive' and name.startswith('steps'):
                    assert bool(row['condition']) == (row['state'] != 'to_come')
            if isinstance(item.what, PlannedTrial):
                assert rows[item.id]['condition'] == item.what.condition.name
            answer_next(session, rng)
        drives.wake()
        shown = participant_document(desk)
        count = sum(isinstance(item.what, PlannedTrial) for item in session.items)
        assert shown['show'] == 'drive' and shown['number'] == count - 1 < 41
        assert shown['progress']['drives'] == count
        assert shown['progress']['of'] == len(session.items)


SEEN = """
name: seen
questions:
  - {name: seen, ask: Would you go?, choice: {choices: {"yes": "Yes", "no": "No"}}}
"""


@pytest.fixture(scope='module')
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a made study with two staircases and a block of conditions."""
    root = tmp_path_factory.mktemp('staircases')
    assert main(['study', 'new', str(root / 'study')]) == 0
    file = root / 'study' / 'study.yaml'
    study = yaml.safe_load(file.read_text())
    scene = study['factors'][1]['levels'][0]['game']
    study['factors'].append({'name': 'gap', 'levels': [
        {'name': name, 'game': scene, 'seed': seed}
        for seed, name in enumerate(('wide', 'middle', 'narrow'))]})
    study['blocks'] = [
        {'name': 'gaps', 'factors': ['planner', 'gap'],
         'after_trial': [{'questions': 'seen.yaml'}],
         'staircase': {'factor': 'gap', 'start': 'middle', 'rule': '1-down 1-up',
                       'success': {'question': 'seen', 'equals': 'yes'},
                       'stop': {'reversals': 4, 'at_most': 9}}},
        {'name': 'main', 'factors': ['planner', 'scene']}]
    study['analysis'] = {'comparisons': [
        {'measure': 'mean_speed_m_per_s', 'factor': 'planner', 'effect': 0.6}]}
    file.write_text(yaml.safe_dump(study, sort_keys=False))
    (root / 'study' / 'seen.yaml').write_text(SEEN)
    assert main(['study', 'make-data', str(file), '--out', str(root / 'made'),
                 '--participants', '3']) == 0
    assert main(['study', 'data', str(root / 'made'), '--bids']) == 0
    return root / 'made'


def test_tables_have_thresholds_and_tracks(made: Path) -> None:
    tables = {name: polars.read_parquet(made / 'data' / f'{name}.parquet')
              for name in ('staircases', 'trials', 'participants')}
    assert tables['staircases'].height == 6
    for row in tables['staircases'].iter_rows(named=True):
        trials = tables['trials'].filter(
            (polars.col('participant') == row['participant'])
            & (polars.col('block') == 'gaps') & (polars.col('staircase') == row['staircase']))
        places = {'wide': 1.0, 'middle': 2.0, 'narrow': 3.0}
        levels = [places[name] for name in trials['gap']]
        assert levels[0] == 2.0 and len(levels) == row['trials'] <= 9
        # 1-down 1-up, from the answers themselves.
        for level, success, after in zip(levels, trials['success'], levels[1:], strict=False):
            assert after == min(max(level + (1 if success else -1), 1.0), 3.0)
        turned = [level for level, reversal in zip(levels, trials['reversal'], strict=True)
                  if reversal]
        assert row['reversals'] == len(turned)
        assert row['end'] == ('reversals' if len(turned) == 4 else 'at_most')
        used = turned[len(turned) % 2:]
        assert row['reversals_used'] == len(used)
        assert row['threshold'] == (statistics.fmean(used) if used else None)
        person = tables['participants'].filter(
            polars.col('participant') == row['participant']).row(0, named=True)
        assert person[f'gaps_{row["staircase"]}_threshold'] == row['threshold']
        assert person['trials'] == person['trials_planned'] == tables['trials'].filter(
            polars.col('participant') == row['participant']).height
        assert person['complete']
    others = tables['trials'].filter(polars.col('block') == 'main')
    assert others['success'].is_null().all() and others['trial'].to_list() == [19, 20, 21, 22] * 3
    assert main(['validate', str(made)]) == 0


def test_the_report_draws_each_track(made: Path) -> None:
    assert main(['study', 'report', str(made)]) == 0
    html = (made / 'data' / 'report.html').read_text()
    assert html.count('<svg class="track"') == 6
    rows = polars.read_parquet(made / 'data' / 'staircases.parquet')
    drawn = html.partition('<h2')[2]
    assert drawn.count('<circle class="success"') + drawn.count('<circle class="failure"') == int(
        rows['trials'].sum())
    assert drawn.count(', reversal</title>') == int(rows['reversals'].sum())
    assert 'Trials of staircases are left out' in html
    told = json.loads((made / 'data' / 'provenance.json').read_text())
    assert told['staircases'] == {'gaps': (
        'staircase of gap, 1-down 1-up from the level middle; success: seen is yes; ends after 4 '
        'reversals, or 9 trials')}


def test_check_and_preregistration_tell_the_plan(made: Path, capsys: pytest.CaptureFixture[str]
                                                 ) -> None:
    file = made.parent / 'study' / 'study.yaml'
    assert main(['study', 'check', str(file), '--participants', '1']) == 0
    told = capsys.readouterr().out
    assert 'block gaps: staircase of gap, 1-down 1-up' in told
    assert '1-18  gaps  2 staircases, at most 18 trials\n   19  main  ' in told
    assert 'a session takes at most about' in told
    assert main(['study', 'preregister', str(file)]) == 0
    text = (file.parent / 'preregistration.md').read_text()
    assert 'Block gaps: staircase of gap, 1-down 1-up from the level middle' in text
    assert '| 1 | gaps: 2 staircases, at most 18 trials, main: ' in text


def test_planned_comparisons_leave_the_trials_out(made: Path) -> None:
    study = ConductedStudy(made).study
    assert [formula.blocks for formula in model_formulas(study)] == [('main',)]
    rows = SimulatedTrials(study, planned_people(study, 2), measure_models(study)).rows
    assert {row['block'] for row in rows} == {'main'} and len(rows) == 8
    trials = polars.read_parquet(made / 'data' / 'trials.parquet').to_dicts()
    used = used_rows(study, trials)
    assert {row['block'] for row in used} == {'main'} and len(used) == 12 < len(trials)
    script = (made / 'data' / 'analysis.R').read_text()
    assert 'trials <- trials[!(trials$block %in% c("gaps")), ]' in script


def test_a_withdrawn_participant_leaves_the_staircases(made: Path) -> None:
    assert main(['study', 'withdraw', str(made), '--participant', 'P02', '--yes']) == 0
    rows = polars.read_parquet(made / 'data' / 'staircases.parquet')
    assert set(rows['participant']) == {'P01', 'P03'}
    study = ConductedStudy(made)
    assert load_study(study.study_path).staircases
    assert all(record.complete for record in study.participants())
