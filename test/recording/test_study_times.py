# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When a study's questions were shown and answered, and after which run."""

from pathlib import Path

from crgame_ros.cli import main
from crgame_ros.study.session_journal import JOURNAL, SessionJournal
import polars
import pytest
from study_maker import DURATION_S, lines_of

pytestmark = pytest.mark.xdist_group('study-data')


def answers(folder: Path) -> polars.DataFrame:
    """Read the table as other programs do."""
    return polars.read_parquet(folder / 'data' / 'answers.parquet')


@pytest.mark.exhaustive
def test_answers_name_their_run_and_its_end(copied: Path) -> None:
    """Answers after a repeated trial belong to the run that they came after."""
    rows = answers(copied).filter(participant='P03', trial=1)
    assert set(rows['recording']) == {'runs/1/run_3'} and set(rows['attempt']) == {3}
    assert set(rows['run_end_s']) == {DURATION_S}
    ended = [entry['at'] for entry in lines_of(copied / 'participants' / 'P03' / JOURNAL)
             if entry['entry'] == 'finished' and entry['item'] == 'main/1']
    assert set(rows['run_ended_s']) == {ended[-1]}
    others = answers(copied).filter(polars.col('trial').is_null())
    assert others.height > 0 and others['recording'].null_count() == others.height


def test_answers_have_the_times_of_their_page(copied: Path) -> None:
    assert answers(copied)['shown_s'].null_count() == answers(copied).height
    with SessionJournal(copied / 'participants' / 'P01') as journal:
        fields = next(entry for entry in journal.entries
                      if entry['entry'] == 'finished' and entry['item'] == 'fields')
        at = journal.entries[-1]['at'] + 9.0
        journal.add({'entry': 'repeated', 'item': 'fields', 'reason': 'typed wrongly', 'at': at})
        journal.add(fields | {'at': at + 8.5, 'shown_at': at + 1.0, 'answered_at': at + 8.0,
                              'taken_s': 7.0, 'after_s': {'age': 2.5}})
    assert main(['study', 'data', str(copied)]) == 0
    row = answers(copied).filter(participant='P01', item='fields').row(0, named=True)
    assert row['shown_s'] == pytest.approx(at + 1.0)
    assert (row['taken_s'], row['after_s'], row['recording']) == (7.0, 2.5, None)


def test_events_say_whether_practice_was_good(copied: Path) -> None:
    with SessionJournal(copied / 'participants' / 'P02') as journal:
        at = journal.entries[-1]['at']
        for good in (False, True):
            at += 1.0
            journal.add({'entry': 'practised', 'item': 'main/1', 'good': good, 'at': at})
    assert main(['study', 'data', str(copied)]) == 0
    events = polars.read_parquet(copied / 'data' / 'events.parquet').filter(kind='practised')
    assert events['text'].to_list() == ['not good', 'good']
