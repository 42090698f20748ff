# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes what is made from the code into documents, or checks it."""

import argparse
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
import re
import sys


def between(text: str, name: str, made: str) -> str:
    """
    Replace what stands between the comments <!-- NAME: begin --> and <!-- NAME: end -->.

    :raises SystemExit: if they are missing.
    """
    begin, end = f'<!-- {name}: begin -->\n', f'<!-- {name}: end -->'
    wanted, found = re.subn(f'{begin}.*?{end}', lambda _: f'{begin}{made}\n{end}', text,
                            flags=re.DOTALL)
    if found != 1:
        raise SystemExit(f'the comments "{name}: begin" and "{name}: end" are missing')
    return wanted


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table as Markdown."""
    lines = [head, ['---'] * len(head), *rows]
    return '\n'.join(f'| {" | ".join(cells)} |' for cells in lines)


def escaped(text: str) -> str:
    """Keep placeholders and bars from being read as markup."""
    return text.replace('<', '&lt;').replace('|', '\\|')


def main_of(description: str | None, files: Callable[[], Mapping[Path, str]]) -> int:
    """
    Write files, or with --check tell which are out of date.

    :param files: returns their texts.
    :return: the exit code.
    """
    parser = argparse.ArgumentParser(description=description,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--check', action='store_true',
                        help='say which files are out of date, and change nothing')
    check = parser.parse_args().check
    old = {path: text for path, text in files().items()
           if not path.is_file() or path.read_text(encoding='utf-8') != text}
    for path, text in old.items():
        if check:
            print(f'{path} is out of date: run scripts/{Path(sys.argv[0]).name}')
        else:
            path.write_text(text, encoding='utf-8')
            print(path)
    return int(check and bool(old))
