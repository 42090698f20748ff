# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A table's file: readers' results, writing in pieces, and refusals."""

import csv
import math
from pathlib import Path
import shutil
import subprocess
from typing import Any

from crgame_ros.analysis.tables import writer as table_writer
from crgame_ros.analysis.tables.column import (
    Column,
    FLAG,
    INTEGER,
    NUMBER,
    TableDeclaration,
    TEXT,
)
from crgame_ros.analysis.tables.writer import FORMATS, TableWriter
import numpy as np
import pandas
import polars
import pyarrow.parquet as pq
import pytest

DECLARED = TableDeclaration('trial', 'a trial', ('number',), (
    Column('number', INTEGER, '1', 'counts'),
    Column('value', NUMBER, 'm', 'measured', 'center', 'first', 'now and then'),
    Column('text', TEXT, '', 'said', empty='nobody spoke'),
    Column('flag', FLAG, '', 'whether', empty='nobody knows')))
VALUES = [0.0, -1.0, 0.1 + 0.2, 5e-324, 1.7976931348623157e308, 1e22, math.inf, -math.inf,
          math.nan, 1e-7]
TEXTS = ['plain', 'a,b', 'say "so"', 'two\nlines', 'two\r\nlines', '=1+1', '@x', None, 'Straße 道',
         '-']
FLAGS = [True, False, None] * 3 + [True]
ROWS = {'number': np.arange(10), 'value': np.array(VALUES), 'text': TEXTS, 'flag': FLAGS}


def write(folder: Path, file_format: Any, *pieces: dict[str, Any]) -> Path:
    """Write a table of the declared columns."""
    path = folder / f'trial.{file_format}'
    with TableWriter(DECLARED, path, file_format) as writer:
        for piece in pieces:
            writer.add(piece)
    return path


def same_numbers(found: list[float | None]) -> bool:
    """Compare with VALUES bit by bit; NaN and missing count as equal."""
    return np.array_equal(np.array([math.nan if each is None else each for each in found]),
                          np.array(VALUES), equal_nan=True)


def guarded(texts: list[str | None]) -> list[str | None]:
    """Return the texts as CSV is to have them, spelled out."""
    return [{'=1+1': "'=1+1", '@x': "'@x", '-': "'-"}.get(text or '', text) for text in texts]


def test_polars_reads_both(tmp_path: Path) -> None:
    """Every bit of every number; types without a hint; missing as missing."""
    frame = polars.read_parquet(write(tmp_path, 'parquet', ROWS))
    assert frame.schema == {'number': polars.Int64, 'value': polars.Float64,
                            'text': polars.String, 'flag': polars.Boolean}
    assert same_numbers(frame['value'].to_list())
    assert frame['value'].null_count() == 1
    assert frame['value'].is_nan().sum() == 0
    assert frame['text'].to_list() == TEXTS
    assert frame['flag'].to_list() == FLAGS
    frame = polars.read_csv(write(tmp_path, 'csv', ROWS))
    assert frame.dtypes == [polars.Int64, polars.Float64, polars.String, polars.Boolean]
    assert same_numbers(frame['value'].to_list())
    assert frame['text'].to_list() == guarded(TEXTS)
    assert frame['flag'].to_list() == FLAGS


def test_pandas_reads_both(tmp_path: Path) -> None:
    """The same in pandas, without an option."""
    for file_format, read, texts in (('parquet', pandas.read_parquet, TEXTS),
                                     ('csv', pandas.read_csv, guarded(TEXTS))):
        frame = read(write(tmp_path, file_format, ROWS))
        assert frame['number'].dtype == (np.int64 if file_format == 'csv' else pandas.Int64Dtype())
        assert frame['value'].dtype == np.float64
        close = frame['value'].to_numpy()
        # Its fast reader of CSV may round the last digit.
        assert np.allclose(close, VALUES, rtol=1e-15, atol=0.0, equal_nan=True)
        assert [None if pandas.isna(text) else text for text in frame['text']] == texts
        assert [None if pandas.isna(flag) else bool(flag) for flag in frame['flag']] == FLAGS


def test_r_reads_csv(tmp_path: Path) -> None:
    """The same in R, with no package."""
    program = shutil.which('Rscript')
    if program is None:
        pytest.skip('R is not installed')
    path = write(tmp_path, 'csv', ROWS)
    done = subprocess.run([program, '--vanilla', '-e', (
        f'x <- read.csv("{path}"); cat(sapply(x, class), "\\n"); '
        'cat(x$value[7], x$value[8], is.na(x$value[9]), sum(x$value[c(1:3, 10)]), "\\n"); '
        'cat(is.na(x$flag[3]), sum(x$flag, na.rm=TRUE), nrow(x), x$text[6], "\\n")')],
        capture_output=True, text=True)
    assert done.stdout.split('\n')[:3] == [
        'integer numeric character logical ', 'Inf -Inf TRUE -0.6999999 ', "TRUE 4 10 '=1+1 "]


def test_csv_is_as_rfc_4180_has_it(tmp_path: Path) -> None:
    """CR LF at the end of every line, quotes doubled, and as many fields in each."""
    data = write(tmp_path, 'csv', ROWS).read_bytes()
    assert data.startswith(b'number,value,text,flag\r\n0,0.0,plain,TRUE\r\n')
    assert data.endswith(b'\r\n')
    assert b'"say ""so"""' in data
    assert b'8,NaN,' in data
    with (tmp_path / 'trial.csv').open(newline='', encoding='utf-8') as stream:
        assert {len(row) for row in csv.reader(stream, strict=True)} == {4}


def test_texts_that_nothing_takes(tmp_path: Path) -> None:
    """Control characters and half characters are replaced; all readers go on."""
    texts = {'number': [0, 1, 2], 'text': ['a\0b', 'a\x1b[31m', 'a\ud800b'], 'value': 1.0}
    for file_format in FORMATS:
        path = write(tmp_path, file_format, texts)
        frame = polars.read_csv(path) if file_format == 'csv' else polars.read_parquet(path)
        found = frame['text'].to_list()
        assert found == ['a\ufffdb', 'a\ufffd[31m', 'a?b']


def test_an_infinite_first_row_is_a_number_to_hasty_readers(tmp_path: Path) -> None:
    """With whole and missing numbers first, a guess of the type by the first rows is right."""
    values = np.concatenate((np.full(60, np.nan), np.zeros(60), [0.5]))
    path = write(tmp_path, 'csv', {'number': np.arange(121), 'value': values})
    frame = polars.read_csv(path, infer_schema_length=10)
    assert frame['value'].dtype == polars.Float64
    assert frame['value'][-1] == 0.5


def test_written_in_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Row groups of the size of a piece, and all rows in order."""
    monkeypatch.setattr(table_writer, 'PIECE_ROWS', 8)
    pieces = [{'number': np.arange(start, start + 5), 'value': 1.0, 'text': 'x'}
              for start in range(0, 50, 5)]
    path = write(tmp_path, 'parquet', *pieces)
    groups = pq.ParquetFile(path).metadata
    assert [groups.row_group(i).num_rows for i in range(groups.num_row_groups)] == [10] * 5
    assert polars.read_parquet(path)['number'].to_list() == list(range(50))
    assert polars.read_csv(write(tmp_path, 'csv', *pieces))['number'].to_list() == list(range(50))


def test_a_table_without_rows_has_its_columns(tmp_path: Path) -> None:
    """So has a table whose last piece is empty."""
    for file_format in FORMATS:
        for pieces in ((), ({'number': []},)):
            path = write(tmp_path, file_format, *pieces)
            frame = polars.read_csv(path) if file_format == 'csv' else polars.read_parquet(path)
            assert (frame.columns, frame.height) == (DECLARED.schema.names, 0)


def test_undeclared_columns_are_refused(tmp_path: Path) -> None:
    """A misspelt column must not be dropped in silence."""
    with pytest.raises(KeyError, match='valu'):
        write(tmp_path, 'parquet', {'number': [1], 'valu': [1.0]})
