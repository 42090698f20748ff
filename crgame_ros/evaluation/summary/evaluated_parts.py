# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""The parts of an evaluation's folder, read batch by batch."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from crgame_ros.errors import InputError
import pyarrow as pa
import pyarrow.dataset as ds

# What a cell is made of; cells that share all but the planner are a pair.
TEXT_FACTORS = ('scenario', 'game', 'planner', 'human', 'perception', 'traffic')
FACTORS = (*TEXT_FACTORS, 'seed')

class PartBatch(NamedTuple):
    """
    Some rows of a part.

    :param rows: with all columns that were asked for; those that the part lacks are empty.
    :param columns: that the part has.
    """

    rows: pa.RecordBatch
    columns: frozenset[str]


class EvaluatedParts:
    """
    The parts that were there when it was made: whatever is added later is not read.

    :param folder: of the evaluation.
    :ivar rows: how many the parts of `cells` have.
    :ivar columns: all that any part of `vehicles` has.
    :raises InputError: if there is none, or one cannot be read.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        if not folder.is_dir():
            raise InputError('no such folder', str(folder), 'give the folder of an evaluation')
        self._parts = {table: sorted((folder / table).glob('part-*.parquet'))
                       for table in ('cells', 'vehicles')}
        if not self._parts['cells']:
            raise InputError('no cell is finished', str(folder),
                             'give the folder of an evaluation, or wait until its first cells are')
        self.rows = 0
        for path in self._parts['cells']:
            part = _fragment(path)
            _require(part, ('cell', 'status'))
            self.rows += part.count_rows()
        self.columns: frozenset[str] = frozenset()
        for path in self._parts['vehicles']:
            part = _fragment(path)
            _require(part, ('cell', 'vehicle', 'role'))
            self.columns |= set(part.physical_schema.names)

    def batches(self, table: str, columns: Mapping[str, pa.DataType],
                where: ds.Expression | None = None,
                batch_rows: int = 32_768) -> Iterator[PartBatch]:
        """
        Read some columns of all parts.

        :param table: `cells` or `vehicles`.
        :param columns: with the types that they are wanted in.
        :param where: which rows; None for all.
        :param batch_rows: at most so many rows at a time.
        :raises InputError: if a part is broken, or a column is of another kind.
        """
        schema = pa.schema(list(columns.items()))
        for path in self._parts[table]:
            # Opened anew each time: what thousands of files say of themselves takes room.
            part = _fragment(path)
            there = frozenset(part.physical_schema.names)
            try:
                for batch in part.to_batches(
                        schema=schema, filter=where, batch_size=batch_rows,
                        batch_readahead=1, use_threads=False):
                    if batch.num_rows:
                        yield PartBatch(batch, there)
            except (pa.ArrowException, OSError) as error:
                raise _unreadable(path, error) from error


def _fragment(path: Path) -> ds.ParquetFileFragment:
    try:
        part = next(iter(ds.dataset(path, format='parquet').get_fragments()))
        # Reads the end of the file, which says what is in it.
        part.ensure_complete_metadata()
    except (pa.ArrowException, OSError) as error:
        raise _unreadable(path, error) from error
    return part


def _require(part: ds.ParquetFileFragment, columns: Sequence[str]) -> None:
    lacking = [name for name in columns if name not in part.physical_schema.names]
    if lacking:
        raise InputError(f'has no column {", ".join(lacking)}', part.path,
                         'give the folder of an evaluation')


def _unreadable(path: Path, error: Exception) -> InputError:
    reason = str(error).partition('\n')[0]
    return InputError(f'cannot be read ({reason})', str(path),
                      'take it out of the folder: the cells in it are then missing')
