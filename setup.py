# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Add to pyproject.toml what ament and colcon need: version, packages, data and executables."""

from pathlib import Path
import sys
from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = 'crgame_ros'
DATA_DIRECTORIES = ('launch', 'config', 'examples', 'scenarios', 'msg_defs', 'page')
# Relative paths only: setuptools refuses absolute ones in data_files.
ROOT = Path(__file__).resolve().parent
NODES = tuple(sorted(path.stem for path in (ROOT / PACKAGE / 'nodes').glob('*_node.py')))


def data_files() -> list[tuple[str, list[str]]]:
    """List what goes into the prefix: the ament marker, the manifest and the data directories."""
    share = f'share/{PACKAGE}'
    files = [
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (share, ['package.xml', 'requirements.txt', 'requirements-planners.txt']),
    ]
    for top in DATA_DIRECTORIES:
        for directory in sorted({path.parent for path in (ROOT / top).rglob('*')
                                 if path.is_file() and '__pycache__' not in path.parts}):
            where = directory.relative_to(ROOT).as_posix()
            names = sorted(path.name for path in directory.iterdir() if path.is_file())
            files.append((f'{share}/{where}', [f'{where}/{name}' for name in names]))
    if 'bdist_wheel' in sys.argv:
        files.append((f'lib/{PACKAGE}', wrappers()))
    return files


def wrappers() -> list[str]:
    """
    Write executables for lib/crgame_ros, where `ros2 run` looks.

    pip installs console scripts into bin/ only; colcon needs none of this (setup.cfg).
    """
    directory = Path('build') / 'wrappers'
    (ROOT / directory).mkdir(parents=True, exist_ok=True)
    for name in (*NODES, 'crgame'):
        file = ROOT / directory / name
        file.write_text(f'#!/bin/sh\nexec "$(dirname "$0")/../../bin/{name}" "$@"\n')
        file.chmod(0o755)
    return [(directory / name).as_posix() for name in (*NODES, 'crgame')]


# `colcon build --symlink-install` runs this file without pyproject.toml: what it needs is here.
setup(
    name=PACKAGE,
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    # colcon reads the metadata as Python literals, which setuptools makes of this one only here.
    python_requires='>=3.11,<3.13',
    version=ElementTree.parse(ROOT / 'package.xml').findtext('version'),
    data_files=data_files(),
    # Declared here: `colcon build --symlink-install` makes no executables of [project.scripts].
    entry_points={
        'console_scripts': [
            *(f'{name} = {PACKAGE}.nodes.{name}:main' for name in NODES),
            f'crgame = {PACKAGE}.cli:main',
        ],
    },
)
