# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The dictionary: every column is explained, from one declaration, wherever it is read."""


from crgame_ros.analysis.criticality.criticality import MEASURES
from crgame_ros.analysis.tables.column import TableDeclaration
from crgame_ros.analysis.tables.data_package import table_schema
from crgame_ros.analysis.tables.pairs import PAIRS
from crgame_ros.analysis.tables.run_tables import TABLES
import pytest

UNITS = {'m/s^3', '1/s', '1/min', '', '1', 'm', 's', 'rad', 'Hz', 'm/s', 'm/s^2', 'rad/s', 's^2',
         'ms'}


@pytest.mark.parametrize('table', TABLES, ids=lambda table: table.name)
def test_every_column_is_explained(table: TableDeclaration) -> None:
    """Names once, SI units, definitions, keys that exist and are never empty."""
    names = [column.name for column in table.columns]
    assert len(set(names)) == len(names)
    for column in table.columns:
        assert column.name.isidentifier()
        assert column.name.islower()
        assert column.unit in UNITS
        assert len(column.definition) > 3
        assert column.kind != 'number' or column.unit
        assert not (column.name.endswith('_s') and column.unit not in ('s', 'm')), column.name
        assert not column.empty or column.name not in table.key
    assert set(table.key) <= set(names)


def test_measures_are_defined_by_themselves() -> None:
    """Unit and definition of each are the measure's own."""
    columns = {column.name: column for column in PAIRS.columns}
    assert list(columns)[-len(MEASURES):] == list(MEASURES)
    for name, measure in MEASURES.items():
        assert columns[name].unit == measure.unit
        assert columns[name].definition == measure.definition


def test_a_table_schema_says_what_the_standard_wants() -> None:
    """A column of each kind has the terms of Table Schema."""
    schema = {table.name: table_schema(table) for table in TABLES}
    fields = {field['name']: field for field in schema['states']['fields']}
    assert fields['k']['type'] == 'integer'
    assert fields['k']['constraints'] == {'required': True}
    assert fields['reverse']['type'] == 'boolean'
    assert (fields['reverse']['trueValues'], fields['reverse']['falseValues']) \
        == (['TRUE'], ['FALSE'])
    assert fields['x_center']['unit'] == 'm'
    assert fields['x_center']['referencePoint'] == 'center'
    assert 'scripted' in fields['role']['constraints']['enum']
    for name, found in schema.items():
        assert found['missingValues'] == ['', 'NaN']
        assert ('foreignKeys' in found) is (name != 'runs')
