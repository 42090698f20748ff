# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The example trains an AV to merge, which then drives in a run of the game."""

from dataclasses import replace
import importlib.util
from pathlib import Path
import shutil
import sys
from types import ModuleType

from crgame_ros.game.game import load_game
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return a copy of the example, as a module."""
    for name in ('train_merge.py', 'train_merge.yaml', 'ZAM_DenseMerge-1_2_T-1.xml'):
        shutil.copy(ROOT / 'examples' / name, tmp_path)
    spec = importlib.util.spec_from_file_location('train_merge', tmp_path / 'train_merge.py')
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, 'train_merge', module)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(('arguments', 'said'), [
    (['--minutes', '0'], "argument --minutes: '0' is not a positive number of minutes"),
    (['--steps', 'many'], "argument --steps: 'many' is not a whole number from 1"),
    (['--worlds', '3'], 'unrecognized arguments: --worlds 3')])
def test_a_wrong_argument_is_refused_in_one_line(
    example: ModuleType, arguments: list[str], said: str, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, 'argv', ['train_merge.py', *arguments])
    with pytest.raises(SystemExit) as exit_:
        example.main()
    assert exit_.value.code == 2
    assert capsys.readouterr().err == f'train_merge.py: {said}\n'


@pytest.mark.exhaustive
def test_equal_steps_and_seeds_give_equal_weights_that_drive_a_run(
    example: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    monkeypatch.setattr(example, 'GENERATIONS', ((2, 1, 1),))
    found = []
    for cores in ('1', '2'):
        monkeypatch.setattr(sys, 'argv', ['train_merge.py', '--steps', '30', '--tests', '2',
                                          '--cores', cores])
        assert example.main() == 0
        found.append(np.load(tmp_path / 'trained_merge.npz')['weights'])
    assert found[0].shape == (4,)
    assert found[0].tobytes() == found[1].tobytes()
    assert (tmp_path / 'trained_merge.png').stat().st_size > 5000
    said = capsys.readouterr().out
    assert 'generation 1: ' in said and ' of 2 merged (' in said
    game = load_game(tmp_path / 'train_merge.yaml')
    assert game.avs is not None
    game = replace(game, avs=(replace(
        game.avs[0], planner=f'policy:{tmp_path / "train_merge.py"}:load'),))
    record = run_offline(build_setup(game), duration_s=2.0).planners['av0']
    assert (record.statistics.fallbacks, record.counters.accepted) == (0, 20)
