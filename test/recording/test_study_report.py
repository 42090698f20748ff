# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The report of a study: one file, with the numbers of the tables, for any answers."""

import hashlib
from html import unescape
from pathlib import Path
import re

from crgame_ros.cli import main
from crgame_ros.study.data.condition_section import within_halves
from crgame_ros.study.data.preregistration import (
    digests_of_folder,
    PREREGISTRATION,
    read_preregistration,
)
from crgame_ros.study.quality import CHECKS, QualityBounds, TIMING
from crgame_ros.study.session_journal import JOURNAL, SessionJournal
import numpy as np
import polars
import pytest
from scipy import stats
from study_maker import Studied

pytestmark = pytest.mark.xdist_group('study-data')
_TAG = re.compile('<[^>]+>')


def report_of(folder: Path) -> str:
    """Write the report, and read it."""
    assert main(['study', 'report', str(folder)]) == 0
    return (folder / 'data' / 'report.html').read_text('utf-8')


def rows_of(html: str, caption: str) -> list[list[str]]:
    """Return the cells of the table with a caption."""
    after = html[html.index(f'<caption>{caption}'):].partition('<tbody>')[2]
    body = after.partition('</tbody>')[0]
    return [[unescape(_TAG.sub('', cell)) for cell in re.findall(r'<t[hd].*?>(.*?)</t[hd]>', row)]
            for row in body.split('</tr>')[:-1]]


def test_means_and_intervals_are_those_of_the_tables(studied: Studied) -> None:
    html = report_of(studied.folder)
    trials = polars.read_parquet(studied.folder / 'data' / 'trials.parquet')
    values = np.array([[trials.filter(participant=name, condition=condition)[
        'mean_speed_m_per_s'].mean() for condition in ('idm', 'cv')]
        for name in ('P01', 'P02', 'P03')])
    row = next(row for row in rows_of(html, 'Driving') if row[0].startswith('mean_speed_m_per_s'))
    wanted = [f'{mean:.2f} ± {half:.2f}' for mean, half in zip(
        values.mean(axis=0), within_halves(values), strict=True)]
    assert 'mean of its signed speed' in row[0] and row[1:] == ['m/s', *wanted, '3*']
    # A point for each participant in each of two conditions.
    assert len(re.findall(r'<title>P0[123]: ', html.partition('mean_speed_m_per_s <')[2]
                          .partition('</figure>')[0])) == 6


def test_planned_comparisons_are_those_of_the_table_and_of_the_script(studied: Studied) -> None:
    html = report_of(studied.folder)
    assert main(['study', 'data', str(studied.folder), '--no-reports']) == 0
    trials = polars.read_parquet(studied.folder / 'data' / 'trials.parquet')
    first, second = (np.array([trials.filter(participant=name, condition=condition)[
        'mean_speed_m_per_s'].mean() for name in ('P01', 'P02', 'P03')])
        for condition in ('idm', 'cv'))
    test = stats.ttest_rel(second, first)
    row = rows_of(html, 'Differences within participants')[0]
    assert row[0] == 'mean_speed_m_per_splanner: cv − idm' and row[1:3] == ['m/s', '3']
    assert row[8] == f'{test.pvalue:.3f}'
    # Of the two tests of the plan.
    assert len(rows_of(html, 'Effect sizes')) == 2
    script = (studied.folder / 'data' / 'analysis.R').read_text()
    assert 'compare("mean_speed_m_per_s", "planner", "idm", "cv", "two.sided")' in script
    assert 'method = "holm", n = 2' in script
    assert '`mean_speed_m_per_s` ~ `planner` + (1 | participant)' in script
    for left, right in ('()', '[]', '{}'):
        assert script.count(left) == script.count(right)
    assert 'statsmodels' in html


def test_the_report_names_the_preregistration_and_what_has_changed_since(copied: Path) -> None:
    study, document = copied / 'study' / 'study.yaml', copied / PREREGISTRATION
    assert main(['study', 'preregister', str(study), '--out', str(document)]) == 0
    text = document.read_bytes()
    # As `head -n -1 FILE | sha256sum` has it.
    above, _, last = text.rstrip(b'\n').rpartition(b'\n')
    digest = hashlib.sha256(above + b'\n').hexdigest()
    assert last.decode() == f'SHA-256 of all lines above: {digest}'
    for known in ('| 4 | ', 'mean of its signed speed', 'cv − idm', 'at most 100 ms',
                  hashlib.sha256(study.read_bytes()).hexdigest(),
                  'mean_speed_m_per_s ~ planner + (1 | participant)'):
        assert known in text.decode()
    assert main(['study', 'preregister', str(study), '--verify', str(document)]) == 0
    registered = read_preregistration(document)
    (copied / 'study' / 'consent.md').write_text('Do you agree now?')
    assert main(['study', 'preregister', str(study), '--verify', str(document)]) == 1
    assert 'consent.md has changed' in registered.differences(
        digests_of_folder(copied / 'study'))
    html = report_of(copied)
    assert digest in html and 'consent.md has changed' in html
    # What is there already is not overwritten, and a changed document is none.
    assert main(['study', 'preregister', str(study), '--out', str(document)]) == 2
    document.write_bytes(text.replace(b'at most 100 ms', b'at most 900 ms'))
    assert main(['study', 'preregister', str(study), '--verify', str(document)]) == 2


def test_it_has_participants_and_problems(studied: Studied) -> None:
    html = report_of(studied.folder)
    people = rows_of(html, 'Participants')
    assert [row[0] for row in people] == ['P01', 'P02', 'P03', 'P04']
    assert [row[-1] for row in people] == ['yes', 'yes', 'yes', 'no']
    troubles = [(row[0], row[1], row[-1]) for row in rows_of(html, 'What did not go')]
    assert troubles == [('P03', 'trial aborted', 'sneezing'),
                        ('P03', 'trial repeated', 'a phone rang'),
                        ('P04', 'session ended early', 'felt ill')]
    for word in ('Kennedy', 'Van der Laan', 'rear axle', 'numpy', 'SHA-256'):
        assert word in html


def test_nothing_is_loaded_and_nothing_written_is_html(copied: Path) -> None:
    with SessionJournal(copied / 'participants' / 'P03') as journal:
        journal.add({'entry': 'skipped', 'item': 'after/1', 'at': journal.entries[-1]['at'],
                     'reason': '<script>alert(1)</script><img src=x>'})
    html = report_of(copied)
    assert '<script' not in html and '<img' not in html
    assert '&lt;script&gt;alert(1)' in html
    assert "default-src 'none'" in html and 'http' not in _TAG.sub('', html)


def test_timing_beyond_a_bound_is_marked_and_named(copied: Path) -> None:
    journal = copied / 'participants' / 'P02' / JOURNAL
    assert main(['study', 'data', str(copied)]) == 0
    row = polars.read_parquet(copied / 'data' / 'trials.parquet').row(0, named=True)
    bounds = QualityBounds()
    assert bounds.faults(row, TIMING) == [] and journal.exists()
    late = row | {'max_cumulative_error_s': 0.31, 'timeout_ratio': 0.02, 'input_delay_s': 0.15,
                  'real_time_ratio_final': 0.98, 'resets': 2, 'gaps': 1}
    assert bounds.faults(late, TIMING) == [
        'greatest cumulative error 310 ms instead of at most 100 ms',
        'cycles that took longer than a step 2.0 % instead of at most 1 %',
        'real-time ratio 0.980 instead of at least 0.99',
        'drift resets 2 instead of at most 0', 'cycles not recorded 1 instead of at most 0',
        'input delay 150 ms instead of at most 100 ms']
    assert CHECKS.keys() <= row.keys()


def test_before_the_first_session_there_is_a_report(studied: Studied, tmp_path: Path) -> None:
    (tmp_path / 'empty' / 'study').mkdir(parents=True)
    for name in ('study.yaml', 'remarks.yaml', 'consent.md'):
        (tmp_path / 'empty' / 'study' / name).write_bytes(
            (studied.folder / 'study' / name).read_bytes())
    assert main(['study', 'data', str(tmp_path / 'empty'), '--bids']) == 0
    html = report_of(tmp_path / 'empty')
    assert 'No participant has begun yet' in html and 'There are no values yet' in html
