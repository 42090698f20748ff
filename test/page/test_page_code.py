# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page's own checks: types by tsc, rules by eslint, unit tests by Node's runner."""

from collections.abc import Callable
import json
import os
from pathlib import Path
import re
import shutil

from crgame_ros.type_stripping import strip_types
from page_tools import HERE, installed_tools, is_stale, missing, ROOT, run
import pytest

# In one worker with the other tests that scan this folder, as npm writes into it.
pytestmark = pytest.mark.xdist_group('test_lint')

PAGE = ROOT / 'page'
MAX_COLUMNS = 99
UNITS = sorted(HERE.glob('*.test.mjs'))
# Prints named files without types, as a list, by the implementation in Node itself.
STRIP = """
import { readFileSync } from 'node:fs';
import { transformSync } from 'amaro';
console.log(JSON.stringify(process.argv.slice(1).map((file) => (
  transformSync(readFileSync(file, 'utf8'), { mode: 'strip-only' }).code))));
"""


@pytest.fixture(scope='module')
def tools() -> Path:
    """Return the folder of the tools pinned by package-lock.json."""
    return installed_tools()


def _scripts() -> list[Path]:
    return [path for path in sorted(PAGE.rglob('*.ts')) if not path.name.endswith('.d.ts')]


def check_types(root: Path) -> None:
    """Check the page of a tree with tsc."""
    here = root / HERE.relative_to(ROOT)
    run('node', here / 'node_modules' / 'typescript' / 'bin' / 'tsc', '--project', here)


def check_rules(root: Path) -> None:
    """Check the page of a tree and its tests with eslint."""
    here = root / HERE.relative_to(ROOT)
    run('node', here / 'node_modules' / 'eslint' / 'bin' / 'eslint.js', '--max-warnings', '0',
        '--config', here / 'eslint.config.mjs', root / 'page', here, cwd=root)


@pytest.mark.slow
@pytest.mark.usefixtures('tools')
def test_types() -> None:
    """The page passes the type check."""
    check_types(ROOT)


@pytest.mark.slow
@pytest.mark.usefixtures('tools')
def test_rules() -> None:
    """The page and its tests pass the rules of eslint.config.mjs without a warning."""
    check_rules(ROOT)


@pytest.fixture(scope='module')
def served(tools: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the page's scripts as the server sends them, and the unit tests."""
    root = tmp_path_factory.mktemp('served')
    for path in _scripts():
        script = root / path.relative_to(ROOT).with_suffix('.js')
        script.parent.mkdir(parents=True, exist_ok=True)
        script.write_bytes(strip_types(path.read_bytes(), path.name))
    tests = root / HERE.relative_to(ROOT)
    tests.mkdir(parents=True)
    for path in (*HERE.glob('*.mjs'), HERE / 'package.json'):
        shutil.copy(path, tests)
    (tests / 'node_modules').symlink_to(tools)
    # Tests of the desk read its words there.
    (root / 'crgame_ros').symlink_to(ROOT / 'crgame_ros')
    return tests


@pytest.mark.slow
@pytest.mark.parametrize('name', [path.name for path in UNITS])
def test_unit(name: str, served: Path) -> None:
    """A file of unit tests without a browser passes in Node's own runner."""
    run('node', '--test', served / name)


@pytest.mark.exhaustive
@pytest.mark.parametrize(('check', 'code', 'told'), [
    (check_types, 'export const f = (x: number, y) => x.length + y;\nexport enum A { b }\n',
     ['TS2339', 'TS7006', 'TS1294']),
    (check_rules, 'export const f = (node, x: number) => { node.innerHTML = x == 1 ? y : x; };\n',
     ['no-restricted-properties', 'eqeqeq', 'no-undef'])], ids=['types', 'rules'])
def test_the_checks_see(tools: Path, tmp_path: Path, check: Callable[[Path], None], code: str,
                        told: list[str]) -> None:
    """Each check fails on a page with a faulty file and gives the reason."""
    shutil.copytree(PAGE, tmp_path / 'page')
    here = tmp_path / HERE.relative_to(ROOT)
    here.mkdir(parents=True)
    for name in ('tsconfig.json', 'globals.d.ts', 'eslint.config.mjs'):
        shutil.copy2(HERE / name, here)
    (here / 'node_modules').symlink_to(tools)
    (tmp_path / 'page' / 'desk' / 'js' / 'wrong.ts').write_text(code, encoding='utf-8')
    with pytest.raises(pytest.fail.Exception) as failure:
        check(tmp_path)
    found = re.findall(r'error\b.*', str(failure.value))
    assert len(found) == len(told), failure.value
    assert all(any(name in line for line in found) for name in told), failure.value


@pytest.mark.slow
@pytest.mark.usefixtures('tools')
def test_the_server_takes_out_types_as_node_does() -> None:
    """Every script has the same words on the same lines."""
    files = _scripts()
    assert len(files) > 200
    for path, wanted in zip(files, json.loads(run(
            'node', '--input-type=module', '--eval', STRIP, *files, cwd=HERE)), strict=True):
        found = strip_types(path.read_bytes(), path.name).decode()
        assert [line.split() for line in found.split('\n')] == [
            line.split() for line in wanted.split('\n')], path


def test_a_machine_without_node_is_told(tmp_path: Path) -> None:
    """Missing programs, or a Node version that eslint refuses, are reported."""
    assert missing(str(tmp_path)) == 'node and npm missing'
    for name, version in (('npm', '11.0.0'), ('node', 'v18.20.4')):
        (tmp_path / name).write_text(f'#!/bin/sh\necho {version}\n')
        (tmp_path / name).chmod(0o755)
    assert missing(str(tmp_path)) == 'node is v18.20.4, older than 20.19'
    (tmp_path / 'node').write_text('#!/bin/sh\necho v22.0.0\n')
    assert missing(str(tmp_path)) == ''


def test_tools_are_installed_anew_when_the_lock_changes(tmp_path: Path) -> None:
    """Tools are checked when absent, half installed, complete, or older than the lock file."""
    lock, installed = tmp_path / 'package-lock.json', tmp_path / 'node_modules'
    lock.touch()
    assert is_stale(tmp_path)
    installed.mkdir()
    assert is_stale(tmp_path)
    (installed / '.package-lock.json').touch()
    os.utime(lock, (1000, 1000))
    assert not is_stale(tmp_path)
    os.utime(installed / '.package-lock.json', (999, 999))
    assert is_stale(tmp_path)


def test_tools_are_pinned_and_come_from_whatever_registry_is_set() -> None:
    """The lock file has exact versions and checksums, and no address of a server."""
    wanted = json.loads((HERE / 'package.json').read_text(encoding='utf-8'))
    lock = json.loads((HERE / 'package-lock.json').read_text(encoding='utf-8'))
    assert 'dependencies' not in wanted
    packages = {name: entry for name, entry in lock['packages'].items() if name}
    for name, version in wanted['devDependencies'].items():
        assert re.fullmatch(r'\d+\.\d+\.\d+', version), name
        assert packages[f'node_modules/{name}']['version'] == version
    assert all(entry['integrity'] and 'resolved' not in entry for entry in packages.values())


def test_lines_have_99_columns() -> None:
    files = [*PAGE.rglob('*.ts'), *HERE.glob('*.mjs'), *HERE.glob('*.ts')]
    assert len(files) > 90
    assert not [file.name for file in sorted(files)
                if max(map(len, file.read_text(encoding='utf-8').splitlines())) > MAX_COLUMNS]
