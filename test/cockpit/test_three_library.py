# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""three.js: fetched by npm, whole or not at all, and served where it is."""

import json
from pathlib import Path
import shutil
import sys

from cockpit_support import cockpit, in_loop
from crgame_ros.cockpit import three_library
from crgame_ros.cockpit.three_library import fetch_library, find_library, SCRIPTS, wanted_version
from crgame_ros.errors import CrgameError
from crgame_ros.paths import config_directory
import pytest


@pytest.fixture(autouse=True)
def nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Let the environment and the user's home be empty; give the folder of the first."""
    monkeypatch.setattr(sys, 'prefix', str(tmp_path / 'environment'))
    monkeypatch.setenv('XDG_DATA_HOME', str(tmp_path / 'home'))
    return tmp_path / 'environment' / 'share' / 'crgame_ros'


@pytest.fixture
def npm() -> None:
    """Skip where there is no npm: the one that pip brings has 60 MB."""
    if shutil.which('npm') is None:
        pytest.skip('three.js is not fetched: npm is missing')


@pytest.mark.usefixtures('npm')
def test_npm_fetches_what_browsers_need_once(nowhere: Path) -> None:
    """The two scripts and the licence, nothing left beside them, and not again."""
    assert find_library() is None
    try:
        folder = fetch_library()
    except CrgameError as error:
        pytest.skip(f'three.js is not fetched: {error}')
    assert find_library() == folder == nowhere / f'three-{wanted_version()}'
    assert {path.name for path in folder.iterdir()} == {*SCRIPTS, 'LICENSE'}
    assert [path.name for path in nowhere.iterdir()] == [folder.name]
    assert f"'{wanted_version().split('.')[1]}'" in (folder / SCRIPTS[1]).read_text('utf-8')
    assert 'MIT' in (folder / 'LICENSE').read_text('utf-8')
    before = folder.stat().st_mtime_ns
    assert fetch_library() == folder and folder.stat().st_mtime_ns == before


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
    monkeypatch.setattr(three_library, 'config_directory', lambda: tmp_path / 'config')
    with pytest.raises(CrgameError, match=r'three\.js cannot be fetched: npm says'):
        fetch_library()
    assert find_library() is None and not any(nowhere.iterdir())


def test_a_machine_that_cannot_fetch_it_says_so_in_a_line(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Npm fails, or nothing can be stored."""
    for name, code in (('node', 'exit 0'), ('npm', 'echo "npm error network" >&2; exit 1')):
        (tmp_path / name).write_text(f'#!/bin/sh\n{code}\n')
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv('PATH', f'{tmp_path}:/usr/bin:/bin')
    with pytest.raises(CrgameError, match='npm says "npm error network"; check the network'):
        fetch_library()
    for name in ('environment', 'home'):
        shutil.rmtree(tmp_path / name, ignore_errors=True)
        (tmp_path / name).write_text('no folder')
    with pytest.raises(CrgameError, match='cannot be stored in'):
        fetch_library()


def test_the_package_is_pinned_and_comes_from_whatever_registry_is_set() -> None:
    """An exact version with its checksum, and no address of a server."""
    folder = config_directory() / 'page_libraries'
    lock = json.loads((folder / 'package-lock.json').read_text('utf-8'))
    entries = {name: entry for name, entry in lock['packages'].items() if name}
    assert list(entries) == ['node_modules/three']
    entry = entries['node_modules/three']
    assert entry['version'] == wanted_version() and entry['integrity'].startswith('sha512-')
    assert 'resolved' not in entry


@in_loop
async def test_it_is_served_from_when_it_is_there(nowhere: Path) -> None:
    """Absent, then fetched while the server runs; and nothing else from its folder."""
    async with cockpit() as running:
        address = f'{running.address}/three/'
        async with running.http.get(address + SCRIPTS[0]) as answer:
            assert answer.status == 404
        folder = nowhere / f'three-{wanted_version()}'
        folder.mkdir(parents=True)
        for name in (*SCRIPTS, 'LICENSE'):
            (folder / name).write_text(f'// {name}')
        for name in SCRIPTS:
            async with running.http.get(address + name) as answer:
                assert (answer.status, answer.content_type) == (200, 'text/javascript')
                assert await answer.text() == f'// {name}'
                assert answer.headers['Cache-Control'] == 'no-cache'
        for name in ('LICENSE', '..%2Fthree-0%2Fx.js', 'other.js'):
            async with running.http.get(address + name) as answer:
                assert answer.status == 404, name
