# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A summary as text, Markdown, JSON and HTML: its content, and that no text in it can run."""

import argparse
import base64
import hashlib
import json
from pathlib import Path
import re

from crgame_ros.evaluation.evaluate_command import add_summary_arguments, summarise_command
from crgame_ros.evaluation.summary.html_page import (
    interval_svg,
    PlottedInterval,
    write_summary_page,
)
from crgame_ros.evaluation.summary.measures import MEASURES
from crgame_ros.evaluation.summary.summarise import summarise
from crgame_ros.evaluation.summary.summary import Summary
from crgame_ros.evaluation.summary.tables import quantity
from crgame_ros.evaluation.summary.text import summary_markdown, summary_text
from evaluation_rows import Evaluation, many
import numpy as np
from page_reader import Page
import pytest

HOSTILE = '<script>alert(1)</script> | `x` \x1b[31m\n\u202eevil'


@pytest.fixture
def summary(tmp_path: Path) -> Summary:
    """Return two planners, the second one with a malicious name; one cell has a report."""
    rows = Evaluation()
    keys = []
    for seed in range(6):
        for planner, ttc in (('idm', 2.0), (HOSTILE, 3.0 + 0.1 * seed)):
            keys.append(rows.add(planner=planner, seed=seed, scenario=f'ZAM_S-{seed}_1_T-1', avs=[
                {'worst_ttc': ttc, 'collided': seed == 4}]))
    rows.add('error', f'no path {HOSTILE}', f'Traceback {HOSTILE}', seed=9)
    folder = rows.write(tmp_path / 'an evaluation')
    (folder / 'reports').mkdir()
    (folder / 'reports' / f'{keys[8]}.html').write_text('the report')
    return summarise(folder)


def test_text_is_for_terminals(summary: Summary) -> None:
    text = summary_text(summary)
    assert all(line.isprintable() for line in text.splitlines())
    rows = {line[2:27].strip(): line for line in text.splitlines()}
    assert re.search(r'least TTC \[s\] +3\.25 \(3.\d+ to 3.\d+, n 6\) '
                     r'+2\.00 \(2\.00 to 2\.00, n 6\)', text)
    assert 'cells that failed [%]' in rows and '14.3 (0 to 49.2, n 7)' in text
    assert '+1.25 (+1.' in text and 'n 6) better' in text
    assert "Student's, of the scenarios' means" in text.replace('\n  ', ' ') and '(Holm)' in text
    assert "crgame evaluate '" in text and "an evaluation' --cell KEY" in text
    assert f'{summary.worst[0].key}.html' in text


def test_no_line_of_text_is_too_long(tmp_path: Path) -> None:
    """Six planners with long names: columns that do not fit stand below."""
    names = [f'a planner with a rather long name, number {number}' for number in range(6)]
    found = summarise(many(60, 3, names).write(tmp_path / 'rows'))
    lines = summary_text(found).splitlines()
    # The command, which names the folder, is exempt.
    assert max(len(line) for line in lines if str(tmp_path) not in line) <= 120
    assert sum(line.lstrip().startswith('least TTC [s]') for line in lines) >= 6


def test_tables_of_markdown_have_as_many_cells_in_each_row(summary: Summary) -> None:
    text = summary_markdown(summary)
    tables = [block.splitlines() for block in text.split('\n\n') if block.startswith('|')]
    assert len(tables) == 4
    for table in tables:
        assert len({len(re.findall(r'(?<!\\)\|', line)) for line in table}) == 1
    assert '<script' not in text.replace('\\<script', '')
    assert f'](reports/{summary.worst[0].key}.html)' in text
    assert text.count('](') == 1


def test_the_page_has_everything_in_it_and_can_do_nothing(summary: Summary,
                                                          tmp_path: Path) -> None:
    path = tmp_path / 'elsewhere.html'
    write_summary_page(summary, path)
    html = path.read_text(encoding='utf-8')
    page = Page(html)
    assert not {'script', 'img', 'iframe', 'object'} & {tag for tag, _ in page.elements}
    assert not [name for _, given in page.elements for name in given
                if name.startswith('on') or name in ('src', 'style')]
    style, = re.findall('<style>(.*?)</style>', html, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    policy = next(given['content'] for tag, given in page.elements
                  if given.get('http-equiv') == 'Content-Security-Policy')
    assert policy == (f"default-src 'none'; script-src 'none'; style-src 'sha256-{digest}'; "
                      "img-src data:; base-uri 'none'; form-action 'none'")
    assert '<script>alert(1)</script>' in page.text and '⟨U+202E⟩' in page.text
    links = [given['href'] for tag, given in page.elements
             if tag == 'a' and not str(given['href']).startswith('#')]
    assert links == [f'an%20evaluation/reports/{summary.worst[0].key}.html']
    for cell in summary.worst[1:]:
        assert summary.report_command(cell.key) in page.text
    assert summary.report_command(summary.worst[0].key) not in page.text
    anchors = {given['href'] for tag, given in page.elements if tag == 'a'} - set(links)
    assert anchors == {f'#{given["id"]}' for tag, given in page.elements if tag == 'section'}


def test_only_keys_lead_to_reports(tmp_path: Path) -> None:
    """For any key in a part no link leaves the folder of reports."""
    rows = Evaluation()
    rows.add(avs=[{'worst_ttc': 1.0}])
    rows.cells[0]['cell'] = rows.vehicles[0]['cell'] = '../../secret'
    folder = rows.write(tmp_path / 'rows')
    (folder / 'reports').mkdir()
    (tmp_path / 'secret.html').write_text('a secret')
    found = summarise(folder)
    assert found.worst[0].key == '../../secret' and found.report('../../secret') is None


@pytest.mark.parametrize(('value', 'name', 'expected'), [
    (0.12345, 'collision', '12.3'), (0.0, 'collision', '0'), (1.0, 'collision', '100'),
    (2.0, 'worst_ttc', '2.00'), (1234.5, 'distance', '1234'), (-0.00123, 'nuplan', '-0.00123'),
    (-1e-9, 'nuplan', '0'), (np.nan, 'worst_ttc', '-'), (np.inf, 'worst_ttc', 'inf')])
def test_numbers_have_three_digits(value: float, name: str, expected: str) -> None:
    assert quantity(value, MEASURES[name]) == expected


def test_pictures_are_to_scale() -> None:
    """Marks lie between the ticks where their values are."""
    svg = interval_svg([PlottedInterval('idm', 3.0, 2.0, 5.0, '3.00', 'estimate'),
                        PlottedInterval('mine', -1.0, np.nan, np.nan, '−1.00', 'worse')], True)
    ticks = np.array([(float(x), float(text.replace('−', '-'))) for x, text in re.findall(
        r'class="tick" x="([\d.]+)" y="\d+">([^<]+)<', svg)])
    assert ticks[0, 1] <= -1.0 and ticks[-1, 1] >= 5.0 and 0.0 in ticks[:, 1]
    circles = [float(x) for x in re.findall(r'cx="([\d.]+)"', svg)]
    lines = re.findall(r'class="estimate" x1="([\d.]+)" x2="([\d.]+)"', svg)
    assert np.interp(circles, *ticks.T) == pytest.approx([3.0, -1.0], abs=0.01)
    assert np.interp(list(map(float, lines[0])), *ticks.T) == pytest.approx([2.0, 5.0], abs=0.01)
    assert 'x1' not in svg.partition('class="worse"')[2]
    zero, = re.findall(r'class="zero" x1="([\d.]+)"', svg)
    assert np.interp(float(zero), *ticks.T) == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize('number', [0.0, 1e-16, -3e-13, 5.0, 1e9, -1e300])
@pytest.mark.parametrize('more', [0.0, 1e-16, 4e-12])
def test_numbers_that_hardly_differ_can_be_drawn(number: float, more: float) -> None:
    svg = interval_svg([PlottedInterval('a', number, number, number + more, 'x', 'estimate')],
                       with_zero=False)
    assert 'nan' not in svg and 'inf' not in svg


def test_the_command_prints_and_writes_the_page(tmp_path: Path,
                                                capsys: pytest.CaptureFixture[str]) -> None:
    folder = many(40, 3).write(tmp_path / 'rows')
    parser = argparse.ArgumentParser()
    add_summary_arguments(parser)

    def printed(*arguments: str) -> str:
        assert summarise_command(folder, parser.parse_args(arguments)) == 0
        return capsys.readouterr().out

    own = ('--measure', 'worst_ttc', '--by', 'planner', '--by', 'human', '--baseline', 'mine',
           '--worst', 'worst_ttc')
    expected = summarise(folder, measures=['worst_ttc'], by=('planner', 'human'), baseline='mine',
                         worst=['worst_ttc'])
    assert printed(*own, '--format', 'json') == json.dumps(
        expected.as_dict(), indent=2, allow_nan=False, ensure_ascii=False) + '\n'
    assert printed(*own) == summary_text(expected)
    assert printed(*own, '--format', 'markdown') == summary_markdown(expected)
    page = (folder / 'summary.html').read_text(encoding='utf-8')
    assert 'Differences from mine' in page
    assert [path.name for path in folder.iterdir() if path.is_file()] == ['summary.html']
