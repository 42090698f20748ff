# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Made data run through the whole analysis, and are never taken for people's."""

import json
from pathlib import Path

from crgame_ros.cli import main
import polars
import pytest

ANALYSIS = """
analysis:
  comparisons:
    - {measure: mean_speed_m_per_s, factor: planner, effect: 3.0}
    - {measure: tlx_mental, factor: scene, effect: 6, sd: 2, sd_of: trial}
"""


@pytest.fixture(scope='module')
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('made') / 'study'
    assert main(['study', 'new', str(folder)]) == 0
    file = folder / 'study.yaml'
    file.write_text(file.read_text() + ANALYSIS)
    return file


def make(study: Path, out: Path, *options: str) -> polars.DataFrame:
    """Make data, and return the table of trials."""
    assert main(['study', 'make-data', str(study), '--out', str(out), '--participants', '6',
                 *options]) == 0
    assert main(['study', 'data', str(out)]) == 0
    return polars.read_parquet(out / 'data' / 'trials.parquet')


def test_made_data_have_the_stated_effects_and_a_report(study: Path, tmp_path: Path) -> None:
    trials = make(study, tmp_path / 'made', '--effects', '--seed', '3')
    # Six people, four conditions, twice each.
    assert len(trials) == 48 and trials['made'].all() and trials['recording'].is_null().all()
    means = trials.group_by('scene').agg(polars.col('tlx_mental').mean()).rows()
    difference = dict(means)['merge'] - dict(means)['cut-in']
    # 24 trials of a standard deviation of 2 in each scene: within three standard errors.
    assert difference == pytest.approx(6.0, abs=3.0 * 2.0 * (2.0 / 24.0) ** 0.5)
    assert main(['study', 'report', str(tmp_path / 'made')]) == 0
    html = (tmp_path / 'made' / 'data' / 'report.html').read_text()
    assert 'Made data: ' in html and 'nobody took part' in html
    planned = html.partition('Differences within participants')[2].partition('</table>')[0]
    assert planned.count('&lt; 0.001') + planned.count('<td>0.0') >= 4
    told = json.loads((tmp_path / 'made' / 'data' / 'provenance.json').read_text())
    assert told['made'] is True
    assert main(['validate', str(tmp_path / 'made')]) == 0


def test_equal_seeds_give_equal_data_and_people_are_not_mixed_in(
        study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, again, other = (make(study, tmp_path / name, '--seed', seed)
                           for name, seed in (('a', '1'), ('b', '1'), ('c', '2')))
    assert first.equals(again) and not first.equals(other)
    assert main(['study', 'make-data', str(study), '--out', str(tmp_path / 'a')]) == 2
    capsys.readouterr()
    assert main(['study', 'run', str(study), '--participant', 'P99', '--out',
                 str(tmp_path / 'a')]) == 2
    assert 'has made data' in capsys.readouterr().err
