# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Write the observations and rewards of environments into docs/gym.md."""

from pathlib import Path
import sys

from crgame_ros.gym.reward import TERMS, USUAL_REWARD
from crgame_ros.policy.observation_spec import (
    OBJECT_COLUMNS,
    ObservedColumn,
    ROUTE_COLUMNS,
    STATE_COLUMNS,
)
from written import between, main_of

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


def files() -> dict[Path, str]:
    """Return the document with its tables."""
    text = DOCUMENT.read_text(encoding='utf-8')
    for name, made in (('observations', observations()), ('terms', terms())):
        text = between(text, name, made)
    return {DOCUMENT: text}


if __name__ == '__main__':
    sys.exit(main_of(__doc__, files))
