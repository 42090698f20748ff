# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Write the columns of the tables that `crgame export` makes into docs/tables.md.

    python3 scripts/make_table_docs.py            write them
    python3 scripts/make_table_docs.py --check    say whether they are up to date, change nothing

They stand between two comments: <!-- columns: begin --> and <!-- columns: end -->.
"""

import argparse
from pathlib import Path
import re
import sys

from crgame_ros.analysis.tables.column import Column, TableDeclaration
from crgame_ros.analysis.tables.run_tables import TABLES

DOCUMENT = Path(__file__).resolve().parent.parent / 'docs' / 'tables.md'
_COLUMNS = re.compile(r'(<!-- columns: begin -->\n).*?(<!-- columns: end -->)', re.DOTALL)


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


def main() -> int:
    """Write the document, or check it."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--check', action='store_true', help='change nothing')
    values = parser.parse_args()
    text = DOCUMENT.read_text(encoding='utf-8')
    columns = '\n'.join(table(declaration) for declaration in TABLES)
    wanted, found = _COLUMNS.subn(lambda match: match[1] + '\n' + columns + '\n' + match[2], text)
    if found != 1:
        print(f'{DOCUMENT}: the comments "columns: begin" and "columns: end" are missing')
        return 1
    if wanted == text:
        return 0
    if values.check:
        print(f'{DOCUMENT} is out of date: run scripts/make_table_docs.py')
        return 1
    DOCUMENT.write_text(wanted, encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
