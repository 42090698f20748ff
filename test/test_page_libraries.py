# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""three.js and Plotly: fetched by npm, whole or not at all, and served where they are."""

import json
from pathlib import Path
import shutil
import sys

from crgame_ros import page_libraries
from crgame_ros.errors import CrgameError
from crgame_ros.page_libraries import (
    fetch_libraries,
    find_libraries,
    PLOTLY,
    plotly_script,
    THREE_SCRIPTS,
)
from crgame_ros.paths import config_directory
import pytest


@pytest.fixture(autouse=True)
def nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Make the environment and the user's home empty; return the folder of the first."""
    monkeypatch.setattr(sys, 'prefix', str(tmp_path / 'environment'))
    monkeypatch.setenv('XDG_DATA_HOME', str(tmp_path / 'home'))
    return tmp_path / 'environment' / 'share' / 'crgame_ros'


@pytest.fixture
def npm() -> None:
    """Skip without npm: the one from pip has 60 MB."""
    if shutil.which('npm') is None:
        pytest.skip('the libraries are not fetched: npm is missing')


@pytest.mark.slow
@pytest.mark.usefixtures('npm')
def test_npm_fetches_what_browsers_need_once(nowhere: Path) -> None:
    """The two scripts and the licence, nothing left beside them, and not again."""
    assert find_libraries() is None
    try:
        folder = fetch_libraries()
    except CrgameError as error:
        pytest.skip(f'the libraries are not fetched: {error}')
    assert find_libraries() == folder and folder.parent == nowhere
    assert {path.name for path in folder.iterdir()} == {
        *THREE_SCRIPTS, PLOTLY, 'three-LICENSE', 'plotly-LICENSE'}
    assert [path.name for path in nowhere.iterdir()] == [folder.name]
    pins = json.loads((config_directory() / 'page_libraries' / 'package.json').read_text('utf-8'))
    three, plotly = (pins['dependencies'][name] for name in ('three', 'plotly.js-basic-dist-min'))
    assert f"'{three.split('.')[1]}'" in (folder / THREE_SCRIPTS[1]).read_text('utf-8')
    assert f'v{plotly}' in plotly_script().read_text('utf-8')[:200]
    for name in ('three', 'plotly'):
        assert 'MIT' in (folder / f'{name}-LICENSE').read_text('utf-8')
    before = folder.stat().st_mtime_ns
    assert fetch_libraries() == folder and folder.stat().st_mtime_ns == before


@pytest.mark.usefixtures('npm')
def test_what_the_lock_file_does_not_know_is_refused(
        nowhere: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another checksum than that of package-lock.json: an error, and no file."""
    changed = shutil.copytree(config_directory() / 'page_libraries',
                              tmp_path / 'config' / 'page_libraries')
    lock = json.loads((changed / 'package-lock.json').read_text('utf-8'))
    entry = lock['packages']['node_modules/three']
    entry['integrity'] = entry['integrity'][:-12] + 'AAAAAAAAAA=='
    (changed / 'package-lock.json').write_text(json.dumps(lock))
    monkeypatch.setattr(page_libraries, 'config_directory', lambda: tmp_path / 'config')
    with pytest.raises(CrgameError, match='page libraries cannot be fetched: npm says'):
        fetch_libraries()
    assert find_libraries() is None and not any(nowhere.iterdir())


def test_a_machine_that_cannot_fetch_it_says_so_in_a_line(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Npm fails, or nothing can be stored."""
    for name, code in (('node', 'exit 0'), ('npm', 'echo "npm error network" >&2; exit 1')):
        (tmp_path / name).write_text(f'#!/bin/sh\n{code}\n')
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv('PATH', f'{tmp_path}:/usr/bin:/bin')
    with pytest.raises(CrgameError, match='npm says "npm error network"; check the network'):
        fetch_libraries()
    for name in ('environment', 'home'):
        shutil.rmtree(tmp_path / name, ignore_errors=True)
        (tmp_path / name).write_text('no folder')
    with pytest.raises(CrgameError, match='cannot be stored in'):
        fetch_libraries()


def test_without_plotly_a_report_names_the_command() -> None:
    with pytest.raises(CrgameError, match='fetch it: crgame page-libraries'):
        plotly_script()


def test_the_packages_are_pinned_and_come_from_whatever_registry_is_set() -> None:
    """Each has an exact version and its checksum, and no address of a server."""
    folder = config_directory() / 'page_libraries'
    pins = json.loads((folder / 'package.json').read_text('utf-8'))['dependencies']
    lock = json.loads((folder / 'package-lock.json').read_text('utf-8'))
    entries = {name.removeprefix('node_modules/'): entry
               for name, entry in lock['packages'].items() if name}
    assert {name: entry['version'] for name, entry in entries.items()} == pins
    for entry in entries.values():
        assert entry['integrity'].startswith('sha512-') and 'resolved' not in entry
