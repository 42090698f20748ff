# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The order of the folders: their allowed imports, and the document that shows it."""

from pathlib import Path
import subprocess
import sys

import networkx as nx
import pytest

ROOT = Path(__file__).resolve().parents[1]
pytestmark = pytest.mark.xdist_group('test_architecture')
sys.path.insert(0, str(ROOT / 'scripts'))

import architecture  # noqa: E402, I100

# These may import ROS; everything else is the core.
ROS_FOLDERS = ('ros', 'nodes', 'launcher', 'study/conduct')
ROS_FILES = {'cli', 'doctor'}
BLOCKED_IMPORTS = """
import importlib, sys

class NoRos:
    def find_spec(self, name, path=None, target=None):
        top = name.partition('.')[0]
        if top in ('rclpy', 'std_srvs', 'builtin_interfaces', 'rcl_interfaces', 'launch',
                   'launch_ros', 'ament_index_python') or top.endswith('_msgs'):
            raise ImportError(f'the core imports {name}')

sys.meta_path.insert(0, NoRos())
failed = 0
for name in sys.argv[1:]:
    try:
        importlib.import_module(name)
    except ImportError as error:
        failed += 1
        print(f'{name}: {error}')
sys.exit(failed)
"""


@pytest.mark.slow
def test_every_folder_imports_from_those_above_it_alone() -> None:
    place = {folder: i for i, folder in enumerate(architecture.FOLDERS)}
    wrong = [line for (folder, other), lines in architecture.imports().items()
             for line in lines if place[other] > place[folder]]
    assert not wrong, '\n'.join(wrong)


@pytest.mark.slow
def test_neither_files_nor_folders_at_the_top_import_each_other_in_a_circle() -> None:
    """Imports within functions and for types count, too."""
    known = architecture.modules()
    files = nx.DiGraph((name, other) for name, path in known.items() if name != 'crgame_ros'
                       for other in architecture.imported_by(path, known) - {name})
    tops = nx.DiGraph((first, second) for first, second in (
        [name.split('.')[1] for name in pair] for pair in files.edges if 'crgame_ros' not in pair)
        if first != second)
    for graph in (files, tops):
        assert len(graph) > 20
        assert [names for names in nx.strongly_connected_components(graph)
                if len(names) > 1] == []


def test_every_folder_has_its_place_and_says_what_it_is() -> None:
    folders = {architecture.folder_of(path) for path in architecture.modules().values()}
    assert folders == set(architecture.FOLDERS)
    assert len({architecture.sentence(folder) for folder in folders}) == len(folders)


@pytest.fixture(scope='module')
def core() -> list[str]:
    """Return the names of the modules that may not import ROS when they are imported."""
    return [name for name, path in architecture.modules().items()
            if not architecture.folder_of(path).startswith(ROS_FOLDERS)
            and path.stem not in ROS_FILES]


def _import_without_ros(*modules: str) -> 'subprocess.CompletedProcess[str]':
    return subprocess.run([sys.executable, '-c', BLOCKED_IMPORTS, *modules], cwd=ROOT,
                          capture_output=True, text=True)


@pytest.mark.exhaustive
def test_the_core_runs_without_ros(core: list[str]) -> None:
    """Every module of the core imports where rclpy and all messages are blocked."""
    assert len(core) > 20
    done = _import_without_ros(*core)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
def test_no_function_of_the_core_imports_ros(core: list[str]) -> None:
    """Imports within functions count, too."""
    lower = architecture.FOLDERS[:architecture.FOLDERS.index('ros')]
    ros = ('rclpy', '_msgs', '_interfaces', 'ament_index_python')
    paths = architecture.modules()
    for module in core:
        if architecture.folder_of(paths[module]) not in lower:
            continue
        names = {name for name, _ in architecture.imported_names(paths[module])}
        assert not [name for name in names
                    if name.split('.')[0].endswith(ros)], f'{module}: {names}'


def test_blocked_imports_fail() -> None:
    """The test above does notice an import of ROS."""
    assert _import_without_ros('rclpy', 'sensor_msgs.msg').returncode == 2
