# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tables of an evaluation survive every end of the process that writes them."""

from collections.abc import Callable
import os
from pathlib import Path
import re
import subprocess
import sys
import time
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.evaluation import results
from crgame_ros.evaluation.results.cell_rows import TABLES_OF_CELLS
from crgame_ros.evaluation.results.parts import EARLIER, ResultParts
from crgame_ros.evaluation.summary.cell_block import EvaluatedParts
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

FILL = """
import os, sys
from pathlib import Path
from crgame_ros.evaluation import results
from crgame_ros.evaluation.results.cell_rows import TABLES_OF_CELLS
from crgame_ros.evaluation.results.parts import ResultParts
sys.path.insert(0, sys.argv[2])
from test_result_parts import rows
parts = ResultParts(Path(sys.argv[1]), part_cells=4)
for number in range(10):
    parts.add(rows(number))
os.kill(os.getpid(), 9)
"""


def rows(number: int, status: str = 'ok') -> dict[str, Any]:
    """Return the rows of a cell with two vehicles."""
    key = f'{number:032x}'
    return {'cell': {'cell': key, 'planner': 'idm', 'seed': number, 'status': status},
            'vehicles': [{'cell': key, 'vehicle': name, 'distance': number + 0.1}
                         for name in ('hv0', 'av0')],
            'work': {'cell': key, 'wall_s': 0.5}}


def seeds(folder: Path, table: str = 'cells', column: str = 'seed') -> list[Any]:
    """Read a column of all parts, in their order."""
    return [value for path in sorted((folder / table).glob('part-*.parquet'))
            for value in pq.read_table(path)[column].to_pylist()]


@pytest.mark.exhaustive
def test_a_killed_process_loses_no_cell(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, '-c', FILL, tmp_path, Path(__file__).parent],
                          capture_output=True, text=True)
    assert done.returncode == -9, done.stderr
    assert seeds(tmp_path) == [*range(8)]
    with ResultParts(tmp_path, part_cells=4) as parts:
        assert list(parts.keys()) == [f'{number:032x}' for number in range(10)]
        parts.add(rows(10))
        parts.finish_part()
    assert seeds(tmp_path) == [*range(11)]
    assert seeds(tmp_path, 'vehicles', 'distance') == [n + 0.1 for n in range(11) for _ in (0, 1)]
    assert seeds(tmp_path, 'work', 'wall_s') == [0.5] * 11
    assert not list(tmp_path.glob('journal*')) and not list(tmp_path.rglob('*.part'))


def test_a_line_that_is_cut_off_is_no_cell(tmp_path: Path) -> None:
    with ResultParts(tmp_path) as parts:
        parts.add(rows(0))
        parts.add(rows(1))
    journal = next(tmp_path.glob('journal*'))
    journal.write_text(journal.read_text()[:-9])
    with ResultParts(tmp_path) as parts:
        assert list(parts.keys()) == [f'{0:032x}']
        parts.add(rows(2))
    with ResultParts(tmp_path) as parts:
        assert list(parts.keys()) == [f'{0:032x}', f'{2:032x}']


def test_a_journal_whose_part_is_written_counts_once(tmp_path: Path) -> None:
    with ResultParts(tmp_path) as parts:
        parts.add(rows(0))
        kept = next(tmp_path.glob('journal*')).read_text()
        parts.finish_part()
    (tmp_path / 'journal-000000.jsonl').write_text(kept)
    with ResultParts(tmp_path) as parts:
        assert list(parts.keys()) == [f'{0:032x}']


def test_a_second_writer_is_refused(tmp_path: Path) -> None:
    with ResultParts(tmp_path), pytest.raises(InputError, match='another evaluation writes there'):
        ResultParts(tmp_path)


@pytest.mark.parametrize('table', ['cells', 'vehicles', 'work'])
@pytest.mark.parametrize('damage', [
    lambda data: b'', lambda data: data[:len(data) // 2], lambda data: data[:-4] + b'none',
    lambda data: bytes(len(data) - 8) + data[-8:]])
def test_a_damaged_part_is_refused_with_what_to_remove(
        tmp_path: Path, table: str, damage: Callable[[bytes], bytes]) -> None:
    """As the message says, the cells of that part are gone then, and only those."""
    with ResultParts(tmp_path, part_cells=2) as parts:
        for number in range(6):
            parts.add(rows(number))
    part = tmp_path / table / 'part-000001.parquet'
    part.write_bytes(damage(part.read_bytes()))
    with pytest.raises(InputError, match='is damaged') as refused, ResultParts(tmp_path) as parts:
        list(parts.keys())
        parts.keep_wanted(lambda key, status: int(key, 16) > 4)
    assert str(part) in str(refused.value)
    removed = re.search(r'remove (\S+),', str(refused.value))
    assert removed is not None
    Path(removed[1]).unlink()
    with ResultParts(tmp_path) as parts:
        assert sorted(int(key, 16) for key in parts.keys()) in ([0, 1, 4, 5], [4, 5])


def test_what_is_not_wanted_is_put_away_and_comes_back(tmp_path: Path) -> None:
    with ResultParts(tmp_path, part_cells=3) as parts:
        for number in range(7):
            parts.add(rows(number, 'error' if number == 5 else 'ok'))
        assert parts.keep_wanted(lambda key, status: int(key, 16) > 1 and status == 'ok') == 3
        assert seeds(tmp_path) == [2, 3, 4, 6]
        assert sorted(seeds(tmp_path / EARLIER)) == [0, 1, 5]
        assert sorted(seeds(tmp_path / EARLIER, 'vehicles', 'distance')) == [
            0.1, 0.1, 1.1, 1.1, 5.1, 5.1]
        parts.add(rows(7))
        assert parts.keep_wanted(lambda key, status: int(key, 16) != 3) == 1
    assert sorted(seeds(tmp_path)) == [0, 1, 2, 4, 5, 6, 7]
    assert sorted(seeds(tmp_path, 'vehicles', 'distance')) == sorted(
        number + 0.1 for number in (0, 1, 2, 4, 5, 6, 7) for _ in (0, 1))
    assert seeds(tmp_path / EARLIER) == [3]


def test_each_part_that_was_put_away_is_read_as_often_as_one(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Reading all parts for each of them took hours with some thousand parts."""
    reads: dict[Path, int] = {}
    parquet_file = pq.ParquetFile

    def counted(path: Path) -> pq.ParquetFile:
        reads[path] = reads.get(path, 0) + 1
        return parquet_file(path)

    with ResultParts(tmp_path, part_cells=1) as parts:
        for number in range(12):
            parts.add(rows(number))
        assert parts.keep_wanted(lambda key, status: int(key, 16) > 9) == 10
        monkeypatch.setattr(pq, 'ParquetFile', counted)
        assert parts.keep_wanted(lambda key, status: int(key, 16) > 9) == 0
    # Ten parts are empty now, and two are not.
    assert len(reads) == 22
    assert max(reads.values()) <= 2


def names(folder: Path, table: str = 'cells') -> list[str]:
    """Return the names of all files of a table."""
    return sorted(path.name for path in (folder / table).iterdir())


def test_parts_become_few_large_ones_with_the_same_rows(tmp_path: Path) -> None:
    """A large part has 64 small ones' cells; later cells join the last large part."""
    with ResultParts(tmp_path, part_cells=1) as parts:
        for number in range(70):
            parts.add(rows(number))
        parts.join_parts()
        for table in TABLES_OF_CELLS:
            assert names(tmp_path, table.name) == ['part-000000-000063.parquet',
                                                   'part-000064-000069.parquet']
        parts.add(rows(70))
        parts.join_parts()
        parts.join_parts()
        assert list(parts.keys()) == [f'{number:032x}' for number in range(71)]
    assert names(tmp_path)[1:] == ['part-000064-000070.parquet']
    assert seeds(tmp_path) == [*range(71)]
    assert seeds(tmp_path, 'vehicles', 'distance') == [n + 0.1 for n in range(71) for _ in (0, 1)]
    with ResultParts(tmp_path) as parts:
        assert parts.keep_wanted(lambda key, status: int(key, 16) != 3) == 1
        parts.add(rows(71))
    assert seeds(tmp_path) == [*range(3), *range(4, 71)]
    assert seeds(tmp_path / EARLIER) == [3]


def test_parts_of_other_columns_stay_apart(tmp_path: Path) -> None:
    """A column that a part lacks is unknown there, not empty."""
    with ResultParts(tmp_path, part_cells=2) as parts:
        for number in range(8):
            parts.add(rows(number))
        for name in names(tmp_path, 'vehicles')[:2]:
            file = tmp_path / 'vehicles' / name
            pq.write_table(pq.read_table(file).drop_columns(['role']), file)
        parts.join_parts()
    assert names(tmp_path) == ['part-000000-000001.parquet', 'part-000002-000003.parquet']
    assert seeds(tmp_path) == [*range(8)]


class Killed(BaseException):
    """Stands for a kill: nothing is done afterwards."""


# Three new parts take the place of nine.
@pytest.mark.parametrize('step', range(12))
def test_a_kill_while_parts_are_joined_loses_and_doubles_nothing(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: int) -> None:
    with ResultParts(tmp_path, part_cells=2) as parts:
        for number in range(6):
            parts.add(rows(number))
        steps = iter(range(12))

        def killed_at(change: Any) -> Any:
            def changed(path: Path, *given: Any) -> Any:
                if next(steps) == step:
                    raise Killed
                return change(path, *given)
            return changed

        with monkeypatch.context() as patch, pytest.raises(Killed):
            patch.setattr(Path, 'replace', killed_at(Path.replace))
            patch.setattr(Path, 'unlink', killed_at(Path.unlink))
            parts.join_parts()
    known = EvaluatedParts(tmp_path)
    for table, column, kind, wanted in (
            ('cells', 'seed', pa.int64(), [*range(6)]),
            ('vehicles', 'distance', pa.float64(), [n + 0.1 for n in range(6) for _ in (0, 1)])):
        assert [value for batch in known.batches(table, {column: kind})
                for value in batch.rows[column].to_pylist()] == wanted
    with ResultParts(tmp_path) as parts:
        assert list(parts.keys()) == [f'{number:032x}' for number in range(6)]
        assert seeds(tmp_path) == [*range(6)]
        parts.join_parts()
    for table in TABLES_OF_CELLS:
        assert names(tmp_path, table.name) == ['part-000000-000002.parquet']
    assert seeds(tmp_path, 'vehicles', 'distance') == [n + 0.1 for n in range(6) for _ in (0, 1)]


def test_a_second_of_cells_is_written_to_the_disk_at_once(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each cell is with the operating system when it is added; the disk is asked rarely."""
    synced: list[int] = []
    with ResultParts(tmp_path) as parts:
        parts.add(rows(0))
        monkeypatch.setattr(os, 'fsync', synced.append)
        monkeypatch.setattr(time, 'monotonic', lambda: 0.0)
        for number in range(1, 100):
            parts.add(rows(number))
            assert len(next(tmp_path.glob('journal*')).read_text().splitlines()) == number + 1
        assert not synced
        monkeypatch.setattr(time, 'monotonic', lambda: 1e12)
        parts.add(*map(rows, range(100, 200)))
        assert len(next(tmp_path.glob('journal*')).read_text().splitlines()) == 200
    assert len(synced) == 1


def test_a_batch_is_one_write_and_one_part(tmp_path: Path,
                                           monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[str] = []
    lines = results.parts._lines
    monkeypatch.setattr(results.parts, '_lines', lambda cells: written.append('') or lines(cells))
    with ResultParts(tmp_path, part_cells=4) as parts:
        parts.add(*map(rows, range(3)))
        parts.add(*map(rows, range(3, 10)))
        parts.add(rows(10))
    assert len(written) == 3
    assert seeds(tmp_path) == [*range(10)]
    with ResultParts(tmp_path, part_cells=4) as parts:
        assert list(parts.keys()) == [f'{number:032x}' for number in range(11)]


@pytest.mark.slow
def test_a_summary_knows_of_cells_that_are_only_in_the_journal(tmp_path: Path) -> None:
    subprocess.run([sys.executable, '-c', FILL, tmp_path, Path(__file__).parent])
    parts = EvaluatedParts(tmp_path)
    assert parts.rows == 10
    for table, column, kind, wanted in (
            ('cells', 'seed', pa.int64(), [*range(10)]),
            ('vehicles', 'distance', pa.float64(), [n + 0.1 for n in range(10) for _ in (0, 1)])):
        assert [value for batch in parts.batches(table, {column: kind})
                for value in batch.rows[column].to_pylist()] == wanted
    # A journal whose part is written counts once; a line that is cut off does not count.
    kept = next(tmp_path.glob('journal*'))
    (tmp_path / 'journal-000000.jsonl').write_text(kept.read_text())
    kept.write_text(kept.read_text()[:-9])
    assert EvaluatedParts(tmp_path).rows == 9
