# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Write the observations and rewards of environments into docs/gym.md.

    python3 scripts/make_gym_docs.py            write the tables
    python3 scripts/make_gym_docs.py --check    say whether they are up to date, change nothing
"""

import argparse
from pathlib import Path
import re
import sys

from crgame_ros.gym.reward import TERMS, USUAL_REWARD
from crgame_ros.policy.observation_spec import (
    OBJECT_COLUMNS,
    ObservedColumn,
    ROUTE_COLUMNS,
    STATE_COLUMNS,
)

DOCUMENT = Path(__file__).resolve().parent.parent / 'docs' / 'gym.md'


def observations() -> str:
    """Return the columns of each part."""
    lines = ['| part | number | unit | what | bounds | 1 if scaled |', '|---|---|---|---|---|---|']
    for part, columns in (('state', STATE_COLUMNS), ('route', ROUTE_COLUMNS),
                          ('objects', OBJECT_COLUMNS)):
        lines += [_column(part, index, column) for index, column in enumerate(columns)]
    return '\n'.join(lines)


def _column(part: str, index: int, column: ObservedColumn) -> str:
    return (f'| `{part}` | {index} `{column.name}` | {column.unit} | {column.meaning} | '
            f'{column.low:g} to {column.high:g} | {_one(part, column)} |')


def _one(part: str, column: ObservedColumn) -> str:
    if column.one is None:
        return '`reach`' if part == 'objects' else 'length of the route ahead'
    return f'{column.one:g}'


def terms() -> str:
    """Return the terms of the reward."""
    lines = ['| term | unit | what | default weight |', '|---|---|---|---|']
    lines += [f'| `{name}` | {term.unit} | {term.meaning} | {USUAL_REWARD.get(name, 0.0):g} |'
              for name, term in TERMS.items()]
    return '\n'.join(lines)


def main() -> int:
    """Write the document, or check it."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--check', action='store_true', help='change nothing')
    values = parser.parse_args()
    text = wanted = DOCUMENT.read_text(encoding='utf-8')
    for name, made in (('observations', observations()), ('terms', terms())):
        begin, end = f'<!-- {name}: begin -->', f'<!-- {name}: end -->'
        wanted, found = re.subn(f'{begin}.*?{end}', lambda _, a=begin, b=made, c=end:
                                f'{a}\n{b}\n{c}', wanted, flags=re.DOTALL)
        if found != 1:
            print(f'{DOCUMENT}: the comments "{begin}" and "{end}" are missing')
            return 1
    if wanted != text and values.check:
        print(f'{DOCUMENT} is out of date: run scripts/make_gym_docs.py')
        return 1
    if wanted != text:
        DOCUMENT.write_text(wanted, encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
