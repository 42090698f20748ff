# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Digests of the code that a cell depends on, separate for the engine and each planner."""

import ast
from collections.abc import Iterable, Iterator
from functools import cache
import hashlib
from importlib.metadata import PackageNotFoundError, version
import inspect
from pathlib import Path
import sys

from crgame_ros.planner.registry import BUILT_IN, EXTERNAL, planner_class
from crgame_ros.version import __version__

# A larger planner should be installed on the workers instead [bytes].
MOST_BYTES = 512 * 1024 * 1024
_PACKAGE = __name__.partition('.')[0]


def code_neighbours(file: Path) -> list[Path]:
    """
    Find what a Python file needs from its own folder: files that it names, modules it imports.

    Names are string literals in its source, as in `Path(__file__).with_name('weights.npz')`. Of a
    package, all files count. Python files among them are searched in the same way; a file that is
    not Python has no neighbours.

    :return: in alphabetical order, without the file itself.
    """
    found, to_read = {file}, [file]
    while to_read:
        reader = to_read.pop()
        nodes = list(_nodes(reader))
        named = [reader.with_name(name) for name in _texts(nodes)]
        for path in (*named, *_modules(_imports(nodes), file.parent)):
            if path not in found and path.is_file():
                found.add(path)
                to_read.append(path)
    return sorted(found - {file})


def _nodes(file: Path) -> Iterator[ast.AST]:
    """Yield all nodes of a Python file; none of another file, or of one with an error."""
    if file.suffix != '.py':
        return
    try:
        tree = ast.parse(file.read_bytes())
    except (OSError, SyntaxError, ValueError):
        # The error is reported when the file is loaded.
        return
    yield from ast.walk(tree)


def _texts(nodes: Iterable[ast.AST]) -> Iterator[str]:
    """Yield string literals that can be names of files in the same folder."""
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str) \
                and 0 < len(node.value.encode(errors='replace')) < 256 and '\0' not in node.value \
                and '/' not in node.value and node.value not in ('.', '..'):
            yield node.value


def _imports(nodes: Iterable[ast.AST]) -> Iterator[str]:
    """Yield the first parts of the names of imported modules."""
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name.partition('.')[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
            yield node.module.partition('.')[0]


def _modules(names: Iterable[str], folder: Path) -> Iterator[Path]:
    """Yield the files of the modules and packages of these names in a folder."""
    for name in set(names) - {_PACKAGE}:
        yield folder / f'{name}.py'
        if (folder / name / '__init__.py').is_file():
            yield from (path for path in sorted((folder / name).rglob('*'))
                        if '__pycache__' not in path.parts)


# Folders and modules that offline runs and measures never execute.
WITHOUT = ('cockpit', 'nodes', 'ros', 'launcher', 'evaluation/summary', 'analysis/pictures',
           'analysis/report', 'reproduction', 'gym', 'python_interface', 'cli.py',
           'doctor.py')


# Another version of these may give other results; '' where one is not installed.
PACKAGES = ('numpy', 'scipy', 'shapely', 'numba', 'commonroad-io', 'commonroad-clcs',
            'commonroad-drivability-checker', 'commonroad-idm-planner',
            'commonroad-reactive-planner')


def _version_of(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ''


@cache
def engine_digest() -> str:
    """
    Return the SHA-256 over the code of every cell, without planners.

    The versions of the packages that compute with it count, too.
    """
    package = Path(__file__).parents[1]
    planners = {f'{target.partition(":")[0].rpartition(".")[2]}.py'
                for target in BUILT_IN.values()}
    total = hashlib.sha256(__version__.encode())
    for name in PACKAGES:
        total.update(f'\0{name} {_version_of(name)}'.encode())
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

    Of an installed package, all of its modules count.

    :param name: its name in a game.
    :raises InputError: if there is no such planner.
    """
    if name == EXTERNAL:
        return ''
    file = inspect.getsourcefile(planner_class(name))
    if file is None:
        return ''
    total = hashlib.sha256(Path(file).read_bytes())
    for each in _package_files(planner_class(name)):
        total.update(f'\0{each.name}\0'.encode() + each.read_bytes())
    return total.hexdigest()


def _package_files(planner: type[object]) -> list[Path]:
    """Return the Python files of the installed package of a planner, if it is not this one."""
    name = planner.__module__.partition('.')[0]
    if name == _PACKAGE or name not in sys.modules:
        return []
    folders = getattr(sys.modules[name], '__path__', ())
    return sorted(path for folder in folders for path in Path(folder).rglob('*.py'))
