# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command `crgame schema`: JSON Schema of the files that users write."""

import argparse
import json
from pathlib import Path

from crgame_ros.schema.file_kinds import FILE_KINDS
from crgame_ros.whole_file import write_text

DESCRIPTION = """\
Write the JSON Schema (draft 2020-12) of a kind of file, with which editors complete and check it.

  crgame schema game --out game.schema.json

A YAML file names its schema in its first line, for editors with the YAML language server:

  # yaml-language-server: $schema=game.schema.json"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument('kind', nargs='?', default='game', choices=tuple(FILE_KINDS),
                        help='kind of file (default: game)')
    parser.add_argument('--out', type=Path, metavar='FILE', help='write it there, not to stdout')
    parser.set_defaults(command=run)


def run(values: argparse.Namespace) -> int:
    """
    Write a schema.

    :raises InputError: if the file cannot be written.
    """
    text = json.dumps(FILE_KINDS[values.kind].schema(), indent=2, ensure_ascii=False) + '\n'
    if values.out is None:
        print(text, end='')
        return 0
    write_text(text, values.out)
    print(values.out)
    return 0
