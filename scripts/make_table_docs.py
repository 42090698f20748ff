# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Write the columns of tables into the documentation.

Those that `crgame export` makes stand in docs/tables.md, those of staircases in docs/studies.md.
They stand between two comments: <!-- columns: begin --> and <!-- columns: end -->; of staircases
<!-- columns of staircases: begin --> and so on.
"""

from pathlib import Path
import sys

from crgame_ros.analysis.tables.column import Column, TableDeclaration
from crgame_ros.analysis.tables.run_tables import TABLES
from crgame_ros.study.data.session_tables import STAIRCASES
from written import between, main_of

DOCS = Path(__file__).resolve().parent.parent / 'docs'


def table(declaration: TableDeclaration) -> str:
    """Describe a table as Markdown."""
    rows = [f'### {declaration.name}\n',
            f'A row is {declaration.row}. Key: {", ".join(declaration.key)}.\n',
            '| column | type | unit | what | of | variant | empty where |',
            '|---|---|---|---|---|---|---|']
    return '\n'.join([*rows, *map(_row, declaration.columns)]) + '\n'


def _row(column: Column) -> str:
    unit = column.unit if column.unit != '1' else '-'
    values = f': {", ".join(f"`{value}`" for value in column.values)}' if column.values else ''
    cells = (f'`{column.name}`', column.kind, unit, column.definition + values,
             column.reference_point, column.variant, column.empty)
    return '| ' + ' | '.join(cell.replace('|', r'\|') for cell in cells) + ' |'


def columns_of_runs() -> str:
    """Describe the tables that `crgame export` makes."""
    return '\n'.join(table(declaration) for declaration in TABLES)


def columns_of_staircases() -> str:
    """Describe the table of staircases, without a heading."""
    return table(STAIRCASES).partition('\n\n')[2]


def files() -> dict[Path, str]:
    """Return the documents with their tables."""
    return {DOCS / file: between((DOCS / file).read_text(encoding='utf-8'), name, f'\n{columns}')
            for file, name, columns in (
                ('tables.md', 'columns', columns_of_runs()),
                ('studies.md', 'columns of staircases', columns_of_staircases()))}


if __name__ == '__main__':
    sys.exit(main_of(__doc__, files))
