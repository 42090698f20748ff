# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Groups: people are allocated once, in balance, whatever ends, and in every process alike."""

from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
import json
import os
from pathlib import Path
import random
import subprocess
import sys
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.schema.reading import read
from crgame_ros.study.file import StudyFile
from crgame_ros.study.groups import allocate, Allocation, enrolled, Groups
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.session_journal import JOURNAL, read_journal, SessionJournal
from crgame_ros.study.session_script import drives_of, session_of
from crgame_ros.study.trial_plan import plan_trials
import pytest

STRATA = [{'field': 'licence'}, {'field': 'age', 'cuts': [30, 50]}]
LEVELS = [{'name': 'bars', 'planner': 'idm'}, {'name': 'lights', 'planner': 'reactive'}]
STUDY: dict[str, Any] = {
    'name': 'groups', 'seed': 4, 'fields': [
        {'name': 'age', 'number': {'low': 0, 'high': 99, 'whole': True}},
        {'name': 'licence', 'choice': {'choices': {'yes': 'Yes', 'no': 'No'}}}],
    'groups': {'name': 'display', 'levels': LEVELS, 'strata': STRATA},
    'factors': [{'name': 'scene', 'levels': [{'name': name, 'game': f'{name}.yaml'}
                                             for name in 'wxyz']}],
    'blocks': [{'name': 'main', 'before': [{'break': {}, 'groups': ['lights']}]}]}
PERSON: dict[str, Any] = {'age': 40, 'licence': 'yes'}
KILLED = """
import os, sys
sys.path.insert(0, sys.argv[2])
from pathlib import Path
from crgame_ros.study.participant_session import ParticipantSession
from test_groups import PERSON, study_of
# The power goes after the answers to the fields are on the disk.
ParticipantSession._allocate = lambda *_: os.kill(os.getpid(), 9)
folder = Path(sys.argv[1])
ParticipantSession(study_of(), folder, folder.name).finish(PERSON)
"""
ARRIVES = """
import sys
sys.path.insert(0, sys.argv[2])
from pathlib import Path
from test_groups import arrive
for number in range(6):
    arrive(Path(sys.argv[1]), f'{sys.argv[3]}{number}')
"""


def study_of(**groups: Any) -> StudyFile:
    """Return the study with other groups."""
    return read(StudyFile, STUDY | {'groups': STUDY['groups'] | groups}, 'study')


@contextmanager
def opened(root: Path, name: str, study: StudyFile | None = None,
           group: str | None = None) -> Iterator[ParticipantSession]:
    """Open the session of a participant."""
    with ParticipantSession(study or study_of(), root / name, name, group=group) as session:
        yield session


def arrive(root: Path, name: str, person: Mapping[str, Any] = PERSON,
           study: StudyFile | None = None) -> Allocation:
    """Let a participant answer the fields; return the allocation."""
    with opened(root, name, study) as session:
        session.finish(person)
        assert session.allocation is not None
        return session.allocation


def people(count: int, seed: int) -> list[dict[str, Any]]:
    """Return people of all ages."""
    rng = random.Random(seed)
    return [{'age': rng.randrange(18, 80), 'licence': rng.choice(['yes', 'no', 'yes'])}
            for _ in range(count)]


def allocated(groups: Groups, arrivals: list[dict[str, Any]], seed: int) -> list[Allocation]:
    """Return the allocations of people who arrive one after the other."""
    found: list[Allocation] = []
    for person in arrivals:
        found.append(allocate(groups, seed, person, found, len(found)))
    return found


def marginal_imbalance(found: list[Allocation]) -> int:
    """Return the sum of the differences between both groups' numbers, over all strata."""
    counts = Counter((field, stratum, each.group) for each in found
                     for field, stratum in each.strata.items())
    return sum(abs(counts[field, stratum, 'bars'] - counts[field, stratum, 'lights'])
               for field, stratum in {key[:2] for key in counts})


def test_minimisation_is_more_balanced_than_chance_and_equal_for_equal_seeds() -> None:
    groups = study_of(allocation='minimisation').groups
    assert groups is not None
    minimised, by_chance = [], []
    for seed in range(20):
        arrivals = people(40, seed)
        found = allocated(groups, arrivals, seed)
        assert found == allocated(groups, arrivals, seed)
        assert {each.group for each in found} == {'bars', 'lights'}
        # The places in each group's orders are taken in turn.
        assert [each.place for each in found if each.group == 'bars'] == list(
            range(sum(each.group == 'bars' for each in found)))
        minimised.append(marginal_imbalance(found))
        rng = random.Random(seed)
        by_chance.append(marginal_imbalance([
            Allocation(rng.choice(groups.names), 0, each.strata) for each in found]))
    # Five strata of 8 to 27 people: the mean difference by chance is 5 * sqrt(2 n / pi).
    assert sum(by_chance) / 20 > 14.0
    assert sum(minimised) / 20 < 0.6 * sum(by_chance) / 20
    assert max(minimised) <= max(by_chance)
    assert allocated(groups, people(40, 1), 1) != allocated(groups, people(40, 1), 2)


def test_minimisation_is_that_of_pocock_and_simon() -> None:
    """A group that leaves less imbalance is taken with the stated probability, or for sure."""
    groups = study_of(allocation='minimisation', probability=1.0).groups
    assert groups is not None
    others = [Allocation('bars', place, {'licence': 'yes', 'age': '30 to below 50'})
              for place in range(2)] + [
        Allocation('lights', 0, {'licence': 'yes', 'age': 'below 30'}),
        Allocation('lights', 1, {'licence': 'no', 'age': 'below 30'})]
    # By hand: with bars the ranges are 3 - 1 and 3 - 0, with lights 2 - 2 and 2 - 1.
    assert {allocate(groups, seed, PERSON, others, 4).group for seed in range(40)} == {'lights'}
    likely = study_of(allocation='minimisation', probability=0.8).groups
    assert likely is not None
    share = sum(allocate(likely, seed, PERSON, others, 4).group == 'lights'
                for seed in range(2000)) / 2000
    # Three standard deviations of a binomial share.
    assert share == pytest.approx(0.8, abs=3.0 * (0.8 * 0.2 / 2000) ** 0.5)
    # Without anybody else, both leave the same.
    first = Counter(allocate(groups, seed, PERSON, [], 0).group for seed in range(2000))
    assert first['bars'] / 2000 == pytest.approx(0.5, abs=3.0 * (0.25 / 2000) ** 0.5)


def test_permuted_blocks_are_balanced_in_each_stratum() -> None:
    groups = study_of(block_size=4).groups
    assert groups is not None
    found = allocated(groups, people(200, 3), 7)
    strata: dict[tuple[str, ...], list[str]] = {}
    for each in found:
        strata.setdefault(tuple(each.strata.values()), []).append(each.group)
    assert len(strata) == 6
    for members in strata.values():
        for start in range(0, len(members) - 3, 4):
            assert Counter(members[start:start + 4]) == {'bars': 2, 'lights': 2}
    # Blocks and strata differ.
    assert len({tuple(members[:4]) for members in strata.values()}) > 1
    # Recorded values: another machine or Python version must give them too.
    assert ''.join(each.group[0] for each in allocated(groups, [PERSON] * 12, 4)) == (
        'lblbblblbllb')


def test_a_field_or_the_experimenter_decides(tmp_path: Path) -> None:
    own = read(StudyFile, STUDY | {'blocks': [{'name': 'main'}], 'groups': {
        'name': 'licensed', 'levels': [{'name': 'no'}, {'name': 'yes'}], 'allocation': 'field',
        'field': 'licence'}}, 'study')
    assert arrive(tmp_path / 'own', 'P1', PERSON, own).group == 'yes'
    assert arrive(tmp_path / 'own', 'P2', PERSON | {'licence': 'no'}, own).group == 'no'
    by_age = study_of(strata=[], allocation='field', field={'field': 'age', 'cuts': [50]})
    assert [arrive(tmp_path / 'age', f'P{age}', PERSON | {'age': age}, by_age).group
            for age in (49, 50)] == ['bars', 'lights']
    given = study_of(strata=[], allocation='given')
    with pytest.raises(InputError, match='needs the group of a new participant'):
        ParticipantSession(given, tmp_path / 'given' / 'P1', 'P1')
    with opened(tmp_path / 'given', 'P1', given, 'lights') as session:
        assert session.allocation is None
    with opened(tmp_path / 'given', 'P1', given) as session:
        session.finish(PERSON)
        assert session.allocation is not None and session.allocation.group == 'lights'
    with pytest.raises(InputError, match='is in the group lights already'), \
            opened(tmp_path / 'given', 'P1', given, 'bars'):
        pass
    with pytest.raises(InputError, match='not given by the experimenter'), \
            opened(tmp_path / 'drawn', 'P1', group='bars'):
        pass


def test_a_group_has_its_settings_steps_and_orders() -> None:
    study = study_of()
    for group, planner in (('bars', 'idm'), ('lights', 'reactive')):
        orders = [[trial.condition.name for trial in plan_trials(study, place, group)]
                  for place in range(4)]
        # A whole square of four in each group: each condition once at each place.
        assert all(len(set(column)) == 4 for column in zip(*orders, strict=True))
        assert {trial.condition.settings.planner for trial in plan_trials(study, 0, group)} == {
            planner}
        ids = [item.id for item in session_of(study, 0, group)]
        assert ('main/before/1' in ids) == (group == 'lights')
    assert len(dict(drives_of(study))) == 8


def test_a_group_is_allocated_once_and_noted(tmp_path: Path) -> None:
    first = arrive(tmp_path, 'P1')
    entries = [entry['entry'] for entry in read_journal(tmp_path / 'P1')]
    assert entries == ['begun', 'finished', 'allocated']
    with opened(tmp_path, 'P1') as session:
        assert session.allocation == first
        session.repeat('fields', 'a slip')
        session.finish(PERSON | {'licence': 'no'})
        # What was drawn stays, whatever is answered later.
        assert session.allocation == first
        assert session.items == session_of(study_of(), first.place, first.group)
    with pytest.raises(InputError, match='began with another plan'), opened(
            tmp_path, 'P1', read(StudyFile, STUDY | {'blocks': [{'name': 'other'}]}, 'study')):
        pass


def test_a_kill_between_the_fields_and_the_group_changes_nothing(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, '-c', KILLED, str(tmp_path / 'killed' / 'P1'),
                           str(Path(__file__).parent)], env=os.environ, check=False)
    assert done.returncode == -9
    assert [entry['entry'] for entry in read_journal(tmp_path / 'killed' / 'P1')] == [
        'begun', 'finished']
    with opened(tmp_path / 'killed', 'P1') as session:
        assert session.allocation == arrive(tmp_path / 'whole', 'P1')
        assert session.next_item is not None and session.next_item.id.startswith('main')


def test_sessions_at_the_same_time_share_no_place(tmp_path: Path) -> None:
    """Two processes let six people arrive each: as if one had let all twelve arrive."""
    command = [sys.executable, '-c', ARRIVES, str(tmp_path), str(Path(__file__).parent)]
    both = [subprocess.Popen([*command, name]) for name in 'AB']
    assert [process.wait(120) for process in both] == [0, 0]
    found = [each.allocation for each in enrolled(tmp_path)]
    assert sorted(each.slot for each in found if each is not None) == list(range(12))
    assert [each.place for each in enrolled(tmp_path)] == list(range(12))
    groups = Counter((each.group, each.place) for each in found if each is not None)
    assert groups == {(group, place): 1 for group in ('bars', 'lights') for place in range(6)}


def test_who_drops_out_is_replaced(tmp_path: Path) -> None:
    """The next new participant gets the group and the place; others keep theirs."""
    first = {f'P{number}': arrive(tmp_path, f'P{number}') for number in range(4)}
    with opened(tmp_path, 'P1') as session:
        session.end('felt sick')
    next_one = arrive(tmp_path, 'P4')
    assert next_one == first['P1']
    assert arrive(tmp_path, 'P5') not in first.values()
    # A withdrawal deletes the folder.
    (tmp_path / 'P2' / JOURNAL).unlink()
    assert arrive(tmp_path, 'P6') == first['P2']
    with opened(tmp_path, 'P0') as session:
        assert session.allocation == first['P0']


def test_a_study_without_groups_replaces_as_well(tmp_path: Path) -> None:
    plain = read(StudyFile, {key: value for key, value in STUDY.items() if key != 'groups'} | {
        'blocks': [{'name': 'main'}]}, 'study')
    places = []
    # A file of another program is no participant.
    (tmp_path / '.DS_Store').touch()
    for name in ('P1', 'P2', 'P3', 'P4'):
        with opened(tmp_path, name, plain) as session:
            places.append(session.place)
            if name == 'P2':
                session.end('felt sick')
    assert places == [0, 1, 1, 2]
    with opened(tmp_path, 'P2', plain) as session:
        assert session.place == 1 and session.next_item is None


def test_what_decides_cannot_be_skipped(tmp_path: Path) -> None:
    with opened(tmp_path, 'P1') as session, pytest.raises(InputError, match='decides on the'):
        session.skip('in a hurry')


@pytest.mark.parametrize(('groups', 'told'), [
    ({'strata': ['experience']}, 'names the field "experience", which is not there'),
    ({'strata': ['age']}, 'does not divide people'),
    ({'strata': [{'field': 'age', 'cuts': [5, 3]}]}, 'cuts that do not rise'),
    ({'strata': [], 'allocation': 'minimisation'}, 'minimises nothing'),
    ({'block_size': 3}, 'give a multiple of 2'),
    ({'allocation': 'field'}, 'has "field" without'),
    ({'strata': [], 'allocation': 'field', 'field': 'licence'}, 'name choices as them: bars'),
    ({'name': 'scene'}, 'has the name of the factor "scene"'),
    ({'levels': LEVELS[:1]}, 'give 2 to 20')])
def test_groups_that_cannot_be_formed_are_refused(groups: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError) as refused:
        study_of(**groups)
    assert told in f'{refused.value}'


def test_steps_of_groups_that_are_not_known_are_refused() -> None:
    for more, told in (
            ({'before': [{'break': {}, 'groups': ['bars']}]}, 'which are not known yet'),
            ({'after': [{'break': {}, 'groups': ['bats']}]}, 'names the group "bats"')):
        with pytest.raises(InputError, match=told):
            read(StudyFile, STUDY | more, 'study')


def test_a_journal_of_other_groups_or_answers_is_refused(tmp_path: Path) -> None:
    """Journals and study files may be edited; nobody is then in a wrong group."""
    group = arrive(tmp_path, 'P1').group
    renamed = [level | {'name': f'{level["name"]}-2'} for level in LEVELS]
    other = read(StudyFile, STUDY | {'blocks': [{'name': 'main'}], 'groups': STUDY['groups'] | {
        'levels': renamed}}, 'study')
    with pytest.raises(InputError, match='began with another plan'), \
            opened(tmp_path, 'P1', other):
        pass
    journal = tmp_path / 'P1' / JOURNAL
    lines = journal.read_text().splitlines(keepends=True)
    journal.write_text(''.join(lines[:-1]).replace('"age": 40', '"age": "old"'))
    with pytest.raises(InputError, match='has no answer to "age", which decides'), \
            opened(tmp_path, 'P1'):
        pass
    journal.write_text(''.join(lines[:-1]))
    with opened(tmp_path, 'P1') as session:
        assert session.allocation is not None and session.allocation.group == group


def test_an_allocation_that_cannot_be_noted_does_not_count(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk is full for a moment: the last item comes again, and is then followed by drives."""
    with opened(tmp_path, 'P1') as session:
        add = SessionJournal.add

        def full(journal: SessionJournal, entry: dict[str, Any]) -> None:
            if entry['entry'] == 'allocated':
                raise InputError('cannot be written (No space left)', str(journal.path))
            add(journal, entry)

        with monkeypatch.context() as patched, pytest.raises(InputError, match='No space left'):
            patched.setattr(SessionJournal, 'add', full)
            session.finish(PERSON)
        assert session.allocation is None
        assert session.next_item is not None and session.next_item.id == 'fields'
        session.finish(PERSON)
        assert session.allocation is not None
        assert session.next_item is not None and session.next_item.id.startswith('main')


def test_an_entry_that_is_damaged_is_left_out(tmp_path: Path) -> None:
    """A journal comes from a disk: a line without a group is no allocation."""
    arrive(tmp_path, 'P1')
    lines = (tmp_path / 'P1' / JOURNAL).read_text().splitlines()
    entry = json.loads(lines[-1])
    del entry['group']
    (tmp_path / 'P1' / JOURNAL).write_text('\n'.join([*lines[:-1], json.dumps(entry)]) + '\n')
    with opened(tmp_path, 'P1') as session:
        assert session.allocation is not None
