# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which packages this installation needs to run, and at which versions."""

from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, requires
from pathlib import Path
import sys

from packaging.requirements import Requirement

# Groups of requirements.txt that only who works on the package needs.
DEVELOPMENT = ('Build and test', 'A real browser in tests and benchmarks')


def read_pins(requirements: Path) -> Iterator[tuple[str, str, str]]:
    """
    Read the pinned packages.

    :return: for each its group (the comment above it), name and version.
    """
    group = ''
    for line in requirements.read_text(encoding='utf-8').splitlines():
        name, pinned, wanted = line.strip().partition('==')
        if line.startswith('# '):
            group = line[2:]
        elif pinned:
            yield group, name, wanted


def needed(requirements: Path, *, wheels: bool) -> list[Requirement]:
    """
    List what this installation needs to run, not what its development does.

    Where scripts/env.sh or nobody has installed the package, these are the pins; where pip or
    colcon has, what the package itself asks for.

    :param requirements: requirements.txt.
    :param wheels: whether ROS comes from wheels, which are then needed, too.
    """
    try:
        declared = requires('crgame_ros') or []
    except PackageNotFoundError:
        declared = []
    if not declared or (Path(sys.prefix) / 'stamp').is_file():
        found = [Requirement(f'{name}=={wanted}')
                 for group, name, wanted in read_pins(requirements) if group not in DEVELOPMENT]
    else:
        found = [item for item in map(Requirement, declared)
                 if item.marker is None or item.marker.evaluate({'extra': ''})]
    return [item for item in found if wheels or not item.name.startswith('ros-')]
