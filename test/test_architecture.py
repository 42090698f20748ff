# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""The order of the folders: who may import whom, and the document that shows it."""

import ast
from pathlib import Path
import subprocess
import sys

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / 'scripts'))

import architecture  # noqa: E402


def test_every_folder_imports_from_those_above_it_alone() -> None:
    place = {folder: i for i, folder in enumerate(architecture.FOLDERS)}
    wrong = [line for (folder, other), lines in architecture.imports().items()
             for line in lines if place[other] > place[folder]]
    assert not wrong, '\n'.join(wrong)


def test_every_folder_has_its_place_and_says_what_it_is() -> None:
    folders = {architecture.folder_of(path) for path in architecture.modules().values()}
    assert folders == set(architecture.FOLDERS)
    assert len({architecture.sentence(folder) for folder in folders}) == len(folders)


def test_the_core_imports_no_ros() -> None:
    core = architecture.FOLDERS[:architecture.FOLDERS.index('ros')]
    ros = ('rclpy', '_msgs', '_interfaces', 'ament_index_python')
    for path in architecture.modules().values():
        if architecture.folder_of(path) not in core:
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            names = [item.name for item in node.names] if isinstance(node, ast.Import) else [
                node.module or ''] if isinstance(node, ast.ImportFrom) else []
            assert not [name for name in names
                        if name.split('.')[0].endswith(ros)], f'{path}: {names}'


def test_list_and_picture_are_up_to_date() -> None:
    done = subprocess.run([sys.executable, ROOT / 'scripts' / 'architecture.py', '--check'],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_no_two_modules_or_public_classes_have_one_name() -> None:
    names: dict[str, list[str]] = {}
    for dotted, path in architecture.modules().items():
        if path.stem == '__init__':
            continue
        names.setdefault(path.stem, []).append(dotted)
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith('_'):
                names.setdefault(node.name, []).append(dotted)
    assert not {name: where for name, where in names.items() if len(where) > 1}
