# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Build crgame_ros with colcon or pip; the metadata is here, tool settings in pyproject.toml."""

from pathlib import Path
import re
import sys

from setuptools import find_packages, setup

PACKAGE = 'crgame_ros'
DATA_DIRECTORIES = ('launch', 'config', 'scenarios', 'msg_defs')
# Relative paths only: setuptools refuses absolute ones in data_files.
ROOT = Path(__file__).resolve().parent
NODES = tuple(sorted(path.stem for path in (ROOT / PACKAGE / 'nodes').glob('*_node.py')))
# They declare Python < 3.12, though they work on it: pip cannot install them there, and whoever
# asks for a planner that needs them is told how to (scripts/env.sh does it).
UNTIL_3_11 = '; python_version < "3.12"'


def version() -> str:
    """Read the version from the package, without importing it."""
    text = (ROOT / PACKAGE / '__init__.py').read_text(encoding='utf-8')
    match = re.search(r"^__version__ = '(.+)'$", text, re.MULTILINE)
    if match is None:
        raise SystemExit(f'{PACKAGE}/__init__.py: no __version__')
    return match.group(1)


def data_files() -> list[tuple[str, list[str]]]:
    """List what goes into the prefix: the ament marker, the manifest and the data directories."""
    share = f'share/{PACKAGE}'
    files = [
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (share, ['package.xml', 'requirements.txt']),
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


setup(
    name=PACKAGE,
    version=version(),
    description='Real-time, human-in-the-loop driving simulation on CommonRoad and ROS 2',
    author='The crgame_ros authors',
    # The package has no public home: .invalid can never be anybody's (RFC 6761).
    maintainer='The crgame_ros authors',
    maintainer_email='maintainers@crgame-ros.invalid',
    url='https://crgame-ros.invalid/',
    license='Apache-2.0',
    python_requires='>=3.11,<3.13',
    packages=find_packages(exclude=['test', 'test.*']),
    package_data={PACKAGE: ['py.typed', 'cockpit/page/*', 'cockpit/page/**/*',
                            'analysis/report/page/*', 'evaluation/summary/page/*',
                            'study/data/page/*', 'study/scales/*', 'study/desk/words/*',
                            'study/desk/page/*', 'study/desk/page/**/*']},
    data_files=data_files(),
    zip_safe=False,
    # What is imported, at the versions of requirements.txt. Those that other packages need in turn
    # are in requirements.txt only: it is the way to a set of versions known to work.
    install_requires=[
        'aiohttp>=3.14,<4',
        'commonroad-clcs==2025.2.0',
        'commonroad-drivability-checker==2025.4.0',
        f'commonroad-idm-planner==0.2.1{UNTIL_3_11}',
        'commonroad-io==2024.3',
        f'commonroad-reactive-planner==2025.1{UNTIL_3_11}',
        'evdev-binary>=2.0,<3',
        'lxml>=6.1,<7',
        'lz4>=4.4,<5',
        'markdown-it-py>=4.3,<5',
        'matplotlib>=3.9,<4',
        'mcap>=1.6,<2',
        'numba>=0.68.1,<0.69',
        'numpy>=2.4,<2.5',
        'packaging>=24',
        'pillow>=12,<14',
        'plotly>=7.1,<8',
        'pyarrow>=26,<27',
        'pyyaml>=6.0.3,<7',
        'ros-jazzy-common-interfaces==5.3.6',
        'ros-jazzy-rclpy[fastrtps]==7.1.6',
        'rosbags>=0.11.9,<0.12',
        'scipy>=1.17,<2',
        'shapely>=2.2,<3',
        'zstandard>=0.25,<1',
    ],
    extras_require={
        'evaluate': ['distributed>=2026.8,<2027'],
        'gym': ['gymnasium>=1.4,<2', 'pettingzoo>=1.27,<2'],
        'test': [
            'commonroad-vehicle-models==3.0.2', 'distributed>=2026.8,<2027',
            'flake8-blind-except', 'flake8-builtins', 'flake8-class-newline',
            'flake8-comprehensions', 'flake8-deprecated', 'flake8-docstrings',
            'flake8-import-order', 'flake8-quotes', 'gymnasium>=1.4,<2', 'jsonschema>=4.26,<5',
            'mcap-ros2-support>=0.6,<1', 'mypy>=2.4,<3', 'pandas>=3.1,<4', 'pettingzoo>=1.27,<2',
            'polars>=2.1,<3', 'psutil>=7,<8', 'pytest>=7.4,<8', 'pytest-xdist>=3.8,<4',
            'ros-ament-flake8==0.17.3', 'ros-ament-pep257==0.17.3', 'ruff>=0.17.5,<0.18',
            'selenium>=4.51,<5', 'types-PyYAML>=6.0.12,<7',
        ],
    },
    entry_points={
        'console_scripts': [
            *(f'{name} = {PACKAGE}.nodes.{name}:main' for name in NODES),
            f'crgame = {PACKAGE}.cli:main',
        ],
        'crgame_ros.planners': [
            f'idm = {PACKAGE}.planner.idm:IdmPlanner',
            f'idm-package = {PACKAGE}.planner.idm_package:IdmPackagePlanner',
            f'reactive = {PACKAGE}.planner.reactive:ReactivePlanner',
            f'reactive-package = {PACKAGE}.planner.reactive_package:ReactivePackagePlanner',
            f'constant-velocity = {PACKAGE}.planner.constant_velocity:ConstantVelocityPlanner',
        ],
    },
)
