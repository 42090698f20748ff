# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads an evaluation's cells in blocks, so that memory does not grow with their number."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
import hashlib
from pathlib import Path
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.evaluation.results.cell_rows import FACTORS, TEXT_FACTORS
from crgame_ros.evaluation.results.parts import newest_parts, part_paths
from crgame_ros.evaluation.summary.cluster_means import CellClusters, IntArray
import numpy as np
from numpy.typing import NDArray
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

_REQUIRED = {'cells': ('cell', 'status'), 'vehicles': ('cell', 'vehicle', 'role')}


class PartBatch(NamedTuple):
    """
    Rows of parts that have the same columns.

    :param rows: rows with all requested columns; columns that the parts lack are empty.
    """

    rows: pa.RecordBatch
    columns: frozenset[str]


class EvaluatedParts:
    """
    The cells that were finished at construction; cells added later are not read.

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


class FactorLabels:
    """
    The distinct labels of a factor.

    :param texts: all labels.
    :ivar texts: labels in alphabetical order, which is the order of their numbers.
    """

    def __init__(self, texts: Iterable[str]) -> None:
        self.texts = sorted(set(texts))
        self._array = pa.array(self.texts, pa.string())
        self._digests = np.array([digest_of(text) for text in self.texts], np.uint64)

    def numbers(self, column: pa.Array) -> NDArray[np.int32]:
        """
        Return the numbers of a column's labels (N); an empty value is an empty label.

        :raises KeyError: if it contains an unknown label.
        """
        found = pc.index_in(pc.fill_null(column, ''), value_set=self._array)
        if found.null_count:
            raise KeyError(column.filter(found.is_null())[0].as_py())
        return np.asarray(found.to_numpy(), np.int32)

    def digests(self, numbers: NDArray[np.int32]) -> NDArray[np.uint64]:
        """Return the digests of the labels (N), which do not depend on the other labels."""
        return np.asarray(self._digests[numbers])


def digest_of(text: str) -> int:
    """Return a 64-bit digest of a text."""
    content = text.encode('utf-8', 'surrogatepass')
    return int.from_bytes(hashlib.blake2b(content, digest_size=8).digest(), 'little')


def mixed(found: NDArray[np.uint64], more: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """
    Return digests (N) mixed with others, by the finaliser of splitmix64, which spreads every bit.

    Among 100,000 different cells, two have the same 64 bits with a probability of 3e-10.
    """
    with np.errstate(over='ignore'):
        value = (found ^ more) + np.uint64(0x9e3779b97f4a7c15)
        value = (value ^ (value >> np.uint64(30))) * np.uint64(0xbf58476d1ce4e5b9)
        value = (value ^ (value >> np.uint64(27))) * np.uint64(0x94d049bb133111eb)
        return np.asarray(value ^ (value >> np.uint64(31)))


BLOCK_CELLS = 65_536
# Greatest length of the reason of a cell's failure [characters].
_LONGEST_REASON = 200
_OK = 'ok'
_COLUMNS = {'cell': pa.string(), 'status': pa.string(), 'reason': pa.string(),
            'state_hash': pa.string(),
            **{factor: pa.string() for factor in TEXT_FACTORS}, 'seed': pa.int64()}


@dataclass(frozen=True)
class CellBlock:
    """
    A block of cells (N), each once, in the order of their keys.

    :param labels: (N, 7) numbers of their labels, in the order of `TEXT_FACTORS`.
    :param seeds: (N)
    :param pairs: (N) digests, equal for cells that share all factors but the planner.
    :param status: `ok`, or the kind of failure.
    :param reasons: reason of the failure, shortened.
    :param ok: (N) whether the cell succeeded.
    :param runs: (N) digests of their runs, equal for runs with the same states.
    """

    number: int
    keys: pa.ChunkedArray
    labels: NDArray[np.int32]
    seeds: IntArray
    pairs: NDArray[np.uint64]
    status: pa.ChunkedArray
    reasons: pa.ChunkedArray
    ok: NDArray[np.bool_]
    runs: NDArray[np.uint64]


class CellBlocks:
    """
    The cells in blocks, which do not depend on the parts: pairs are never split between blocks.

    Each block reads all parts and keeps its own rows. A cell that was run again counts once, as
    ok if any of its runs succeeded.

    :param block_cells: approximate number of cells in a block.
    :ivar labels: labels of each text factor.
    :ivar count: number of blocks.
    """

    def __init__(self, parts: EvaluatedParts, block_cells: int = BLOCK_CELLS) -> None:
        self.labels = {factor: FactorLabels(texts) for factor, texts in _all_labels(parts).items()}
        self.count = max(1, -(-parts.rows // block_cells))
        self._parts = parts

    def __iter__(self) -> Iterator[CellBlock]:
        return map(self._read, range(self.count))

    @property
    def planners(self) -> list[str]:
        """Return the planners' labels in alphabetical order."""
        return [text for text in self.labels['planner'].texts if text]

    def clusters(self, block: CellBlock) -> CellClusters:
        """Return what its cells have in common; a cell without a scenario has that of its game."""
        scenarios, games, participants = (
            block.labels[:, TEXT_FACTORS.index(name)].astype(np.int64)
            for name in ('scenario', 'game', 'participant'))
        # The empty label has number 0. Games get negative numbers, apart from those of scenarios.
        return CellClusters(np.where(scenarios == 0, -1 - games, scenarios), participants,
                            block.runs)

    def factors(self, block: CellBlock, row: int) -> tuple[str, ...]:
        """Return the labels and the seed of a cell, in the order of `FACTORS`."""
        texts = (self.labels[factor].texts[number] for factor, number in zip(
            TEXT_FACTORS, block.labels[row].tolist(), strict=True))
        return (*texts, str(block.seeds[row]))

    def _read(self, number: int) -> CellBlock:
        tables, labels, seeds, pairs = [], [], [], []
        for batch in self._parts.batches('cells', _COLUMNS):
            numbers = np.column_stack([self.labels[factor].numbers(batch.rows[factor])
                                       for factor in TEXT_FACTORS])
            own_seeds = pc.fill_null(batch.rows['seed'], 0).to_numpy()
            digests = self._pairs(numbers, own_seeds)
            mine = digests % np.uint64(self.count) == number
            tables.append(_failure_columns(batch.rows.filter(pa.array(mine))))
            labels.append(numbers[mine])
            seeds.append(own_seeds[mine])
            pairs.append(digests[mine])
        if not tables:
            return _empty(number)
        table = pa.Table.from_batches(tables).combine_chunks()
        rows = _each_once(table)
        table = table.take(pa.array(rows))
        own_pairs = np.concatenate(pairs)[rows]
        # Runs without a hash of their states are different ones.
        runs = np.array([digest_of(text) if text else other for text, other in zip(
            table['state_hash'].to_pylist(), own_pairs.tolist(), strict=True)], np.uint64)
        return CellBlock(number, table['cell'], np.concatenate(labels)[rows],
                         np.concatenate(seeds)[rows], own_pairs, table['status'],
                         table['reason'], ~table['failed'].to_numpy(), runs)

    def _pairs(self, numbers: NDArray[np.int32], seeds: IntArray) -> NDArray[np.uint64]:
        digests = [self.labels[factor].digests(numbers[:, column])
                   for column, factor in enumerate(TEXT_FACTORS) if factor != 'planner']
        return reduce(mixed, (*digests, seeds.view(np.uint64)),
                      np.full(len(seeds), len(FACTORS), np.uint64))


def _all_labels(parts: EvaluatedParts) -> dict[str, set[str]]:
    found: dict[str, set[str]] = {factor: {''} for factor in TEXT_FACTORS}
    for batch in parts.batches('cells', {factor: pa.string() for factor in TEXT_FACTORS}):
        for factor, texts in found.items():
            texts.update(pc.unique(pc.fill_null(batch.rows[factor], '')).to_pylist())
    return found


def _failure_columns(rows: pa.RecordBatch) -> pa.RecordBatch:
    status = pc.fill_null(rows['status'], '')
    return pa.RecordBatch.from_arrays([
        pc.fill_null(rows['cell'], ''), pc.not_equal(status, _OK), status,
        pc.utf8_slice_codeunits(pc.fill_null(rows['reason'], ''), 0, _LONGEST_REASON),
        pc.fill_null(rows['state_hash'], '')],
        ['cell', 'failed', 'status', 'reason', 'state_hash'])


def _each_once(table: pa.Table) -> IntArray:
    """Return the rows of a table of cells in the order of their keys, one for each cell."""
    order = pc.sort_indices(table, [(name, 'ascending') for name in table.column_names])
    keys = table['cell'].take(order)
    first = np.ones(len(keys), bool)
    first[1:] = pc.not_equal(keys.slice(1), keys.slice(0, max(len(keys) - 1, 0))).to_numpy()
    return np.asarray(order.to_numpy()[first], np.int64)


def _empty(number: int) -> CellBlock:
    texts = pa.chunked_array([], pa.string())
    return CellBlock(number, texts, np.empty((0, len(TEXT_FACTORS)), np.int32),
                     np.empty(0, np.int64), np.empty(0, np.uint64), texts, texts,
                     np.empty(0, bool), np.empty(0, np.uint64))


class CellGroups:
    """
    Cells that share the labels of some factors.

    :param by: the factors.
    :ivar labels: labels of each group by its number, in the order of their first cells.
    """

    def __init__(self, blocks: CellBlocks, by: Sequence[str]) -> None:
        self._blocks, self._by = blocks, tuple(by)
        self.labels: list[tuple[str, ...]] = []
        self._numbers: dict[tuple[str, ...], int] = {}

    def numbers(self, block: CellBlock) -> IntArray:
        """Return the number of each cell's group (N)."""
        columns = [TEXT_FACTORS.index(factor) for factor in self._by]
        different, inverse = np.unique(block.labels[:, columns], axis=0, return_inverse=True)
        own = []
        for row in different.tolist():
            labels = tuple(self._blocks.labels[factor].texts[number]
                           for factor, number in zip(self._by, row, strict=True))
            own.append(self._numbers.setdefault(labels, len(self._numbers)))
            if own[-1] == len(self.labels):
                self.labels.append(labels)
        return np.array(own, np.int64)[inverse.reshape(-1)]
