# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A block that ends as soon as so many trials in a row were a success."""

from collections.abc import Sequence
from itertools import count
from pathlib import Path
import sys
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.study.data.conducted_study import read_participant
from crgame_ros.study.file import StudyFile
from crgame_ros.study.participant_session import ParticipantSession
from crgame_ros.study.session_journal import JOURNAL
from crgame_ros.study.session_script import is_driven
from crgame_ros.study.staircase import StopRule, Success
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from desk_support import write_study  # noqa: E402, I100

TIMES = count(1_000.0)
STOP = {'success': {'drive': 'contacts', 'equals': 0}, 'in_a_row': 2}


def study_of(folder: Path, **changed: Any) -> StudyFile:
    """Return a study of a block of six trials that may end early, and one of two after it."""
    block = {'settings': {'game': 'x.yaml'}, 'order': 'given'}
    return write_study(folder, before=[], fields=[], after=[], blocks=[
        {'name': 'learn', 'repetitions': 3, 'stop': STOP, 'break_every': 2, 'break_minutes': 0,
         **block, **changed}, {'name': 'test', **block}])


def conduct(session: ParticipantSession, contacts: Sequence[int]) -> list[str]:
    """Go through a session; return its items in their order."""
    touched, found = iter(contacts), []
    while (item := session.next_item) is not None:
        found.append(item.id)
        session.start('runs/1' if is_driven(item) else '')
        session.finish(**({'run': 'runs/1', 'outcome': 'time', 'contacts': next(touched, 0)}
                          if is_driven(item) else {}))
    return found


@pytest.mark.parametrize(('successes', 'end'), [
    ([], None), ([True], None), ([True, True], 2), ([True, False, True], None),
    ([False, True, None, True, False], 4), ([True, True, True], 2)])
def test_a_row_is_broken_by_a_failure_alone(successes: list[bool | None], end: int | None) -> None:
    assert StopRule(Success(drive='contacts', equals=0), 2).ends_after(successes) == end


def test_a_block_ends_early_or_with_its_last_trial(tmp_path: Path) -> None:
    """Later trials keep their numbers; no break comes at the end."""
    study = study_of(tmp_path / 'study')
    for name, contacts, trials in (
            ('P01', [1, 0, 0], '123'), ('P02', [0, 1, 0, 1, 0, 1], '123456'),
            ('P03', [0, 0], '12')):
        with ParticipantSession(study, tmp_path / name, name, 0, lambda: next(TIMES)) as session:
            found = conduct(session, contacts)
            numbers = [item.what.number for item in session.items if is_driven(item)]
        assert [item.partition('/')[2] for item in found if item.startswith('learn/')
                and 'break' not in item] == list(trials)
        assert [item for item in found if 'break' in item] == [
            f'learn/{number}/break' for number in (2, 4) if number < len(trials)]
        assert numbers[-2:] == [7, 8] and found[-2:] == ['test/1', 'test/2']
        record = read_participant(study, tmp_path / name)
        assert record is not None and record.complete
        assert len(record.counted) == record.trials_planned == len(trials) + 2


def test_after_any_entry_the_session_goes_on_as_if_never_ended(tmp_path: Path) -> None:
    study, contacts = study_of(tmp_path / 'study'), [1, 0, 1, 0, 0]
    with ParticipantSession(study, tmp_path / 'whole', 'P01', 0, lambda: next(TIMES)) as session:
        whole = conduct(session, contacts)
    lines = (tmp_path / 'whole' / JOURNAL).read_bytes().splitlines(True)
    for cut in range(1, len(lines) + 1):
        folder = tmp_path / f'{cut}'
        folder.mkdir()
        (folder / JOURNAL).write_bytes(b''.join(lines[:cut]))
        with ParticipantSession(study, folder, 'P01', 0, lambda: next(TIMES)) as session:
            driven = sum(item.startswith('learn/') and 'break' not in item
                         for item in session.done)
            done = [item for item in whole if item in session.done]
            assert done + conduct(session, contacts[driven:]) == whole


def test_a_repeat_can_let_the_block_go_on(tmp_path: Path) -> None:
    study = study_of(tmp_path / 'study')
    with ParticipantSession(study, tmp_path / 'P01', 'P01', 0, lambda: next(TIMES)) as session:
        conduct(session, [0, 0])
        session.repeat('learn/2', 'a noise')
        assert conduct(session, [1, 0, 0]) == [
            'learn/2', 'learn/2/break', 'learn/3', 'learn/4']


def test_what_is_done_stays_if_a_repeat_ends_the_block_sooner(tmp_path: Path) -> None:
    study = study_of(tmp_path / 'study')
    with ParticipantSession(study, tmp_path / 'P01', 'P01', 0, lambda: next(TIMES)) as session:
        conduct(session, [1, 0, 1, 0, 0])
        for item in ('learn/1', 'learn/5'):
            session.repeat(item, 'a noise')
            assert conduct(session, [0]) == [item]
    record = read_participant(study, tmp_path / 'P01')
    assert record is not None and record.complete
    assert [*record.counted] == [*(f'learn/{number}' for number in range(1, 6)), 'test/1',
                                 'test/2']


def test_an_answer_can_be_the_success_and_refusals_name_the_key(tmp_path: Path) -> None:
    asked = {'after_trial': [{'questions': 'kinds.yaml'}],
             'stop': {'success': {'question': 'trust', 'at_least': 5}, 'in_a_row': 1}}
    study = study_of(tmp_path / 'study', **asked)
    assert study.blocks[0].judged is not None
    assert study.blocks[0].stop is not None and study.is_adaptive
    assert study.blocks[0].stop.told == (
        'ends after a success; success: trust is at least 5')
    other = {**asked, 'stop': {'success': {'question': 'trus', 'equals': 5}}}
    with pytest.raises(InputError, match='learn: stop: success.*"trus", which does not follow'):
        ParticipantSession(study_of(tmp_path / 'other', **other), tmp_path / 'P01', 'P01')
    with pytest.raises(InputError, match='ends by its own rule'):
        study_of(tmp_path / 'both', repetitions=1, order='williams', staircase={
            'factor': 'planner', 'success': STOP['success'], 'stop': {'reversals': 4}})
