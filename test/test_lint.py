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
"""Style, types, licence headers, sizes, and that the core needs no ROS."""

import ast
from collections.abc import Iterator
import hashlib
from importlib.metadata import distributions
from importlib.util import find_spec
import os
from pathlib import Path
import re
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'crgame_ros'
# By its text ament_copyright knows a licence; the identifier alone it does not take.
HEADER = """\
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
""".splitlines()
FOLDERS = ('crgame_ros', 'test', 'launch', 'scripts', 'benchmarks', 'examples')
# Where npm puts the tools that check the page.
FOREIGN = ROOT / 'test' / 'page' / 'node_modules'
MAX_FILE_LINES = 350
MAX_FUNCTION_LINES = 60
# These may import ROS; everything else is the core.
ROS_FOLDERS = ('ros', 'nodes', 'launcher', 'study/conduct')
ROS_FILES = {'cli.py', 'doctor.py'}
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


def _sources() -> list[Path]:
    """List every Python file that is ours."""
    files = [file for folder in FOLDERS for file in (ROOT / folder).rglob('*.py')
             if FOREIGN not in file.parents]
    return sorted([*files, ROOT / 'setup.py'])


def _run(*command: str) -> None:
    """Run a tool of this interpreter at the root and fail with its output."""
    done = subprocess.run([sys.executable, *command], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def _functions(file: Path) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    """Walk over the functions and methods of a file."""
    for node in ast.walk(ast.parse(file.read_text(encoding='utf-8'))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node


def _linter_versions() -> str:
    """Name Python and every installed package: plugins are among them, and say things, too."""
    packages = {f'{item.name} {item.version}' for item in distributions()}
    return '\n'.join([sys.version, *sorted(packages)])


def _lint_each(linter: str) -> None:
    """
    Run a linter that looks at each file by itself on those that it has not found clean before.

    What it said of a file holds as long as the file, its place and all installed packages do.
    """
    versions = hashlib.sha256(f'{linter}\n{_linter_versions()}'.encode())
    digests = {}
    for file in _sources():
        found = versions.copy()
        found.update(str(file.relative_to(ROOT)).encode() + b'\0' + file.read_bytes())
        digests[str(file.relative_to(ROOT))] = found.hexdigest()
    clean = ROOT / 'build' / f'.{linter}_clean'
    known = set(clean.read_text().split()) if clean.is_file() else set()
    unknown = [name for name, digest in digests.items() if digest not in known]
    if unknown:
        _run('-m', f'{linter}.main', *unknown)
        clean.parent.mkdir(exist_ok=True)
        whole = clean.with_suffix(f'.{os.getpid()}')
        whole.write_text('\n'.join(sorted(digests.values())))
        whole.replace(clean)


def test_ruff() -> None:
    """Line length, quotes, import order, docstrings, annotations (pyproject.toml)."""
    _run('-m', 'ruff', 'check', '--no-cache', *(str(file) for file in _sources()))


def test_mypy() -> None:
    """Everything in the package is annotated, and consistently so (pyproject.toml)."""
    _run('-m', 'mypy', '--cache-dir', str(ROOT / 'build' / '.mypy_cache'))


@pytest.mark.parametrize('linter', ['ament_copyright', 'ament_flake8', 'ament_pep257'])
def test_ament_linter(linter: str) -> None:
    """
    Keep the rules of ROS 2 by its own linters.

    Two of them are among the wheels; ament_copyright is where ROS is installed.
    """
    if find_spec(linter) is None:
        pytest.skip(f'{linter} is not installed')
    _lint_each(linter)


def test_a_linter_forgets_no_complaint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file with a fault is looked at, and told, as often as it is asked for; so is a new one."""
    monkeypatch.setitem(globals(), 'ROOT', tmp_path)
    module = tmp_path / 'module.py'
    monkeypatch.setitem(globals(), '_sources', lambda: [module])
    module.write_text('x = 1\n')
    _lint_each('ament_flake8')
    module.write_text('x = "1"\n')
    for _ in range(2):
        with pytest.raises(AssertionError, match='Q000'):
            _lint_each('ament_flake8')
    module.write_text('x = 1\n')
    _lint_each('ament_flake8')


def test_every_file_starts_with_the_licence_header() -> None:
    """Copyright and licence come first, after `#!` where there is one, as the licence has them."""
    wrong = []
    for file in _sources():
        lines = file.read_text(encoding='utf-8').splitlines()
        start = 1 if lines and lines[0].startswith('#!') else 0
        if lines[start:start + len(HEADER)] != HEADER:
            wrong.append(str(file.relative_to(ROOT)))
    assert not wrong
    licence = ' '.join((ROOT / 'LICENSE').read_text(encoding='utf-8').split())
    text = ' '.join(' '.join(line.lstrip('#') for line in HEADER[3:]).split())
    # In its appendix, which says what to put into each file.
    assert text in licence
    # What ament_copyright asks of the page for contributors of a repository under this licence.
    contributing = (ROOT / 'CONTRIBUTING.md').read_text(encoding='utf-8')
    clause = re.search(r'5\. Submission of Contributions\..*?with Licensor regarding such '
                       r'Contributions\.', licence)
    assert clause is not None and clause.group() in ' '.join(contributing.split())


def test_core_imports_no_ros() -> None:
    """The core runs where there is no ROS: it imports with rclpy and the messages blocked."""
    modules = []
    for file in sorted(PACKAGE.rglob('*.py')):
        path = file.relative_to(PACKAGE)
        ours = any(path.is_relative_to(folder) for folder in ROS_FOLDERS)
        if not ours and path.name not in ROS_FILES:
            parts = ('crgame_ros', *path.with_suffix('').parts)
            modules.append('.'.join(parts).removesuffix('.__init__'))
    assert len(modules) > 20
    _run('-c', BLOCKED_IMPORTS, *modules)


def test_the_import_block_blocks() -> None:
    """The check above does see an import of ROS."""
    done = subprocess.run([sys.executable, '-c', BLOCKED_IMPORTS, 'rclpy', 'sensor_msgs.msg'],
                          cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2


def test_files_and_functions_are_short() -> None:
    """A file has one subject and a function fits a screen."""
    wrong = []
    for file in sorted(PACKAGE.rglob('*.py')):
        name = str(file.relative_to(ROOT))
        lines = len(file.read_text(encoding='utf-8').splitlines()) - len(HEADER)
        if lines > MAX_FILE_LINES:
            wrong.append(f'{name}: {lines} lines')
        for function in _functions(file):
            length = (function.end_lineno or 0) - function.lineno + 1
            if length > MAX_FUNCTION_LINES:
                wrong.append(f'{name}:{function.lineno}: {function.name} has {length} lines')
    assert not wrong, '\n'.join(wrong)
