# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame reproduce`: its files, exit codes, and output if no AV reacts."""

import json
from pathlib import Path
from xml.etree import ElementTree

from crgame_ros.cli import main
from crgame_ros.reproduction.commonroad_game import CAPTIONS
import pytest

pytestmark = pytest.mark.xdist_group('reproduction')
WORDS = ['reproduce', 'commonroad-game']


@pytest.mark.exhaustive
def test_without_reactions(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All files are there, each unmet expectation has its line, and the exit code is 1."""
    out = tmp_path / 'again'
    out.mkdir()
    assert main([*WORDS, '--offline', '--idm', 'constant-velocity', '--reactive',
                 'constant-velocity', '--out', str(out)]) == 1
    told = capsys.readouterr()
    unmet = [line for line in told.err.splitlines() if line.startswith('UNMET: ')]
    found = json.loads((tmp_path / 'again_2' / 'comparison.json').read_text())
    assert not found['met']
    assert found['mode'] == 'offline'
    assert len(unmet) == sum(not each['is_met'] for each in found['expectations'])
    for part in ('one AV, IDM: comes to a stop', 'one AV, reactive: leaves its lane',
                 'two AVs, IDM: each AV reacts', 'two AVs, reactive: each AV reacts'):
        assert any(part in line for line in unmet), part
    assert 'met: one AV, both: the same human' in told.out
    report = (tmp_path / 'again_2' / 'REPRODUCTION.md').read_text()
    assert f'expectations, {len(unmet)} of them unmet' in report
    assert report.count('**unmet**') == len(unmet)
    for name in CAPTIONS.keys() - {'figure_14_timing'}:
        ElementTree.parse(tmp_path / 'again_2' / f'{name}.svg')
        assert f'({name}.svg)' in report
    assert sorted(path.name for path in (tmp_path / 'again_2' / 'runs').iterdir()) == [
        'idm.xml', 'reactive.xml', 'two_avs_idm.xml', 'two_avs_reactive.xml']
    # Existing files are unchanged.
    assert not list(out.iterdir())


@pytest.mark.parametrize(('words', 'message'), [
    (['--duration', '0.5'], '--duration: is 0.5 s'),
    (['--duration', 'nan'], '--duration: is nan s'),
    (['--format', 'gif'], '--format: is "gif"'),
    (['--idm', 'nobody'], 'nobody'),
    (['--reactive', 'nowhere.py:Nobody'], 'nowhere.py')])
def test_refusals(words: list[str], message: str, tmp_path: Path,
                  capsys: pytest.CaptureFixture[str]) -> None:
    """Unusable arguments are refused in one line before anything is run or written."""
    assert main([*WORDS, '--offline', '--out', str(tmp_path / 'out'), *words]) == 2
    told = capsys.readouterr().err
    assert message in told
    assert told.count('\n') == 1
    assert not (tmp_path / 'out').exists()
