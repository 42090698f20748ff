# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A folder of tables is written whole or not at all, and foreign files stay."""

import hashlib
import json
from pathlib import Path
from typing import Any

from crgame_ros.analysis.tables.column import Column, INTEGER, RUN, TableDeclaration, TEXT
from crgame_ros.analysis.tables.run_tables import table_folder
from crgame_ros.errors import InputError
import polars
import pytest

TABLES = tuple(TableDeclaration(name, 'a row', ('run',), (
    RUN, Column('number', INTEGER, '1', 'counts'), Column('who', TEXT, '', 'name', empty='none')))
    for name in ('runs', 'others'))


def fill(out: Path, number: int, file_format: Any = 'parquet',
         error: BaseException | None = None) -> None:
    """Write a row into each table, and fail then where an error is given."""
    with table_folder(out, TABLES, file_format, 'trial') as writers:
        for writer in writers.values():
            writer.add({'run': ['a'], 'number': [number]})
        if error is not None:
            raise error


def names(out: Path) -> list[str]:
    return sorted(path.name for path in out.iterdir())


@pytest.mark.parametrize('file_format', ['parquet', 'csv'])
def test_the_dictionary_tells_of_the_files(tmp_path: Path, file_format: Any) -> None:
    """Paths, sizes, sums and rows are those of the files."""
    fill(tmp_path / 'out', 3, file_format)
    package = json.loads((tmp_path / 'out' / 'datapackage.json').read_text())
    assert names(tmp_path / 'out') == sorted(
        ['datapackage.json', *(resource['path'] for resource in package['resources'])])
    for resource in package['resources']:
        data = (tmp_path / 'out' / resource['path']).read_bytes()
        assert resource.get('bytes', len(data)) == len(data)
        assert resource['hash'] == f'sha256:{hashlib.sha256(data).hexdigest()}'
        assert (resource['rows'], resource['format']) == (1, file_format)


@pytest.mark.parametrize('error', [KeyboardInterrupt(), InputError('no'), ValueError('bug')])
def test_an_interruption_leaves_what_was_there(tmp_path: Path, error: BaseException) -> None:
    """A new folder has no files, an old one has the earlier export unchanged."""
    out = tmp_path / 'out'
    with pytest.raises(type(error)):
        fill(out, 1, error=error)
    assert names(out) == []
    fill(out, 2)
    before = {name: (out / name).read_bytes() for name in names(out)}
    with pytest.raises(type(error)):
        fill(out, 3, error=error)
    assert {name: (out / name).read_bytes() for name in names(out)} == before


def test_an_earlier_export_is_replaced_and_nothing_else(tmp_path: Path) -> None:
    """This holds also for another format; foreign files stay, or stop it."""
    fill(tmp_path, 1)
    (tmp_path / 'notes.csv').write_text('mine')
    fill(tmp_path, 2, 'csv')
    assert names(tmp_path) == ['datapackage.json', 'notes.csv', 'others.csv', 'runs.csv']
    assert polars.read_csv(tmp_path / 'runs.csv')['number'].to_list() == [2]
    (tmp_path / 'runs.parquet').write_text('mine, too')
    with pytest.raises(InputError, match='no exported table'):
        fill(tmp_path, 3)
    assert (tmp_path / 'runs.parquet').read_text() == 'mine, too'
    assert polars.read_csv(tmp_path / 'runs.csv')['number'].to_list() == [2]


@pytest.mark.parametrize('text', ['{}', 'no JSON', '[]', '{"createdBy": "somebody"}',
                                  '{"createdBy": "crgame_ros", "resources": [{"path": 3}]}'])
def test_a_foreign_dictionary_is_not_touched(tmp_path: Path, text: str) -> None:
    """A datapackage.json is replaced only if it describes our tables."""
    (tmp_path / 'datapackage.json').write_text(text)
    if 'crgame_ros' in text:
        fill(tmp_path, 1)
        return
    with pytest.raises(InputError, match='datapackage.json: a file that is no exported'):
        fill(tmp_path, 1)
    assert names(tmp_path) == ['datapackage.json']


def test_a_dictionary_cannot_name_files_to_remove_elsewhere(tmp_path: Path) -> None:
    """Paths out of the folder, and files that could be no table, are never removed."""
    victims = [tmp_path / 'keep.csv', tmp_path / 'out' / 'keep.txt']
    (tmp_path / 'out').mkdir()
    for victim in victims:
        victim.write_text('mine')
    (tmp_path / 'out' / 'datapackage.json').write_text(json.dumps({
        'createdBy': 'crgame_ros 1', 'resources': [{'path': '../keep.csv'},
                                                   {'path': 'keep.txt'}]}))
    fill(tmp_path / 'out', 1)
    assert [victim.read_text() for victim in victims] == ['mine', 'mine']


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    """For instance a file is in its place."""
    (tmp_path / 'file').write_text('')
    with pytest.raises(InputError, match='cannot be written'):
        fill(tmp_path / 'file' / 'out', 1)
