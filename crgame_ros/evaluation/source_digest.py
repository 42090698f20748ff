# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which code a cell depends on: a change of one planner is no change of the others."""

from functools import cache
import hashlib
import inspect
from pathlib import Path

import crgame_ros
from crgame_ros import __version__
from crgame_ros.planner.planner_registry import BUILT_IN, EXTERNAL, planner_class

# Folders and modules whose code no offline run and no measure executes.
WITHOUT = ('cockpit', 'nodes', 'ros', 'launcher', 'evaluation/summary', 'analysis/pictures',
           'analysis/report', 'analysis/reproduction', 'gym', 'python_interface', 'cli.py',
           'doctor.py')


@cache
def engine_digest() -> str:
    """Return the SHA-256 over the version and the code that every cell runs, without planners'."""
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

    :param name: as a game names it.
    :raises InputError: if there is no such planner.
    """
    if name == EXTERNAL:
        return ''
    file = inspect.getsourcefile(planner_class(name))
    return '' if file is None else hashlib.sha256(Path(file).read_bytes()).hexdigest()
