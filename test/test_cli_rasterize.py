# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame rasterize`: its files, its output, and the files that it does not overwrite."""

from pathlib import Path
import re
import subprocess
import sys
from types import SimpleNamespace

from crgame_ros.cli import main
from crgame_ros.occupancy import command as occupancy_command
from crgame_ros.occupancy.tiles import TiledOccupancy
import pytest


@pytest.fixture
def scenario(project_root: Path) -> Path:
    """Name a scenario with static obstacles."""
    return project_root / 'scenarios' / 'ZAM_ParkedCars-1_1_T-1.xml'


def run(*words: object) -> int:
    """Run the command in this process."""
    return main(['rasterize', *map(str, words)])


def test_a_map_and_a_line_about_it(scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                   capsys: pytest.CaptureFixture[str]) -> None:
    """Folders above the map are made, nothing else is left there; short work is not reported."""
    monkeypatch.setattr(occupancy_command, 'time', SimpleNamespace(monotonic=lambda: 0.0))
    assert run(scenario, tmp_path / 'maps' / 'street') == 0
    told = capsys.readouterr()
    assert not told.err
    assert re.fullmatch(r'\S+/street/map\.yaml: 39\d\d\d occupied cells of 0\.1 m, 6 of 10 tiles '
                        r'of 100 m have some, 500 m x 200 m\n', told.out)
    assert [path.name for path in (tmp_path / 'maps').iterdir()] == ['street']
    assert TiledOccupancy(tmp_path / 'maps' / 'street').resolution == 0.1


def test_options(scenario: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fewer cells without obstacles, only those of obstacles without curbs, more with ends."""
    cells = {}
    for name, words in {'all': (), 'curbs': ('--no-obstacles',), 'cars': ('--no-curbs',),
                        'ends': ('--no-obstacles', '--close-ends'),
                        'wide': ('--no-obstacles', '--curb-width', 0.5)}.items():
        assert run(scenario, tmp_path / name, '--resolution', 0.2, '--tile', 50, *words) == 0
        cells[name] = int(capsys.readouterr().out.split(': ')[1].split()[0])
    assert cells['all'] <= cells['curbs'] + cells['cars']
    assert cells['all'] > max(cells['curbs'], cells['cars'])
    # Two ends of 9 m or so, one to two cells of 0.2 m wide.
    assert 60 < cells['ends'] - cells['curbs'] < 250
    assert cells['wide'] > 1.5 * cells['curbs']


def test_what_is_there_stays(scenario: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
                             ) -> None:
    """A map is replaced with --force only, all of it; other folders and files never."""
    out = tmp_path / 'map'
    assert run(scenario, out) == 0
    before = {path: path.stat().st_ino for path in out.iterdir()}
    assert run(scenario, out, '--resolution', 1) == 2
    assert f'error: {out}: is there already; add --force' in capsys.readouterr().err
    assert {path: path.stat().st_ino for path in out.iterdir()} == before
    assert run(scenario, out, '--resolution', 1, '--tile', 200, '--force') == 0
    assert len(list(out.glob('tile_*.pgm'))) == 3
    assert [path.name for path in tmp_path.iterdir()] == ['map']
    (tmp_path / 'empty').mkdir()
    assert run(scenario, tmp_path / 'empty') == 0
    (tmp_path / 'mine').mkdir()
    (tmp_path / 'mine' / 'letter.txt').write_text('dear')
    (tmp_path / 'file').write_text('dear')
    (tmp_path / 'link').symlink_to(tmp_path / 'mine')
    capsys.readouterr()
    for name, message in (('mine', 'is a folder with other things in it; name a new folder'),
                          ('file', 'is no folder'), ('link', 'is no folder')):
        assert run(scenario, tmp_path / name, '--force') == 2
        assert capsys.readouterr().err.startswith(f'error: {tmp_path / name}: {message}')
    assert (tmp_path / 'mine' / 'letter.txt').read_text() == 'dear'


@pytest.mark.parametrize(('words', 'message'), [
    (('{scenario}',), 'crgame rasterize: the following arguments are required: out; see --help'),
    (('none.xml', '{out}'), 'none.xml: cannot be read (No such file or directory)'),
    (('{scenario}', '{out}', '--resolution', 'fine'), "invalid float value: 'fine'"),
    (('{scenario}', '{out}', '--resolution', '0.3'),
     '--tile: 100 m are 333.333 cells of 0.3 m; give a whole number of cells, 1 to 2048'),
    (('{scenario}', '{out}', '--tile', '1e5'), '--tile: is 100000; give a number from 1 to'),
    (('{scenario}', '{out}', '--no-curbs', '--no-obstacles'), 'has nothing to draw')],
    ids=['no folder', 'no scenario', 'no number', 'not whole', 'too large', 'nothing'])
def test_bad_input_is_one_line(words: tuple[str, ...], message: str, scenario: Path,
                               tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It has exit code 2 and names fault, place and remedy; nothing is written."""
    out = tmp_path / 'map'
    assert run(*(word.format(scenario=scenario, out=out) for word in words)) == 2
    told = capsys.readouterr()
    assert told.err.startswith('error: ')
    assert message in told.err
    assert told.err.count('\n') == 1
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written(scenario: Path, capsys: pytest.CaptureFixture[str]
                                         ) -> None:
    """One line, exit code 1."""
    assert run(scenario, '/proc/map') == 1
    assert capsys.readouterr().err.startswith('error: /proc/map: cannot write the map (')


def test_long_work_is_reported(scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                               capsys: pytest.CaptureFixture[str]) -> None:
    """Reports come after two seconds, then once a second, by a clock that advances when read."""
    clock = iter(range(1000))
    monkeypatch.setattr(occupancy_command, 'time',
                        SimpleNamespace(monotonic=lambda: float(next(clock))))
    assert run(scenario, tmp_path / 'map') == 0
    assert capsys.readouterr().err.splitlines() == [
        f'rasterize: {percent} % ({done} of 6 tiles drawn)'
        for percent, done in ((33, 2), (50, 3), (66, 4), (83, 5))]


def test_other_commands_do_not_wait_for_it() -> None:
    """Naming the arguments imports none of the libraries that drawing needs."""
    code = ("import sys; from crgame_ros.cli import _build_parser; _build_parser('info'); "
            "sys.exit(any(name in sys.modules for name in ('shapely', 'commonroad', 'numpy')))")
    assert subprocess.run([sys.executable, '-c', code], check=False).returncode == 0
