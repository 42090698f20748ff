# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Participants who drive together: one plan, journals that agree after any end, own tables."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, ExitStack
from itertools import count
from pathlib import Path
import sys

from crgame_ros.cli import main
from crgame_ros.cockpit.run_status import RunStatus
from crgame_ros.errors import InputError
from crgame_ros.paths import scenarios_directory
from crgame_ros.study.conduct.study_drive import outcome_of, Rider
from crgame_ros.study.data.conducted_study import read_participant
from crgame_ros.study.data.withdrawal import Withdrawal
from crgame_ros.study.desk.desk import Desk
from crgame_ros.study.desk.participant_document import experimenter_document, participant_document
from crgame_ros.study.drive_watch import DrivePhase, DriveState
from crgame_ros.study.file import StudyFile
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.session_journal import JOURNAL
from crgame_ros.study.session_script import is_driven, members_of, PracticeDrives
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from desk_support import write_study  # noqa: E402, I100

PAIR = ('P01', 'P02')
# One clock for all journals.
TIMES = count(1_000.0)
BLOCKS = [{'name': 'main', 'settings': {'game': 'x.yaml'}, 'order': 'given',
           'practice': {'at_least': 2, 'at_most': 3},
           'after_trial': [{'questions': 'kinds.yaml'}]}]


def study_of(folder: Path, **changed: object) -> StudyFile:
    return write_study(folder, **{
        'settings': {'seats': ['hv0', 'av0']}, 'fields': [], 'before': [], 'after': [],
        'blocks': BLOCKS, **changed})


@contextmanager
def opened(study: StudyFile, root: Path, pair: Sequence[str] = PAIR
           ) -> Iterator[list[ParticipantSession]]:
    """Open the sessions of those who drive together, as the program does."""
    with ExitStack() as stack:
        sessions: list[ParticipantSession] = []
        for name in pair:
            sessions.append(stack.enter_context(ParticipantSession(
                study, root / name, name, sessions[0].place if sessions else None,
                lambda: next(TIMES), members=pair)))
        sessions[0].join(sessions[1:])
        yield sessions


def go_on(sessions: Sequence[ParticipantSession], steps: int = 1000) -> int:
    """Do the next things, as often as told; return how many were left to do."""
    while steps and any(session.next_item is not None for session in sessions):
        steps -= 1
        for session in sessions:
            item = session.next_item
            if item is not None and not is_driven(item):
                session.finish({question.name: None if not question.required else _answer(
                    question.name) for question in session.questions(item)})
                break
        else:
            for session in sessions:
                session.start('runs/1')
            for session in sessions:
                assert session.next_item is not None
                if isinstance(session.next_item.what, PracticeDrives):
                    session.practised(True, run='runs/1')
                else:
                    session.finish(run='runs/1', outcome='time')
    return steps


def _answer(name: str) -> object:
    return {'words': 'nothing', 'tired': 5, 'distance': 7}.get(name, 2)


def test_a_pair_has_one_plan_and_each_an_own_seat(tmp_path: Path) -> None:
    study = study_of(tmp_path / 'study')
    assert members_of(study) == 2
    with opened(study, tmp_path / 'data') as pair, \
            opened(study, tmp_path / 'data', ('P03', 'P04')) as later:
        assert [session.place for session in (*pair, *later)] == [0, 0, 1, 1]
        first, second = (session.items for session in pair)
        assert [item.id for item in first] == [item.id for item in second]
        assert {item.what.condition.settings.seat for item in first if is_driven(item)
                and not isinstance(item.what, PracticeDrives)} == {'hv0'}
        assert {item.what.settings.seat for item in second
                if isinstance(item.what, PracticeDrives)} == {'av0'}
    for others in (('P01', 'P03'), ('P02', 'P01')):
        with pytest.raises(InputError, match='began with P01 and P02'), \
                opened(study, tmp_path / 'data', others):
            pass
    with pytest.raises(InputError, match='give --participant P01,P02'):
        ParticipantSession(study, tmp_path / 'data' / 'P02', 'P02')


@pytest.mark.parametrize('changed, told', [
    ({'blocks': [*BLOCKS, {'name': 'alone', 'settings': {'game': 'x.yaml', 'seat': 'hv0'}}]},
     'as many people'),
    ({'groups': {'name': 'g', 'levels': [{'name': 'a'}, {'name': 'b'}]}}, 'drive alone')])
def test_all_drives_are_for_as_many(tmp_path: Path, changed: dict[str, object],
                                    told: str) -> None:
    with pytest.raises(InputError, match=told):
        members_of(study_of(tmp_path, **changed))


def test_journals_agree_wherever_the_program_was_killed(tmp_path: Path) -> None:
    """Each line of the two journals may be the last; each drive is then had by both or neither."""
    study, whole = study_of(tmp_path / 'study'), tmp_path / 'whole'
    with opened(study, whole) as sessions:
        go_on(sessions, 3)
        sessions[1].repeat('main/practice', 'too short')
        go_on(sessions, 6)
        sessions[0].repeat('main/1', 'a noise')
        go_on(sessions, 2)
        sessions[1].skip('late')
        go_on(sessions)
        # The journals tell in which order they were written.
        lines = sorted((entry['at'], number, line) for number, session in enumerate(sessions)
                       for entry, line in zip(session.journal.entries, (
                           whole / session.participant / JOURNAL).read_bytes().splitlines(True),
                           strict=True))
    assert len(lines) > 30
    for cut in range(1, len(lines)):
        root = tmp_path / f'{cut}'
        for number, name in enumerate(PAIR):
            (root / name).mkdir(parents=True)
            (root / name / JOURNAL).write_bytes(b''.join(
                line for _, whose, line in lines[:cut] if whose == number))
        with opened(study, root) as sessions:
            assert _driven(sessions[0]) == _driven(sessions[1])
            assert go_on(sessions) > 0
            assert all(session.done == {item.id for item in session.items}
                       for session in sessions)


def _driven(session: ParticipantSession) -> set[str]:
    return {item.id for item in session.items if is_driven(item) and item.id in session.done}


def test_who_leaves_ends_it_for_the_others_only_before_the_last_drive(tmp_path: Path) -> None:
    study = study_of(tmp_path / 'study')
    with opened(study, tmp_path / 'early') as (one, other):
        one.end('ill')
        assert other.next_item is None
        assert other.journal.entries[-1]['reason'] == (
            'P01, who drove too, takes part no longer: ill')
    # Killed between the two lines.
    journal = tmp_path / 'early' / 'P02' / JOURNAL
    journal.write_bytes(b''.join(journal.read_bytes().splitlines(True)[:-1]))
    with opened(study, tmp_path / 'early') as (one, other):
        assert other.next_item is None
    with opened(study, tmp_path / 'late') as (one, other):
        while 'main/2' not in one.done:
            go_on((one, other), 1)
        one.end('ill')
        assert other.next_item is not None and other.next_item.id == 'main/2/after/1'


def test_pages_say_who_waits_for_whom(tmp_path: Path) -> None:
    class Conductor:
        time_s, woken = None, 0

        def wake(self) -> None:
            self.woken += 1

        def abort(self, reason: str) -> None:
            raise AssertionError(reason)

        def record(self, kind: str, text: str) -> None:
            raise AssertionError(kind)

    study, conductor = study_of(tmp_path / 'study', languages=[]), Conductor()
    with opened(study, tmp_path / 'data') as (one, other):
        rider = Rider(one, conductor)
        desk = Desk(one, rider)
        rider.enter(DriveState(DrivePhase.READY, 'main/practice', confederate='http://here/'))
        assert participant_document(desk)['awaits_others'] is False
        desk.ready('main/practice')
        assert rider.is_ready and conductor.woken
        # Others may be ready while the experimenter holds this one.
        desk.hold(True)
        assert not rider.is_ready
        desk.hold(False)
        assert rider.is_ready
        rider.enter(DriveState(DrivePhase.READY, 'main/practice', awaits_others=True))
        assert participant_document(desk)['awaits_others'] is True
        told = experimenter_document(desk, {})
        assert told['partners'] == ['P02'] and told['drive']['awaits_others'] is True
        assert other.partners == (one,)


def test_recordings_are_those_of_the_first_and_go_with_any_of_them(tmp_path: Path) -> None:
    study, root = study_of(tmp_path / 'study'), tmp_path / 'data'
    (root / 'study').mkdir(parents=True)
    (root / 'study' / 'study.yaml').write_text('')
    with opened(study, root / 'participants') as sessions:
        go_on(sessions)
    for name in ('1', '2'):
        run = root / 'participants' / 'P01' / 'runs' / name
        run.mkdir(parents=True)
        (run / 'x.mcap').write_bytes(b'x')
    record = read_participant(study, root / 'participants' / 'P02')
    assert record is not None and record.members == PAIR
    assert {attempt.folder for attempt in record.attempts} == {
        root / 'participants' / 'P01' / 'runs' / '1'}
    held = [path.relative_to(root).as_posix() for path in Withdrawal(root, 'P02').held()]
    assert held == ['participants/P01/runs/1', 'participants/P02']


def test_who_did_nothing_has_not_left_the_road() -> None:
    """The violation of one ends the drive of all."""
    status = RunStatus()
    status.begin(('hv0', 'hv1', 'hv2'))
    status.reason = 'drivability of hv1'
    status.contacts.append({'vehicle': 'hv1', 'with': 'hv0', 't': 2.0})
    assert [outcome_of(status, seat, 3.0)['outcome'] for seat in ('hv0', 'hv1', 'hv2')] == [
        'collision', 'collision', 'other']
    status.contacts.clear()
    assert [outcome_of(status, seat, 3.0)['outcome'] for seat in ('hv0', 'hv1')] == [
        'other', 'off_road']


def test_a_preregistration_has_one_order_for_each_pair(tmp_path: Path) -> None:
    study_of(tmp_path, participants=6, blocks=[{'name': 'main'}], settings={
        'game': str(scenarios_directory() / 'cut_in.yaml'), 'seats': ['hv0', 'av0']})
    assert main(['study', 'preregister', str(tmp_path / 'study.yaml')]) == 0
    orders = (tmp_path / 'preregistration.md').read_text().partition('## Orders')[2]
    assert [line[:4] for line in orders.partition('## ')[0].splitlines()
            if line[2:3].isdecimal()] == ['| 1 ', '| 2 ', '| 3 ']
