#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which tests of a failed run may be tried a second time, alone: those that keep to the clock.

    python scripts/second_try.py log/pytest.txt

Prints their ids, a line each, and exits with 1 if any other test failed, or more than MOST.
"""

from collections.abc import Iterator
from pathlib import Path
import re
import sys

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / 'test'))

from worker_roles import keeps_to_the_clock  # noqa: E402

# More of them have a cause of their own.
MOST = 5
# pytest's closing lines; pytest-xdist names the group behind the id.
_CLOSING = re.compile(r'(?:FAILED|ERROR) (\S+::.*?)@([\w/.-]+)(?: - .*)?')


def failed(text: str) -> Iterator[tuple[str, str]]:
    """Yield id and group of each test that failed, as pytest's closing lines name them."""
    for line in dict.fromkeys(text.splitlines()):
        match = _CLOSING.fullmatch(line)
        if match is not None:
            yield match[1], match[2]
        elif line.startswith(('FAILED ', 'ERROR ')):
            # Of a run in one process, or an error before any test.
            yield line, ''


def second_try(text: str) -> list[str] | None:
    """
    Choose the tests to try again.

    :param text: what pytest printed.
    :return: their ids; None if the run has failed whatever they do.
    """
    found = list(failed(text))
    if not 0 < len(found) <= MOST or not all(keeps_to_the_clock(group) for _, group in found):
        return None
    return [name for name, _ in found]


def main() -> int:
    """Print the ids."""
    if len(sys.argv) != 2:
        print(f'usage: {sys.argv[0]} FILE', file=sys.stderr)
        return 2
    chosen = second_try(Path(sys.argv[1]).read_text(encoding='utf-8', errors='replace'))
    print('\n'.join(chosen or ()))
    return 0 if chosen else 1


if __name__ == '__main__':
    sys.exit(main())
