# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the parts of an evaluation's folder batch by batch."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.evaluation.results.parts import newest_parts, part_paths
import pyarrow as pa
import pyarrow.parquet as pq

_REQUIRED = {'cells': ('cell', 'status'), 'vehicles': ('cell', 'vehicle', 'role')}


class PartBatch(NamedTuple):
    """
    Rows of parts that have the same columns.

    :param rows: rows with all requested columns; columns that the parts lack are empty.
    :param columns: columns that the parts have.
    """

    rows: pa.RecordBatch
    columns: frozenset[str]


class EvaluatedParts:
    """
    The cells that were finished at construction; cells added later are not read.

    :param folder: folder of the evaluation.
    :ivar rows: number of rows in the parts of `cells`.
    :ivar columns: columns that any part of `vehicles` has.
    :raises InputError: if there is no part, or one cannot be read.
    """

    def __init__(self, folder: Path) -> None:
        if not folder.is_dir():
            raise InputError('no such folder', str(folder), 'give the folder of an evaluation')
        newest = newest_parts(folder)
        self._parts: dict[str, list[Path | pa.Buffer]] = {
            table: [*part_paths(folder / table)] + ([newest[table]] if table in newest else [])
            for table in _REQUIRED}
        if not self._parts['cells']:
            raise InputError('no cell is finished', str(folder),
                             'give the folder of an evaluation, or wait until its first cells are')
        self.rows = sum(_read_metadata(part, 'cells').num_rows for part in self._parts['cells'])
        self.columns = frozenset(name for part in self._parts['vehicles']
                                 for name in _read_metadata(part, 'vehicles').schema.names)

    def batches(self, table: str, columns: Mapping[str, pa.DataType],
                batch_rows: int = 32_768) -> Iterator[PartBatch]:
        """
        Yield some columns of all parts in batches.

        :param table: `cells` or `vehicles`.
        :param columns: columns with the types to convert them to.
        :param batch_rows: greatest number of rows in a batch.
        :raises InputError: if a part is broken, or a column cannot be converted.
        """
        kept: list[PartBatch] = []
        for part in self._parts[table]:
            try:
                with pq.ParquetFile(_opened(part)) as file:
                    there = frozenset(file.schema_arrow.names)
                    for batch in file.iter_batches(
                            batch_rows, columns=list(there & columns.keys()), use_threads=False):
                        found = PartBatch(_wanted(batch, columns), there)
                        # Merge small parts: each batch has a fixed cost for its reader.
                        if kept and (kept[0].columns != there or batch_rows < sum(
                                each.rows.num_rows for each in (*kept, found))):
                            yield _together(kept)
                            kept = []
                        kept.append(found)
            except (pa.ArrowException, OSError) as error:
                raise _unreadable(part, error) from error
        if kept:
            yield _together(kept)


def _together(batches: list[PartBatch]) -> PartBatch:
    rows = pa.concat_batches([batch.rows for batch in batches])
    return PartBatch(rows, batches[0].columns)


def _wanted(batch: pa.RecordBatch, columns: Mapping[str, pa.DataType]) -> pa.RecordBatch:
    """Return the requested columns in the requested types; missing ones are empty."""
    there = batch.schema.names
    return pa.RecordBatch.from_arrays(
        [batch[name].cast(kind) if name in there else pa.nulls(batch.num_rows, kind)
         for name, kind in columns.items()], list(columns))


def _opened(part: Path | pa.Buffer) -> Path | pa.BufferReader:
    return part if isinstance(part, Path) else pa.BufferReader(part)


def _read_metadata(part: Path | pa.Buffer, table: str) -> pq.FileMetaData:
    try:
        found = pq.read_metadata(_opened(part))
    except (pa.ArrowException, OSError) as error:
        raise _unreadable(part, error) from error
    lacking = [name for name in _REQUIRED[table] if name not in found.schema.names]
    if lacking:
        raise InputError(f'has no column {", ".join(lacking)}', _named(part),
                         'give the folder of an evaluation')
    return found


def _named(part: Path | pa.Buffer) -> str:
    return str(part) if isinstance(part, Path) else 'journal'


def _unreadable(part: Path | pa.Buffer, error: Exception) -> InputError:
    if isinstance(part, Path) and not part.exists():
        return InputError('was joined with others, because the evaluation has ended', str(part),
                          'give the command again')
    reason = str(error).partition('\n')[0]
    return InputError(f'cannot be read ({reason})', _named(part),
                      'take it out of the folder: the cells in it are then missing')
