# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Write the columns of tables into the documentation.

Those that `crgame export` makes stand in docs/tables.md, those of staircases in docs/studies.md.

    python3 scripts/make_table_docs.py            write them
    python3 scripts/make_table_docs.py --check    say whether they are up to date, change nothing

They stand between two comments: <!-- columns: begin --> and <!-- columns: end -->; of staircases
<!-- columns of staircases: begin --> and so on.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
import re
import sys

from crgame_ros.analysis.tables.column import Column, TableDeclaration
from crgame_ros.analysis.tables.run_tables import TABLES
from crgame_ros.study.data.session_tables import STAIRCASES

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


PARTS: tuple[tuple[str, str, Callable[[], str]], ...] = (
    ('tables.md', 'columns', columns_of_runs),
    ('studies.md', 'columns of staircases', columns_of_staircases))


def written(document: Path, words: str, columns: str, check: bool) -> bool:
    """Write a part of a document, or check it; return whether it is as it should be."""
    text = document.read_text(encoding='utf-8')
    wanted, found = re.subn(
        f'(<!-- {words}: begin -->\n).*?(<!-- {words}: end -->)',
        lambda match: f'{match[1]}\n{columns}\n{match[2]}', text, flags=re.DOTALL)
    if found != 1:
        print(f'{document}: the comments "{words}: begin" and "{words}: end" are missing')
        return False
    if wanted == text:
        return True
    if check:
        print(f'{document} is out of date: run scripts/make_table_docs.py')
        return False
    document.write_text(wanted, encoding='utf-8')
    return True


def main() -> int:
    """Write the documents, or check them."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--check', action='store_true', help='change nothing')
    values = parser.parse_args()
    done = [written(DOCS / name, words, columns(), values.check) for name, words, columns in PARTS]
    return int(not all(done))


if __name__ == '__main__':
    sys.exit(main())
