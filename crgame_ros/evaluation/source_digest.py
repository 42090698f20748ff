# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Digests of the code that a cell depends on, separate for the engine and each planner."""

import ast
from collections.abc import Iterator
from functools import cache
import hashlib
import inspect
from pathlib import Path

import crgame_ros
from crgame_ros import __version__
from crgame_ros.planner.registry import BUILT_IN, EXTERNAL, planner_class

# A larger planner should be installed on the workers instead [bytes].
MOST_BYTES = 512 * 1024 * 1024


def code_neighbours(file: Path) -> list[Path]:
    """
    Find the files in a Python file's folder whose names are string literals in its source.

    An example is `Path(__file__).with_name('weights.npz')`. Python files among them are searched
    in the same way; a file that is not Python has no neighbours.

    :return: in alphabetical order, without the file itself.
    """
    found, to_read = {file}, [file]
    while to_read:
        for name in _texts(to_read.pop()):
            path = file.with_name(name)
            if path not in found and path.is_file():
                found.add(path)
                to_read.append(path)
    return sorted(found - {file})


def _texts(file: Path) -> Iterator[str]:
    """Yield string literals of a Python file that can be names of files in the same folder."""
    if file.suffix != '.py':
        return
    try:
        tree = ast.parse(file.read_bytes())
    except (OSError, SyntaxError, ValueError):
        # The error is reported when the file is loaded.
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) \
                and 0 < len(node.value) < 256 and '\0' not in node.value \
                and '/' not in node.value and node.value not in ('.', '..'):
            yield node.value


# Folders and modules that offline runs and measures never execute.
WITHOUT = ('cockpit', 'nodes', 'ros', 'launcher', 'evaluation/summary', 'analysis/pictures',
           'analysis/report', 'analysis/reproduction', 'gym', 'python_interface', 'cli.py',
           'doctor.py')


@cache
def engine_digest() -> str:
    """Return the SHA-256 over the version and the code of every cell, without planners."""
    package = Path(crgame_ros.__file__).parent
    planners = {f'{target.partition(":")[0].rpartition(".")[2]}.py'
                for target in BUILT_IN.values()}
    total = hashlib.sha256(__version__.encode())
    for path in sorted(package.rglob('*.py')):
        name = path.relative_to(package).as_posix()
        if name.startswith(WITHOUT) or path.parent.name == 'planner' and path.name in planners:
            continue
        total.update(f'\0{name}\0'.encode() + path.read_bytes())
    return total.hexdigest()


@cache
def planner_digest(name: str) -> str:
    """
    Return the SHA-256 over the code of the module that defines a planner.

    :param name: its name in a game.
    :raises InputError: if there is no such planner.
    """
    if name == EXTERNAL:
        return ''
    file = inspect.getsourcefile(planner_class(name))
    return '' if file is None else hashlib.sha256(Path(file).read_bytes()).hexdigest()
