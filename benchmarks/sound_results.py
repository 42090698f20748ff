# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A finished evaluation and a study with two participants, for the trials of broken files."""

import importlib.util
from pathlib import Path
import sys
from typing import Any

from crgame_ros import cli
from crgame_ros.paths import scenarios_directory


def test_module(name: str) -> Any:
    """Import a module from the folder of the recording tests, which make recordings."""
    source = Path(__file__).resolve().parents[1] / 'test' / 'recording' / f'{name}.py'
    spec = importlib.util.spec_from_file_location(f'recording_{name}', source)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def make_results(folder: Path) -> None:
    """Make the folders `evaluation` and `studied`."""
    _command('evaluate', '--games', 'cut_in', '--planners', 'constant-velocity', '--seeds', '2',
             '--duration', '1', '--workers', '1', '--out', folder / 'evaluation')
    maker = test_module('conftest')
    make = maker.StudyMaker(maker.RunRecorder(maker.Samples()), folder / 'studied',
                            scenarios_directory() / 'cut_in.yaml')
    for place, name in enumerate(('P01', 'P02')):
        with make.session(name, place) as session:
            random = maker.np.random.default_rng(place)
            while session.next_item is not None:
                make.do(session, random)
    _command('study', 'data', folder / 'studied')


def _command(*words: object) -> None:
    code = cli.main([str(word) for word in words])
    assert not code, words


if __name__ == '__main__':
    make_results(Path(sys.argv[1]))
