# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tables of an evaluation on disk: complete parts, and a journal of newer rows."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
import fcntl
from functools import partial
import json
import os
from pathlib import Path
import time
from types import TracebackType
from typing import IO, Self

from crgame_ros.analysis.tables.column import TableDeclaration
from crgame_ros.analysis.tables.writer import TableWriter
from crgame_ros.errors import InputError, refusing
from crgame_ros.evaluation.results.cell_rows import (
    CellRows,
    CELLS,
    TABLES_OF_CELLS,
    VEHICLES_OF_CELLS,
)
from crgame_ros.whole_file import name_whole, write_whole
import pyarrow as pa
import pyarrow.parquet as pq

PART_CELLS = 256
# A large part has as many cells as this number of parts.
PARTS_TOGETHER = 64
JOURNAL, LOCK = 'journal', '.lock'
EARLIER = 'earlier'
# The journal is written to the disk at most this often [s].
SYNC_S = 1.0


def part_name(number: int, last: int | None = None) -> str:
    """Return the file name of a part, or of the large part of those from one to a last one."""
    return f'part-{number:06}.parquet' if last is None else f'part-{number:06}-{last:06}.parquet'


def _numbers(name: str) -> tuple[int, int]:
    """Return the numbers of the first and the last part that a part stands for."""
    numbers = [int(number) for number in Path(name).stem.split('-')[1:]]
    return numbers[0], numbers[-1]


def part_paths(table: Path) -> list[Path]:
    """Return the parts in the folder of a table, in order; not those that a large one contains."""
    found: list[Path] = []
    last = -1
    for path in sorted(table.glob('part-[0-9]*.parquet'), key=lambda path: (
            _numbers(path.name)[0], -_numbers(path.name)[1])):
        if _numbers(path.name)[1] > last:
            found.append(path)
            last = _numbers(path.name)[1]
    return found


class ResultParts:
    """
    The store of finished cells' rows, which loses none however the process ends.

    A machine that fails may lose those that were added within a second of the last write to disk.

    Rows are appended to a journal, a line for each cell. Once there are `part_cells` of them, they
    are written as a part of each table. The part of `cells` is written last: if it exists, all are
    complete. A large part replaces those that it contains in the same way: where its part of
    `cells` does not exist, it does not count; where it does, the others do not.

    :param folder: folder of the evaluation; it is created.
    :param part_cells: number of cells in a part, at least.
    :raises InputError: if it cannot be written, or another process writes there.
    """

    def __init__(self, folder: Path, part_cells: int = PART_CELLS) -> None:
        self.folder, self._part_cells = folder, part_cells
        with self._refusing():
            for table in TABLES_OF_CELLS:
                (folder / table.name).mkdir(parents=True, exist_ok=True)
            self._lock = (folder / LOCK).open('w')
            try:
                fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise InputError('another evaluation writes there', str(folder),
                                 'wait for it, or name another folder') from error
        self._rows: list[CellRows] = []
        self._journal: IO[str] | None = None
        self._synced_s = 0.0
        self._journal_path = folder
        self._start_journal(self._recover())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def add(self, *cells: CellRows) -> None:
        """
        Store the rows of cells, by one write to the journal.

        :param cells: `cell`, `vehicles`, `work` of each, with all columns of the tables.
        :raises InputError: if they cannot be written.
        """
        with self._refusing():
            assert self._journal is not None
            self._journal.write(_lines(cells))
            self._journal.flush()
            if time.monotonic() - self._synced_s > SYNC_S:
                os.fsync(self._journal.fileno())
                self._synced_s = time.monotonic()
            self._rows += cells
            if len(self._rows) >= self._part_cells:
                self.finish_part()

    def finish_part(self) -> None:
        """Write the rows that are only in the journal as a part."""
        if not self._rows:
            return
        _replace_part(self.folder, part_name(self._number),
                      lambda table, path: _write_rows(table, self._rows, path))
        self._rows = []
        self._start_journal(self._number + 1)

    def join_parts(self) -> None:
        """Write all rows as few large parts, in the order in which they were added."""
        self.finish_part()
        for names in _joinable(self.folder, PARTS_TOGETHER * self._part_cells):
            name = part_name(_numbers(names[0])[0], _numbers(names[-1])[1])
            _replace_part(self.folder, name, partial(_write_joined, self.folder, names))
            _remove_others(self.folder)

    def close(self) -> None:
        """Release the folder without writing a part."""
        if self._journal is not None:
            self._journal.close()
        if not self._rows:
            with suppress(OSError):
                self._journal_path.unlink()
        self._lock.close()

    def keys(self) -> Iterator[str]:
        """Yield the keys of all stored cells."""
        for path in part_paths(self.folder / CELLS.name):
            yield from _read(path, ['cell'])['cell'].to_pylist()
        for rows in self._rows:
            yield str(rows['cell']['cell'])

    def keep_wanted(self, wanted: Callable[[str, str], bool]) -> int:
        """
        Put away the rows of unwanted cells, and restore those that are wanted again.

        :param wanted: returns for a key and a status whether the cell is wanted.
        :return: the number of cells put away.
        """
        self.finish_part()
        earlier, away = self.folder / EARLIER, 0
        before, known = _part_names(self.folder), set(self.keys())

        def is_wanted_again(key: str, status: str) -> bool:
            if key in known or not wanted(key, status):
                return False
            known.add(key)
            return True

        for name in _part_names(earlier):
            _move(earlier, name, self.folder, is_wanted_again)
        for name in before:
            away += _move(self.folder, name, earlier, lambda key, status: not wanted(key, status))
        self._start_journal(_next_number(self.folder))
        return away

    def _refusing(self) -> AbstractContextManager[None]:
        return refusing('cannot be written', self.folder,
                        'choose a folder that can be written, on a disk with room')

    def _start_journal(self, number: int) -> None:
        """Start the journal of a part, and remove an empty one of another part."""
        if self._journal is not None:
            self._journal.close()
            self._journal_path.unlink()
        self._number = number
        self._journal_path = self.folder / f'{JOURNAL}-{number:06}.jsonl'
        self._journal = self._journal_path.open('a', encoding='utf-8')

    def _recover(self) -> int:
        """Recover the state that an earlier process left; return the next part's number."""
        _remove_others(self.folder)
        number = _next_number(self.folder)
        for path in sorted(self.folder.glob(f'{JOURNAL}-*.jsonl')):
            if _journal_number(path) < number:
                # The process died between writing the part and removing the journal.
                path.unlink()
                continue
            self._rows += _journal_lines(path)
            write_whole(_lines(self._rows).encode(), path)
        return number


def _lines(cells: Iterable[Mapping[str, object]]) -> str:
    """Return the rows of cells as lines of a journal."""
    return ''.join(json.dumps(rows) + '\n' for rows in cells)


def _part_names(folder: Path) -> list[str]:
    return [path.name for path in part_paths(folder / CELLS.name)]


def _next_number(folder: Path) -> int:
    return max((_numbers(name)[1] for name in _part_names(folder)), default=-1) + 1


def _remove_others(folder: Path) -> None:
    """Remove files of parts that do not count: contained in a large one, or never complete."""
    names = {*_part_names(folder)}
    for table in TABLES_OF_CELLS:
        for path in (folder / table.name).glob('part-[0-9]*'):
            if path.name not in names:
                path.unlink()


def _joinable(folder: Path, most_cells: int) -> list[list[str]]:
    """Return the names of successive parts that can be one: of equal columns, and not too big."""
    groups: list[list[str]] = []
    size, columns = 0, None
    for name in _part_names(folder):
        with _refused(folder / CELLS.name / name):
            cells = pq.read_metadata(folder / CELLS.name / name).num_rows
        schemas = []
        for table in TABLES_OF_CELLS:
            with _refused(folder / table.name / name):
                schemas.append(pq.read_schema(folder / table.name / name))
        if not groups or schemas != columns or size + cells > most_cells:
            groups.append([])
            size, columns = 0, schemas
        groups[-1].append(name)
        size += cells
    return [names for names in groups if len(names) > 1]


def _write_joined(folder: Path, names: Sequence[str], table: TableDeclaration, path: Path) -> None:
    """Write the rows of some parts of a table, in their order."""
    rows = pa.concat_tables([_read(folder / table.name / name) for name in names])
    pq.write_table(rows.combine_chunks(), path, compression='zstd')


def newest_parts(folder: Path) -> Mapping[str, pa.Buffer]:
    """
    Return the rows that are only in the journal so far, as the bytes of a part of each table.

    :return: by the table's name; empty without such rows.
    """
    journals = {path: _journal_lines(path) for path in sorted(folder.glob(f'{JOURNAL}-*.jsonl'))}
    # Read the number only now, because a journal is removed after its part is written.
    number = _next_number(folder)
    cells = [rows for path, found in journals.items() if _journal_number(path) >= number
             for rows in found]
    parts: dict[str, pa.Buffer] = {}
    if cells:
        for table in TABLES_OF_CELLS:
            sink = pa.BufferOutputStream()
            _write_rows(table, cells, sink)
            parts[table.name] = sink.getvalue()
    return parts


def stored_rows(folder: Path) -> Iterator[tuple[dict[str, object], list[dict[str, object]]]]:
    """
    Yield the row of each finished cell, with the rows of its vehicles.

    :raises InputError: if a part is damaged.
    """
    newest = newest_parts(folder)
    parts: list[tuple[pa.Table, pa.Table]] = [
        (_read(folder / CELLS.name / name), _read(folder / VEHICLES_OF_CELLS.name / name))
        for name in _part_names(folder)]
    if newest:
        cells, vehicles = (pq.read_table(pa.BufferReader(newest[table.name]))
                           for table in (CELLS, VEHICLES_OF_CELLS))
        parts.append((cells, vehicles))
    for cells, vehicles in parts:
        by_cell: dict[str, list[dict[str, object]]] = {}
        for row in vehicles.to_pylist():
            by_cell.setdefault(row['cell'], []).append(row)
        yield from ((row, by_cell.get(row['cell'], [])) for row in cells.to_pylist())


def _journal_number(path: Path) -> int:
    return int(path.stem.rpartition('-')[2])


def _journal_lines(path: Path) -> list[CellRows]:
    """Read the rows of a journal; return none if it was removed in the meantime."""
    try:
        lines = path.read_text(encoding='utf-8').splitlines()
    except FileNotFoundError:
        return []
    rows = []
    for line in lines:
        # The last line may be incomplete: its cell was not finished.
        with suppress(ValueError):
            rows.append(json.loads(line))
    return rows


def _write_rows(table: TableDeclaration, cells: Sequence[CellRows],
                sink: Path | pa.NativeFile) -> None:
    """Write the rows of cells in a table."""
    with TableWriter(table, sink, 'parquet') as writer:
        writer.add_rows(row for each in cells for row in _rows_of(table, each))


def _rows_of(table: TableDeclaration, cell: CellRows) -> list[dict[str, object]]:
    if table is VEHICLES_OF_CELLS:
        return cell['vehicles']
    return [cell['cell'] if table is CELLS else cell['work']]


def _replace_part(folder: Path, name: str,
                  write: Callable[[TableDeclaration, Path], object]) -> None:
    """Write a part of every table, completely or not at all; that of `cells` is last."""
    written: list[tuple[Path, Path]] = []
    for table in reversed(TABLES_OF_CELLS):
        (folder / table.name).mkdir(parents=True, exist_ok=True)
        path = folder / table.name / name
        part = path.with_suffix(f'.{os.getpid()}.part')
        write(table, part)
        written.append((part, path))
    for part, path in written:
        name_whole(part, path)


def _move(source: Path, name: str, target: Path, chosen: Callable[[str, str], bool]) -> int:
    """Move the chosen cells of a part into a part of another folder; return their number."""
    cells = _read(source / CELLS.name / name, ['cell', 'status'])
    keys = {key for key, status in zip(*(column.to_pylist() for column in cells.columns),
                                       strict=True) if chosen(key, status)}
    if keys:
        for folder, new, inside in ((target, part_name(_next_number(target)), True),
                                    (source, name, False)):
            _replace_part(folder, new, partial(_write_filtered, source, name, keys, inside))
    return len(keys)


def _write_filtered(source: Path, name: str, keys: set[str], inside: bool,
                    table: TableDeclaration, path: Path) -> None:
    """Write the rows of a part whose cells are among the keys, or those whose cells are not."""
    rows = _read(source / table.name / name)
    pq.write_table(rows.filter(pa.array(
        [(key in keys) is inside for key in rows['cell'].to_pylist()], pa.bool_())), path,
        compression='zstd')


def _read(path: Path, columns: list[str] | None = None) -> pa.Table:
    """
    Read a part of a table.

    :param columns: only these, in this order; None: all.
    :raises InputError: if it is damaged.
    """
    with _refused(path):
        # Of one file alone: read_table would look for others around it.
        found = pq.ParquetFile(path).read(columns)
        return found if columns is None else found.select(columns)


@contextmanager
def _refused(path: Path) -> Iterator[None]:
    """Refuse a damaged part in one line."""
    try:
        yield
    except (pa.ArrowException, OSError, ValueError, KeyError) as error:
        reason = ' '.join(str(error).split())[:120]
        raise InputError(f'is damaged ({reason})', str(path), 'remove '
                         f'{path.parent.parent / CELLS.name / path.name}, and the same command '
                         'computes its cells again') from error
